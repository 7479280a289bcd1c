"""Compiled sequence of implicit steps on a frictional ground; steps in which contact changes are made again in parts.

Between changes of contact the scheme is of second order, across one of first: the time at which a point lands,
leaves, breaks loose or comes to rest is rounded to the step in which that happens. Such a step is undone and made again
in a few parts, and so are the next ones, in which what the change sets ringing dies out. The error of these times
shrinks with the part, at the cost of the few steps that are divided.

Impulses are those of the middle of a step. A foot whose static friction is used up in the second half of one still
sticks in it, and would be released with the next: half a step late, a first-order error that no division takes away.
What is used at the end is therefore told from this step and the last (`gives_way`), and such a step is divided, too.
"""

from __future__ import annotations

import numpy as np

from fem_biobot.compile_cache import ALLOCATES, BORROWS, INNER, KERNEL, ensure_cache_folder

ensure_cache_folder()

from numba import njit  # noqa: E402  (numba looks for its cache folder when it loads)

from fem_biobot.friction.kernels import LIFTED, SLIP  # noqa: E402
from fem_biobot.rod.dynamics.ground.kernels import gives_way, settle_contacts  # noqa: E402
from fem_biobot.rod.dynamics.inertia.kernels import copy, copy_frames, copy_row  # noqa: E402
from fem_biobot.rod.dynamics.kernels import CONVERGED  # noqa: E402

AFTER = 2  # steps after one with a change of contact that are divided, too


@njit(**INNER, **BORROWS)
def _rubs(plane, i):
    """Whether contact `i` has friction in any direction: without, to stick and to slip are the same."""
    mu = plane.static[i]
    return max(mu[0], mu[1], mu[2], mu[3]) > 0.0


@njit(**INNER, **BORROWS)
def contact_changes(grounded, system, plane, state, work, h):
    """Whether a contact changes between lifted, stick and slip in a step of length `h`, turns its slip or gives way."""
    if grounded == 0:
        return False
    settle_contacts(work)
    for i in range(grounded):
        before, after = state.touch[i], work.settled[i]
        if before != after and (before == LIFTED or after == LIFTED or _rubs(plane, i)):
            return True
        turned = state.slide[i, 0] * work.slid[i, 0] + state.slide[i, 1] * work.slid[i, 1] < 0.0
        if before == SLIP and turned and _rubs(plane, i):
            return True
    return gives_way(system.foot, system.touching.shape[0], plane, state, work, h)


@njit(**INNER, **BORROWS)
def copy_state(state, to):
    copy(state.x, to.x)
    copy_frames(state.Q, to.Q)
    copy(state.v, to.v)
    copy(state.change, to.change)
    copy(state.impulse, to.impulse)
    copy_row(state.touch, to.touch)
    copy(state.slide, to.slide)
    copy(state.joint, to.joint)
    copy(state.strain, to.strain)
    copy_row(state.lengths, to.lengths)
    copy_row(state.alert, to.alert)
    copy_row(state.length, to.length)


@njit(**INNER, **BORROWS)
def average(table, i, begin, end, theta, out):
    """Write the average over a part of a step, from `begin` to `end` of it, of a table's rows `i` and `i + 1`."""
    at = begin + theta * (end - begin)
    for k in range(out.shape[0]):
        out[k] = at * table[i + 1, k] + (1.0 - at) * table[i, k]


@njit(**INNER, **BORROWS)
def try_part(
    assembly, system, state, plane, length, weight, close, pull, factors, arm, tolerance, most, calls, fresh, work,
    scratch,
):  # fmt: skip
    """Try a step or a part of one, with the factors at hand if they are of its length (`fresh`), else with new ones.

    Returns the outcome, the residual, iterations and factorisations.
    """
    outcome, iterations, factorisations, residual = calls.step(
        assembly, system, state, plane, length, weight, close, pull, factors, arm, tolerance, most, fresh, calls.within,
        work, scratch,
    )  # fmt: skip
    if outcome != CONVERGED and fresh:  # old factors may be to blame
        outcome, tried, renewed, residual = calls.step(
            assembly, system, state, plane, length, weight, close, pull, factors, arm, tolerance, most, False,
            calls.within, work, scratch,
        )  # fmt: skip
        iterations += tried
        factorisations += renewed
    return outcome, residual, iterations, factorisations


@njit(**KERNEL, **ALLOCATES)
def implicit_run(
    assembly, system, state, plane, h, theta, theta_part, parts, closing, pulls, load_factors, arm, tolerance, most,
    calls, work, scratch, book, tally,
):  # fmt: skip
    """Make steps of length `h` until one fails or the tables end; `state` is where it got to.

    Parameters are tuples of arrays (see `rod.arrays`, `rod.system`, `rod.dynamics.arrays`). Where contact changes, a
    step is made in `parts` with `theta_part`. A step of length `closing` follows the last. `pulls` (s + 1, k) [mN] and
    `load_factors` (s + 1, l) hold the values at the ends of the steps. `calls` are `step`, `accept` and those `within`
    a step, by address. `tally` takes sums over the steps: contact impulses, time in slip and time in contact of each
    point, (c, 5). Returns the steps made, the outcome of the last try, iterations, factorisations, the largest residual
    accepted, and steps divided.
    """
    pull = np.empty(pulls.shape[1])
    factors = np.empty(load_factors.shape[1])
    grounded = assembly.contacts.node.shape[0]
    iterations = 0
    factorisations = 0
    divided = 0
    worst = 0.0
    factored = 0.0  # length of the step that the factors belong to
    steps = pulls.shape[0] - 1
    for i in range(steps):
        count = parts if parts > 1 and state.alert[0] > 0 else 1
        made = False
        alarmed = count > 1
        while not made:
            length = h / count
            weight = theta if count == 1 else theta_part
            changes = False
            if count > 1:
                divided += 1
                copy_state(state, work.kept)
                copy_row(book, work.kept_book)
                copy(tally, work.kept_tally)
            for part in range(count):
                # gaps close within the next step: if that is longer, a shorter one would overrun them
                last = part == count - 1 and (count == 1 or (state.alert[0] == 1 and not changes))
                close = length if not last else (h if i < steps - 1 else closing)
                average(pulls, i, part / count, (part + 1) / count, weight, pull)
                average(load_factors, i, part / count, (part + 1) / count, weight, factors)
                outcome, residual, tried, renewed = try_part(
                    assembly, system, state, plane, length, weight, close, pull, factors, arm, tolerance, most, calls,
                    factored == length, work, scratch,
                )  # fmt: skip
                iterations += tried
                factorisations += renewed
                factored = length if outcome == CONVERGED else 0.0
                if outcome != CONVERGED:
                    if count > 1:
                        copy_state(work.kept, state)
                        copy_row(work.kept_book, book)
                        copy(work.kept_tally, tally)
                    return i, outcome, iterations, factorisations, worst, divided
                if parts > 1 and contact_changes(grounded, system, plane, state, work, length):
                    changes = True
                    if count == 1:
                        break
                worst = max(worst, residual)
                calls.accept(assembly, system, state, length, weight, factors, work, book, tally)
            made = count > 1 or not changes
            if count > 1:
                state.alert[0] = AFTER if changes or not alarmed else state.alert[0] - 1
            count = parts
    return steps, CONVERGED, iterations, factorisations, worst, divided

"""Compiled sequence of implicit steps made in halves, halves of halves and so on, as their error and contact ask for.

A step of length h is made in parts of length h / 2^level, each of which begins at a multiple of its length, so that the
output grid stays and few lengths occur. A part is undone and begun again with half its length where

* Newton's iteration does not end,
* a contact begins or ceases to touch, to stick or to slip, or turns its slip, and the part is longer than the one to
  which changes are to be located: bisection, since the part before the change is accepted on the way (without friction
  stick and slip are the same);
* its error is too large. The error of positions by the trapezoidal rule is ``length^3 / 12`` times the derivative of
  the acceleration (Dahlquist and Bjorck 1974, 8.5), here its difference from the part before over the length: one try
  tells it. It may be the part's share of what is allowed a step, so that those of a step add up to that.

A part of twice the length follows one whose error would leave it well below its share. After a change the accelerations
before it say nothing, and an impact is met within a few parts while gaps close to a third each: so many parts after a
change are not made shorter for their error than those to which changes are located, nor are the first of a motion.
Where velocities jump on for longer, halves have no end: the shortest parts may together take once more what one step is
allowed, and one that would take more fails. Drive and loads are linear within a step.
"""

from __future__ import annotations

import numpy as np

from fem_biobot.compile_cache import ALLOCATES, BORROWS, INNER, KERNEL, ensure_cache_folder

ensure_cache_folder()

from numba import njit  # noqa: E402  (numba looks for its cache folder when it loads)

from fem_biobot.rod.dynamics.inertia.kernels import copy, copy_row  # noqa: E402
from fem_biobot.rod.dynamics.kernels import CONVERGED  # noqa: E402
from fem_biobot.rod.dynamics.run.kernels import average, contact_changes, copy_state, try_part  # noqa: E402

INACCURATE = 5  # an outcome beside those of a step
FINEST = 12  # level of the shortest parts
UNSETTLED = 256  # a part after a change of contact, in `State.alert`, to which the level is added
AFTER_CHANGE = 8  # such parts
BEGINNING = FINEST + UNSETTLED * AFTER_CHANGE  # `State.alert` of a motion that has no step behind it
_GROWS = 0.2  # of the error allowed; twice the length has eight times the error and two shares


@njit(**INNER, **BORROWS)
def _error(held, state, v1, length):
    """Error of the positions in a part that leads to the velocities `v1` [mm]."""
    worst = 0.0
    for i in range(held.shape[0]):
        if held[i] == 0:
            for c in range(3):
                worst = max(worst, abs((v1[i, c] - state.v[i, c]) / length - state.change[i, c]))
    return worst * length * length / 12.0


@njit(**KERNEL, **ALLOCATES)
def adaptive_run(
    assembly, system, state, plane, h, dissipation, located, allowed, pulls, load_factors, arm, tolerance, most, calls,
    work, scratch, book, tally,
):  # fmt: skip
    """Make steps of length `h` until one fails or the tables end; `state` is where it got to.

    Parameters are those of `rod.dynamics.run.kernels.implicit_run`, but for `dissipation` [1/s], from which follows the
    weight of each part's end, the level to which changes of contact are `located`, and the error `allowed` a step [mm].
    `state.alert` carries the level from step to step. Returns the steps made, the outcome of the last try, iterations,
    factorisations, the largest residual accepted, tries undone, steps made in parts, and how much of a step that failed
    was made [1].
    """
    pull = np.empty(pulls.shape[1])
    factors = np.empty(load_factors.shape[1])
    contacts = state.impulse.shape[0]
    iterations = 0
    factorisations = 0
    undone = 0
    divided = 0
    worst = 0.0
    factored = 0.0  # length of the part that the factors belong to
    steps = pulls.shape[0] - 1
    whole = 1 << FINEST
    for i in range(steps):
        level = min(state.alert[0] % UNSETTLED, FINEST)
        unsettled = state.alert[0] // UNSETTLED
        at = 0
        spare = allowed
        copy_state(state, work.kept)
        copy_row(book, work.kept_book)
        copy(tally, work.kept_tally)
        while at < whole:
            end = at + (whole >> level)
            length = h / (1 << level)
            weight = min(0.5 + dissipation * length, 1.0)
            # gaps close within the next part: if that is longer, a shorter one would overrun them
            following = level - 1 if level > 0 and end % (whole >> (level - 1)) == 0 else level
            average(pulls, i, at / whole, end / whole, weight, pull)
            average(load_factors, i, at / whole, end / whole, weight, factors)
            outcome, residual, tried, renewed = try_part(
                assembly, system, state, plane, length, weight, h / (1 << following), pull, factors, arm, tolerance,
                most, calls, factored == length, work, scratch,
            )  # fmt: skip
            iterations += tried
            factorisations += renewed
            factored = length if outcome == CONVERGED else 0.0
            changes = False
            calm = False
            if outcome == CONVERGED:
                share = allowed / (1 << level)
                error = _error(assembly.inertia.held, state, work.v1, length)
                changes = contact_changes(contacts, system, plane, state, work, length)
                calm = error <= _GROWS * share
                if not error <= share and not (unsettled > 0 and level >= located):
                    outcome = INACCURATE
                    if level == FINEST and error <= spare:
                        outcome = CONVERGED
                        spare -= error
                if changes:
                    outcome = CONVERGED if level >= located else INACCURATE
            if outcome != CONVERGED:
                if level == FINEST:
                    copy_state(work.kept, state)
                    copy_row(work.kept_book, book)
                    copy(work.kept_tally, tally)
                    return i, outcome, iterations, factorisations, worst, undone, divided, at / whole
                level += 1
                undone += 1
                continue
            worst = max(worst, residual)
            calls.accept(assembly, system, state, length, weight, factors, work, book, tally)
            if changes:
                unsettled = AFTER_CHANGE
            else:
                unsettled = max(unsettled - 1, 0)
                if calm:
                    level = following
            divided += int(end == whole and length < h)
            at = end
        state.alert[0] = level + UNSETTLED * unsettled
    return steps, CONVERGED, iterations, factorisations, worst, undone, divided, 0.0

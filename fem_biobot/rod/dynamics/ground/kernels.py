"""Compiled contact problem of a time step: velocities of the contacts by their impulses, and what those do.

Both integrators use it. Letters are those of `friction.kernels`; ``rows`` (c, 3, e, 6) turn the velocities of a
contact's nodes, ``ends`` (c, e), into that of the contact along the normal and two tangents. A contact point on the
ground has one node; a node that touches another part has three, itself and the two of the nearest segment.
"""

from __future__ import annotations

import numpy as np

from fem_biobot.compile_cache import BORROWS, INNER, KERNEL, ensure_cache_folder

ensure_cache_folder()

from numba import njit  # noqa: E402  (numba looks for its cache folder when it loads)

from fem_biobot.friction.kernels import LIFTED, SLIP, STICK, settle  # noqa: E402
from fem_biobot.rod.dynamics.inertia.kernels import clear  # noqa: E402

CONTACT_TOLERANCE = 1e-12
CONTACT_ACCEPTED = 1e-9  # residual of the contact problem with which a step may be accepted
CONTACT_ITERATIONS = 100
_NEAR = 0.05  # gap over the distance between axes, within which a touch is looked at


@njit(**INNER, **BORROWS)
def _gather(distance, touch, slide, plane, h, theta, gap, p, rows, ends, v1, free, near):
    """Copy the contacts that matter to the front of `near`: all of the ground's, others that are near or press.

    Far nodes keep away by themselves; one that comes nearer within an iteration is taken in the next.
    """
    grounded = p.shape[0] - distance.shape[0]
    count = 0
    for i in range(p.shape[0]):
        if i >= grounded and gap[i] > _NEAR * distance[i - grounded] and p[i, 0] == 0.0:
            continue
        near.order[count] = i
        near.touch[count] = touch[i]
        for a in range(3):
            present = 0.0
            change = 0.0
            for e in range(ends.shape[1]):
                node = ends[i, e]
                if node >= 0:
                    for k in range(6):
                        present += rows[i, a, e, k] * v1[node, k]
                        change += rows[i, a, e, k] * free[node, k]
            if i < grounded:
                for k in range(3):
                    present -= plane.axes[a, k] * plane.velocity[k]
            # a velocity moves the gap by theta h as well; dividing by this keeps the operator symmetric
            near.b[count, a] = change + ((present + gap[i] / h) / (1.0 + theta) if a == 0 else present)
            near.p[count, a] = p[i, a]
        for k in range(4):
            near.static[count, k] = plane.static[i, k]
            near.kinetic[count, k] = plane.kinetic[i, k]
        for k in range(2):
            near.slide[count, k] = slide[i, k]
        count += 1
    near.number[0] = count


@njit(**INNER, **BORROWS)
def _condense(grounded, number, rows, ends, push, push_ends, compliance, response, near):
    """Write velocities at the near contacts by impulses there, (3 a, 3 a), to the front of `near.W`.

    `rows` turn velocities of nodes at the end into those of the contacts, `push` impulses there into those of nodes
    during the step. `number` (n,) are the nodes' places in `compliance`. Parts that touch without friction, after the
    first `grounded` contacts, have no impulses along their surface: of what these would do nothing but a mobility is
    written, and the velocity along the surface is left out of the product.
    """
    W, order, active = near.W, near.order, near.number[0]
    size = 3 * active
    for t in range(size * size):
        W[t] = 0.0
    for j in range(active):
        c = order[j]
        lanes = _lanes(grounded, j, near)
        clear(response)
        for e in range(push_ends.shape[1]):
            if push_ends[c, e] < 0:
                continue
            f = 6 * number[push_ends[c, e]]
            for a in range(lanes):
                for k in range(6):
                    impulse = push[c, a, e, k]
                    if impulse != 0.0:
                        for r in range(compliance.shape[1]):
                            response[a, r] += impulse * compliance[f + k, r]
        for i in range(active):
            row = order[i]
            rising = _lanes(grounded, i, near)
            for e in range(ends.shape[1]):
                if ends[row, e] < 0:
                    continue
                f = 6 * number[ends[row, e]]
                for a in range(rising):
                    at = (3 * i + a) * size + 3 * j
                    for b in range(lanes):
                        total = 0.0
                        for k in range(6):
                            total += rows[row, a, e, k] * response[b, f + k]
                        W[at + b] += total
        if lanes == 1:
            for a in range(1, 3):
                W[(3 * j + a) * (size + 1)] = W[3 * j * (size + 1)]


@njit(**INNER, **BORROWS)
def _lanes(grounded, i, near):
    """Directions in which a near contact can have impulses: one without friction, of parts that touch, else three."""
    if near.order[i] < grounded:
        return 3
    for k in range(4):
        if near.static[i, k] > 0.0:
            return 3
    return 1


@njit(**INNER, **BORROWS)
def solve_contacts(
    distance, number, touch, slide, plane, h, theta, push, push_ends, friction, work, scratch
):  # fmt: skip
    """Write impulses of all contacts to `work.p`, and what became of them to `work.touch`; returns the residual.

    `distance` (t,) are those of the touches, `number` (n,) the nodes' places in `work.compliance`, `touch` (c,) and
    `slide` (c, 2) those of the state. `push` (c, 3, e, 6) and `push_ends` are the directions along which impulses act,
    `work.rows` those of velocities at the end; `work.free` is the change of the velocities `work.v1` without contact.
    `friction` is `solve_friction` by address.
    """
    near, p = work.near, work.p
    _gather(distance, touch, slide, plane, h, theta, work.gap, p, work.rows, work.ends, work.v1, work.free, near)
    a = near.number[0]
    _condense(
        p.shape[0] - distance.shape[0], number, work.rows, work.ends, push, push_ends, work.compliance, work.response,
        near,
    )  # fmt: skip
    W = near.W[: 9 * a * a].reshape((3 * a, 3 * a))
    trouble, _ = friction(
        W, near.b[:a], near.static[:a], near.kinetic[:a], near.touch[:a], near.slide[:a], near.p[:a], near.w[:a],
        scratch, CONTACT_TOLERANCE, CONTACT_ITERATIONS,
    )  # fmt: skip
    clear(p)
    for i in range(work.touch.shape[0]):
        work.touch[i] = LIFTED
    for i in range(a):
        work.touch[near.order[i]] = near.touch[i]
        for k in range(3):
            p[near.order[i], k] = near.p[i, k]
    return trouble


@njit(**INNER, **BORROWS)
def settle_contacts(work):
    """Write stick, slip or lift of all contacts at the end of a converged step, and how they slide, to `work`."""
    near = work.near
    a = near.number[0]
    settle(near.b[:a], near.w[:a], near.touch[:a], near.slide[:a], CONTACT_TOLERANCE)
    for i in range(work.settled.shape[0]):
        work.settled[i] = LIFTED
        for k in range(2):
            work.slid[i, k] = 0.0
    for i in range(a):
        work.settled[near.order[i]] = near.touch[i]
        for k in range(2):
            work.slid[near.order[i], k] = near.slide[i, k]


@njit(**KERNEL, **BORROWS)
def even_out(foot, n_feet, axes, touch, rows, p):
    """Share the tangential impulses of feet that stick among their corners in proportion to the normal ones.

    Sum and moment of each foot are kept, so that velocities are, too: what goes is the part that is in equilibrium by
    itself, which a slide leaves behind and nothing else would ever remove. For the start of an iteration only.
    """
    for f in range(n_feet):
        weight = 0.0
        sticks = True
        cx = 0.0
        cy = 0.0
        for i in range(foot.shape[0]):
            if foot[i] == f and p[i, 0] > 0.0:
                sticks = sticks and touch[i] == STICK
                weight += p[i, 0]
                for k in range(3):
                    # (r x t2) . n = r . t1 and (r x t1) . n = -r . t2
                    cx += p[i, 0] * rows[i, 2, 0, 3 + k] * axes[0, k]
                    cy -= p[i, 0] * rows[i, 1, 0, 3 + k] * axes[0, k]
        if not sticks or weight == 0.0:
            continue
        cx /= weight
        cy /= weight
        fx = 0.0
        fy = 0.0
        moment = 0.0
        polar = 0.0
        for i in range(foot.shape[0]):
            if foot[i] == f and p[i, 0] > 0.0:
                x, y = -cx, -cy
                for k in range(3):
                    x += rows[i, 2, 0, 3 + k] * axes[0, k]
                    y -= rows[i, 1, 0, 3 + k] * axes[0, k]
                fx += p[i, 1]
                fy += p[i, 2]
                moment += x * p[i, 2] - y * p[i, 1]
                polar += p[i, 0] * (x * x + y * y)
        turn = moment / polar if polar > 0.0 else 0.0
        for i in range(foot.shape[0]):
            if foot[i] == f and p[i, 0] > 0.0:
                x, y = -cx, -cy
                for k in range(3):
                    x += rows[i, 2, 0, 3 + k] * axes[0, k]
                    y -= rows[i, 1, 0, 3 + k] * axes[0, k]
                p[i, 1] = p[i, 0] * (fx / weight - turn * y)
                p[i, 2] = p[i, 0] * (fy / weight + turn * x)


@njit(**INNER, **BORROWS)
def _used(foot, f, plane, impulse):
    """Share of the static friction of foot `f` that its impulses (c, 3) use along both tangents; no number without."""
    normal = 0.0
    first = 0.0
    second = 0.0
    for i in range(foot.shape[0]):
        if foot[i] == f and impulse[i, 0] > 0.0:
            mu = plane.static[i]
            with_first = mu[0] if impulse[i, 1] < 0.0 else mu[1]
            with_second = mu[2] if impulse[i, 2] < 0.0 else mu[3]
            if with_first == 0.0 or with_second == 0.0:
                return np.nan, np.nan
            normal += impulse[i, 0]
            first += impulse[i, 1] / with_first
            second += impulse[i, 2] / with_second
    if normal == 0.0:
        return np.nan, np.nan
    return first / normal, second / normal


@njit(**INNER, **BORROWS)
def gives_way(foot, n_feet, plane, state, work, h):
    """Whether a foot that sticks through a converged step of length `h` is past its static friction at the end of it.

    A step's impulses are those of its middle. What friction is used there and in the middle of the step before, whose
    length may be another, is carried on by half of this step; impulses of a foot are summed, since how its corners
    share them is not determined. Where static friction is the kinetic one nothing is released, and nothing told. To be
    called after `settle_contacts`.
    """
    on = h / (h + state.length[0])  # half of this step over the time between the middles
    for f in range(n_feet):
        drops = False
        sticks = True
        for i in range(foot.shape[0]):
            if foot[i] == f and work.p[i, 0] > 0.0:
                sticks = sticks and state.touch[i] == STICK and work.settled[i] == STICK
                for k in range(4):
                    drops = drops or plane.kinetic[i, k] < plane.static[i, k]
        if not (drops and sticks):
            continue
        x0, y0 = _used(foot, f, plane, state.impulse)
        x1, y1 = _used(foot, f, plane, work.p)
        x = x1 + on * (x1 - x0)
        y = y1 + on * (y1 - y0)
        if x * x + y * y > 1.0:  # not for no number
            return True
    return False


@njit(**INNER, **BORROWS)
def add_contact_impulses(ends, rows, p, to):
    """Add the impulses `p` (c, 3) of the contacts to those of their nodes, `to` (n, 6)."""
    for i in range(p.shape[0]):
        for a in range(3):
            if p[i, a] != 0.0:
                for e in range(ends.shape[1]):
                    if ends[i, e] >= 0:
                        for k in range(6):
                            to[ends[i, e], k] += rows[i, a, e, k] * p[i, a]


@njit(**INNER, **BORROWS)
def enter_contacts(ends, rows, p, touch, vm, h, book, tally):
    """Enter a step's work of friction and normal force into `book`; impulses and times into `tally` (c, 5)."""
    for i in range(p.shape[0]):
        for a in range(3):
            tally[i, a] += p[i, a]
            motion = 0.0
            for e in range(ends.shape[1]):
                if ends[i, e] >= 0:
                    for k in range(6):
                        motion += rows[i, a, e, k] * vm[ends[i, e], k]
            book[7 if a == 0 else 6] += p[i, a] * motion
        if touch[i] == SLIP:
            tally[i, 3] += h
        if p[i, 0] > 0.0:
            tally[i, 4] += h

"""Compiled contact problem of a time step: velocities of the contact points by their impulses, and what those do.

Both integrators use it. Letters are those of `rod.contact.kernels`; ``rows`` (c, 3, 6) turn the velocity of a point's
node into that of the point along the normal and two tangents.
"""

from __future__ import annotations

from fem_biobot.compile_cache import INNER, ensure_cache_folder

ensure_cache_folder()

from numba import njit  # noqa: E402  (numba looks for its cache folder when it loads)

from fem_biobot.rod.contact.kernels import SLIP, STICK  # noqa: E402

CONTACT_TOLERANCE = 1e-12
CONTACT_ACCEPTED = 1e-9  # residual of the contact problem with which a step may be accepted
CONTACT_ITERATIONS = 100


@njit(**INNER)
def condense(contacts, foot, plane, h, theta, rows, push, work):
    """Write `work.W` and `work.b`, velocities at the contact points by impulse and those of ``v1 + free`` without.

    `rows` (c, 3, 6) turn velocities at the end, `push` are those along which impulses act during the step; `foot` (c,)
    numbers the nodes that touch, whose compliance (6 f, 6 f) is `work.compliance`. The velocity that closes a gap
    within `h` is part of the normal `b`.
    """
    compliance = work.compliance
    response = work.response
    W = work.W
    count = contacts.node.shape[0]
    for i in range(count):
        node = contacts.node[i]
        f = 6 * foot[i]
        for a in range(3):
            present = 0.0
            free = 0.0
            for k in range(6):
                present += rows[i, a, k] * work.v1[node, k]
                free += rows[i, a, k] * work.free[node, k]
            for k in range(3):
                present -= plane.axes[a, k] * plane.velocity[k]
            # a velocity moves the gap by theta h as well; dividing by this keeps the operator symmetric
            work.b[i, a] = free + ((present + work.gap[i] / h) / (1.0 + theta) if a == 0 else present)
        for r in range(compliance.shape[0]):
            for a in range(3):
                total = 0.0
                for k in range(6):
                    total += compliance[r, f + k] * push[i, a, k]
                response[r, 3 * i + a] = total
    for i in range(count):
        f = 6 * foot[i]
        for a in range(3):
            for j in range(3 * count):
                total = 0.0
                for k in range(6):
                    total += rows[i, a, k] * response[f + k, j]
                W[3 * i + a, j] = total


@njit(cache=True, nogil=True)
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
        for i in range(p.shape[0]):
            if foot[i] == f and p[i, 0] > 0.0:
                sticks = sticks and touch[i] == STICK
                weight += p[i, 0]
                for k in range(3):
                    # (r x t2) . n = r . t1 and (r x t1) . n = -r . t2
                    cx += p[i, 0] * rows[i, 2, 3 + k] * axes[0, k]
                    cy -= p[i, 0] * rows[i, 1, 3 + k] * axes[0, k]
        if not sticks or weight == 0.0:
            continue
        cx /= weight
        cy /= weight
        fx = 0.0
        fy = 0.0
        moment = 0.0
        polar = 0.0
        for i in range(p.shape[0]):
            if foot[i] == f and p[i, 0] > 0.0:
                x, y = -cx, -cy
                for k in range(3):
                    x += rows[i, 2, 3 + k] * axes[0, k]
                    y -= rows[i, 1, 3 + k] * axes[0, k]
                fx += p[i, 1]
                fy += p[i, 2]
                moment += x * p[i, 2] - y * p[i, 1]
                polar += p[i, 0] * (x * x + y * y)
        turn = moment / polar if polar > 0.0 else 0.0
        for i in range(p.shape[0]):
            if foot[i] == f and p[i, 0] > 0.0:
                x, y = -cx, -cy
                for k in range(3):
                    x += rows[i, 2, 3 + k] * axes[0, k]
                    y -= rows[i, 1, 3 + k] * axes[0, k]
                p[i, 1] = p[i, 0] * (fx / weight - turn * y)
                p[i, 2] = p[i, 0] * (fy / weight + turn * x)


@njit(**INNER)
def add_ground_impulses(node, rows, p, to):
    """Add the impulses `p` (c, 3) of the contact points to the nodes' impulses `to` (n, 6)."""
    for i in range(node.shape[0]):
        for a in range(3):
            if p[i, a] != 0.0:
                for k in range(6):
                    to[node[i], k] += rows[i, a, k] * p[i, a]


@njit(**INNER)
def enter_ground(node, rows, p, touch, vm, h, book, tally):
    """Enter a step's work of friction and normal force into `book`; impulses and times into `tally` (c, 5)."""
    for i in range(node.shape[0]):
        for a in range(3):
            tally[i, a] += p[i, a]
            motion = 0.0
            for k in range(6):
                motion += rows[i, a, k] * vm[node[i], k]
            book[7 if a == 0 else 6] += p[i, a] * motion
        if touch[i] == SLIP:
            tally[i, 3] += h
        if p[i, 0] > 0.0:
            tally[i, 4] += h

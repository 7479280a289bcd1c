"""Compiled forces of axial members and loads, joints and contact points, with their derivatives.

Forces on nodes are (n, 6): force [mN] and moment about the node [uJ] in world axes. Increments are spatial: a
displacement and a small rotation of each node. `r` is the arm from a node to a point fixed to it, in world axes.
"""

from __future__ import annotations

import numpy as np

from fem_biobot.compile_cache import ALLOCATES, BORROWS, KERNEL, ensure_cache_folder

ensure_cache_folder()

from numba import njit  # noqa: E402  (numba looks for its cache folder when it loads)


@njit(**KERNEL, **BORROWS)
def arm(Q, node, offset, r):
    """Write the arm ``Q^T offset`` of a point of a node; the world's points have none."""
    for i in range(3):
        r[i] = 0.0
        if node >= 0:
            for k in range(3):
                r[i] += Q[node, k, i] * offset[k]


@njit(**KERNEL, **BORROWS)
def point(x, Q, node, offset, r, p):
    """Write the arm `r` and the position `p` of a point of a node, or of the world (node -1)."""
    arm(Q, node, offset, r)
    for i in range(3):
        p[i] = x[node, i] + r[i] if node >= 0 else offset[i]


@njit(**KERNEL, **BORROWS)
def add_force(node, r, f, factor, force):
    """Add a force `f` times `factor` at the arm `r` of a node."""
    if node >= 0:
        for i in range(3):
            force[node, i] += factor * f[i]
        force[node, 3] += factor * (r[1] * f[2] - r[2] * f[1])
        force[node, 4] += factor * (r[2] * f[0] - r[0] * f[2])
        force[node, 5] += factor * (r[0] * f[1] - r[1] * f[0])


@njit(**KERNEL, **ALLOCATES)
def point_tangent(ra, rb, K, g, out):
    """Add the derivative of a force `f` at arm `ra` whose own derivative is ``K dp_b``, to `out` (6, 6).

    Rows: force and moment of node a; columns: increments of node b, ``dp_b = dx_b + dtheta_b x rb``. With ``rb is ra``
    as the same node, the moment's change with its arm is added for the force `g`; pass zeros otherwise.
    """
    B = np.empty((3, 6))
    for i in range(3):
        for j in range(3):
            B[i, j] = K[i, j]
        # K [rb]x with the sign of dtheta x r = -[r]x dtheta
        B[i, 3] = -(K[i, 1] * rb[2] - K[i, 2] * rb[1])
        B[i, 4] = -(K[i, 2] * rb[0] - K[i, 0] * rb[2])
        B[i, 5] = -(K[i, 0] * rb[1] - K[i, 1] * rb[0])
    for j in range(6):
        for i in range(3):
            out[i, j] += B[i, j]
        out[3, j] += ra[1] * B[2, j] - ra[2] * B[1, j]
        out[4, j] += ra[2] * B[0, j] - ra[0] * B[2, j]
        out[5, j] += ra[0] * B[1, j] - ra[1] * B[0, j]
    # (dtheta x r) x g = g x (r x dtheta) = [g]x [r]x dtheta = (r g^T - (g . r) I) dtheta
    dot = g[0] * ra[0] + g[1] * ra[1] + g[2] * ra[2]
    for i in range(3):
        for j in range(3):
            out[3 + i, 3 + j] += ra[i] * g[j]
        out[3 + i, 3 + i] -= dot


@njit(**KERNEL, **ALLOCATES)
def member_lengths(members, x, Q, lengths):
    """Write the present length of each member, (k,)."""
    r = np.empty(3)
    a = np.empty(3)
    b = np.empty(3)
    for k in range(members.law.shape[0]):
        point(x, Q, members.nodes[k, 0], members.offset[k, 0], r, a)
        point(x, Q, members.nodes[k, 1], members.offset[k, 1], r, b)
        lengths[k] = np.sqrt((b[0] - a[0]) ** 2 + (b[1] - a[1]) ** 2 + (b[2] - a[2]) ** 2)


@njit(**KERNEL, **BORROWS)
def passive_tension(law, stiffness, rest, length):
    """Tensile force of a member without activation, its derivative by length, and its energy."""
    if law == 0:
        d = length - rest
        return stiffness * d, stiffness, 0.5 * stiffness * d * d
    s = length / rest
    if law == 1:
        return stiffness * (s - 1.0) / s, stiffness / (s * s * rest), stiffness * rest * (s - 1.0 - np.log(s))
    third = stiffness / 3.0
    return third * (s - 1.0 / s**2), third * (1.0 + 2.0 / s**3) / rest, third * rest * (0.5 * s * s + 1.0 / s - 1.5)


@njit(**KERNEL, **ALLOCATES)
def add_member_forces(members, x, Q, tension, force):
    """Add to `force` what members of the given tension (k,) exert on their nodes."""
    ra = np.empty(3)
    rb = np.empty(3)
    a = np.empty(3)
    b = np.empty(3)
    for k in range(members.law.shape[0]):
        i = members.nodes[k, 0]
        j = members.nodes[k, 1]
        point(x, Q, i, members.offset[k, 0], ra, a)
        point(x, Q, j, members.offset[k, 1], rb, b)
        length = 0.0
        for c in range(3):
            b[c] -= a[c]
            length += b[c] * b[c]
        factor = tension[k] / np.sqrt(length)
        add_force(i, ra, b, factor, force)
        add_force(j, rb, b, -factor, force)


@njit(**KERNEL, **ALLOCATES)
def member_tangent(members, k, x, Q, tension, stiffness, out):
    """Write minus the derivative of a member's forces, (12, 12), for a derivative `stiffness` of tension by length."""
    ra = np.empty(3)
    rb = np.empty(3)
    a = np.empty(3)
    b = np.empty(3)
    i = members.nodes[k, 0]
    j = members.nodes[k, 1]
    point(x, Q, i, members.offset[k, 0], ra, a)
    point(x, Q, j, members.offset[k, 1], rb, b)
    length = 0.0
    for c in range(3):
        b[c] -= a[c]
        length += b[c] * b[c]
    length = np.sqrt(length)
    K = np.empty((3, 3))
    g = np.empty(3)
    zero = np.zeros(3)
    for c in range(3):
        b[c] /= length
    for c in range(3):
        g[c] = tension[k] * b[c]
        for d in range(3):
            K[c, d] = (stiffness - tension[k] / length) * b[c] * b[d]
        K[c, c] += tension[k] / length
    out[:] = 0.0
    point_tangent(rb, rb, K, g, out[6:, 6:])
    point_tangent(rb, ra, -K, zero, out[6:, :6])
    point_tangent(ra, rb, -K, zero, out[:6, 6:])
    point_tangent(ra, ra, K, -g, out[:6, :6])


@njit(**KERNEL, **ALLOCATES)
def add_loads(loads, factor, Q, force):
    """Add loads times their factors (l,) to `force`."""
    r = np.empty(3)
    f = np.empty(3)
    m = np.empty(3)
    for k in range(loads.node.shape[0]):
        i = loads.node[k]
        arm(Q, i, loads.offset[k], r)
        for c in range(3):
            f[c] = loads.force[k, c]
            m[c] = loads.moment[k, c]
        if loads.following[k] == 1:
            arm(Q, i, loads.force[k], f)
            arm(Q, i, loads.moment[k], m)
        add_force(i, r, f, factor[k], force)
        for c in range(3):
            force[i, 3 + c] += factor[k] * m[c]


@njit(**KERNEL, **ALLOCATES)
def load_tangent(loads, k, factor, Q, out):
    """Write minus the derivative of a load's force on its node, (6, 6)."""
    r = np.empty(3)
    f = np.empty(3)
    m = np.empty(3)
    i = loads.node[k]
    arm(Q, i, loads.offset[k], r)
    out[:] = 0.0
    if loads.following[k] == 1:
        arm(Q, i, loads.force[k], f)
        arm(Q, i, loads.moment[k], m)
        m[0] += r[1] * f[2] - r[2] * f[1]
        m[1] += r[2] * f[0] - r[0] * f[2]
        m[2] += r[0] * f[1] - r[1] * f[0]
        # a vector a fixed to the node changes by dtheta x a = -[a]x dtheta; minus that is [a]x
        for block, a in ((0, f), (3, m)):
            out[block, 4] = -factor * a[2]
            out[block, 5] = factor * a[1]
            out[block + 1, 3] = factor * a[2]
            out[block + 1, 5] = -factor * a[0]
            out[block + 2, 3] = -factor * a[1]
            out[block + 2, 4] = factor * a[0]
        return
    dot = 0.0
    for c in range(3):
        f[c] = factor * loads.force[k, c]
        dot += f[c] * r[c]
    for c in range(3):
        for d in range(3):
            out[3 + c, 3 + d] = -r[c] * f[d]
        out[3 + c, 3 + c] += dot


@njit(**KERNEL, **BORROWS)
def add_gravity(inertia, gravity, factor, force):
    """Add the weights of the nodes."""
    for i in range(inertia.mass.shape[0]):
        for c in range(3):
            force[i, c] += factor * inertia.mass[i] * gravity[c]


@njit(**KERNEL, **ALLOCATES)
def constraint(constraints, j, x, Q, value, rows):
    """Write a joint's six residuals `value` and their derivatives by the two nodes' increments, `rows` (6, 12).

    Rows that do not hold are zero. Two rotation rows keep the third axis of both parts parallel, however far they turn
    about it. One or three are components, in the second part's frame, of the axial vector of the relative rotation:
    exact where they vanish.
    """
    ra = np.empty(3)
    rb = np.empty(3)
    a = np.empty(3)
    b = np.empty(3)
    A = np.zeros((3, 3))
    B = np.zeros((3, 3))
    i = constraints.nodes[j, 0]
    k = constraints.nodes[j, 1]
    point(x, Q, i, constraints.offset[j, 0], ra, a)
    point(x, Q, k, constraints.offset[j, 1], rb, b)
    value[:] = 0.0
    rows[:] = 0.0
    turns = 0
    free = 0
    for c in range(3):
        turns += constraints.rows[j, 3 + c]
        if constraints.rows[j, 3 + c] == 0:
            free = c
    for c in range(3):
        arm(Q, i, constraints.frame[j, 0, c], A[c])
        if k >= 0:
            arm(Q, k, constraints.frame[j, 1, c], B[c])
        else:
            for d in range(3):
                B[c, d] = constraints.frame[j, 1, c, d]
    for c in range(3):
        if constraints.rows[j, c] == 1:
            value[c] = a[c] - b[c]
            rows[c, c] = 1.0
            rows[c, 6 + c] = -1.0
            d = (c + 1) % 3
            e = (c + 2) % 3
            # (dtheta x r)_c = dtheta_d r_e - dtheta_e r_d
            rows[c, 3 + d] = ra[e]
            rows[c, 3 + e] = -ra[d]
            rows[c, 9 + d] = -rb[e]
            rows[c, 9 + e] = rb[d]
        if constraints.rows[j, 3 + c] == 1:
            # the row is weight (A_d . B_e) plus other (A_e . B_d)
            d = (c + 1) % 3
            e = (c + 2) % 3
            weight = 0.5
            other = -0.5
            if turns == 2:
                # the free axis of the first part stays across the other axes of the second
                d = free
                e = 3 - free - c
                weight = 1.0 if (free + 1) % 3 == e else -1.0
                other = 0.0
            for t in range(3):
                value[3 + c] += weight * A[d, t] * B[e, t] + other * A[e, t] * B[d, t]
            for t in range(3):
                u = (t + 1) % 3
                w = (t + 2) % 3
                # dA = dtheta x A, so d(A . B) = dtheta . (A x B)
                across = weight * (A[d, u] * B[e, w] - A[d, w] * B[e, u])
                across += other * (A[e, u] * B[d, w] - A[e, w] * B[d, u])
                rows[3 + c, 3 + t] = across
                rows[3 + c, 9 + t] = -across
    if k < 0:
        rows[:, 6:] = 0.0


@njit(**KERNEL, **ALLOCATES)
def contact(contacts, k, x, Q, axes, height, pushing, rows):
    """Gap of a contact point to the ground, and derivatives of its motion along the ground's axes, `rows` (3, e, 6).

    Only the first of the `e` nodes that rows may have is its own. Where the ground's force acts elsewhere, the
    tangential rows are those of that point, and with `pushing` the normal one, too.

    A round surface touches below its axis: the arm of its lowest point is what turns its rotation into slip.
    """
    r = np.empty(3)
    p = np.empty(3)
    i = contacts.node[k]
    point(x, Q, i, contacts.offset[k], r, p)
    radius = contacts.radius[k]
    if radius > 0.0:
        # direction to the lowest point: minus the normal, made perpendicular to the axis of a cylinder
        axis = np.empty(3)
        arm(Q, i, contacts.axis[k], axis)
        along = axis[0] * axes[0, 0] + axis[1] * axes[0, 1] + axis[2] * axes[0, 2]
        down = np.empty(3)
        size = 0.0
        for c in range(3):
            down[c] = along * axis[c] - axes[0, c]
            size += down[c] * down[c]
        size = max(np.sqrt(size), 1e-300)
        for c in range(3):
            r[c] += radius * down[c] / size
            p[c] += radius * down[c] / size
    gap = -height
    for c in range(3):
        gap += axes[0, c] * p[c]
    for a in range(3):
        if contacts.elsewhere[k] == 1 and (pushing or a > 0):
            arm(Q, i, contacts.acting[k], r)
        for c in range(3):
            rows[a, 0, c] = axes[a, c]
        # axes . (dtheta x r) = dtheta . (r x axes)
        rows[a, 0, 3] = r[1] * axes[a, 2] - r[2] * axes[a, 1]
        rows[a, 0, 4] = r[2] * axes[a, 0] - r[0] * axes[a, 2]
        rows[a, 0, 5] = r[0] * axes[a, 1] - r[1] * axes[a, 0]
    return gap

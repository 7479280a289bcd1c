"""Compiled drag on the nodes of an assembly, and its exact derivatives by velocity and by direction.

A lump moves with a point of a node at the velocity ``u`` relative to the medium. With its axis t, the part ``n`` of `u`
across it, and the node's angular velocity ``w``,

    f = -a (u . t) t - (c + q |n|) n,        m = r x f - s (w . t) t - p (w - (w . t) t)

A lump without axis (zero) resists alike in all directions: ``n = u``.
"""

from __future__ import annotations

import numpy as np

from fem_biobot.compile_cache import BORROWS, KERNEL, ensure_cache_folder

ensure_cache_folder()

from numba import njit  # noqa: E402  (numba looks for its cache folder when it loads)

from fem_biobot.rod.algebra.kernels import apply, combine, cross, dot, matrix_of, row_of, transpose  # noqa: E402


@njit(**KERNEL, **BORROWS)
def _lump(drags, k, Q, v):
    """Arm and axis of a lump, its relative velocity along and across that, its node's angular velocity, and force."""
    i = drags.node[k]
    frame = transpose(matrix_of(Q, i))
    r = apply(frame, row_of(drags.offset, k))
    t = apply(frame, row_of(drags.axis, k))
    w = (v[i, 3], v[i, 4], v[i, 5])
    u = combine(1.0, combine(1.0, (v[i, 0], v[i, 1], v[i, 2]), -1.0, row_of(drags.velocity, k)), 1.0, cross(w, r))
    along = dot(u, t)
    n = combine(1.0, u, -along, t)
    gain = drags.across[k] + drags.quadratic[k] * np.sqrt(dot(n, n))
    return r, t, along, n, w, combine(-drags.along[k] * along, t, -gain, n)


@njit(**KERNEL, **BORROWS)
def add_drag(drags, Q, v, force):
    """Add the drag at velocities `v` (n, 6) to `force` (n, 6); returns the largest component of a lump's force."""
    largest = 0.0
    for k in range(drags.node.shape[0]):
        r, t, _, _, w, f = _lump(drags, k, Q, v)
        spin = dot(w, t)
        m = combine(1.0, cross(r, f), -drags.tumble[k], w)
        m = combine(1.0, m, (drags.tumble[k] - drags.spin[k]) * spin, t)
        i = drags.node[k]
        for c in range(3):
            force[i, c] += f[c]
            force[i, 3 + c] += m[c]
            largest = max(largest, abs(f[c]))
    return largest


@njit(**KERNEL, **BORROWS)
def drag_tangent(drags, k, Q, v, by_velocity, by_turn, out):
    """Add minus the derivatives of a lump's force on its node to `out` (6, 6).

    By the node's velocity times `by_velocity`, and by its spatial increment times `by_turn`.
    """
    r, t, along, n, w, f = _lump(drags, k, Q, v)
    size = np.sqrt(dot(n, n))
    q = drags.quadratic[k] / size if size > 0.0 else 0.0
    gain = drags.across[k] + drags.quadratic[k] * size
    extra = drags.spin[k] - drags.tumble[k]
    spin = dot(w, t)
    for c in range(9):
        # three velocities, three angular velocities, three turns
        e = (1.0 if c % 3 == 0 else 0.0, 1.0 if c % 3 == 1 else 0.0, 1.0 if c % 3 == 2 else 0.0)
        if c < 6:
            du = e if c < 3 else cross(e, r)
            dt = (0.0, 0.0, 0.0)
            dr = (0.0, 0.0, 0.0)
        else:
            dr = cross(e, r)
            dt = cross(e, t)
            du = cross(w, dr)
        # with the axis at rest, then for its turn: t . dt = 0, so that u . dt = n . dt
        push = dot(du, t)
        dn = combine(1.0, du, -push, t)
        df = combine(-drags.along[k] * push, t, -gain, dn)
        turned = dot(n, dt)
        df = combine(1.0, df, (gain - drags.along[k]) * turned, t)
        df = combine(1.0, df, (gain - drags.along[k]) * along, dt)
        df = combine(1.0, df, q * (along * turned - dot(n, du)), n)
        dm = combine(1.0, cross(r, df), 1.0, cross(dr, f))
        if 3 <= c < 6:
            dm = combine(1.0, dm, -drags.tumble[k], e)
            dm = combine(1.0, dm, -extra * dot(e, t), t)
        dm = combine(1.0, dm, -extra * dot(w, dt), t)
        dm = combine(1.0, dm, -extra * spin, dt)
        scale = by_velocity if c < 6 else by_turn
        column = c if c < 6 else c - 3
        for a in range(3):
            out[a, column] -= scale * df[a]
            out[3 + a, column] -= scale * dm[a]


@njit(**KERNEL, **BORROWS)
def add_drag_tangents(drags, held, diagonal, Q, v, by_velocity, by_turn, blocks):
    """Add the lumps' tangents to the nodes' blocks; held nodes take nothing."""
    for k in range(drags.node.shape[0]):
        i = drags.node[k]
        if held[i] == 0:
            drag_tangent(drags, k, Q, v, by_velocity, by_turn, blocks[diagonal[i]])

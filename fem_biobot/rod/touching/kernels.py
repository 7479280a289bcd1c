"""Compiled contact between parts: a round rod's node against a round chain of straight segments.

The gap is the distance of the node's centre from the nearest point of the chain's axis less the distance at which the
surfaces meet. Surfaces touch on the line between the two, so that friction has an arm on both sides.
"""

from __future__ import annotations

import numpy as np

from fem_biobot.compile_cache import ALLOCATES, BORROWS, INNER, KERNEL, ensure_cache_folder

ensure_cache_folder()

from numba import njit  # noqa: E402  (numba looks for its cache folder when it loads)

from fem_biobot.rod.parts.kernels import contact, point  # noqa: E402


@njit(**INNER, **BORROWS)
def _level(w, p):
    """Take from `p` its part along the unit vector `w`, which may be zero."""
    part = w[0] * p[0] + w[1] * p[1] + w[2] * p[2]
    for c in range(3):
        p[c] -= part * w[c]


@njit(**INNER, **BORROWS)
def _nearest(p, a, b, low, high):
    """Share of the way from `a` to `b`, in the bounds, of the point nearest to `p`, and the distance squared."""
    along = 0.0
    length = 0.0
    for c in range(3):
        along += (p[c] - a[c]) * (b[c] - a[c])
        length += (b[c] - a[c]) ** 2
    t = min(max(along / length, low), high) if length > 0.0 else 0.0
    square = 0.0
    for c in range(3):
        square += (p[c] - a[c] - t * (b[c] - a[c])) ** 2
    return t, square


@njit(**INNER, **BORROWS)
def _across(n, s, t1):
    """Write the unit vector `t1` across the unit vector `n`, along `s` if that is possible."""
    along = n[0] * s[0] + n[1] * s[1] + n[2] * s[2]
    size = 0.0
    full = 0.0
    for c in range(3):
        t1[c] = s[c] - along * n[c]
        size += t1[c] * t1[c]
        full += s[c] * s[c]
    if size <= 1e-12 * full:  # the segment points at the node: any direction across will do
        least = 0
        for c in range(1, 3):
            if abs(n[c]) < abs(n[least]):
                least = c
        size = 1.0 - n[least] * n[least]
        for c in range(3):
            t1[c] = (1.0 if c == least else 0.0) - n[least] * n[c]
    size = np.sqrt(size)
    for c in range(3):
        t1[c] /= size


@njit(**INNER, **BORROWS)
def _enter(direction, r, weight, row):
    """Write ``weight direction . (dx + dtheta x r)`` by the six increments of a node to `row` (6,)."""
    for c in range(3):
        d = (c + 1) % 3
        e = (c + 2) % 3
        row[c] = weight * direction[c]
        row[3 + c] = weight * (r[d] * direction[e] - r[e] * direction[d])


@njit(**KERNEL, **ALLOCATES)
def touch(touches, k, x, Q, rows, ends):
    """Gap of a node to its chain, and the derivatives of the relative motion of the surfaces, `rows` (3, 3, 6).

    Rows are along the normal, from the chain to the node, and two tangents, the first along the chain; `ends` (3,) are
    the nodes moved: the touching one and the two of the nearest segment.
    """
    r = np.empty(3)
    ra = np.empty(3)
    rb = np.empty(3)
    p = np.empty(3)
    a = np.empty(3)
    b = np.empty(3)
    n = np.empty(3)
    along = np.empty(3)
    t1 = np.empty(3)
    t2 = np.empty(3)
    i = touches.node[k]
    wall = touches.along[k]
    point(x, Q, i, touches.offset[k], r, p)
    _level(wall, p)
    best = np.inf
    share = 0.0
    nearest = touches.first[k]
    for s in range(touches.first[k], touches.last[k]):
        point(x, Q, touches.chain_node[s, 0], touches.chain_offset[s, 0], ra, a)
        point(x, Q, touches.chain_node[s, 1], touches.chain_offset[s, 1], rb, b)
        _level(wall, a)
        _level(wall, b)
        on = touches.endless[k] == 1
        low = -np.inf if on and s == touches.first[k] else 0.0
        high = np.inf if on and s == touches.last[k] - 1 else 1.0
        t, square = _nearest(p, a, b, low, high)
        if square < best:
            best, share, nearest = square, t, s
    point(x, Q, touches.chain_node[nearest, 0], touches.chain_offset[nearest, 0], ra, a)
    point(x, Q, touches.chain_node[nearest, 1], touches.chain_offset[nearest, 1], rb, b)
    _level(wall, a)
    _level(wall, b)
    apart = np.sqrt(best)
    for c in range(3):
        along[c] = b[c] - a[c]
        n[c] = (p[c] - a[c] - share * along[c]) / max(apart, 1e-300)
    if apart == 0.0:  # on the axis: pushed out across it
        length = np.sqrt(along[0] ** 2 + along[1] ** 2 + along[2] ** 2)
        for c in range(3):
            t1[c] = along[c] / length
        _across(t1, along, n)
    _across(n, along, t1)
    for c in range(3):
        t2[c] = n[(c + 1) % 3] * t1[(c + 2) % 3] - n[(c + 2) % 3] * t1[(c + 1) % 3]
        # to where the surfaces touch: one point for both parts, or friction would turn the whole
        r[c] -= touches.radius[k] * n[c]
        ra[c] += (apart - touches.radius[k]) * n[c]
        rb[c] += (apart - touches.radius[k]) * n[c]
    _enter(n, r, 1.0, rows[0, 0])
    _enter(t1, r, 1.0, rows[1, 0])
    _enter(t2, r, 1.0, rows[2, 0])
    _enter(n, ra, share - 1.0, rows[0, 1])
    _enter(t1, ra, share - 1.0, rows[1, 1])
    _enter(t2, ra, share - 1.0, rows[2, 1])
    _enter(n, rb, -share, rows[0, 2])
    _enter(t1, rb, -share, rows[1, 2])
    _enter(t2, rb, -share, rows[2, 2])
    ends[0] = i
    ends[1] = touches.chain_node[nearest, 0]
    ends[2] = touches.chain_node[nearest, 1]
    return apart - touches.distance[k]


@njit(**INNER, **BORROWS)
def meet(contacts, touches, held, x, Q, axes, height, pushing, gap, rows, ends):
    """Write gaps (c,), rows (c, 3, e, 6) and nodes `ends` (c, e) of all contacts: first the ground's, then touches.

    With `pushing` the rows are those along which impulses act, which may be at another point of a foot. Nodes that are
    held do not move: they are left out, as -1.
    """
    count = contacts.node.shape[0]
    for k in range(count):
        gap[k] = contact(contacts, k, x, Q, axes, height, pushing, rows[k])
        for e in range(ends.shape[1]):
            ends[k, e] = -1
        if held[contacts.node[k]] == 0:
            ends[k, 0] = contacts.node[k]
    for k in range(touches.node.shape[0]):
        gap[count + k] = touch(touches, k, x, Q, rows[count + k], ends[count + k])
        for e in range(3):
            if held[ends[count + k, e]] == 1:
                ends[count + k, e] = -1

"""Compiled kernels that find where the normals of one surface meet the facets of the other.

Shape letters: ``b`` nodes of a facet (3 or 6), ``f`` facets, ``p`` points. A facet of six nodes has its corners first,
then the middles of the sides 01, 12, 02. Every kernel writes only to the buffers named in its first line.
"""

from __future__ import annotations

import numpy as np

from fem_biobot.compile_cache import ensure_cache_folder

ensure_cache_folder()

from numba import njit  # noqa: E402  (numba looks for its cache folder when it loads)

_ITERATIONS = 20
_CLOSE = 1e-13


@njit(cache=True, nogil=True)
def basis(n, x, y, N, D):
    """Write the basis `N` (b,) and its gradient `D` (b, 2) on the unit triangle at (x, y)."""
    z = 1.0 - x - y
    if n == 3:
        N[0], N[1], N[2] = z, x, y
        D[0, 0], D[0, 1] = -1.0, -1.0
        D[1, 0], D[1, 1] = 1.0, 0.0
        D[2, 0], D[2, 1] = 0.0, 1.0
        return
    N[0], N[1], N[2] = z * (2.0 * z - 1.0), x * (2.0 * x - 1.0), y * (2.0 * y - 1.0)
    N[3], N[4], N[5] = 4.0 * z * x, 4.0 * x * y, 4.0 * z * y
    D[0, 0] = D[0, 1] = 1.0 - 4.0 * z
    D[1, 0], D[1, 1] = 4.0 * x - 1.0, 0.0
    D[2, 0], D[2, 1] = 0.0, 4.0 * y - 1.0
    D[3, 0], D[3, 1] = 4.0 * (z - x), -4.0 * x
    D[4, 0], D[4, 1] = 4.0 * y, 4.0 * x
    D[5, 0], D[5, 1] = -4.0 * y, 4.0 * (z - y)


@njit(cache=True, nogil=True)
def inverse(a, b, c, R):
    """Write the inverse of the matrix with columns `a`, `b`, `c` to `R`; return its determinant."""
    R[0, 0] = b[1] * c[2] - b[2] * c[1]
    R[0, 1] = b[2] * c[0] - b[0] * c[2]
    R[0, 2] = b[0] * c[1] - b[1] * c[0]
    R[1, 0] = c[1] * a[2] - c[2] * a[1]
    R[1, 1] = c[2] * a[0] - c[0] * a[2]
    R[1, 2] = c[0] * a[1] - c[1] * a[0]
    R[2, 0] = a[1] * b[2] - a[2] * b[1]
    R[2, 1] = a[2] * b[0] - a[0] * b[2]
    R[2, 2] = a[0] * b[1] - a[1] * b[0]
    det = a[0] * R[0, 0] + a[1] * R[0, 1] + a[2] * R[0, 2]
    if det != 0.0:
        for i in range(3):
            for k in range(3):
                R[i, k] /= det
    return det


@njit(cache=True, nogil=True)
def _meet(nodes, f, x, p, n, at, N, D, t, R):
    """Write to `at` (3,) the place on facet `f` and the way along `n` from `p`, begun at its entries; whether found.

    Finds only facets that look against `n`.
    """
    count = nodes.shape[0]
    best = np.inf
    size = 0.0
    for k in range(3):
        size = max(size, abs(x[nodes[1, f], k] - x[nodes[0, f], k]), abs(x[nodes[2, f], k] - x[nodes[0, f], k]))
    for _ in range(_ITERATIONS):
        basis(count, at[0], at[1], N, D)
        for k in range(3):
            t[0, k] = p[k] + at[2] * n[k]
            t[1, k] = 0.0
            t[2, k] = 0.0
            t[3, k] = -n[k]
        for b in range(count):
            for k in range(3):
                v = x[nodes[b, f], k]
                t[0, k] -= N[b] * v
                t[1, k] += D[b, 0] * v
                t[2, k] += D[b, 1] * v
        miss = abs(t[0, 0]) + abs(t[0, 1]) + abs(t[0, 2])
        # columns two tangents and -n: looking against n they turn the right-handed way round
        det = inverse(t[1], t[2], t[3], R)
        if not det > 0.0:
            return False
        if miss <= _CLOSE * size or (miss <= 1e-9 * size and not miss < 0.5 * best):
            return True
        best = min(best, miss)
        for i in range(3):
            step = R[i, 0] * t[0, 0] + R[i, 1] * t[0, 1] + R[i, 2] * t[0, 2]
            at[i] += step
        if abs(at[0]) + abs(at[1]) > 20.0:
            return False
    return False


@njit(cache=True, nogil=True)
def locate(points, normals, part, x, nodes, part_of, margin, facet, at):
    """Write for each point the facet opposite to it (-1 for none), and place and gap, `facet` (p,), `at` (p, 3).

    A facet that is there already is kept while the place is inside it or beyond its sides by less than `margin`; other
    facets must be met inside. The nearest of several counts; only those of the point's own `part` are looked at.
    """
    count, f = nodes.shape
    N, D = np.empty(6), np.empty((6, 2))
    t, R, to = np.empty((4, 3)), np.empty((3, 3)), np.empty(3)
    centre, radius = np.zeros((f, 3)), np.zeros(f)
    for k in range(f):
        for b in range(count):
            for i in range(3):
                centre[k, i] += x[nodes[b, k], i] / count
        for b in range(count):
            square = 0.0
            for i in range(3):
                square += (x[nodes[b, k], i] - centre[k, i]) ** 2
            radius[k] = max(radius[k], 1.2 * np.sqrt(square))
    for q in range(points.shape[0]):
        p, n = points[q], normals[q]
        if facet[q] >= 0:
            to[:] = at[q]
            found = _meet(nodes, facet[q], x, p, n, to, N, D, t, R)
            if found and min(to[0], to[1], 1.0 - to[0] - to[1]) >= -margin:
                at[q] = to
                continue
        facet[q] = -1
        nearest = np.inf
        for k in range(f):
            if part_of[k] != part[q]:
                continue
            along = 0.0
            square = 0.0
            for i in range(3):
                d = centre[k, i] - p[i]
                along += d * n[i]
                square += d * d
            if square - along * along > radius[k] ** 2:
                continue
            to[0], to[1], to[2] = 1.0 / 3.0, 1.0 / 3.0, along
            if not _meet(nodes, k, x, p, n, to, N, D, t, R):
                continue
            if min(to[0], to[1], 1.0 - to[0] - to[1]) >= -1e-9 and abs(to[2]) < nearest:
                nearest = abs(to[2])
                facet[q] = k
                at[q] = to


@njit(cache=True, nogil=True)
def follow(points, normals, x, nodes, facet, at):
    """Write place and gap on the facets that points have, `at` (p, 3); return how many are lost."""
    N, D = np.empty(6), np.empty((6, 2))
    t, R, to = np.empty((4, 3)), np.empty((3, 3)), np.empty(3)
    lost = 0
    for q in range(points.shape[0]):
        if facet[q] < 0:
            continue
        to[:] = at[q]
        if _meet(nodes, facet[q], x, points[q], normals[q], to, N, D, t, R):
            at[q] = to
        else:
            lost += 1
    return lost

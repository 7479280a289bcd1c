"""Compiled transfer between quadratic and linear tetrahedra, and the smoother of the quadratic ones.

Matrices are upper triangles in the layout of `solid.pattern.Pattern`: three rows a node, of which the first starts with
the node's own block. A node's `parents` (n, 2) are the vertices at the ends of its edge, a vertex is its own parents;
its displacement is the mean of theirs. Nodes with axes of their own, `turned` (n,) and `axes` (3, 3, m), have them on
both levels.
"""

from __future__ import annotations

import numpy as np

from fem_biobot.compile_cache import ensure_cache_folder

ensure_cache_folder()

from numba import njit  # noqa: E402  (numba looks for its cache folder when it loads)


@njit(cache=True, nogil=True)
def _turns(turned, axes, a, p, R):
    """Write half the turn from the axes of vertex `p` to those of node `a`; returns whether it is more than a half."""
    own = turned[a] >= 0 or turned[p] >= 0
    for i in range(3):
        for j in range(3):
            total = 0.0
            if not own:
                total = 1.0 if i == j else 0.0
            else:
                for k in range(3):
                    left = axes[i, k, turned[a]] if turned[a] >= 0 else (1.0 if i == k else 0.0)
                    right = axes[j, k, turned[p]] if turned[p] >= 0 else (1.0 if j == k else 0.0)
                    total += left * right
            R[i, j] = 0.5 * total
    return own


@njit(cache=True, nogil=True)
def _block_at(starts, columns, c, d):
    """Which of the blocks in the rows of node `c` is that of `d`, at or after it."""
    low = 0
    high = (starts[3 * c + 1] - starts[3 * c]) // 3 - 1
    while low < high:
        middle = (low + high) // 2
        if columns[starts[3 * c] + 3 * middle] < 3 * d:
            low = middle + 1
        else:
            high = middle
    return low


@njit(cache=True, nogil=True)
def _add_block(starts, columns, out, c, d, K, transposed):
    """Add a block, or its transpose, at the vertices ``c <= d``; of a diagonal block the upper half."""
    k = _block_at(starts, columns, c, d)
    for i in range(3):
        begin = starts[3 * c + i] + 3 * k - i
        for j in range(i if c == d else 0, 3):
            out[begin + j] += K[j, i] if transposed else K[i, j]


@njit(cache=True, nogil=True)
def coarsen(starts, columns, data, blocked, parents, turned, axes, coarse_starts, coarse_columns, out):
    """Write ``P^T A P``, the matrix on the vertices, to `out`; unknowns that are held (`blocked`) are left out."""
    K = np.empty((3, 3))
    L = np.empty((3, 3))
    M = np.empty((3, 3))
    R = np.empty((3, 3))
    S = np.empty((3, 3))
    out[:] = 0.0
    for a in range(parents.shape[0]):
        first = starts[3 * a]
        for k in range((starts[3 * a + 1] - first) // 3):
            b = columns[first + 3 * k] // 3
            for i in range(3):
                begin = starts[3 * a + i] + 3 * k - i
                for j in range(i if a == b else 0, 3):
                    value = data[begin + j]
                    if blocked[3 * a + i] == 1 or blocked[3 * b + j] == 1:
                        value = 0.0
                    K[i, j] = value
                    if a == b:
                        K[j, i] = value
            for s in range(2):
                p = parents[a, s]
                turns = _turns(turned, axes, a, p, R)
                for t in range(2):
                    q = parents[b, t]
                    if a == b and p > q:
                        continue
                    turns_too = _turns(turned, axes, b, q, S)
                    if turns or turns_too:
                        for i in range(3):
                            for j in range(3):
                                L[i, j] = 0.0
                                for m in range(3):
                                    L[i, j] += R[m, i] * K[m, j]
                        for i in range(3):
                            for j in range(3):
                                M[i, j] = 0.0
                                for m in range(3):
                                    M[i, j] += L[i, m] * S[m, j]
                    else:
                        for i in range(3):
                            for j in range(3):
                                M[i, j] = 0.25 * K[i, j]
                    if p <= q:
                        _add_block(coarse_starts, coarse_columns, out, p, q, M, False)
                    if a != b and q <= p:
                        _add_block(coarse_starts, coarse_columns, out, q, p, M, True)
    # vertices that are held: a unit of the size of the others
    n_coarse = coarse_starts.shape[0] - 1
    scale = 0.0
    for i in range(n_coarse):
        scale = max(scale, out[coarse_starts[i]])
    for i in range(n_coarse):
        for e in range(coarse_starts[i] + 1, coarse_starts[i + 1]):
            if blocked[i] == 1 or blocked[coarse_columns[e]] == 1:
                out[e] = 0.0
        if blocked[i] == 1 or out[coarse_starts[i]] <= 0.0:
            out[coarse_starts[i]] = scale


@njit(cache=True, nogil=True)
def restrict(parents, turned, axes, blocked, r, coarse):
    """Write ``P^T r``."""
    R = np.empty((3, 3))
    coarse[:] = 0.0
    for a in range(parents.shape[0]):
        for s in range(2):
            p = parents[a, s]
            _turns(turned, axes, a, p, R)
            for i in range(3):
                if blocked[3 * a + i] == 0:
                    for j in range(3):
                        coarse[3 * p + j] += R[i, j] * r[3 * a + i]
    for i in range(coarse.shape[0]):
        if blocked[i] == 1:
            coarse[i] = 0.0


@njit(cache=True, nogil=True)
def prolong(parents, turned, axes, blocked, coarse, x):
    """Add ``P coarse`` to `x`."""
    R = np.empty((3, 3))
    for a in range(parents.shape[0]):
        for s in range(2):
            p = parents[a, s]
            _turns(turned, axes, a, p, R)
            for i in range(3):
                if blocked[3 * a + i] == 0:
                    for j in range(3):
                        x[3 * a + i] += R[i, j] * coarse[3 * p + j]


@njit(cache=True, nogil=True)
def invert_diagonal(starts, data, inverse):
    """Write the inverses of the nodes' own blocks, (n, 3, 3); returns False where one is not positive definite."""
    for a in range(inverse.shape[0]):
        xx, xy, xz = data[starts[3 * a]], data[starts[3 * a] + 1], data[starts[3 * a] + 2]
        yy, yz = data[starts[3 * a + 1]], data[starts[3 * a + 1] + 1]
        zz = data[starts[3 * a + 2]]
        cx, cy, cz = yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy
        det = xx * cx + xy * cy + xz * cz
        if not (xx > 0.0 and xx * yy - xy * xy > 0.0 and det > 0.0):
            return False
        B = inverse[a]
        B[0, 0], B[0, 1], B[0, 2] = cx / det, cy / det, cz / det
        B[1, 1], B[1, 2] = (xx * zz - xz * xz) / det, (xy * xz - xx * yz) / det
        B[2, 2] = (xx * yy - xy * xy) / det
        B[1, 0], B[2, 0], B[2, 1] = B[0, 1], B[0, 2], B[1, 2]
    return True


@njit(cache=True, nogil=True)
def smoothing_step(inverse, keep, weight, r, d, x):
    """``d = keep d + weight D^-1 r`` and ``x += d``, with the inverses of the diagonal blocks."""
    for a in range(inverse.shape[0]):
        for i in range(3):
            total = 0.0
            for j in range(3):
                total += inverse[a, i, j] * r[3 * a + j]
            d[3 * a + i] = keep * d[3 * a + i] + weight * total
            x[3 * a + i] += d[3 * a + i]

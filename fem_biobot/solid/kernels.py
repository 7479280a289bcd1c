"""Compiled kernels of the solid: kinematics, internal force, tangent and the symmetric matrix-vector product.

Shape letters: ``e`` elements, ``q`` quadrature points, ``b`` nodes of an element, ``n`` nodes. Tensor axes first, point
axes last, but nodal vectors are (n, 3) so that one node lies together. Symmetric tensors are packed as in
`material.law.PAIRS`. Every kernel writes only to the buffers named in its first line.
"""

from __future__ import annotations

import numpy as np

from fem_biobot.compile_cache import ensure_cache_folder

ensure_cache_folder()

from numba import njit  # noqa: E402  (numba looks for its cache folder when it loads)

_FIRST = np.array([0, 1, 2, 0, 1, 0])
_SECOND = np.array([0, 1, 2, 1, 2, 2])
_PACKED = np.array([[0, 3, 5], [3, 1, 4], [5, 4, 2]])


@njit(cache=True, nogil=True)
def deformation_gradient(u, nodes, slopes, to_reference, F):
    """Write ``F = I + du/dX``, (3, 3, e, q); `slopes` (b, 3, q) on the unit cell, `to_reference` (3, 3, e) = dxi/dX."""
    n_basis = nodes.shape[0]
    H = np.empty((3, 3))
    for e in range(nodes.shape[1]):
        for q in range(slopes.shape[2]):
            H[:] = 0.0
            for a in range(n_basis):
                node = nodes[a, e]
                for d in range(3):
                    s = slopes[a, d, q]
                    H[0, d] += u[node, 0] * s
                    H[1, d] += u[node, 1] * s
                    H[2, d] += u[node, 2] * s
            for i in range(3):
                for k in range(3):
                    F[i, k, e, q] = (
                        H[i, 0] * to_reference[0, k, e]
                        + H[i, 1] * to_reference[1, k, e]
                        + H[i, 2] * to_reference[2, k, e]
                    )
                F[i, i, e, q] += 1.0


@njit(cache=True, nogil=True)
def smallest_volume_ratio(F):
    """Smallest ``det F`` and the element that has it."""
    worst = np.inf
    where = -1
    for e in range(F.shape[2]):
        for q in range(F.shape[3]):
            J = (
                F[0, 0, e, q] * (F[1, 1, e, q] * F[2, 2, e, q] - F[1, 2, e, q] * F[2, 1, e, q])
                - F[0, 1, e, q] * (F[1, 0, e, q] * F[2, 2, e, q] - F[1, 2, e, q] * F[2, 0, e, q])
                + F[0, 2, e, q] * (F[1, 0, e, q] * F[2, 1, e, q] - F[1, 1, e, q] * F[2, 0, e, q])
            )
            if not J >= worst:  # also true for a NaN
                worst = J
                where = e
                if np.isnan(J):
                    return J, e
    return worst, where


@njit(cache=True, nogil=True)
def extrapolated_stress(F, F_next, S, D, out):
    """Write ``S + D : sym(F^T (F_next - F))``, (6, e, q): the second Piola stress carried along linearly."""
    dE = np.empty(6)
    for e in range(F.shape[2]):
        for q in range(F.shape[3]):
            for a in range(6):
                k = _FIRST[a]
                m = _SECOND[a]
                total = 0.0
                for i in range(3):
                    total += F[i, k, e, q] * (F_next[i, m, e, q] - F[i, m, e, q])
                    total += F[i, m, e, q] * (F_next[i, k, e, q] - F[i, k, e, q])
                # off-diagonal components count twice in the contraction
                dE[a] = 0.5 * total if a < 3 else total
            for a in range(6):
                out[a, e, q] = S[a, e, q]
            place = 0
            for a in range(6):
                for b in range(a, 6):
                    out[a, e, q] += D[place, e, q] * dE[b]
                    if b != a:
                        out[b, e, q] += D[place, e, q] * dE[a]
                    place += 1


@njit(cache=True, nogil=True)
def internal_force(nodes, slopes, to_reference, dV, F, S, force, magnitude):
    """Add to `force` (n, 3) the internal force ``int P dN/dX``, to `magnitude` the sizes of its element parts."""
    n_basis = nodes.shape[0]
    n_points = slopes.shape[2]
    local = np.empty((n_basis, 3))
    P = np.empty((3, 3))
    T = np.empty((3, 3))
    for e in range(nodes.shape[1]):
        local[:] = 0.0
        for q in range(n_points):
            for i in range(3):
                for k in range(3):
                    P[i, k] = (
                        F[i, 0, e, q] * S[_PACKED[0, k], e, q]
                        + F[i, 1, e, q] * S[_PACKED[1, k], e, q]
                        + F[i, 2, e, q] * S[_PACKED[2, k], e, q]
                    ) * dV[e, q]
            for i in range(3):
                for d in range(3):
                    T[i, d] = (
                        P[i, 0] * to_reference[d, 0, e]
                        + P[i, 1] * to_reference[d, 1, e]
                        + P[i, 2] * to_reference[d, 2, e]
                    )
            for a in range(n_basis):
                for i in range(3):
                    local[a, i] += T[i, 0] * slopes[a, 0, q] + T[i, 1] * slopes[a, 1, q] + T[i, 2] * slopes[a, 2, q]
        for a in range(n_basis):
            for i in range(3):
                force[nodes[a, e], i] += local[a, i]
                magnitude[nodes[a, e], i] += abs(local[a, i])


@njit(cache=True, nogil=True)
def tangent(nodes, slopes, to_reference, dV, F, S, D, row_start, rank, turned, turns, data):
    """Add to `data` the tangent's upper triangle, ``int dN_a A4 dN_b`` with ``A4 = I x S + F D F``.

    `S` is the stress of the geometric part, `D` the material tangent at `F`. `row_start` (n,) is the place of the
    first entry of node a's rows, `rank` (pairs, e) the place of node b in node a's row; see `solid.pattern`. Nodes
    with ``turned[node] >= 0`` are assembled in the axes ``turns[:, :, turned[node]]`` (rows are the local axes).
    Same as the scikit-fem form in tests/oracles.
    """
    n_basis = nodes.shape[0]
    n_points = slopes.shape[2]
    A4 = np.empty((3, 3, 3, 3))
    half = np.empty((3, 3, 6))
    D6 = np.empty((6, 6))
    dN = np.empty((3, n_basis))
    # local matrix in the order (i, a, j, b) so that the last loop runs over contiguous memory
    K = np.empty((n_basis, 3, 3, n_basis))
    block = np.empty((3, 3))
    other = np.empty((3, 3))
    H = np.empty((3, 3, 3))
    for e in range(nodes.shape[1]):
        K[:] = 0.0
        for q in range(n_points):
            w = dV[e, q]
            for a in range(n_basis):
                for k in range(3):
                    dN[k, a] = (
                        slopes[a, 0, q] * to_reference[0, k, e]
                        + slopes[a, 1, q] * to_reference[1, k, e]
                        + slopes[a, 2, q] * to_reference[2, k, e]
                    )
            place = 0
            for a in range(6):
                for b in range(a, 6):
                    D6[a, b] = D[place, e, q] * w
                    D6[b, a] = D6[a, b]
                    place += 1
            for i in range(3):
                for k in range(3):
                    for b in range(6):
                        half[i, k, b] = (
                            F[i, 0, e, q] * D6[_PACKED[0, k], b]
                            + F[i, 1, e, q] * D6[_PACKED[1, k], b]
                            + F[i, 2, e, q] * D6[_PACKED[2, k], b]
                        )
            for i in range(3):
                for k in range(3):
                    for j in range(3):
                        for m in range(3):
                            A4[i, k, j, m] = (
                                half[i, k, _PACKED[0, m]] * F[j, 0, e, q]
                                + half[i, k, _PACKED[1, m]] * F[j, 1, e, q]
                                + half[i, k, _PACKED[2, m]] * F[j, 2, e, q]
                            )
                for k in range(3):
                    for m in range(3):
                        A4[i, k, i, m] += S[_PACKED[k, m], e, q] * w
            for a in range(n_basis):
                for i in range(3):
                    for j in range(3):
                        for m in range(3):
                            H[i, j, m] = (
                                dN[0, a] * A4[i, 0, j, m] + dN[1, a] * A4[i, 1, j, m] + dN[2, a] * A4[i, 2, j, m]
                            )
                for i in range(3):
                    for j in range(3):
                        h0 = H[i, j, 0]
                        h1 = H[i, j, 1]
                        h2 = H[i, j, 2]
                        for b in range(a, n_basis):
                            K[a, i, j, b] += h0 * dN[0, b] + h1 * dN[1, b] + h2 * dN[2, b]
        pair = 0
        for a in range(n_basis):
            for b in range(a, n_basis):
                A = nodes[a, e]
                B = nodes[b, e]
                if A <= B:
                    for i in range(3):
                        for j in range(3):
                            block[i, j] = K[a, i, j, b]
                    row, ta, tb = A, turned[A], turned[B]
                else:
                    for i in range(3):
                        for j in range(3):
                            block[i, j] = K[a, j, i, b]
                    row, ta, tb = B, turned[B], turned[A]
                if ta >= 0:
                    for i in range(3):
                        for j in range(3):
                            other[i, j] = (
                                turns[i, 0, ta] * block[0, j]
                                + turns[i, 1, ta] * block[1, j]
                                + turns[i, 2, ta] * block[2, j]
                            )
                    block[:] = other
                if tb >= 0:
                    for i in range(3):
                        for j in range(3):
                            other[i, j] = (
                                block[i, 0] * turns[j, 0, tb]
                                + block[i, 1] * turns[j, 1, tb]
                                + block[i, 2] * turns[j, 2, tb]
                            )
                    block[:] = other
                r = rank[pair, e]
                start = row_start[row]
                width = row_start[row + 1] - start
                # rows of one node: widths L, L - 1, L - 2 with width = 3 L - 3
                length = (width + 3) // 3
                if r == 0:
                    data[start] += block[0, 0]
                    data[start + 1] += block[0, 1]
                    data[start + 2] += block[0, 2]
                    data[start + length] += block[1, 1]
                    data[start + length + 1] += block[1, 2]
                    data[start + 2 * length - 1] += block[2, 2]
                else:
                    at0 = start + 3 * r
                    at1 = start + length + 3 * r - 1
                    at2 = start + 2 * length - 1 + 3 * r - 2
                    for j in range(3):
                        data[at0 + j] += block[0, j]
                        data[at1 + j] += block[1, j]
                        data[at2 + j] += block[2, j]
                pair += 1


@njit(cache=True, nogil=True)
def symmetric_product(starts, columns, data, x, y):
    """Write ``y = A x`` for a symmetric matrix kept as its upper triangle by rows, the diagonal entry first."""
    for i in range(y.shape[0]):
        y[i] = 0.0
    for i in range(y.shape[0]):
        begin = starts[i]
        xi = x[i]
        total = data[begin] * xi
        for p in range(begin + 1, starts[i + 1]):
            j = columns[p]
            total += data[p] * x[j]
            y[j] += data[p] * xi
        y[i] += total


@njit(cache=True, nogil=True)
def inner_product(x, y):
    """Inner product of two vectors."""
    total = 0.0
    for i in range(x.shape[0]):
        total += x[i] * y[i]
    return total


@njit(cache=True, nogil=True)
def advance(alpha, p, Ap, x, r):
    """Write ``x += alpha p`` and ``r -= alpha Ap``; returns the squared norm of the new `r`."""
    total = 0.0
    for i in range(x.shape[0]):
        x[i] += alpha * p[i]
        r[i] -= alpha * Ap[i]
        total += r[i] * r[i]
    return total


@njit(cache=True, nogil=True)
def add_scaled(z, beta, p):
    """Write ``p = z + beta p``."""
    for i in range(p.shape[0]):
        p[i] = z[i] + beta * p[i]

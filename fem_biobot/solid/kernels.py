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
def deformation_gradient(elements, u, nodes, slopes, to_reference, F):
    """Write ``F = I + du/dX`` of `elements`, (3, 3, e, q); `slopes` (b, 3, q) are on the unit cell."""
    n_basis = nodes.shape[0]
    H = np.empty((3, 3))
    for e in elements:
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
def internal_force(elements, nodes, slopes, to_reference, dV, F, S, force, magnitude):
    """Add to `force` (n, 3) the internal force of `elements`, to `magnitude` the sizes of its element parts."""
    n_basis = nodes.shape[0]
    n_points = slopes.shape[2]
    local = np.empty((n_basis, 3))
    P = np.empty((3, 3))
    T = np.empty((3, 3))
    for e in elements:
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


# Elements whose matrices are made by one product of matrices: small enough to stay in cache and below the size at which
# BLAS would wake threads of its own.
_BLOCK = 12
_ONE, _TWO, _THREE, _FOUR = np.uint64(1), np.uint64(2), np.uint64(3), np.uint64(4)
_FIVE, _SIX, _SEVEN = np.uint64(5), np.uint64(6), np.uint64(7)


@njit(cache=True, nogil=True)
def reference_moduli(e, q, to_reference, dV, F, S, D, small, large, out):
    """Write ``A4 = I x S + F D F`` of one point, times its volume, with its slots k, l on the unit cell.

    `out` (9, 9): rows 3 i + j over displacements, columns 3 d + f over directions of the unit cell. The slots k, l of
    ``A4[i, k, j, l]`` are carried there by d xi/dX, so that gradients of the basis on the unit cell, the same for all
    elements, apply to it. `small` (4, 3, 3) and `large` (15, 9) are scratch: allocating them here would cost as much
    as the arithmetic.
    """
    w = dV[e, q]
    f, R, S_full, S_ref = small[0], small[1], small[2], small[3]
    D_full, half, part = large[:9], large[9:12], large[12:15]
    for i in range(3):
        for k in range(3):
            f[i, k] = F[i, k, e, q]
            R[i, k] = to_reference[i, k, e]
    place = 0
    for a in range(6):
        i = _FIRST[a]
        j = _SECOND[a]
        S_full[i, j] = S[a, e, q]
        S_full[j, i] = S[a, e, q]
        for b in range(a, 6):
            k = _FIRST[b]
            m = _SECOND[b]
            value = D[place, e, q] * w
            place += 1
            D_full[3 * i + j, 3 * k + m] = value
            D_full[3 * i + j, 3 * m + k] = value
            D_full[3 * j + i, 3 * k + m] = value
            D_full[3 * j + i, 3 * m + k] = value
            D_full[3 * k + m, 3 * i + j] = value
            D_full[3 * m + k, 3 * i + j] = value
            D_full[3 * k + m, 3 * j + i] = value
            D_full[3 * m + k, 3 * j + i] = value
    for d in range(3):
        for g in range(3):
            total = 0.0
            for k in range(3):
                total += R[d, k] * (S_full[k, 0] * R[g, 0] + S_full[k, 1] * R[g, 1] + S_full[k, 2] * R[g, 2])
            S_ref[d, g] = total * w
    for i in range(3):
        # half[k, (n, l)] = F[i, m] D[(m, k), (n, l)], then k to the unit cell
        for k in range(3):
            for c in range(9):
                half[k, c] = f[i, 0] * D_full[k, c] + f[i, 1] * D_full[3 + k, c] + f[i, 2] * D_full[6 + k, c]
        for d in range(3):
            for c in range(9):
                part[d, c] = R[d, 0] * half[0, c] + R[d, 1] * half[1, c] + R[d, 2] * half[2, c]
        for j in range(i, 3):
            for d in range(3):
                x0 = f[j, 0] * part[d, 0] + f[j, 1] * part[d, 3] + f[j, 2] * part[d, 6]
                x1 = f[j, 0] * part[d, 1] + f[j, 1] * part[d, 4] + f[j, 2] * part[d, 7]
                x2 = f[j, 0] * part[d, 2] + f[j, 1] * part[d, 5] + f[j, 2] * part[d, 8]
                for g in range(3):
                    value = x0 * R[g, 0] + x1 * R[g, 1] + x2 * R[g, 2]
                    if i == j:
                        value += S_ref[d, g]
                    else:  # major symmetry: A4[i, k, j, l] = A4[j, l, i, k]
                        out[3 * j + i, 3 * g + d] = value
                    out[3 * i + j, 3 * d + g] = value


@njit(cache=True, nogil=True)
def tangent(elements, nodes, pairs, to_reference, dV, F, S, D, place, turned, turns, data):
    """Add to `data` the tangent's upper triangle of `elements`, ``int dN_a A4 dN_b`` with ``A4 = I x S + F D F``.

    `S` is the stress of the geometric part, `D` the material tangent at `F`. `pairs` (9 q, p) holds the products of
    the basis gradients on the unit cell for every pair ``a <= b``: one product of matrices gives the matrices of a
    block of elements. `place` (e, p, 2) says where each pair's block begins in `data` and how long its first row is
    there, negative where the later node comes first; see `solid.pattern`. Nodes with ``turned[node] >= 0`` (an empty
    `turned` if there are none) are assembled in the axes ``turns[:, :, turned[node]]`` (rows are the local axes). Same
    as the scikit-fem form in tests/oracles.
    """
    n_basis = nodes.shape[0]
    n_points = dV.shape[1]
    n_pairs = pairs.shape[1]
    moduli = np.empty((_BLOCK * 9, 9 * n_points))
    matrices = np.empty((_BLOCK * 9, n_pairs))
    small = np.empty((4, 3, 3))
    large = np.empty((15, 9))
    block = np.empty((3, 3))
    other = np.empty((3, 3))
    for first in range(0, elements.shape[0], _BLOCK):
        count = min(_BLOCK, elements.shape[0] - first)
        for local in range(count):
            for q in range(n_points):
                out = moduli[9 * local : 9 * local + 9, 9 * q : 9 * q + 9]
                reference_moduli(elements[first + local], q, to_reference, dV, F, S, D, small, large, out)
        np.dot(moduli, pairs, matrices)
        for local in range(count):
            # places are unsigned: signed ones would be checked for counting from the end at every access
            e = np.uint64(elements[first + local])
            K = matrices[9 * local : 9 * local + 9]
            pair = np.uint64(0)
            for a in range(n_basis):
                for b in range(a, n_basis):
                    length = np.int64(place[e, pair, 1])
                    # the block of the later node under the earlier one is the transpose; no branch, for it is a toss-up
                    ordered = length > 0
                    flip = np.uint64(0) if ordered else _ONE
                    length = abs(length)
                    k00 = K[0, pair]
                    k11 = K[4, pair]
                    k22 = K[8, pair]
                    k01, k10 = K[_ONE + _TWO * flip, pair], K[_THREE - _TWO * flip, pair]
                    k02, k20 = K[_TWO + _FOUR * flip, pair], K[_SIX - _FOUR * flip, pair]
                    k12, k21 = K[_FIVE + _TWO * flip, pair], K[_SEVEN - _TWO * flip, pair]
                    if turned.shape[0] > 0:
                        ta = turned[nodes[a, e]]
                        tb = turned[nodes[b, e]]
                        if ta >= 0 or tb >= 0:
                            block[0, 0], block[0, 1], block[0, 2] = k00, k01, k02
                            block[1, 0], block[1, 1], block[1, 2] = k10, k11, k12
                            block[2, 0], block[2, 1], block[2, 2] = k20, k21, k22
                            if ordered:
                                _turn(block, other, turns, ta, tb)
                            else:
                                _turn(block, other, turns, tb, ta)
                            k00, k01, k02 = block[0, 0], block[0, 1], block[0, 2]
                            k10, k11, k12 = block[1, 0], block[1, 1], block[1, 2]
                            k20, k21, k22 = block[2, 0], block[2, 1], block[2, 2]
                    # rows of one node: lengths L, L - 1, L - 2
                    start = np.int64(place[e, pair, 0])
                    at0 = np.uint64(start)
                    at1 = np.uint64(start + length - 1)
                    at2 = np.uint64(start + 2 * length - 3)
                    data[at0] += k00
                    data[at0 + _ONE] += k01
                    data[at0 + _TWO] += k02
                    data[at1 + _ONE] += k11
                    data[at1 + _TWO] += k12
                    data[at2 + _TWO] += k22
                    if b > a:  # a diagonal block has its upper half only
                        data[at1] += k10
                        data[at2] += k20
                        data[at2 + _ONE] += k21
                    pair += _ONE


@njit(cache=True, nogil=True)
def _turn(block, other, turns, ta, tb):
    """Carry a 3 by 3 block into the axes of its row's and its column's node, in place; -1 leaves a side as it is."""
    if ta >= 0:
        for i in range(3):
            for j in range(3):
                other[i, j] = (
                    turns[i, 0, ta] * block[0, j] + turns[i, 1, ta] * block[1, j] + turns[i, 2, ta] * block[2, j]
                )
        block[:] = other
    if tb >= 0:
        for i in range(3):
            for j in range(3):
                other[i, j] = (
                    block[i, 0] * turns[j, 0, tb] + block[i, 1] * turns[j, 1, tb] + block[i, 2] * turns[j, 2, tb]
                )
        block[:] = other


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

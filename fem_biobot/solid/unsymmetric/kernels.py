"""Compiled kernels of the skew part of the tangent, kept in the pattern of the upper triangle.

A matrix without symmetry is kept as its symmetric part and its skew part, each in the upper triangle by rows of
`solid.pattern`; letters and layouts as in `solid.kernels`.
"""

from __future__ import annotations

import numpy as np

from fem_biobot.compile_cache import ensure_cache_folder

ensure_cache_folder()

from numba import njit  # noqa: E402  (numba looks for its cache folder when it loads)

_FIRST = np.array([0, 1, 2, 0, 1, 0])
_SECOND = np.array([0, 1, 2, 1, 2, 2])


@njit(cache=True, nogil=True)
def parted_moduli(full, even, odd):
    """Write the symmetric part (21, e, q) and the skew part (15, e, q), above the diagonal, of moduli (36, e, q)."""
    for e in range(full.shape[1]):
        for q in range(full.shape[2]):
            entry = 0
            above = 0
            for a in range(6):
                even[entry, e, q] = full[7 * a, e, q]
                entry += 1
                for b in range(a + 1, 6):
                    x, y = full[6 * a + b, e, q], full[6 * b + a, e, q]
                    even[entry, e, q] = 0.5 * (x + y)
                    odd[above, e, q] = 0.5 * (x - y)
                    entry += 1
                    above += 1


@njit(cache=True, nogil=True)
def add_skew_stress(F, F_next, odd, S):
    """Add to `S` what the skew part of the moduli (15, e, q) carries along; see `extrapolated_stress`."""
    dE = np.empty(6)
    for e in range(F.shape[2]):
        for q in range(F.shape[3]):
            for a in range(6):
                k, m = _FIRST[a], _SECOND[a]
                total = 0.0
                for i in range(3):
                    total += F[i, k, e, q] * (F_next[i, m, e, q] - F[i, m, e, q])
                    total += F[i, m, e, q] * (F_next[i, k, e, q] - F[i, k, e, q])
                dE[a] = 0.5 * total if a < 3 else total
            above = 0
            for a in range(6):
                for b in range(a + 1, 6):
                    S[a, e, q] += odd[above, e, q] * dE[b]
                    S[b, e, q] -= odd[above, e, q] * dE[a]
                    above += 1


@njit(cache=True, nogil=True)
def skew_tangent(elements, nodes, slopes, to_reference, dV, F, odd, place, turned, turns, data):
    """Add to `data` the upper triangle of ``int B_a odd B_b``, skew; same as the scikit-fem form in tests/oracles.

    ``B_a`` (6, 3) takes a displacement of node a to the Green strain, shears doubled.
    """
    n_basis = nodes.shape[0]
    B = np.empty((n_basis, 6, 3))
    moved = np.empty((6, 3))
    K = np.empty((n_basis, n_basis, 3, 3))
    turn = np.empty((3, 3))
    for index in range(elements.shape[0]):
        e = elements[index]
        K[:] = 0.0
        for q in range(slopes.shape[2]):
            for a in range(n_basis):
                for c in range(6):
                    k, m = _FIRST[c], _SECOND[c]
                    gk, gm = 0.0, 0.0
                    for d in range(3):
                        gk += slopes[a, d, q] * to_reference[d, k, e]
                        gm += slopes[a, d, q] * to_reference[d, m, e]
                    for i in range(3):
                        if c < 3:
                            B[a, c, i] = F[i, k, e, q] * gk
                        else:
                            B[a, c, i] = F[i, k, e, q] * gm + F[i, m, e, q] * gk
            for b in range(n_basis):
                moved[:] = 0.0
                above = 0
                for c in range(6):
                    for d in range(c + 1, 6):
                        value = odd[above, e, q] * dV[e, q]
                        for j in range(3):
                            moved[c, j] += value * B[b, d, j]
                            moved[d, j] -= value * B[b, c, j]
                        above += 1
                for a in range(b + 1):
                    for c in range(6):
                        for i in range(3):
                            for j in range(3):
                                K[a, b, i, j] += B[a, c, i] * moved[c, j]
        pair = 0
        for a in range(n_basis):
            for b in range(a, n_basis):
                if turned.shape[0] > 0:
                    ta, tb = turned[nodes[a, e]], turned[nodes[b, e]]
                    if ta >= 0:
                        for i in range(3):
                            for j in range(3):
                                turn[i, j] = 0.0
                                for k in range(3):
                                    turn[i, j] += turns[i, k, ta] * K[a, b, k, j]
                        K[a, b] = turn
                    if tb >= 0:
                        for i in range(3):
                            for j in range(3):
                                turn[i, j] = 0.0
                                for k in range(3):
                                    turn[i, j] += K[a, b, i, k] * turns[j, k, tb]
                        K[a, b] = turn
                at = np.int64(place[e, pair, 0])
                length = np.int64(place[e, pair, 1])
                pair += 1
                # the block of the later node under the earlier one is minus the transpose
                later = length < 0
                length = abs(length)
                for i in range(3):
                    row = at + i * length - i * (i + 1) // 2
                    for j in range(i + 1 if a == b else 0, 3):
                        data[row + j] += -K[a, b, j, i] if later else K[a, b, i, j]


@njit(cache=True, nogil=True)
def add_skew_product(starts, columns, data, x, y):
    """Add to `y` a skew-symmetric matrix, kept as its upper triangle by rows, times `x`."""
    for i in range(y.shape[0]):
        xi = x[i]
        total = 0.0
        # the first entry of a row is its diagonal
        for p in range(starts[i] + 1, starts[i + 1]):
            j = columns[p]
            total += data[p] * x[j]
            y[j] -= data[p] * xi
        y[i] += total


@njit(cache=True, nogil=True)
def add_to(x, factor, p):
    """Write ``x += factor p``."""
    for i in range(x.shape[0]):
        x[i] += factor * p[i]

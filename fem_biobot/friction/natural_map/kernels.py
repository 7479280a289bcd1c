"""Compiled kernels of the scaled contact problem: its natural map, that map's Newton matrix, a sweep point by point.

All work on the buffers of a `ContactScratch`, called ``S``; `c` is the number of points and ``n = 3 c``. Letters and
the equations are those of `friction.kernels`.
"""

from __future__ import annotations

import math

import numpy as np

from fem_biobot.compile_cache import BORROWS, KERNEL, ensure_cache_folder

ensure_cache_folder()

from numba import njit  # noqa: E402  (numba looks for its cache folder when it loads)

from fem_biobot.friction.friction_set.kernels import project  # noqa: E402
from fem_biobot.friction.one_point.kernels import solve_point  # noqa: E402

_EPS = 2.0**-52


@njit(**KERNEL, **BORROWS)
def velocity_scale(b):
    """Largest tangential or approaching velocity in `b` (c, 3) [mm/s]; zero where nothing could slide or press."""
    largest = 0.0
    for i in range(b.shape[0]):
        largest = max(largest, -b[i, 0], abs(b[i, 1]), abs(b[i, 2]))
    return largest


@njit(**KERNEL, **BORROWS)
def _power_of_two(mobility):
    """Power of two next to ``1 / sqrt(mobility)``; one where there is no mobility."""
    if not 0.0 < mobility < np.inf:
        return 1.0
    _, exponent = math.frexp(1.0 / math.sqrt(mobility))
    return math.ldexp(1.0, exponent)


@njit(**KERNEL, **BORROWS)
def scaled(W, b, mu, p, S):
    """Write the scaled problem to `S`: a unit diagonal, nearly, for every point."""
    c = p.shape[0]
    n = 3 * c
    for i in range(c):
        normal = _power_of_two(W[3 * i, 3 * i])
        tangential = _power_of_two(0.5 * (W[3 * i + 1, 3 * i + 1] + W[3 * i + 2, 3 * i + 2]))
        S.scale[3 * i] = normal
        S.scale[3 * i + 1] = tangential
        S.scale[3 * i + 2] = tangential
        for k in range(4):
            S.radii[i, k] = mu[i, k] * normal / tangential
    for i in range(n):
        row = W[i, :n]
        out = S.W[i, :n]
        r = S.scale[i]
        for j in range(n):
            out[j] = r * row[j] * S.scale[j]
        S.b[i] = r * b[i // 3, i % 3]
        S.p[i] = p[i // 3, i % 3] / r


@njit(**KERNEL, **BORROWS)
def natural_map(c, V, S):
    """Write `w`, the natural map `F` and the slopes of its projection for the impulses of `S`; return the residual."""
    n = 3 * c
    for i in range(n):
        row = S.W[i, :n]
        total = 0.0
        for j in range(n):
            total += row[j] * S.p[j]
        S.w[i] = S.b[i] + total
    worst = 0.0
    for i in range(c):
        k = 3 * i
        s = S.p[k] - S.w[k]
        if s > 0.0:
            m = S.radii[i]
            x1, x2, A11, A12, A22 = project(S.p[k + 1] - S.w[k + 1], S.p[k + 2] - S.w[k + 2], s, m[0], m[1], m[2], m[3])
            S.F[k] = S.w[k]
            if A11 == 1.0 and A22 == 1.0:
                S.F[k + 1] = S.w[k + 1]
                S.F[k + 2] = S.w[k + 2]
                S.slope[i, 3] = 0.0
                S.slope[i, 4] = 0.0
            else:
                z1 = S.p[k + 1] - S.w[k + 1]
                z2 = S.p[k + 2] - S.w[k + 2]
                S.F[k + 1] = S.p[k + 1] - x1
                S.F[k + 2] = S.p[k + 2] - x2
                S.slope[i, 3] = (x1 - A11 * z1 - A12 * z2) / s
                S.slope[i, 4] = (x2 - A12 * z1 - A22 * z2) / s
            S.slope[i, 0] = A11
            S.slope[i, 1] = A12
            S.slope[i, 2] = A22
        else:
            S.F[k] = S.p[k]
            S.F[k + 1] = S.p[k + 1]
            S.F[k + 2] = S.p[k + 2]
        for j in range(k, k + 3):
            size = abs(S.F[j]) / S.scale[j]
            if not size < np.inf:
                return np.inf
            worst = max(worst, size)
    return worst / V


@njit(**KERNEL, **BORROWS)
def rounding_floor(c, V, S):
    """Residual that rounding of ``b + W p`` alone may leave."""
    n = 3 * c
    worst = 0.0
    for i in range(n):
        row = S.W[i, :n]
        total = abs(S.b[i])
        for j in range(n):
            total += abs(row[j] * S.p[j])
        worst = max(worst, total / S.scale[i])
    return 2.0 * _EPS * worst / V


@njit(**KERNEL, **BORROWS)
def newton_system(c, proximal, S):
    """Write the Newton matrix of the points that press to `J` and its right side to `step`; return its size."""
    n = 3 * c
    size = 0
    lifted = False
    for i in range(c):
        k = 3 * i
        if S.p[k] - S.w[k] > 0.0:
            for j in range(k, k + 3):
                S.place[size] = j
                size += 1
        else:
            lifted = lifted or S.p[k] != 0.0 or S.p[k + 1] != 0.0 or S.p[k + 2] != 0.0
    for row in range(0, size, 3):
        k = S.place[row]
        i = k // 3
        A11, A12, A22, g1, g2 = S.slope[i]
        J0 = S.J[row, :size]
        J1 = S.J[row + 1, :size]
        J2 = S.J[row + 2, :size]
        W0 = S.W[k, :n]
        W1 = S.W[k + 1, :n]
        W2 = S.W[k + 2, :n]
        for column in range(size):
            j = S.place[column]
            J0[column] = W0[j]
            J1[column] = g1 * W0[j] + A11 * W1[j] + A12 * W2[j]
            J2[column] = g2 * W0[j] + A12 * W1[j] + A22 * W2[j]
        J0[row] += proximal
        J1[row] += g1 * (proximal - 1.0)
        J2[row] += g2 * (proximal - 1.0)
        J1[row + 1] += 1.0 - A11 * (1.0 - proximal)
        J1[row + 2] -= A12 * (1.0 - proximal)
        J2[row + 1] -= A12 * (1.0 - proximal)
        J2[row + 2] += 1.0 - A22 * (1.0 - proximal)
        S.step[row] = -S.F[k]
        S.step[row + 1] = -S.F[k + 1]
        S.step[row + 2] = -S.F[k + 2]
        if lifted:  # their impulses go to zero in the same step
            for j in range(n):
                if S.p[3 * (j // 3)] - S.w[3 * (j // 3)] <= 0.0:
                    S.step[row] += W0[j] * S.p[j]
                    S.step[row + 1] += (g1 * W0[j] + A11 * W1[j] + A12 * W2[j]) * S.p[j]
                    S.step[row + 2] += (g2 * W0[j] + A12 * W1[j] + A22 * W2[j]) * S.p[j]
    return size


@njit(**KERNEL, **BORROWS)
def take_step(c, size, S):
    """Add the solved step; points that do not press lose their impulse."""
    for i in range(c):
        k = 3 * i
        if not S.p[k] - S.w[k] > 0.0:
            S.p[k] = 0.0
            S.p[k + 1] = 0.0
            S.p[k + 2] = 0.0
    for row in range(size):
        S.p[S.place[row]] += S.step[row]


@njit(**KERNEL, **BORROWS)
def sweep(c, S):
    """One round of block Gauss-Seidel: each point solved exactly with the others held."""
    n = 3 * c
    for i in range(c):
        k = 3 * i
        for a in range(3):
            row = S.W[k + a, :n]
            total = S.b[k + a]
            for j in range(n):
                total += row[j] * S.p[j]
            for d in range(3):
                S.block[a, d] = row[k + d]
            S.w[k + a] = total
        for a in range(3):
            for d in range(3):
                S.w[k + a] -= S.block[a, d] * S.p[k + d]
        m = S.radii[i]
        p0, p1, p2, found = solve_point(S.block, S.w[k], S.w[k + 1], S.w[k + 2], m[0], m[1], m[2], m[3])
        if found:
            S.p[k] = p0
            S.p[k + 1] = p1
            S.p[k + 2] = p2

"""Compiled kernels of two surfaces in contact: frames of the bearing surface, forces, weighted gaps, derivatives.

Shape letters: ``b`` nodes of a facet (3 or 6), ``f`` facets of the bearing surface, ``k`` quadrature points of one,
``h`` points in contact, ``g`` pairs of facets, ``c`` multipliers. Nodes of a pair: those of the bearing facet, then
those of the other, ``2 b``. Every kernel writes only to the buffers named in its first line.

At a point with bearing normal ``n`` and directions ``a1``, ``a2`` in the surface, the traction is
``T = t_n n + t_1 a1 + t_2 a2`` on the other body, ``-T`` on the bearing one, per reference area, with the values t of
linear functions at the corners. The opposite place xi and the gap g satisfy ``y(xi) - x = g n``; their derivatives
follow from ``[y_1 y_2 -n] (dxi, dg) = dx - dy + g dn``.
"""

from __future__ import annotations

import math

import numpy as np

from fem_biobot.compile_cache import ensure_cache_folder

ensure_cache_folder()

from numba import njit  # noqa: E402  (numba looks for its cache folder when it loads)

from fem_biobot.friction.friction_set.kernels import project  # noqa: E402
from fem_biobot.solid.interface.rays.kernels import basis, inverse  # noqa: E402


@njit(cache=True, nogil=True)
def _cross(a, b, out):
    """Write ``a x b``."""
    out[0] = a[1] * b[2] - a[2] * b[1]
    out[1] = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]


@njit(cache=True, nogil=True)
def _frame(f, slopes, k, x, nodes, across, t1, t2, a1, a2, n):
    """Write tangents and frame at quadrature point `k` of facet `f`; return sizes of ``t1 x t2`` and of a1 unscaled.

    `across` (2, f) are the weights of the tangents in the direction a1.
    """
    for i in range(3):
        t1[i] = 0.0
        t2[i] = 0.0
        for b in range(nodes.shape[0]):
            v = x[nodes[b, f], i]
            t1[i] += slopes[b, 0, k] * v
            t2[i] += slopes[b, 1, k] * v
        a1[i] = across[0, f] * t1[i] + across[1, f] * t2[i]
    _cross(t1, t2, n)
    area = math.sqrt(n[0] ** 2 + n[1] ** 2 + n[2] ** 2)
    size = math.sqrt(a1[0] ** 2 + a1[1] ** 2 + a1[2] ** 2)
    for i in range(3):
        n[i] /= area
        a1[i] /= size
    _cross(n, a1, a2)
    return area, size


@njit(cache=True, nogil=True)
def frames(values, slopes, x, nodes, across, points, basis3):
    """Write positions `points` (f, k, 3) and frames `basis3` (f, k, 3, 3), rows n, a1, a2, of all quadrature points."""
    t1, t2 = np.empty(3), np.empty(3)
    a1, a2, n = np.empty(3), np.empty(3), np.empty(3)
    for f in range(nodes.shape[1]):
        for k in range(values.shape[1]):
            _frame(f, slopes, k, x, nodes, across, t1, t2, a1, a2, n)
            for i in range(3):
                total = 0.0
                for b in range(nodes.shape[0]):
                    total += values[b, k] * x[nodes[b, f], i]
                points[f, k, i] = total
                basis3[f, k, 0, i] = n[i]
                basis3[f, k, 1, i] = a1[i]
                basis3[f, k, 2, i] = a2[i]


@njit(cache=True, nogil=True)
def _turning(slopes, f, k, across, t1, t2, a1, a2, n, area, size, dB):
    """Write ``dB[d, s]`` (2, 3, 3, 3): derivative of n, a1, a2 (s) by the tangents t1, t2 (d), ``[i, j]``."""
    P = np.empty((3, 3))
    X = np.empty((3, 3))
    for d in range(2):
        t = t2 if d == 0 else t1
        sign = -1.0 if d == 0 else 1.0
        # d(t1 x t2) = -[t2] dt1 = [t1] dt2
        X[0, 0] = X[1, 1] = X[2, 2] = 0.0
        X[0, 1], X[0, 2] = -t[2] * sign, t[1] * sign
        X[1, 0], X[1, 2] = t[2] * sign, -t[0] * sign
        X[2, 0], X[2, 1] = -t[1] * sign, t[0] * sign
        for i in range(3):
            for j in range(3):
                P[i, j] = ((1.0 if i == j else 0.0) - n[i] * n[j]) / area
        for i in range(3):
            for j in range(3):
                dB[d, 0, i, j] = P[i, 0] * X[0, j] + P[i, 1] * X[1, j] + P[i, 2] * X[2, j]
                dB[d, 1, i, j] = across[d, f] * ((1.0 if i == j else 0.0) - a1[i] * a1[j]) / size
        for j in range(3):
            # da2 = n x da1 - a1 x dn
            b0, b1, b2 = dB[d, 1, 0, j], dB[d, 1, 1, j], dB[d, 1, 2, j]
            c0, c1, c2 = dB[d, 0, 0, j], dB[d, 0, 1, j], dB[d, 0, 2, j]
            dB[d, 2, 0, j] = n[1] * b2 - n[2] * b1 - (a1[1] * c2 - a1[2] * c1)
            dB[d, 2, 1, j] = n[2] * b0 - n[0] * b2 - (a1[2] * c0 - a1[0] * c2)
            dB[d, 2, 2, j] = n[0] * b1 - n[1] * b0 - (a1[0] * c1 - a1[1] * c0)


@njit(cache=True, nogil=True)
def meet(
    values, slopes, hats, weights, x, nodes, across, corners, other, point, facet, at, facet0, at0, pair, pair0,
    traction, force, gaps, K, C, D, D0,
):  # fmt: skip
    """Add to `force` (n, 3), `gaps` (c, 3), and with any pairs `K`, `C`, `D`, `D0`, all begun as zero.

    Parameters
    ----------
    values, slopes, hats
        Basis (b, k), its gradients (b, 2, k) and the linear one (3, k) at the quadrature points.
    weights
        Reference areas of the points, (f, k).
    corners
        Multiplier of each corner, (3, f).
    other
        Nodes of the other surface's facets, (b, F).
    point
        Points in contact, ``f k + k'``, (h,).
    facet, at, facet0, at0
        Opposite facet with place and gap now, and the material place that slip is measured from, (h,), (h, 3).
    pair, pair0
        Numbers of the pairs of facets, (h,).
    traction
        t_n, t_1, t_2 at the multipliers, (c, 3).
    gaps
        Integrals of hat times gap, slip along a1, slip along a2.
    K
        Minus the derivative of the force, (g, 2b, 2b, 3, 3).
    C
        Derivative of the force by the tractions, (g, 2b, 3, 3, 3): node, corner, component of t, direction.
    D, D0
        Derivative of the gap (g, 3, 2b, 3) and of the slips (g0, 3, 2, 2b, 3).
    """
    count, n_points = values.shape
    t1, t2 = np.empty(3), np.empty(3)
    B = np.empty((3, 3))  # rows n, a1, a2
    N, M, N0, M0 = np.empty(6), np.empty((6, 2)), np.empty(6), np.empty((6, 2))
    y1, y2, back, T, e = np.empty(3), np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    R = np.empty((3, 3))
    dB, dT, dX = np.empty((2, 3, 3, 3)), np.empty((2, 3, 3)), np.empty((3, 3))
    derive = K.shape[0] > 0
    for h in range(point.shape[0]):
        f, k = point[h] // n_points, point[h] % n_points
        w = weights[f, k]
        area, size = _frame(f, slopes, k, x, nodes, across, t1, t2, B[1], B[2], B[0])
        F, F0 = facet[h], facet0[h]
        basis(count, at[h, 0], at[h, 1], N, M)
        basis(count, at0[h, 0], at0[h, 1], N0, M0)
        g = at[h, 2]
        for i in range(3):
            y1[i] = y2[i] = T[i] = e[i] = 0.0
            back[i] = -B[0, i]
            for b in range(count):
                y1[i] += M[b, 0] * x[other[b, F], i]
                y2[i] += M[b, 1] * x[other[b, F], i]
                e[i] += N0[b] * x[other[b, F0], i] - values[b, k] * x[nodes[b, f], i]
        s1 = s2 = 0.0
        for i in range(3):
            s1 += B[1, i] * e[i]
            s2 += B[2, i] * e[i]
        for j in range(3):
            c = corners[j, f]
            for s in range(3):
                for i in range(3):
                    T[i] += hats[j, k] * traction[c, s] * B[s, i]
            gaps[c, 0] += w * hats[j, k] * g
            gaps[c, 1] += w * hats[j, k] * s1
            gaps[c, 2] += w * hats[j, k] * s2
        for b in range(count):
            for i in range(3):
                force[other[b, F], i] += w * N[b] * T[i]
                force[nodes[b, f], i] -= w * values[b, k] * T[i]
        if not derive:
            continue
        inverse(y1, y2, back, R)
        _turning(slopes, f, k, across, t1, t2, B[1], B[2], B[0], area, size, dB)
        tn = ta = tb = 0.0
        for j in range(3):
            c = corners[j, f]
            tn += hats[j, k] * traction[c, 0]
            ta += hats[j, k] * traction[c, 1]
            tb += hats[j, k] * traction[c, 2]
        for d in range(2):
            for i in range(3):
                for j in range(3):
                    dT[d, i, j] = tn * dB[d, 0, i, j] + ta * dB[d, 1, i, j] + tb * dB[d, 2, i, j]
        P, P0 = pair[h], pair0[h]
        for c in range(2 * count):
            bearing = c < count
            v = values[c, k] if bearing else 0.0
            d1 = slopes[c, 0, k] if bearing else 0.0
            d2 = slopes[c, 1, k] if bearing else 0.0
            # rows of dX: derivative of xi_1, xi_2 and the gap by this node
            for r in range(3):
                for j in range(3):
                    if bearing:
                        total = R[r, j] * v
                        for i in range(3):
                            total += g * R[r, i] * (d1 * dB[0, 0, i, j] + d2 * dB[1, 0, i, j])
                    else:
                        total = -R[r, j] * N[c - count]
                    dX[r, j] = total
            for i in range(3):
                for j in range(3):
                    turn = d1 * dT[0, i, j] + d2 * dT[1, i, j]
                    for b in range(count):
                        moved = M[b, 0] * dX[0, j] + M[b, 1] * dX[1, j]
                        K[P, count + b, c, i, j] -= w * (N[b] * turn + T[i] * moved)
                        K[P, b, c, i, j] += w * values[b, k] * turn
            share = -w * v if bearing else w * N[c - count]
            for j in range(3):
                for s in range(3):
                    for i in range(3):
                        C[P, c, j, s, i] += share * hats[j, k] * B[s, i]
                for i in range(3):
                    D[P, j, c, i] += w * hats[j, k] * dX[2, i]
            for s in range(2):
                for i in range(3):
                    if bearing:
                        value = -v * B[s + 1, i]
                        for r in range(3):
                            value += e[r] * (d1 * dB[0, s + 1, r, i] + d2 * dB[1, s + 1, r, i])
                    else:
                        value = N0[c - count] * B[s + 1, i]
                    for j in range(3):
                        D0[P0, j, s, c, i] += w * hats[j, k] * value


@njit(cache=True, nogil=True)
def coulomb(traction, gaps, stiffness, radii, nearly, miss, slope, state):
    """Write what Coulomb's law is missed by, its slope and the state of each multiplier.

    Parameters
    ----------
    traction, gaps
        t_n, t_1, t_2 [kPa] and mean gap and slips [mm], (c, 3).
    stiffness
        That weighs one against the other, (c,) [kPa/mm].
    radii
        Friction against slip along a1, against it, and the same along a2, (c, 4) [1].
    nearly
        Gap below which a point without traction counts as touching [mm].
    miss
        Natural map over the stiffness, (c, 3) [mm]: zero where the law holds.
    slope
        Derivative of the projection of ``t - stiffness gap``, (c, 3, 3).
    state
        0 lifted, 1 sticks, 2 slips, (c,).
    """
    for c in range(traction.shape[0]):
        r = stiffness[c]
        z0 = traction[c, 0] - r * gaps[c, 0]
        z1 = traction[c, 1] - r * gaps[c, 1]
        z2 = traction[c, 2] - r * gaps[c, 2]
        slope[c] = 0.0
        state[c] = 0
        s = max(z0, 0.0)
        x1, x2, A11, A12, A22 = project(z1, z2, s, radii[c, 0], radii[c, 1], radii[c, 2], radii[c, 3])
        miss[c, 0] = (traction[c, 0] - s) / r
        miss[c, 1] = (traction[c, 1] - x1) / r
        miss[c, 2] = (traction[c, 2] - x2) / r
        if z0 <= -r * nearly:
            continue
        slope[c, 0, 0] = 1.0
        slope[c, 1, 1], slope[c, 1, 2], slope[c, 2, 1], slope[c, 2, 2] = A11, A12, A12, A22
        inside = A11 == 1.0 and A22 == 1.0
        state[c] = 1 if inside else 2
        if s > 0.0 and not inside:
            slope[c, 1, 0] = (x1 - A11 * z1 - A12 * z2) / s
            slope[c, 2, 0] = (x2 - A12 * z1 - A22 * z2) / s

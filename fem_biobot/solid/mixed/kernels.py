"""Compiled kernels of the mixed form: volumetric stress with a pressure of its own, volume error and coupling.

Letters as in `solid.kernels`, ``c`` the pressure nodes of an element. Every kernel ADDS to its outputs unless it says
"write", for the elements listed, which must have pressure nodes.
"""

from __future__ import annotations

import numpy as np

from fem_biobot.compile_cache import ensure_cache_folder

ensure_cache_folder()

from numba import njit  # noqa: E402  (numba looks for its cache folder when it loads)

_FIRST = np.array([0, 1, 2, 0, 1, 0])
_SECOND = np.array([0, 1, 2, 1, 2, 2])
# see `solid.kernels`
_LANES = 16
# below this |J - 1| the quadratic measure is summed as a series, and how far; see `material.volume`
_NEAR = 0.2
_TERMS = 26


@njit(cache=True, nogil=True)
def volume_measure(J, measure):
    """``g``, ``dg/dJ`` and ``d2g/dJ2`` of a measure of volume change; the numbers are those of `material.volume`."""
    if measure == 0:
        return np.log(J), 1.0 / J, -1.0 / (J * J)
    if measure == 1:
        return J - 1.0, 1.0, 0.0
    # with x = J - 1: g = x r, r^2 = 1/2 + h, h = (x - ln(1 + x)) / x^2
    x = J - 1.0
    h, h1, h2 = 0.0, 0.0, 0.0
    if abs(x) < _NEAR:
        for k in range(_TERMS, -1, -1):
            h2 = h2 * x + 2.0 * h1
            h1 = h1 * x + h
            h = h * x + (1.0 if k % 2 == 0 else -1.0) / (k + 2.0)
    else:
        h = (x - np.log1p(x)) / (x * x)
        h1 = (1.0 / J - 2.0 * h) / x
        h2 = -(1.0 / (J * J) + 3.0 * h1) / x
    r = np.sqrt(0.5 + h)
    r1 = 0.5 * h1 / r
    r2 = 0.5 * h2 / r - 0.25 * h1 * h1 / (r * r * r)
    return x * r, r + x * r1, 2.0 * r1 + x * r2


@njit(cache=True, nogil=True, fastmath={"contract"}, error_model="numpy")
def volumetric_points(F, elements, nodes, values, p, compliance, measure, S, D, psi, slope, error):
    """Add the volumetric stress and moduli; write ``slope`` (6, e, q), ``dg/dE`` packed, and ``error`` (e, q).

    With ``p`` (m,) the pressure at its nodes, `nodes` (c, e), `values` (c, q) its basis and `compliance` the inverse
    bulk modulus: energy ``p g - compliance p^2 / 2``, stress ``p dg/dE``, moduli ``p d2g/dE2``, volume error
    ``g - compliance p``. A `D` without components is left out. Same as the scikit-fem form in tests/oracles.
    """
    n_elements = elements.shape[0]
    moduli = D.shape[0] > 0
    C = np.empty((6, _LANES))
    ci = np.empty((3, 3, _LANES))
    det = np.empty(_LANES)
    push = np.empty(_LANES)
    first_part = np.empty(_LANES)
    second_part = np.empty(_LANES)
    tangent = np.empty((21, _LANES))
    for first in range(0, n_elements, _LANES):
        filled = min(_LANES, n_elements - first)
        for q in range(F.shape[3]):
            for lane in range(_LANES):
                e = elements[min(first + lane, n_elements - 1)]
                for a in range(6):
                    i, j = _FIRST[a], _SECOND[a]
                    C[a, lane] = (
                        F[0, i, e, q] * F[0, j, e, q] + F[1, i, e, q] * F[1, j, e, q] + F[2, i, e, q] * F[2, j, e, q]
                    )
                pressure = 0.0
                for c in range(values.shape[0]):
                    pressure += values[c, q] * p[nodes[c, e]]
                push[lane] = pressure
            for lane in range(_LANES):
                c00, c11, c22 = C[0, lane], C[1, lane], C[2, lane]
                c01, c12, c02 = C[3, lane], C[4, lane], C[5, lane]
                m00 = c11 * c22 - c12 * c12
                m01 = c02 * c12 - c01 * c22
                m02 = c01 * c12 - c02 * c11
                J2 = c00 * m00 + c01 * m01 + c02 * m02
                det[lane] = J2
                i01, i02, i12 = m01 / J2, m02 / J2, (c01 * c02 - c00 * c12) / J2
                ci[0, 0, lane] = m00 / J2
                ci[0, 1, lane] = i01
                ci[0, 2, lane] = i02
                ci[1, 0, lane] = i01
                ci[1, 1, lane] = (c00 * c22 - c02 * c02) / J2
                ci[1, 2, lane] = i12
                ci[2, 0, lane] = i02
                ci[2, 1, lane] = i12
                ci[2, 2, lane] = (c00 * c11 - c01 * c01) / J2
            for lane in range(filled):
                e = elements[first + lane]
                J = np.sqrt(det[lane])
                g, dg, ddg = volume_measure(J, measure)
                pressure = push[lane]
                first_part[lane] = J * dg
                second_part[lane] = J * (J * ddg + dg)
                psi[e, q] += pressure * (g - 0.5 * compliance * pressure)
                error[e, q] = g - compliance * pressure
                for a in range(6):
                    s = first_part[lane] * ci[_FIRST[a], _SECOND[a], lane]
                    slope[a, e, q] = s
                    S[a, e, q] += pressure * s
            if not moduli:
                continue
            entry = 0
            for a in range(6):
                i, j = _FIRST[a], _SECOND[a]
                for b in range(a, 6):
                    k, m = _FIRST[b], _SECOND[b]
                    for lane in range(_LANES):
                        tangent[entry, lane] = push[lane] * (
                            second_part[lane] * ci[i, j, lane] * ci[k, m, lane]
                            - first_part[lane] * (ci[i, k, lane] * ci[j, m, lane] + ci[i, m, lane] * ci[j, k, lane])
                        )
                    entry += 1
            for lane in range(filled):
                e = elements[first + lane]
                for entry in range(21):
                    D[entry, e, q] += tangent[entry, lane]


@njit(cache=True, nogil=True)
def volume_residual(elements, nodes, values, dV, error, residual):
    """Add ``int N_c error`` to `residual` (m,)."""
    for index in range(elements.shape[0]):
        e = elements[index]
        for c in range(values.shape[0]):
            total = 0.0
            for q in range(values.shape[1]):
                total += values[c, q] * error[e, q] * dV[e, q]
            residual[nodes[c, e]] += total


@njit(cache=True, nogil=True)
def add_pressure_change(elements, nodes, values, change, slope, S):
    """Add to stresses `S` (6, e, q) what a change (m,) of the pressure adds at an unchanged deformation."""
    for index in range(elements.shape[0]):
        e = elements[index]
        for q in range(values.shape[1]):
            pressure = 0.0
            for c in range(values.shape[0]):
                pressure += values[c, q] * change[nodes[c, e]]
            for a in range(6):
                S[a, e, q] += pressure * slope[a, e, q]


@njit(cache=True, nogil=True, fastmath={"contract"})
def coupling(
    elements, nodes, slopes, to_reference, dV, F, slope, p_nodes, values, scale, starts, place, turned, turns, data
):
    """Add to `data` the block of displacement and pressure, ``int (F dg/dE dN_a) N_c`` times ``scale[c]``.

    `place` (e, b, c) says where in `data` the first of a block's three rows is; `starts` are those of the matrix's
    rows. Nodes are turned as in `solid.kernels.tangent`. Same as the scikit-fem form in tests/oracles.
    """
    n_basis, n_values = nodes.shape[0], p_nodes.shape[0]
    n_elements = elements.shape[0]
    turning = turned.shape[0] > 0
    R = np.empty((3, 3, _LANES))
    f = np.empty((3, 3, _LANES))
    s = np.empty((6, _LANES))
    T = np.empty((3, 3, _LANES))
    local = np.empty((n_basis, n_values, 3, _LANES))
    row = np.empty(3)
    for first in range(0, n_elements, _LANES):
        filled = min(_LANES, n_elements - first)
        for lane in range(_LANES):
            e = elements[min(first + lane, n_elements - 1)]
            for d in range(3):
                for k in range(3):
                    R[d, k, lane] = to_reference[d, k, e]
        local[:] = 0.0
        for q in range(slopes.shape[2]):
            for lane in range(_LANES):
                e = elements[min(first + lane, n_elements - 1)]
                w = dV[e, q]
                for i in range(3):
                    for k in range(3):
                        f[i, k, lane] = F[i, k, e, q]
                for a in range(6):
                    s[a, lane] = slope[a, e, q] * w
            for i in range(3):
                for lane in range(_LANES):
                    f0, f1, f2 = f[i, 0, lane], f[i, 1, lane], f[i, 2, lane]
                    p0 = f0 * s[0, lane] + f1 * s[3, lane] + f2 * s[5, lane]
                    p1 = f0 * s[3, lane] + f1 * s[1, lane] + f2 * s[4, lane]
                    p2 = f0 * s[5, lane] + f1 * s[4, lane] + f2 * s[2, lane]
                    for d in range(3):
                        T[i, d, lane] = p0 * R[d, 0, lane] + p1 * R[d, 1, lane] + p2 * R[d, 2, lane]
            for a in range(n_basis):
                s0, s1, s2 = slopes[a, 0, q], slopes[a, 1, q], slopes[a, 2, q]
                for c in range(n_values):
                    v = values[c, q]
                    for lane in range(_LANES):
                        for i in range(3):
                            local[a, c, i, lane] += v * (T[i, 0, lane] * s0 + T[i, 1, lane] * s1 + T[i, 2, lane] * s2)
        for lane in range(filled):
            e = elements[first + lane]
            for a in range(n_basis):
                node = nodes[a, e]
                own = turned[node] if turning else -1
                length = starts[3 * node + 1] - starts[3 * node]
                for c in range(n_values):
                    factor = scale[p_nodes[c, e]]
                    for i in range(3):
                        row[i] = local[a, c, i, lane] * factor
                    if own >= 0:
                        x, y, z = row[0], row[1], row[2]
                        for i in range(3):
                            row[i] = turns[i, 0, own] * x + turns[i, 1, own] * y + turns[i, 2, own] * z
                    at = place[e, a, c]
                    # rows of one node: lengths L, L - 1, L - 2, each without the columns before its diagonal
                    data[at] += row[0]
                    data[at + length - 1] += row[1]
                    data[at + 2 * length - 3] += row[2]


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

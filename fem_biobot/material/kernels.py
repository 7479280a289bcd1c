"""Compiled point stage of the laws: second Piola stress and material tangent at every quadrature point.

Layout (one for all): ``F`` (3, 3, e, q) [1]; ``S`` (6, e, q) and ``D`` (21, e, q) [kPa] packed in the order of
`material.law.PAIRS`, ``D`` as the upper triangle of ``dS/dE`` by rows; ``psi`` (e, q) [kPa]. Every kernel of a law
ADDS to its outputs, for the elements listed, so that laws sum; a ``D`` without components (0, e, q) is left out.
Inverted points must have been refused before, by `smallest_volume_ratio`.
"""

from __future__ import annotations

import numpy as np

from fem_biobot.compile_cache import ensure_cache_folder

ensure_cache_folder()

from numba import njit  # noqa: E402  (numba looks for its cache folder when it loads)

_FIRST = np.array([0, 1, 2, 0, 1, 0])
_SECOND = np.array([0, 1, 2, 1, 2, 2])


# Elements in a pack, one in each lane of the last axis, so that the innermost loops become vector instructions; see
# `solid.kernels`.
_LANES = 16


# "numpy": a division by zero gives no exception, whose check would keep the loop from becoming vector instructions
@njit(cache=True, nogil=True, fastmath={"contract"}, error_model="numpy")
def neo_hooke_points(F, elements, mu, lmbda, S, D, psi):
    """Compressible neo-Hooke; same as `NeoHooke.stress` and `.tangent`."""
    n_elements = elements.shape[0]
    moduli = D.shape[0] > 0
    f = np.empty((3, 3, _LANES))
    C = np.empty((6, _LANES))
    ci = np.empty((3, 3, _LANES))
    det = np.empty(_LANES)
    ln_J = np.empty(_LANES)
    stress = np.empty((6, _LANES))
    tangent = np.empty((21, _LANES))
    for first in range(0, n_elements, _LANES):
        filled = min(_LANES, n_elements - first)
        for q in range(F.shape[3]):
            for lane in range(_LANES):
                e = elements[min(first + lane, n_elements - 1)]
                for i in range(3):
                    for k in range(3):
                        f[i, k, lane] = F[i, k, e, q]
            for lane in range(_LANES):
                for a in range(6):
                    i, j = _FIRST[a], _SECOND[a]
                    C[a, lane] = (
                        f[0, i, lane] * f[0, j, lane] + f[1, i, lane] * f[1, j, lane] + f[2, i, lane] * f[2, j, lane]
                    )
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
            for lane in range(_LANES):
                ln_J[lane] = 0.5 * np.log(det[lane])
            for lane in range(_LANES):
                pressure_part = lmbda * ln_J[lane] - mu
                for a in range(6):
                    stress[a, lane] = pressure_part * ci[_FIRST[a], _SECOND[a], lane]
                for a in range(3):
                    stress[a, lane] += mu
            for lane in range(filled):
                e = elements[first + lane]
                x = ln_J[lane]
                trace = C[0, lane] + C[1, lane] + C[2, lane]
                psi[e, q] += 0.5 * mu * (trace - 3.0) - mu * x + 0.5 * lmbda * x * x
                for a in range(6):
                    S[a, e, q] += stress[a, lane]
            if not moduli:
                continue
            entry = 0
            for a in range(6):
                i, j = _FIRST[a], _SECOND[a]
                for b in range(a, 6):
                    k, m = _FIRST[b], _SECOND[b]
                    for lane in range(_LANES):
                        tangent[entry, lane] = lmbda * ci[i, j, lane] * ci[k, m, lane] - (lmbda * ln_J[lane] - mu) * (
                            ci[i, k, lane] * ci[j, m, lane] + ci[i, m, lane] * ci[j, k, lane]
                        )
                    entry += 1
            for lane in range(filled):
                e = elements[first + lane]
                for entry in range(21):
                    D[entry, e, q] += tangent[entry, lane]


@njit(cache=True, nogil=True)
def pull_back_points(G, elements, volume, S_e, D_e, psi_e, S, D, psi):
    """Second Piola quantities from a natural state back to the reference body.

    `G` (3, 3, e) is the inverse of the natural state's gradient, `volume` (e,) its determinant; adds
    ``volume G S_e G^T`` and the fourth-order counterpart; same as `NaturalState.stress` and `.tangent`.
    """
    full = np.empty((6, 6))
    turn = np.empty((6, 6))
    half = np.empty((6, 6))
    for index in range(elements.shape[0]):
        e = elements[index]
        # turn[a, b]: packed matrix of X -> G X G^T on symmetric tensors
        for a in range(6):
            i = _FIRST[a]
            j = _SECOND[a]
            for b in range(6):
                k = _FIRST[b]
                m = _SECOND[b]
                turn[a, b] = G[i, k, e] * G[j, m, e]
                if k != m:
                    turn[a, b] += G[i, m, e] * G[j, k, e]
        for q in range(S.shape[2]):
            psi[e, q] += volume[e] * psi_e[e, q]
            for a in range(6):
                total = 0.0
                for b in range(6):
                    total += turn[a, b] * S_e[b, e, q]
                S[a, e, q] += volume[e] * total
            if D.shape[0] == 0:
                continue
            entry = 0
            for a in range(6):
                for b in range(a, 6):
                    full[a, b] = D_e[entry, e, q]
                    full[b, a] = full[a, b]
                    entry += 1
            for a in range(6):
                for b in range(6):
                    acc = 0.0
                    for c in range(6):
                        acc += turn[a, c] * full[c, b]
                    half[a, b] = acc
            entry = 0
            for a in range(6):
                for b in range(a, 6):
                    acc = 0.0
                    for c in range(6):
                        acc += half[a, c] * turn[b, c]
                    D[entry, e, q] += volume[e] * acc
                    entry += 1


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
            entry = 0
            for a in range(6):
                for b in range(a, 6):
                    out[a, e, q] += D[entry, e, q] * dE[b]
                    if b != a:
                        out[b, e, q] += D[entry, e, q] * dE[a]
                    entry += 1

"""Compiled point stage of the laws: second Piola stress and material tangent at every quadrature point.

Layout (one for all): ``F`` (3, 3, e, q) [1]; ``S`` (6, e, q) and ``D`` (21, e, q) [kPa] packed in the order of
`material.law.PAIRS`, ``D`` as the upper triangle of ``dS/dE`` by rows; ``psi`` (e, q) [kPa]. Every kernel ADDS to its
outputs, for the elements listed, so that laws sum; a ``D`` without components (0, e, q) is left out. Inverted points
must have been refused before.
"""

from __future__ import annotations

import numpy as np

from fem_biobot.compile_cache import ensure_cache_folder

ensure_cache_folder()

from numba import njit  # noqa: E402  (numba looks for its cache folder when it loads)

_FIRST = np.array([0, 1, 2, 0, 1, 0])
_SECOND = np.array([0, 1, 2, 1, 2, 2])


@njit(cache=True, nogil=True)
def neo_hooke_points(F, elements, mu, lmbda, S, D, psi):
    """Compressible neo-Hooke; same as `NeoHooke.stress` and `.tangent`."""
    ci = np.empty((3, 3))
    moduli = D.shape[0] > 0
    for index in range(elements.shape[0]):
        e = elements[index]
        for q in range(F.shape[3]):
            c00 = F[0, 0, e, q] ** 2 + F[1, 0, e, q] ** 2 + F[2, 0, e, q] ** 2
            c11 = F[0, 1, e, q] ** 2 + F[1, 1, e, q] ** 2 + F[2, 1, e, q] ** 2
            c22 = F[0, 2, e, q] ** 2 + F[1, 2, e, q] ** 2 + F[2, 2, e, q] ** 2
            c01 = F[0, 0, e, q] * F[0, 1, e, q] + F[1, 0, e, q] * F[1, 1, e, q] + F[2, 0, e, q] * F[2, 1, e, q]
            c12 = F[0, 1, e, q] * F[0, 2, e, q] + F[1, 1, e, q] * F[1, 2, e, q] + F[2, 1, e, q] * F[2, 2, e, q]
            c02 = F[0, 0, e, q] * F[0, 2, e, q] + F[1, 0, e, q] * F[1, 2, e, q] + F[2, 0, e, q] * F[2, 2, e, q]
            m00 = c11 * c22 - c12 * c12
            m01 = c02 * c12 - c01 * c22
            m02 = c01 * c12 - c02 * c11
            det = c00 * m00 + c01 * m01 + c02 * m02
            ci[0, 0] = m00 / det
            ci[0, 1] = m01 / det
            ci[0, 2] = m02 / det
            ci[1, 1] = (c00 * c22 - c02 * c02) / det
            ci[1, 2] = (c01 * c02 - c00 * c12) / det
            ci[2, 2] = (c00 * c11 - c01 * c01) / det
            ci[1, 0] = ci[0, 1]
            ci[2, 0] = ci[0, 2]
            ci[2, 1] = ci[1, 2]
            ln_J = 0.5 * np.log(det)
            pressure_part = lmbda * ln_J - mu
            psi[e, q] += 0.5 * mu * (c00 + c11 + c22 - 3.0) - mu * ln_J + 0.5 * lmbda * ln_J * ln_J
            place = 0
            for a in range(6):
                i = _FIRST[a]
                j = _SECOND[a]
                S[a, e, q] += pressure_part * ci[i, j]
                if a < 3:
                    S[a, e, q] += mu
                if not moduli:
                    continue
                for b in range(a, 6):
                    k = _FIRST[b]
                    m = _SECOND[b]
                    D[place, e, q] += lmbda * ci[i, j] * ci[k, m] - pressure_part * (
                        ci[i, k] * ci[j, m] + ci[i, m] * ci[j, k]
                    )
                    place += 1


@njit(cache=True, nogil=True)
def nominal_tension_points(F, elements, tension, a0, S, D, psi):
    """Nominal tension along `a0`, (3, e, q); `tension` (e, q) [kPa]; same as `NominalTension`."""
    aa = np.empty(6)
    moduli = D.shape[0] > 0
    for index in range(elements.shape[0]):
        e = elements[index]
        for q in range(F.shape[3]):
            T = tension[e, q]
            x = a0[0, e, q]
            y = a0[1, e, q]
            z = a0[2, e, q]
            fx = F[0, 0, e, q] * x + F[0, 1, e, q] * y + F[0, 2, e, q] * z
            fy = F[1, 0, e, q] * x + F[1, 1, e, q] * y + F[1, 2, e, q] * z
            fz = F[2, 0, e, q] * x + F[2, 1, e, q] * y + F[2, 2, e, q] * z
            stretch = np.sqrt(fx * fx + fy * fy + fz * fz)
            aa[0] = x * x
            aa[1] = y * y
            aa[2] = z * z
            aa[3] = x * y
            aa[4] = y * z
            aa[5] = x * z
            psi[e, q] += T * (stretch - 1.0)
            first = T / stretch
            second = -T / stretch**3
            place = 0
            for a in range(6):
                S[a, e, q] += first * aa[a]
                if not moduli:
                    continue
                for b in range(a, 6):
                    D[place, e, q] += second * aa[a] * aa[b]
                    place += 1


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
            place = 0
            for a in range(6):
                for b in range(a, 6):
                    full[a, b] = D_e[place, e, q]
                    full[b, a] = full[a, b]
                    place += 1
            for a in range(6):
                for b in range(6):
                    acc = 0.0
                    for c in range(6):
                        acc += turn[a, c] * full[c, b]
                    half[a, b] = acc
            place = 0
            for a in range(6):
                for b in range(a, 6):
                    acc = 0.0
                    for c in range(6):
                        acc += half[a, c] * turn[b, c]
                    D[place, e, q] += volume[e] * acc
                    place += 1

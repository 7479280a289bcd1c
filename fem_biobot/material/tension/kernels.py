"""Compiled point stage of active tension in every convention; layout as in `material.kernels`.

A ``D`` of 21 rows takes the symmetric part of ``dS/dE``, one of 36 rows all of it (6 by 6 by rows), one without rows
nothing.
"""

from __future__ import annotations

import numpy as np

from fem_biobot.compile_cache import ensure_cache_folder

ensure_cache_folder()

from numba import njit  # noqa: E402  (numba looks for its cache folder when it loads)

_FIRST = np.array([0, 1, 2, 0, 1, 0])
_SECOND = np.array([0, 1, 2, 1, 2, 2])


@njit(cache=True, nogil=True)
def tension_points(F, elements, tension, factor, H, power, per_volume, pieces, S, D, psi):
    """Tension carried by the structure tensor `H`; same as `FibreTension`.

    ``S = factor tension f(m) m^-power (J) H`` with ``m = sqrt(H : C)``, ``J`` if `per_volume` (no energy then).
    `tension` (e or 1, q or 1) [kPa]; `H` (6, e or 1, q or 1), trace one; `pieces` (k, 5) of the curve ``f``, from
    `ForceLength.pieces`.
    """
    h = np.empty(6)
    c = np.empty(6)
    ci = np.zeros(6)
    columns = D.shape[0]
    for index in range(elements.shape[0]):
        e = elements[index]
        et = e if tension.shape[0] > 1 else 0
        eh = e if H.shape[1] > 1 else 0
        for q in range(F.shape[3]):
            T = factor * tension[et, q if tension.shape[1] > 1 else 0]
            for a in range(6):
                h[a] = H[a, eh, q if H.shape[2] > 1 else 0]
                i, j = _FIRST[a], _SECOND[a]
                c[a] = F[0, i, e, q] * F[0, j, e, q] + F[1, i, e, q] * F[1, j, e, q] + F[2, i, e, q] * F[2, j, e, q]
            square = h[0] * c[0] + h[1] * c[1] + h[2] * c[2] + 2.0 * (h[3] * c[3] + h[4] * c[4] + h[5] * c[5])
            m = np.sqrt(square)
            piece = 0
            while piece + 1 < pieces.shape[0] and pieces[piece + 1, 0] <= m:
                piece += 1
            c0, c1, c2 = pieces[piece, 1], pieces[piece, 2], pieces[piece, 3]
            f = c0 + m * (c1 + m * c2)
            df = c1 + 2.0 * m * c2
            if power == 0:
                scale = 1.0
                work = m * m * (c0 / 2.0 + m * (c1 / 3.0 + m * c2 / 4.0))
            elif power == 1:
                scale = 1.0 / m
                work = m * (c0 + m * (c1 / 2.0 + m * c2 / 3.0))
            else:
                scale = 1.0 / square
                work = c0 * np.log(m) + m * (c1 + m * c2 / 2.0)
            first = T * f * scale
            # dS/dE along H, from dm/dE = H / m
            second = T * scale * (df - power * f / m) / m
            if per_volume:
                m0 = c[1] * c[2] - c[4] * c[4]
                m3 = c[5] * c[4] - c[3] * c[2]
                m5 = c[3] * c[4] - c[5] * c[1]
                J2 = c[0] * m0 + c[3] * m3 + c[5] * m5
                J = np.sqrt(J2)
                ci[0], ci[3], ci[5] = m0 / J2, m3 / J2, m5 / J2
                ci[1] = (c[0] * c[2] - c[5] * c[5]) / J2
                ci[2] = (c[0] * c[1] - c[3] * c[3]) / J2
                ci[4] = (c[3] * c[5] - c[0] * c[4]) / J2
                first *= J
                second *= J
            else:
                psi[e, q] += T * (pieces[piece, 4] + work)
            for a in range(6):
                S[a, e, q] += first * h[a]
            if columns == 36:
                for a in range(6):
                    for b in range(6):
                        D[6 * a + b, e, q] += h[a] * (second * h[b] + (first * ci[b] if per_volume else 0.0))
            elif columns > 0:
                entry = 0
                for a in range(6):
                    for b in range(a, 6):
                        value = second * h[a] * h[b]
                        if per_volume:
                            value += 0.5 * first * (h[a] * ci[b] + h[b] * ci[a])
                        D[entry, e, q] += value
                        entry += 1

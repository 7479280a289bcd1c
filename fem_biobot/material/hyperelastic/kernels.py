"""Compiled point stage of laws written in invariants: the tensors, given the energy's derivatives by the invariants.

Invariants are those of ``C``, without and with a unit fibre ``a0``, and ``J``: ``I1, I2, J`` or ``I1, I2, I4, I5, J``,
in this order. Packing as in `material.kernels`; arrays named by an index ``k`` are over the listed elements only.
"""

from __future__ import annotations

import numpy as np

from fem_biobot.compile_cache import ensure_cache_folder

ensure_cache_folder()

from numba import njit  # noqa: E402  (numba looks for its cache folder when it loads)

_FIRST = np.array([0, 1, 2, 0, 1, 0])
_SECOND = np.array([0, 1, 2, 1, 2, 2])
_DELTA = np.eye(3)
# places of I1, I2, J and of their pairs among those of I1, I2, I4, I5, J
_PLAIN = np.array([0, 1, 4])
_PLAIN_PAIRS = np.array([0, 1, 4, 5, 8, 14])
# elements in a pack, one in each lane of the last axis; see `solid.kernels`
_LANES = 16
_EYE = np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])


@njit(cache=True, nogil=True, error_model="numpy")
def _right_cauchy_green(F, e, q, c):
    """Write ``C``, (6,)."""
    for a in range(6):
        i, j = _FIRST[a], _SECOND[a]
        c[a] = F[0, i, e, q] * F[0, j, e, q] + F[1, i, e, q] * F[1, j, e, q] + F[2, i, e, q] * F[2, j, e, q]


@njit(cache=True, nogil=True, error_model="numpy")
def _cofactor(c, out):
    """Write the cofactor of a symmetric tensor, (6,)."""
    out[0] = c[1] * c[2] - c[4] * c[4]
    out[1] = c[0] * c[2] - c[5] * c[5]
    out[2] = c[0] * c[1] - c[3] * c[3]
    out[3] = c[5] * c[4] - c[3] * c[2]
    out[4] = c[3] * c[5] - c[0] * c[4]
    out[5] = c[3] * c[4] - c[5] * c[1]


@njit(cache=True, nogil=True, error_model="numpy")
def _times(c, v, out):
    """Write a symmetric tensor times a vector, (3,)."""
    out[0] = c[0] * v[0] + c[3] * v[1] + c[5] * v[2]
    out[1] = c[3] * v[0] + c[1] * v[1] + c[4] * v[2]
    out[2] = c[5] * v[0] + c[4] * v[1] + c[2] * v[2]


@njit(cache=True, nogil=True, error_model="numpy")
def invariants(F, elements, a0, out):
    """Write the invariants, (3, k, q), or (5, k, q) with fibres `a0` (3, e or 1); an empty `a0` (3, 0) means none.

    Same as `material.invariants.invariants`.
    """
    c, m, v, w = np.empty(6), np.empty(6), np.empty(3), np.empty(3)
    fibres = a0.shape[1] > 0
    for k in range(elements.shape[0]):
        e = elements[k]
        for q in range(F.shape[3]):
            _right_cauchy_green(F, e, q, c)
            _cofactor(c, m)
            out[0, k, q] = c[0] + c[1] + c[2]
            out[1, k, q] = m[0] + m[1] + m[2]
            if fibres:
                for i in range(3):
                    v[i] = a0[i, e if a0.shape[1] > 1 else 0]
                _times(c, v, w)
                out[2, k, q] = v[0] * w[0] + v[1] * w[1] + v[2] * w[2]
                out[3, k, q] = w[0] * w[0] + w[1] * w[1] + w[2] * w[2]
            out[out.shape[0] - 1, k, q] = np.sqrt(c[0] * m[0] + c[3] * m[3] + c[5] * m[5])


@njit(cache=True, nogil=True, fastmath={"contract"}, error_model="numpy")
def add_invariant_points(F, elements, a0, energy, first, second, S, D, psi):
    """Add ``S``, ``dS/dE`` and energy of a law with derivatives `first` (n, k, q) and `second` (n (n + 1)/2, k, q).

    n is 3, or 5 with fibres `a0` (3, e or 1); `second` is an upper triangle by rows. Same as
    `material.invariants.first_piola` and `.tangent`.
    """
    fibres = first.shape[0] == 5
    n_elements = elements.shape[0]
    moduli = D.shape[0] > 0
    f = np.empty((3, 3, _LANES))
    c = np.empty((6, _LANES))
    ci = np.empty((3, 3, _LANES))
    v = np.zeros((3, _LANES))
    w = np.zeros((3, _LANES))
    J = np.empty(_LANES)
    # derivatives of the invariants by E, of the energy by the invariants, and of its first ones by E; those by I4 and
    # I5 stay empty without fibres
    B = np.zeros((5, 6, _LANES))
    slope = np.zeros((5, _LANES))
    bend = np.zeros((15, _LANES))
    V = np.empty((5, 6, _LANES))
    stress = np.empty((6, _LANES))
    tangent = np.empty((21, _LANES))
    B[0, :3] = 2.0
    for start in range(0, n_elements, _LANES):
        filled = min(_LANES, n_elements - start)
        if fibres:
            for lane in range(_LANES):
                e = elements[min(start + lane, n_elements - 1)]
                for i in range(3):
                    v[i, lane] = a0[i, e if a0.shape[1] > 1 else 0]
        for q in range(F.shape[3]):
            for lane in range(_LANES):
                k = min(start + lane, n_elements - 1)
                e = elements[k]
                for i in range(3):
                    for j in range(3):
                        f[i, j, lane] = F[i, j, e, q]
                for p in range(first.shape[0]):
                    slope[p if fibres else _PLAIN[p], lane] = first[p, k, q]
                if moduli:
                    for p in range(second.shape[0]):
                        bend[p if fibres else _PLAIN_PAIRS[p], lane] = second[p, k, q]
            for a in range(6):
                i, j = _FIRST[a], _SECOND[a]
                for lane in range(_LANES):
                    c[a, lane] = (
                        f[0, i, lane] * f[0, j, lane] + f[1, i, lane] * f[1, j, lane] + f[2, i, lane] * f[2, j, lane]
                    )
            for lane in range(_LANES):
                c0, c1, c2, c3, c4, c5 = c[0, lane], c[1, lane], c[2, lane], c[3, lane], c[4, lane], c[5, lane]
                m0, m3, m5 = c1 * c2 - c4 * c4, c5 * c4 - c3 * c2, c3 * c4 - c5 * c1
                J2 = c0 * m0 + c3 * m3 + c5 * m5
                J[lane] = np.sqrt(J2)
                ci[0, 0, lane] = m0 / J2
                ci[1, 1, lane] = (c0 * c2 - c5 * c5) / J2
                ci[2, 2, lane] = (c0 * c1 - c3 * c3) / J2
                i01, i02, i12 = m3 / J2, m5 / J2, (c3 * c5 - c0 * c4) / J2
                ci[0, 1, lane] = i01
                ci[0, 2, lane] = i02
                ci[1, 2, lane] = i12
                ci[1, 0, lane] = i01
                ci[2, 0, lane] = i02
                ci[2, 1, lane] = i12
                w[0, lane] = c0 * v[0, lane] + c3 * v[1, lane] + c5 * v[2, lane]
                w[1, lane] = c3 * v[0, lane] + c1 * v[1, lane] + c4 * v[2, lane]
                w[2, lane] = c5 * v[0, lane] + c4 * v[1, lane] + c2 * v[2, lane]
            for a in range(6):
                i, j = _FIRST[a], _SECOND[a]
                twice = 2.0 * _EYE[a]
                for lane in range(_LANES):
                    b1 = twice * (c[0, lane] + c[1, lane] + c[2, lane]) - 2.0 * c[a, lane]
                    b4 = J[lane] * ci[i, j, lane]
                    B[1, a, lane] = b1
                    B[4, a, lane] = b4
                    stress[a, lane] = slope[0, lane] * twice + slope[1, lane] * b1 + slope[4, lane] * b4
                    V[0, a, lane] = bend[0, lane] * twice + bend[1, lane] * b1 + bend[4, lane] * b4
                    V[1, a, lane] = bend[1, lane] * twice + bend[5, lane] * b1 + bend[8, lane] * b4
                    V[4, a, lane] = bend[4, lane] * twice + bend[8, lane] * b1 + bend[14, lane] * b4
                if fibres:
                    for lane in range(_LANES):
                        b1, b4 = B[1, a, lane], B[4, a, lane]
                        b2 = 2.0 * v[i, lane] * v[j, lane]
                        b3 = 2.0 * (v[i, lane] * w[j, lane] + w[i, lane] * v[j, lane])
                        B[2, a, lane] = b2
                        B[3, a, lane] = b3
                        stress[a, lane] += slope[2, lane] * b2 + slope[3, lane] * b3
                        V[0, a, lane] += bend[2, lane] * b2 + bend[3, lane] * b3
                        V[1, a, lane] += bend[6, lane] * b2 + bend[7, lane] * b3
                        V[4, a, lane] += bend[11, lane] * b2 + bend[13, lane] * b3
                        V[2, a, lane] = (
                            bend[2, lane] * twice
                            + bend[6, lane] * b1
                            + bend[9, lane] * b2
                            + bend[10, lane] * b3
                            + bend[11, lane] * b4
                        )
                        V[3, a, lane] = (
                            bend[3, lane] * twice
                            + bend[7, lane] * b1
                            + bend[10, lane] * b2
                            + bend[12, lane] * b3
                            + bend[13, lane] * b4
                        )
            for lane in range(filled):
                e = elements[start + lane]
                psi[e, q] += energy[start + lane, q]
                for a in range(6):
                    S[a, e, q] += stress[a, lane]
            if not moduli:
                continue
            entry = 0
            for a in range(6):
                i, j = _FIRST[a], _SECOND[a]
                twice = 2.0 * _EYE[a]
                for b in range(a, 6):
                    k, h = _FIRST[b], _SECOND[b]
                    ik, jh, ih, jk = _DELTA[i, k], _DELTA[j, h], _DELTA[i, h], _DELTA[j, k]
                    flat = 4.0 * (_EYE[a] * _EYE[b] - 0.5 * (ik * jh + ih * jk))
                    for lane in range(_LANES):
                        tangent[entry, lane] = (
                            flat * slope[1, lane]
                            + slope[4, lane]
                            * J[lane]
                            * (
                                ci[i, j, lane] * ci[k, h, lane]
                                - ci[i, k, lane] * ci[j, h, lane]
                                - ci[i, h, lane] * ci[j, k, lane]
                            )
                            + twice * V[0, b, lane]
                            + B[1, a, lane] * V[1, b, lane]
                            + B[4, a, lane] * V[4, b, lane]
                        )
                    if fibres:
                        for lane in range(_LANES):
                            tangent[entry, lane] += (
                                B[2, a, lane] * V[2, b, lane]
                                + B[3, a, lane] * V[3, b, lane]
                                + 2.0
                                * slope[3, lane]
                                * (
                                    v[i, lane] * (jk * v[h, lane] + jh * v[k, lane])
                                    + v[j, lane] * (ik * v[h, lane] + ih * v[k, lane])
                                )
                            )
                    entry += 1
            for lane in range(filled):
                e = elements[start + lane]
                for entry in range(21):
                    D[entry, e, q] += tangent[entry, lane]

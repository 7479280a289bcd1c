"""Strains of packed tensors, and what moduli make of them, at all quadrature points at once.

Packed strains have their shears doubled, as the moduli ``D`` of `solid.system.Points` take them: six components in the
order of `material.law.PAIRS`.
"""

from __future__ import annotations

import numpy as np

from fem_biobot.material.law import PAIRS, Array
from fem_biobot.solid.moduli import PACKED_ENTRY


def green_lagrange(F: Array) -> Array:
    """Green-Lagrange strain ``(F^T F - I) / 2`` of (3, 3, ...) with its shears doubled, (6, ...) [1]."""
    E = np.empty((6, *F.shape[2:]))
    for a, (i, k) in enumerate(PAIRS):
        E[a] = F[0, i] * F[0, k] + F[1, i] * F[1, k] + F[2, i] * F[2, k]
        if i == k:
            E[a] -= 1.0
            E[a] *= 0.5
    return E


def strain_change(F: Array, dF: Array) -> Array:
    """Symmetric part of ``F^T dF`` with its shears doubled, (6, ...) [1]: the strain that the stress at F works on."""
    E = np.empty((6, *F.shape[2:]))
    for a, (i, k) in enumerate(PAIRS):
        E[a] = F[0, i] * dF[0, k] + F[1, i] * dF[1, k] + F[2, i] * dF[2, k]
        if i != k:
            E[a] += F[0, k] * dF[0, i] + F[1, k] * dF[1, i] + F[2, k] * dF[2, i]
    return E


def stretch_of(E: Array) -> Array:
    """The upper triangular gradient R with ``R^T R = I + 2 E``, (3, 3, ...) [1], for strains as above.

    Laws depend on ``F^T F`` alone, so that R serves in place of F. Not a number where no gradient has that strain.
    """
    c = {pair: E[a] if pair[0] != pair[1] else 2.0 * E[a] + 1.0 for a, pair in enumerate(PAIRS)}
    R = np.zeros((3, 3, *E.shape[1:]))
    with np.errstate(invalid="ignore", divide="ignore"):
        R[0, 0] = np.sqrt(c[0, 0])
        R[0, 1] = c[0, 1] / R[0, 0]
        R[0, 2] = c[0, 2] / R[0, 0]
        R[1, 1] = np.sqrt(c[1, 1] - R[0, 1] ** 2)
        R[1, 2] = (c[1, 2] - R[0, 1] * R[0, 2]) / R[1, 1]
        R[2, 2] = np.sqrt(c[2, 2] - R[0, 2] ** 2 - R[1, 2] ** 2)
    return R


def stress_of(D: Array, E: Array) -> Array:
    """Packed moduli (21, ...) times packed strains, (6, ...) [kPa]."""
    S = np.zeros_like(E)
    for (a, b), entry in PACKED_ENTRY.items():
        S[a] += D[entry] * E[b]
        if a != b:
            S[b] += D[entry] * E[a]
    return S


def work_of(S: Array, E: Array, dV: Array) -> float:
    """Integral of the packed stress times a packed strain [uJ]."""
    return float(np.einsum("aeq,aeq,eq->", S, E, dV))

"""Small-strain moduli of a region's law in the reference body."""

from __future__ import annotations

import numpy as np

from fem_biobot.material.law import Law, add_law
from fem_biobot.solid.space import Ints, Space

# entry of component (a, b), a <= b, in the packed upper triangle of a 6 by 6 matrix
PACKED_ENTRY = {(a, b): 6 * a - a * (a - 1) // 2 + b - a for a in range(6) for b in range(a, 6)}


def rest_moduli(law: Law, elements: Ints, body: Space) -> tuple[float, float]:
    """Mean shear and bulk modulus of a region in the reference body [kPa]."""
    shape = body.dV.shape
    F = np.zeros((3, 3, *shape))
    for i in range(3):
        F[i, i] = 1.0
    S, D, psi = np.zeros((6, *shape)), np.zeros((21, *shape)), np.zeros(shape)
    add_law(law, F, elements, S, D, psi)
    shear = [PACKED_ENTRY[a, a] for a in (3, 4, 5)]
    # a third of the trace of D : I
    weights = np.zeros(21)
    for a in range(3):
        for b in range(a, 3):
            weights[PACKED_ENTRY[a, b]] = 1.0 if a == b else 2.0
    bulk = float(np.mean(np.tensordot(weights, D[:, elements], axes=1))) / 9.0
    return float(np.mean(D[shear][:, elements])), bulk


def poisson_ratio(shear: float, bulk: float) -> float:
    """Poisson's ratio of an isotropic body with these moduli [1]."""
    return (3.0 * bulk - 2.0 * shear) / (2.0 * (3.0 * bulk + shear))

"""Independent twins of the laws, written from their energies in other variables than the package uses.

Passive laws are isotropic, so the twin works in principal stretches; nothing is imported from the package.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# (stretches (3,), young, poisson) -> principal first Piola stresses (3,)
Principal = Callable[[Array, float, float], Array]


def lame(young: float, poisson: float) -> tuple[float, float]:
    """``lmbda, mu`` through the bulk modulus."""
    bulk, mu = young / (3.0 * (1.0 - 2.0 * poisson)), young / (2.0 + 2.0 * poisson)
    return bulk - 2.0 * mu / 3.0, mu


def neo_hooke_energy(stretches: Array, young: float, poisson: float) -> float:
    """``mu sum (l^2 - 1)/2 - mu ln J + lmbda/2 (ln J)^2``."""
    lmbda, mu = lame(young, poisson)
    ln_J = float(np.sum(np.log(stretches)))
    return float(0.5 * mu * np.sum(stretches**2 - 1.0) - mu * ln_J + 0.5 * lmbda * ln_J**2)


def neo_hooke_principal(stretches: Array, young: float, poisson: float) -> Array:
    """``dpsi/dl_i = mu (l_i - 1/l_i) + lmbda ln J / l_i``."""
    lmbda, mu = lame(young, poisson)
    return mu * (stretches - 1.0 / stretches) + lmbda * np.sum(np.log(stretches)) / stretches


# one entry for every name in LAWS; a test compares the two tables
ENERGY = {"neo_hooke": neo_hooke_energy}
PRINCIPAL: dict[str, Principal] = {"neo_hooke": neo_hooke_principal}


def principal(name: str, F: Array, young: float, poisson: float) -> tuple[float, Array]:
    """Energy and first Piola stress (3, 3) at one point by the singular value decomposition of ``F``."""
    R, stretches, Vt = np.linalg.svd(F)
    P = PRINCIPAL[name](stretches, young, poisson)
    return ENERGY[name](stretches, young, poisson), (R * P) @ Vt


def linear_elasticity(young: float, poisson: float) -> Array:
    """Hooke's isotropic tensor ``A4[i, k, j, l]`` acting on displacement gradients, (3, 3, 3, 3)."""
    lmbda, mu = lame(young, poisson)
    d = np.eye(3)
    C = np.zeros((3, 3, 3, 3))
    for i in range(3):
        for k in range(3):
            for j in range(3):
                for m in range(3):
                    C[i, k, j, m] = lmbda * d[i, k] * d[j, m] + mu * (d[i, j] * d[k, m] + d[i, m] * d[k, j])
    return C

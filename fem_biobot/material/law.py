"""What a constitutive law is: energy, first Piola stress and tangent at a point, and nothing else.

A law knows no mesh and keeps no state. Arrays have tensor axes first and point axes last. A law may also offer
`add_second_piola`, the compiled form that the solver prefers; without it the solver converts `stress` and `tangent`.
"""

from __future__ import annotations

from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from fem_biobot.errors import ModelError

Array = NDArray[np.float64]

# the six components of a symmetric tensor in the order in which packed arrays keep them
PAIRS: tuple[tuple[int, int], ...] = ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2))


@runtime_checkable
class Law(Protocol):
    """Energy, stress and tangent of a hyperelastic contribution.

    Each method takes the deformation gradient ``F``, (3, 3, ...) [1], and returns a new array: `energy` (...) [kPa],
    `stress` the first Piola stress ``P``, (3, 3, ...) [kPa], `tangent` ``A4 = dP/dF``, (3, 3, 3, 3, ...) [kPa] with
    ``A4[i, k, j, l] = dP[i, k] / dF[j, l]``. Each refuses ``det F <= 0`` with `ModelError`.
    """

    def energy(self, F: Array) -> Array: ...

    def stress(self, F: Array) -> Array: ...

    def tangent(self, F: Array) -> Array: ...


def volume_ratio(F: Array) -> Array:
    """Determinant of the deformation gradient, refused where a point is inverted.

    Parameters
    ----------
    F
        Deformation gradient, (3, 3, ...) [1].

    Returns
    -------
    Array
        ``det F``, (...) [1], positive everywhere.

    Raises
    ------
    ModelError
        Where any determinant is not positive (or not a number).
    """
    J = np.linalg.det(np.moveaxis(F, (0, 1), (-2, -1)))
    if not np.all(J > 0.0):
        raise ModelError(f"deformation gradient: found det F = {np.min(J):.3g}, expected above 0 at every point")
    return J


def inverse(F: Array) -> Array:
    """Inverse of a 3 by 3 tensor field, (3, 3, ...) [1]."""
    matrices = np.asarray(np.moveaxis(F, (0, 1), (-2, -1)), dtype=np.float64)
    return np.moveaxis(np.linalg.inv(matrices), (-2, -1), (0, 1)).astype(np.float64, copy=False)


def lame(young: float, poisson: float) -> tuple[float, float]:
    """Lame's ``lmbda`` and shear modulus ``mu`` [kPa] from Young's modulus [kPa] and Poisson's ratio [1].

    Refuses a modulus that is not positive and a ratio outside [0, 0.5]; at 0.5 exactly ``lmbda`` is infinite.
    """
    if not (np.isfinite(young) and young > 0.0):
        raise ModelError(f"young: found {young:g} kPa, expected above 0 kPa")
    if not 0.0 <= poisson <= 0.5:
        raise ModelError(f"poisson: found {poisson:g}, expected at least 0 and at most 0.5")
    mu = young / (2.0 * (1.0 + poisson))
    if poisson == 0.5:
        return np.inf, mu
    return young * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson)), mu

"""What a constitutive law is: energy, first Piola stress and tangent at a point, and nothing else.

A law knows no mesh and keeps no state. Arrays have tensor axes first and point axes last. Any object with the three
methods of `Law` is one; it needs no base class and no entry anywhere:

    class SaintVenantKirchhoff:
        def energy(self, F): ...
        def stress(self, F): ...
        def tangent(self, F): ...

    SolidModel(mesh, materials={"gel": SaintVenantKirchhoff()}, supports=[...])

What a law may have besides, and what a solver makes of it:

``add_second_piola(F, elements, S, D, psi)``
    Compiled form, which a solver prefers. ``F`` (3, 3, e, q) is of ALL elements; second Piola stress, material tangent
    ``dS/dE`` and energy are ADDED to ``S`` (6, e, q), ``D`` and ``psi`` (e, q) at `elements`, packed as in `PAIRS`. A
    ``D`` of 21 rows is the upper triangle by rows, one of 0 rows is left out. Without this method `add_law` converts
    ``stress`` and ``tangent``.
``at(elements)``
    For a law with parameters that differ from element to element, given over ALL elements: the law of those elements
    only, which is what ``energy``, ``stress`` and ``tangent`` then take a part of ``F`` with.
``symmetric``
    False for a law without energy, whose tangent lacks major symmetry (tension per current area). Its ``energy``
    refuses and its ``psi`` is left alone. It fills a ``D`` of 36 rows, the whole 6 by 6 matrix ``dS/dE`` by rows, for a
    solver with an unsymmetric matrix, which lets laws with energy fill the same ``D`` through `add_law`. In a ``D`` of
    21 rows it puts the symmetric part: a symmetric solver then has the exact residual with an approximate tangent and
    converges linearly, not quadratically. Absent means True; read it with `is_symmetric`.
``isotropic``
    True says that the law knows no direction, which saves active strain from asking it element by element.
``split()``
    For near incompressibility, see `material.volume`.
"""

from __future__ import annotations

from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from fem_biobot.errors import ModelError

Array = NDArray[np.float64]

# the six components of a symmetric tensor in the order in which packed arrays keep them
PAIRS: tuple[tuple[int, int], ...] = ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2))


class OutsideLawError(ModelError):
    """A point is deformed beyond where the law has an energy (chains pulled out); a solver takes a smaller step.

    Attributes
    ----------
    point
        Number of the worst point among those that the law was asked for, in one row, or None.
    element
        The mesh's element that it lies in, where that is known.
    """

    def __init__(self, message: str, point: int | None = None) -> None:
        super().__init__(message)
        self.point = point
        self.element: int | None = None


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


def is_symmetric(law: object) -> bool:
    """Whether a law has an energy, and so a tangent with major symmetry."""
    return bool(getattr(law, "symmetric", True))


def at_elements(law: Law, elements: np.ndarray) -> Law:
    """The law of some elements only, for a law whose parameters differ from element to element; else the law itself."""
    at = getattr(law, "at", None)
    return law if at is None else at(elements)


def add_law(law: Law, F: Array, elements: np.ndarray, S: Array, D: Array, psi: Array) -> None:
    """Add a law's second Piola stress, tangent and energy at the points of `elements`.

    Parameters
    ----------
    F
        Deformation gradient of all elements, (3, 3, e, q) [1].
    S, D, psi
        Added to; (6, e, q), (0, 21 or 36, e, q) and (e, q) [kPa], see the module's text.

    Notes
    -----
    Uses the law's compiled form where it has one, else converts its first Piola stress and tangent.
    """
    compiled = getattr(law, "add_second_piola", None)
    if compiled is not None and (len(D) != 36 or not is_symmetric(law)):
        compiled(F, elements, S, D, psi)
        return
    if compiled is not None:
        half = np.zeros((21, *D.shape[1:]))
        compiled(F, elements, S, half, psi)
        for a in range(6):
            for b in range(6):
                low, high = min(a, b), max(a, b)
                D[6 * a + b, elements] += half[6 * low - low * (low - 1) // 2 + high - low, elements]
        return
    part, own = F[:, :, elements], at_elements(law, elements)
    g = inverse(part)
    if is_symmetric(law):
        psi[elements] += own.energy(part)
    full = np.einsum("im...,mk...->ik...", g, own.stress(part))
    for a, (i, j) in enumerate(PAIRS):
        S[a, elements] += full[i, j]
    if not len(D):
        return
    A4 = own.tangent(part)
    eye = np.eye(3)[:, :, None, None]
    material = np.einsum("mi...,ikjl...,nj...->mknl...", g, A4 - np.einsum("ij...,kl...->ikjl...", eye, full), g)
    entry = 0
    for a, (i, j) in enumerate(PAIRS):
        for b, (k, m) in enumerate(PAIRS):
            if len(D) == 36:
                D[6 * a + b, elements] += material[i, j, k, m]
            elif b >= a:
                D[entry, elements] += 0.5 * (material[i, j, k, m] + material[k, m, i, j])
                entry += 1

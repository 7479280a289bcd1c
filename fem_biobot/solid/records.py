"""Small frozen records that say how a body is held and loaded, and which states are asked for."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fem_biobot.errors import ModelError

Array = NDArray[np.float64]
Where = str | tuple[float, float, float]
Vector = tuple[float, float, float]

_LETTERS = {"x": 0, "y": 1, "z": 2}


def components(given: str | tuple[int, ...] | list[int]) -> tuple[int, ...]:
    """Component numbers from letters such as ``"xz"`` or from numbers such as ``(0, 2)``."""
    try:
        found = tuple(_LETTERS[c] if isinstance(c, str) else int(c) for c in given)
    except (KeyError, TypeError, ValueError):
        raise ModelError(
            f"components: found {given!r}, expected letters out of 'xyz' or numbers out of 0, 1, 2"
        ) from None
    if not found or len(set(found)) != len(found) or not set(found) <= {0, 1, 2}:
        raise ModelError(f"components: found {given!r}, expected each of 'xyz' at most once and at least one")
    return found


def numbers(given: object, what: str, expected: str = "finite numbers") -> Array:
    """Finite numbers as an array of floats; anything else is refused, also text that reads like a number."""
    try:
        found = np.asarray(given)
    except ValueError:  # rows of different lengths
        raise ModelError(f"{what}: found {given!r}, expected {expected}") from None
    if found.dtype.kind not in "iuf" or not np.all(np.isfinite(found)):
        # an array as text would take many lines
        told = "values that are no finite numbers" if isinstance(given, np.ndarray) else repr(given)
        raise ModelError(f"{what}: found {told}, expected {expected}")
    return found.astype(float)


@dataclass(frozen=True)
class Fix:
    """Prescribed displacement components.

    Parameters
    ----------
    where
        Name of a surface or of a landmark, or the position of a vertex, (3,) [mm].
    components
        Which: letters out of ``"xyz"`` or numbers out of 0, 1, 2.
    value
        Displacement at load factor 1 [mm]: one number for all these components, one for each of them, or a function
        from reference positions (3, k) to displacements (3, k), of which the named components are used.
    axes
        Axes to which the components refer, rows, (3, 3), orthonormal; the global axes by default.
    """

    where: Where
    components: str | tuple[int, ...] = "xyz"
    value: float | tuple[float, ...] | Callable[[Array], Array] = 0.0
    axes: tuple[Vector, Vector, Vector] | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "components", components(self.components))
        if self.axes is not None:
            Q = numbers(self.axes, "axes")
            if Q.shape != (3, 3) or not np.allclose(Q @ Q.T, np.eye(3), rtol=0.0, atol=1e-10):
                raise ModelError("axes: found rows that are not orthonormal, expected three orthonormal vectors")


@dataclass(frozen=True)
class Symmetry:
    """A plane surface that may slide in its own plane only; the normal is taken from the mesh.

    Refuses a surface that is not plane.
    """

    surface: str


@dataclass(frozen=True)
class Traction:
    """Dead traction: force per reference area [kPa], fixed in direction, on a surface.

    `value` is one vector (3,) or a function from reference positions (3, k) to tractions (3, k).
    """

    surface: str
    value: Vector | Callable[[Array], Array]


@dataclass(frozen=True)
class Pressure:
    """Pressure on a part of the boundary [kPa], positive pushing into the body.

    `value` is one number or a function from reference positions (3, k) to pressures (k,). With `follower` it acts on
    the current area against the current normal; else it is a dead load along the reference normal.

    A follower pressure has a potential, and a symmetric tangent, where its surface is closed or its edge held (a
    symmetry plane will do). Where the edge is free the tangent is not symmetric, and the model is solved with the
    unsymmetric factorisation.
    """

    surface: str
    value: float | Callable[[Array], Array]
    follower: bool = True


@dataclass(frozen=True)
class Foundation:
    """Elastic foundation: springs between a part of the boundary and where it was at first.

    The force on the body is minus `normal` [kPa/mm] times the displacement along the reference normal, and minus
    `tangential` [kPa/mm] times that across it, per reference area. A support: the load factor does not scale it.
    """

    surface: str
    normal: float
    tangential: float = 0.0

    def __post_init__(self) -> None:
        for what, given in (("normal", self.normal), ("tangential", self.tangential)):
            found = numbers(given, f"foundation, {what}", "a finite stiffness")
            if found.ndim or found < 0.0:
                raise ModelError(f"foundation, {what}: found {given!r}, expected one stiffness of at least 0 kPa/mm")


@dataclass(frozen=True)
class BodyForce:
    """Dead body force: force per reference volume [mN/mm^3], on one region or on all.

    `value` is one vector (3,) or a function from reference positions (3, k) to forces (3, k).
    """

    value: Vector | Callable[[Array], Array]
    region: str | None = None


Support = Fix | Symmetry | Foundation
Load = Traction | Pressure | BodyForce


@dataclass(frozen=True)
class Step:
    """A state asked for: factors on the loads (with prescribed displacements) and on the active tension."""

    load: float = 1.0
    tension: float = 1.0

    def __post_init__(self) -> None:
        for what, factor in (("load", self.load), ("tension", self.tension)):
            if numbers(factor, f"step, {what}", "a finite factor").ndim:
                raise ModelError(f"step, {what}: found several numbers, expected one factor")
        if self.tension < 0.0:
            raise ModelError(f"step: found tension factor {self.tension:g}, expected at least 0 (muscle pulls)")


def as_step(given: float | Step) -> Step:
    """A plain number scales loads and tension alike."""
    return given if isinstance(given, Step) else Step(given, given)

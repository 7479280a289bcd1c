"""Small frozen records that say how a body is held and loaded, and which states are asked for."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

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
    name
        Name by which `Step.loads` drives the displacement on its own; by default that of the surface or landmark.
    """

    where: Where
    components: str | tuple[int, ...] = "xyz"
    value: float | tuple[float, ...] | Callable[[Array], Array] = 0.0
    axes: tuple[Vector, Vector, Vector] | None = None
    name: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "components", components(self.components))
        if self.axes is not None:
            Q = numbers(self.axes, "axes")
            if Q.shape != (3, 3) or not np.allclose(Q @ Q.T, np.eye(3), rtol=0.0, atol=1e-10):
                raise ModelError("axes: found rows that are not orthonormal, expected three orthonormal vectors")


@dataclass(frozen=True)
class Rotate:
    """Prescribed rotation of a surface about a fixed axis, as of a rigid plate bonded to it.

    Parameters
    ----------
    where
        Name of a surface or of a landmark, or the position of a vertex, (3,) [mm].
    axis, point
        Direction of the axis (any length but zero) and a point on it in the reference body [mm].
    angle
        Rotation at load factor 1 [rad], right-handed about `axis`; of any size, also more than a turn.
    advance
        Displacement along the axis at load factor 1 [mm], the motion of a screw; None leaves the surface free to slide
        along the axis, point by point.
    name
        Name by which `Step.loads` drives it on its own; by default that of the surface or landmark.

    Notes
    -----
    The load factor s scales the angle, not the displacement: ``u = (R(s angle) - I)(X - point) + s advance axis`` with
    the rotation matrix R, so that distances within the surface are kept at every s, and half the factor is half the
    angle. `SolidState.reaction_moment` is the moment that it takes.
    """

    where: Where
    axis: Vector
    point: Vector
    angle: float
    advance: float | None = 0.0
    name: str = ""

    def __post_init__(self) -> None:
        for what, given in (("axis", self.axis), ("point", self.point)):
            if numbers(given, f"rotate, {what}", "a vector of three finite numbers").shape != (3,):
                raise ModelError(f"rotate, {what}: found {given!r}, expected a vector of three finite numbers")
        if not np.any(np.asarray(self.axis)):
            raise ModelError(f"rotate, axis: found {self.axis!r}, expected a direction")
        for what, given in (("angle", self.angle), ("advance", 0.0 if self.advance is None else self.advance)):
            if numbers(given, f"rotate, {what}", "a finite number").ndim:
                raise ModelError(f"rotate, {what}: found {given!r}, expected one number")

    def displacement(self, X: Array, factor: float) -> Array:
        """Displacement of reference positions `X` (3, k) at a load factor, (3, k) [mm]."""
        n = np.asarray(self.axis, dtype=float) / np.linalg.norm(self.axis)
        arm = X - np.asarray(self.point, dtype=float)[:, None]
        across = arm - np.outer(n, n @ arm)
        angle = factor * self.angle
        # 1 - cos from the half angle keeps its digits at small angles
        turned = np.sin(angle) * np.cross(n, arm, axis=0) - 2.0 * np.sin(0.5 * angle) ** 2 * across
        return turned + factor * (self.advance or 0.0) * n[:, None]


@dataclass(frozen=True)
class Symmetry:
    """A plane surface that may slide in its own plane only; the normal is taken from the mesh.

    Refuses a surface that is not plane.
    """

    surface: str


@dataclass(frozen=True)
class Traction:
    """Dead traction: force per reference area [kPa], fixed in direction, on a surface.

    `value` is one vector (3,) or a function from reference positions (3, k) to tractions (3, k). `name` is that by
    which `Step.loads` drives it on its own, by default the surface's.
    """

    surface: str
    value: Vector | Callable[[Array], Array]
    name: str = ""


@dataclass(frozen=True)
class Pressure:
    """Pressure on a part of the boundary [kPa], positive pushing into the body.

    `value` is one number or a function from reference positions (3, k) to pressures (k,). With `follower` it acts on
    the current area against the current normal; else it is a dead load along the reference normal.

    A follower pressure has a potential, and a symmetric tangent, where its surface is closed or its edge held (a
    symmetry plane will do). Where the edge is free the tangent is not symmetric, and the model is solved with the
    unsymmetric factorisation. `name` is that by which `Step.loads` drives it on its own, by default the surface's.
    """

    surface: str
    value: float | Callable[[Array], Array]
    follower: bool = True
    name: str = ""


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

    `value` is one vector (3,) or a function from reference positions (3, k) to forces (3, k). `name` is that by which
    `Step.loads` drives it on its own, by default the region's.
    """

    value: Vector | Callable[[Array], Array]
    region: str | None = None
    name: str = ""


Support = Fix | Rotate | Symmetry | Foundation
Load = Traction | Pressure | BodyForce


def drive_name(record: Fix | Rotate | Load) -> str:
    """Name by which `Step.loads` drives a record: its own, or that of where it acts; empty where that has none."""
    place = record.region if isinstance(record, BodyForce) else getattr(record, "surface", getattr(record, "where", ""))
    return record.name or (place if isinstance(place, str) else "")


@dataclass(frozen=True)
class Step:
    """A state asked for: factors on the loads (with prescribed displacements) and on the active tension.

    Parameters
    ----------
    load, tension
        Factors on all loads and on the tension of all muscles.
    loads
        Factors of some loads or prescribed displacements in place of `load`, by name (see `drive_name`).
    tensions
        Factors of some muscles in place of `tension`, by region.
    time
        Instant for which activations that change with time are asked [s].
    """

    load: float = 1.0
    tension: float = 1.0
    loads: Mapping[str, float] = field(default_factory=dict, hash=False)
    tensions: Mapping[str, float] = field(default_factory=dict, hash=False)
    time: float = 0.0

    def __post_init__(self) -> None:
        for what, factors in (("loads", self.loads), ("tensions", self.tensions)):
            if not isinstance(factors, Mapping):
                raise ModelError(f"step, {what}: found {factors!r}, expected factors by name")
            object.__setattr__(self, what, dict(factors))
        named = [(f"loads[{name!r}]", factor) for name, factor in self.loads.items()]
        tensions = [("tension", self.tension), *((f"tensions[{n!r}]", f) for n, f in self.tensions.items())]
        for what, factor in (("load", self.load), ("time", self.time), *named, *tensions):
            if numbers(factor, f"step, {what}", "a finite factor").ndim:
                raise ModelError(f"step, {what}: found several numbers, expected one factor")
        for what, factor in tensions:
            if factor < 0.0:
                raise ModelError(f"step, {what}: found tension factor {factor:g}, expected at least 0 (muscle pulls)")

    def load_on(self, name: str) -> float:
        """Factor of the load or prescribed displacement of a name."""
        return self.loads.get(name, self.load)

    def tension_in(self, region: str) -> float:
        """Factor of the muscle in a region."""
        return self.tensions.get(region, self.tension)

    def between(self, other: Step, way: float) -> Step:
        """The step at `way` on the straight line to another, 0 here and 1 there; tensions end at zero."""

        def at(a: float, b: float) -> float:
            return a + way * (b - a)

        return Step(
            at(self.load, other.load),
            max(at(self.tension, other.tension), 0.0),
            {name: at(self.load_on(name), other.load_on(name)) for name in {**self.loads, **other.loads}},
            {
                name: max(at(self.tension_in(name), other.tension_in(name)), 0.0)
                for name in {**self.tensions, **other.tensions}
            },
            at(self.time, other.time),
        )

    def told(self) -> str:
        """The factors in words, those of their own and a time only where given."""
        parts = [f"load x{self.load:.4g}", f"tension x{self.tension:.4g}"]
        parts += [f"{name} x{factor:.4g}" for name, factor in (*self.loads.items(), *self.tensions.items())]
        return ", ".join(parts) + (f", time {self.time:.4g} s" if self.time else "")


def as_step(given: float | Mapping[str, float] | Step) -> Step:
    """A plain number scales loads and tension alike; a mapping has the tension factors of regions, under full load."""
    if isinstance(given, Step):
        return given
    return Step(tensions=given) if isinstance(given, Mapping) else Step(given, given)


def load_factor(given: float | Step, name: str) -> float:
    """Factor of a named load at a step, or the number given for all of them."""
    return given.load_on(name) if isinstance(given, Step) else given


def tension_factor(given: float | Step, region: str) -> float:
    """Factor of a region's tension at a step, or the number given for all of them."""
    return given.tension_in(region) if isinstance(given, Step) else given

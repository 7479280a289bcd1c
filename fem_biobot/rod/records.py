"""Small frozen records that describe an assembly of rods, bodies, joints, muscles and loads.

A place is a pair: the name of a rod with the number of one of its nodes (``("beam", -1)`` is the last), or the name of
a body with a point of it in the assembly as drawn (``("foot", (1.0, 0.0, 0.0))``). Records know nothing of each other;
`rod.model` puts them together and refuses what does not fit. Units: mm, mN, kPa, s, kg, uJ.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem_biobot.errors import ModelError
from fem_biobot.rod.activation.curve import MuscleCurve
from fem_biobot.rod.discretisation import Discretisation
from fem_biobot.rod.section import RodMaterial, Section

Array = NDArray[np.float64]
Vector = tuple[float, float, float]
Place = tuple[str, int | Vector]
History = Callable[[float], float]


def _number(what: str, value: Any, low: float = -np.inf, *, open_low: bool = False) -> float:
    """The value as a float; refuses what is not a finite number above (or at) `low`."""
    good = isinstance(value, int | float | np.floating | np.integer) and not isinstance(value, bool)
    if not good or not np.isfinite(value) or value < low or (open_low and value == low):
        limit = "" if low == -np.inf else (f" above {low:g}" if open_low else f" of at least {low:g}")
        raise ModelError(f"{what}: found {value!r}, expected a finite number{limit}")
    return float(value)


def vector(what: str, value: Any) -> Array:
    """The value as three finite numbers, (3,)."""
    try:
        found = np.array(value, dtype=float)
    except (TypeError, ValueError):
        found = np.array([])
    if found.shape != (3,) or not np.isfinite(found).all():
        raise ModelError(f"{what}: found {value!r}, expected three finite numbers")
    return found


def _set(record: object, **values: Any) -> None:
    for name, value in values.items():
        object.__setattr__(record, name, value)


@dataclass(frozen=True, eq=False)
class Rod:
    """A rod, drawn as a chain of nodes; straight or curved, of one section or one for each element.

    Parameters
    ----------
    points
        Positions of its nodes, (n, 3) [mm], n at least 2.
    section, material
        One `Section`, or one for each of the n - 1 elements, and what the rod is made of.
    name
        For places; unique in a model.
    normal
        Direction of the first director, (3,); made perpendicular to the rod and carried along it without twist. By
        default some perpendicular of the first element.
    natural_curvature
        Curvature and twist without load in the material frame, (3,) or (n - 1, 3) [1/mm]. By default the rod is free
        of stress as drawn.
    mass
        Factor on the rod's mass [1], one or one for each element; 0 for a rod without any.
    damping_time
        Kelvin-Voigt time of this rod [s]: resultants gain ``damping_time`` times their rate. By default that of the
        analysis.
    discretisation
        How it becomes elements, see `Discretisation`.
    """

    points: Array
    section: Section | Sequence[Section]
    material: RodMaterial
    name: str = "rod"
    normal: Vector | None = None
    natural_curvature: Any = None
    mass: float | Sequence[float] = 1.0
    damping_time: float | None = None
    discretisation: Discretisation | str = Discretisation.corrected

    def __post_init__(self) -> None:
        points = np.array(self.points, dtype=float)
        if points.ndim != 2 or points.shape[1] != 3 or len(points) < 2 or not np.isfinite(points).all():
            raise ModelError(f"rod {self.name}: found points of shape {points.shape}, expected (n, 3), n >= 2, finite")
        lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
        if lengths.min() <= 1e-12 * max(1.0, np.abs(points).max()):
            raise ModelError(
                f"rod {self.name}: element {int(lengths.argmin())} has zero length, expected distinct nodes"
            )
        sections = (self.section,) * len(lengths) if isinstance(self.section, Section) else tuple(self.section)
        if len(sections) != len(lengths):
            raise ModelError(f"rod {self.name}: found {len(sections)} sections, expected 1 or {len(lengths)}")
        if self.normal is not None:
            vector(f"rod {self.name}: normal", self.normal)
        masses = tuple(self.mass) if isinstance(self.mass, Sequence) else (self.mass,) * len(lengths)
        if len(masses) != len(lengths):
            raise ModelError(f"rod {self.name}: found {len(masses)} factors of mass, expected 1 or {len(lengths)}")
        masses = tuple(_number(f"rod {self.name}: mass", factor, 0.0) for factor in masses)
        if self.damping_time is not None:
            _number(f"rod {self.name}: damping_time", self.damping_time, 0.0)
        points.flags.writeable = False
        made = Discretisation.of(self.discretisation, f"rod {self.name}")
        _set(self, points=points, section=sections, mass=masses, discretisation=made)

    @property
    def masses(self) -> tuple[float, ...]:
        """Factor on the mass of each element."""
        return tuple(self.mass) if isinstance(self.mass, Sequence) else (self.mass,) * (len(self.points) - 1)

    @property
    def sections(self) -> tuple[Section, ...]:
        """One for each element."""
        return (self.section,) if isinstance(self.section, Section) else tuple(self.section)


@dataclass(frozen=True, eq=False)
class Body:
    """A rigid body.

    Parameters
    ----------
    centre
        Its centre of mass as drawn, (3,) [mm].
    mass, inertia
        [kg], and the inertia about the centre in the drawing's axes, (3, 3) or its diagonal (3,) [kg mm^2].
    name
        For places; unique in a model.
    volume
        That a medium buoys up, about the centre [mm^3].
    boxes
        What it looks like as drawn, in files and pictures alone: pairs of the centre and the edges of a box along the
        drawing's axes, (3,) each [mm].
    """

    centre: Vector
    mass: float
    inertia: Any
    name: str = "body"
    volume: float = 0.0
    boxes: Sequence[tuple[Vector, Vector]] = ()

    def __post_init__(self) -> None:
        _number(f"body {self.name}: mass", self.mass, 0.0, open_low=True)
        _number(f"body {self.name}: volume", self.volume, 0.0)
        inertia = np.array(self.inertia, dtype=float)
        inertia = np.diag(inertia) if inertia.shape == (3,) else inertia
        if inertia.shape != (3, 3) or not np.isfinite(inertia).all() or np.linalg.eigvalsh(inertia).min() <= 0.0:
            raise ModelError(f"body {self.name}: found inertia {self.inertia!r}, expected a positive definite one")
        vector(f"body {self.name}: centre", self.centre)
        for centre, edges in self.boxes:
            vector(f"body {self.name}: centre of a box", centre)
            if not vector(f"body {self.name}: edges of a box", edges).min() > 0.0:
                raise ModelError(f"body {self.name}: found a box with edges {edges!r}, expected lengths above 0 mm")
        _set(self, inertia=inertia, boxes=tuple(self.boxes))

    @classmethod
    def box(cls, centre: Vector, size: Vector, density: float, name: str = "body") -> Body:
        """A box with edges along the drawing's axes; `size` (3,) [mm], `density` [kg/mm^3]."""
        a, b, c = (_number(f"body {name}: size", s, 0.0, open_low=True) for s in size)
        mass = _number(f"body {name}: density", density, 0.0, open_low=True) * a * b * c
        inertia = mass / 12.0 * np.array([b * b + c * c, a * a + c * c, a * a + b * b])
        return cls(centre, mass, inertia, name, a * b * c, ((centre, (a, b, c)),))


@dataclass(frozen=True)
class Rigid:
    """Two places move as one, at whatever distance they were drawn: the parts share their unknowns."""

    a: Place
    b: Place


@dataclass(frozen=True)
class Spherical:
    """Two places, drawn at the same point, stay together and turn freely against each other."""

    a: Place
    b: Place


@dataclass(frozen=True)
class Hinge:
    """As `Spherical`, and the parts turn against each other about `axis` (3,) alone."""

    a: Place
    b: Place
    axis: Vector

    def __post_init__(self) -> None:
        if not np.linalg.norm(vector("hinge: axis", self.axis)) > 0.0:
            raise ModelError(f"hinge: found axis {self.axis}, expected a direction")


@dataclass(frozen=True)
class Hold:
    """Translations and rotations that a place cannot make, by letters out of ``"xyz"`` in the drawing's axes.

    With two rotations held the part turns about the third axis freely, however far.

    Parameters
    ----------
    place
        What is held.
    translation, rotation
        Letters of the components held.
    displacement, turn
        In statics, where load factor 1 moves what is held: displacement (3,) [mm] and rotation vector (3,) [rad] of
        any number of turns, from the drawing; of the translations, only the held components count. Dynamics holds
        parts where its start has them.
    """

    place: Place
    translation: str = "xyz"
    rotation: str = "xyz"
    displacement: Vector = (0.0, 0.0, 0.0)
    turn: Vector = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        for what, letters in (("translation", self.translation), ("rotation", self.rotation)):
            if len(set(letters)) != len(letters) or not set(letters) <= set("xyz"):
                raise ModelError(f"hold: found {what} {letters!r}, expected each of 'xyz' at most once")
        if not self.translation and not self.rotation:
            raise ModelError("hold: found neither translation nor rotation, expected something to hold")
        vector("hold: displacement", self.displacement)
        if vector("hold: turn", self.turn).any() and set(self.rotation) != set("xyz"):
            raise ModelError(f"hold: found a turn with rotation {self.rotation!r}, expected all of 'xyz' to be held")

    @property
    def moves(self) -> bool:
        """Whether loading moves what is held."""
        return any(self.displacement) or any(self.turn)


@dataclass(frozen=True)
class PointLoad:
    """Force [mN] and moment [uJ] on a place, dead or, with `following`, turning with it.

    `history` is a factor over time [1], 1 by default.
    """

    place: Place
    force: Vector = (0.0, 0.0, 0.0)
    moment: Vector = (0.0, 0.0, 0.0)
    following: bool = False
    history: History | None = None

    def __post_init__(self) -> None:
        vector("point load: force", self.force)
        vector("point load: moment", self.moment)


@dataclass(frozen=True)
class DistributedLoad:
    """Force per reference length [mN/mm] and moment per reference length [mN] along a whole rod, dead or following."""

    rod: str
    force: Vector = (0.0, 0.0, 0.0)
    moment: Vector = (0.0, 0.0, 0.0)
    following: bool = False
    history: History | None = None

    def __post_init__(self) -> None:
        vector("distributed load: force", self.force)
        vector("distributed load: moment", self.moment)


@dataclass(frozen=True)
class Gravity:
    """Weight of every part: `acceleration` (3,) [mm/s^2], less the buoyancy in a medium of the given density."""

    acceleration: Vector = (0.0, 0.0, -9810.0)
    medium_density: float = 0.0

    def __post_init__(self) -> None:
        vector("gravity: acceleration", self.acceleration)
        _number("gravity: medium_density", self.medium_density, 0.0)


@dataclass(frozen=True)
class Spring:
    """Linear spring along the line between two places, or between a place and a fixed point.

    `stiffness` [mN/mm]; `rest_length` [mm], by default as drawn; `damping` [mN s/mm] along the line.
    """

    a: Place
    b: Place | Vector
    stiffness: float
    rest_length: float | None = None
    damping: float = 0.0

    def __post_init__(self) -> None:
        _number("spring: stiffness", self.stiffness, 0.0)
        _number("spring: damping", self.damping, 0.0)
        if self.rest_length is not None:
            _number("spring: rest_length", self.rest_length, 0.0)


class Resistance(StrEnum):
    """How a muscle member resists shortening, as nominal stress of the stretch s with Young's modulus E.

    eq2
        ``E (s - 1) / s``: Eq. 2 of the paper with its strain eps = 1 - s. Grows without bound as s goes to 0.
    neo_hooke
        ``E / 3 (s - s^-2)``: a strip of an incompressible neo-Hookean material. The same slope E at s = 1, stiffer
        in shortening by a factor 1.02 at s = 0.8 and 1.09 at s = 0.6.
    """

    eq2 = "eq2"
    neo_hooke = "neo_hooke"


@dataclass(frozen=True)
class Muscle:
    """A muscle that pulls along the line between two places (Eq. 2 of the paper).

    Its tensile force is ``area * (gamma * sin(theta) * T + resistance(stretch) + viscosity * rate of stretch)`` with
    the tension ``T(t) = passive + drive(t) * active * force_length(stretch) * force_velocity(rate of stretch)``.

    Parameters
    ----------
    a, b
        Its ends.
    area
        Section as moulded [mm^2].
    young
        Modulus of its passive resistance [kPa].
    passive, active
        Standing tension, and what full drive adds [kPa].
    gamma, theta
        Viable fraction [1] and the paper's angle [rad].
    resistance
        See `Resistance`.
    rest_length
        Length without passive stress [mm]; as drawn by default.
    viscosity
        Nominal stress per rate of stretch [kPa s].
    mass
        [kg], half at each end.
    name
        For outputs; unique in a model.
    force_length, force_velocity
        Factors on the stimulated part alone, `MuscleCurve`: of the stretch, and of its rate [1/s]; 1 by default.
    """

    a: Place
    b: Place
    area: float
    young: float
    passive: float = 0.0
    active: float = 0.0
    gamma: float = 1.0
    theta: float = np.pi / 2
    resistance: Resistance = Resistance.eq2
    rest_length: float | None = None
    viscosity: float = 0.0
    mass: float = 0.0
    name: str = "muscle"
    force_length: MuscleCurve | None = None
    force_velocity: MuscleCurve | None = None

    def isometric(self, drive: float) -> float:
        """Tensile force of its tension at a drive, with factors of length and velocity of 1 [mN]."""
        return float(self.area * self.gamma * np.sin(self.theta) * (self.passive + drive * self.active))

    def __post_init__(self) -> None:
        _number(f"muscle {self.name}: area", self.area, 0.0, open_low=True)
        for key in ("young", "passive", "active", "gamma", "viscosity", "mass"):
            _number(f"muscle {self.name}: {key}", getattr(self, key), 0.0)
        if self.gamma > 1.0:
            raise ModelError(f"muscle {self.name}: gamma: found {self.gamma:g}, expected at most 1")
        if not 0.0 <= _number(f"muscle {self.name}: theta", self.theta) <= np.pi:
            raise ModelError(f"muscle {self.name}: theta: found {self.theta:g} rad, expected between 0 and pi")
        if self.rest_length is not None:
            _number(f"muscle {self.name}: rest_length", self.rest_length, 0.0, open_low=True)
        for key in ("force_length", "force_velocity"):
            if not isinstance(getattr(self, key), MuscleCurve | None):
                raise ModelError(f"muscle {self.name}: {key}: found {getattr(self, key)!r}, expected a MuscleCurve")
        try:
            _set(self, resistance=Resistance(self.resistance))
        except ValueError:
            known = ", ".join(Resistance)
            raise ModelError(
                f"muscle {self.name}: resistance: found {self.resistance!r}, expected one of: {known}"
            ) from None

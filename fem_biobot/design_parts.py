"""The records of which a design is made, and the kinds of value in them: quantities with unit and range, and choices.

Every key of a design file stands here once, with its dimension, range, default and a line of description that ends with
the coherent unit.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import BaseModel, Field

from fem_biobot.units import format_quantity


@dataclass(frozen=True)
class Quantity:
    """Coherent unit of a field, the interval it lies in, and why where that is not plain."""

    unit: str
    low: float = -math.inf
    high: float = math.inf
    low_open: bool = False
    note: str = ""

    def allows(self, value: float) -> bool:
        """Whether the value is finite and inside."""
        above = value > self.low if self.low_open else value >= self.low
        return math.isfinite(value) and above and value <= self.high

    def interval(self) -> str:
        """The interval in words, such as "above 0 mm"."""
        low, high = (format_quantity(v, self.unit) if math.isfinite(v) else "" for v in (self.low, self.high))
        if low and low == high:
            return low
        if low and high:
            return f"above {low} and at most {high}" if self.low_open else f"between {low} and {high}"
        if low:
            return f"above {low}" if self.low_open else f"{low} or more"
        return "a finite value"


PositiveLength = Annotated[float, Quantity("mm", 0.0, low_open=True)]
# Zero where the kind of machine or the layout has no such part; `Design` asks for it where there is one.
PartLength = Annotated[float, Quantity("mm", 0.0)]
Coordinate = Annotated[float, Quantity("mm")]
Angle = Annotated[float, Quantity("rad", 0.0, math.pi)]
Modulus = Annotated[float, Quantity("kPa", 0.0, low_open=True)]
Tension = Annotated[float, Quantity("kPa", 0.0)]
Density = Annotated[float, Quantity("kg/mm^3", 0.0)]
OptionalViscosity = Annotated[float | None, Quantity("kPa s", 0.0)]
Force = Annotated[float, Quantity("mN")]
Frequency = Annotated[float, Quantity("Hz", 0.0, low_open=True)]
PositiveTime = Annotated[float, Quantity("s", 0.0, low_open=True)]
NonNegativeTime = Annotated[float, Quantity("s", 0.0)]
Fraction = Annotated[float, Quantity("1", 0.0, 1.0)]
Coefficient = Annotated[float, Quantity("1", 0.0)]
Poisson = Annotated[
    float,
    Quantity("1", 0.0, 0.5),
]
Spread = Annotated[float, Quantity("rad", 0.0, 0.0, note="dispersion of the fibres is not modelled yet")]

Kind = Literal["bot", "strip", "cantilever"]
Law = Literal["neo_hooke"]
Layout = Literal["junction", "ring"]
Reference = Literal["as_moulded", "remodelled"]
Convention = Literal["nominal"]
Waveform = Literal["abs_sine", "constant"]
Immersion = Literal["air", "submerged"]
Element = Literal["P2", "P2-P1"]


class Record(BaseModel, frozen=True, extra="forbid", strict=True):
    """Frozen, refuses unknown names and wrong types."""


class Material(Record, frozen=True):
    """Passive material."""

    law: Law = Field(default="neo_hooke", description="Constitutive law")
    young: Modulus = Field(description="Young's modulus at small strain [kPa]")
    poisson: Poisson = Field(description="Poisson's ratio at small strain [1]")
    density: Density = Field(description="Mass per reference volume [kg/mm^3]")


class Skeleton(Record, frozen=True):
    """Hydrogel beam with pillars at its ends."""

    beam_length: PositiveLength = Field(description="Whole length of the beam along x, pillars included [mm]")
    beam_width: PositiveLength = Field(description="Width of the beam along y [mm]")
    beam_thickness: PositiveLength = Field(description="Thickness of the beam along z [mm]")
    pillar_count: int = Field(default=2, description="Number of pillars, equally spaced from end to end [1]")
    pillar_length: PartLength = Field(default=0.0, description="Extent of a pillar along x [mm]")
    pillar_width: PartLength = Field(default=0.0, description="Extent of a pillar along y [mm]")
    short_pillar_height: PartLength = Field(
        default=0.0, description="From the beam axis to the short pillar's sole [mm]"
    )
    long_pillar_height: PartLength = Field(default=0.0, description="From the beam axis to the long pillar's sole [mm]")
    fillet_radius: PartLength = Field(default=0.0, description="Radius where a pillar's inner face meets the beam [mm]")
    material: Material = Field(description="Hydrogel")


class Muscle(Record, frozen=True):
    """Muscle tissue, its fibres and its tension."""

    layout: Layout = Field(
        default="junction",
        description="junction: rings joined by a thin strip between the pillars; ring: one loop around both",
    )
    junction_length: PartLength = Field(
        default=0.0, description="Length of a strip along x; a bot's follows from its span [mm]"
    )
    junction_width: PartLength = Field(default=0.0, description="Width of the junction along y [mm]")
    junction_thickness: PartLength = Field(default=0.0, description="Thickness of the junction along z [mm]")
    junction_height: Coordinate = Field(description="z of the muscle's mid-plane above the longest pillar's sole [mm]")
    ring_thickness: PartLength = Field(default=0.0, description="In-plane thickness of the ring around a pillar [mm]")
    ring_height: PartLength = Field(default=0.0, description="Extent of the ring along z [mm]")
    ring_offset: Coordinate = Field(default=0.0, description="z of the ring's mid-plane minus the junction's [mm]")
    reference: Reference = Field(
        default="as_moulded",
        description="as_moulded: stress-free at pillar spacing; remodelled: stress-free in the passive shape",
    )
    theta: Angle = Field(description="Angle from the lateral axis to the fibre; 90 deg is along the machine [rad]")
    spread: Spread = Field(default=0.0, description="Standard deviation of the fibre angle; only 0 deg so far [rad]")
    gamma: Fraction = Field(default=1.0, description="Viable fraction; scales the passive and the active tension [1]")
    passive_tension: Tension = Field(description="Standing tension of the compacted tissue along the fibre [kPa]")
    active_tension: Tension = Field(description="Tension that stimulation adds at full drive [kPa]")
    convention: Convention = Field(
        default="nominal", description="nominal: force per reference area, psi = T (stretch - 1)"
    )
    material: Material = Field(description="Tissue without its tension")


class Drive(Record, frozen=True):
    """Stimulation over time."""

    waveform: Waveform = Field(
        default="abs_sine", description="abs_sine: amplitude |sin(pi f t)|; constant: the amplitude at all times"
    )
    frequency: Frequency = Field(default=2.0, description="Strokes per second [Hz]")
    duration: PositiveTime = Field(default=5.0, description="Stimulated time [s]")
    amplitude: Fraction = Field(default=1.0, description="Largest drive; 1 adds the whole active tension [1]")


class Ground(Record, frozen=True):
    """Surface and surroundings."""

    static_friction: Coefficient = Field(default=0.42, description="Coulomb coefficient of a sticking foot [1]")
    kinetic_friction: Coefficient = Field(default=0.3, description="Coulomb coefficient of a sliding foot [1]")
    immersion: Immersion = Field(default="air", description="submerged: buoyancy reduces the weight; air: it does not")
    medium_density: Density = Field(default=1e-6, description="Density of the medium when submerged [kg/mm^3]")
    viscosity: OptionalViscosity = Field(
        default=None, description="Viscosity of the medium when submerged, for drag; none if left out [kPa s]"
    )


class MeshSettings(Record, frozen=True):
    """How the body is divided."""

    size: PositiveLength = Field(description="Edge length asked of the mesh generator away from refinement [mm]")
    element: Element = Field(
        default="P2",
        description="P2: quadratic tetrahedra, displacement only; P2-P1: with a linear pressure, for ratios up to 0.5",
    )


class Numerics(Record, frozen=True):
    """Settings of the solvers."""

    step: PositiveTime = Field(default=1e-3, description="Time step of the dynamics [s]")
    damping_time: NonNegativeTime = Field(
        default=1e-4, description="Kelvin-Voigt time of gel and tissue: stress per rate over stress per strain [s]"
    )
    tolerance: Annotated[float, Quantity("1", 1e-13, 1e-3)] = Field(
        default=1e-9, description="Residual relative to the force scale at which an equilibrium is accepted [1]"
    )


class Load(Record, frozen=True):
    """Load of a cantilever."""

    tip_force: Force = Field(description="Force along z, spread over the tip face [mN]")

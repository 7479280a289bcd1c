"""The kinds of value that a design's fields hold: quantities with their unit and range, and the choices that exist."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Literal

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
Force = Annotated[float, Quantity("mN")]
Frequency = Annotated[float, Quantity("Hz", 0.0, low_open=True)]
PositiveTime = Annotated[float, Quantity("s", 0.0, low_open=True)]
NonNegativeTime = Annotated[float, Quantity("s", 0.0)]
Fraction = Annotated[float, Quantity("1", 0.0, 1.0)]
Coefficient = Annotated[float, Quantity("1", 0.0)]
Poisson = Annotated[
    float,
    Quantity("1", 0.0, 0.499, note="nearer to 0.5 the displacement element locks; that needs the mixed element"),
]
Spread = Annotated[float, Quantity("rad", 0.0, 0.0, note="dispersion of the fibres is not modelled yet")]

Kind = Literal["bot", "strip", "cantilever"]
Law = Literal["neo_hooke"]
Layout = Literal["junction", "ring"]
Reference = Literal["as_moulded", "remodelled"]
Convention = Literal["nominal"]
Waveform = Literal["abs_sine", "constant"]
Immersion = Literal["air", "submerged"]
Element = Literal["P2"]

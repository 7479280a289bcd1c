"""The kinds of value in a design file: quantities with unit and range, and choices.

What a choice brings along, such as the parameters of each law, stands here, too.
"""

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
OptionalCoordinate = Annotated[float | None, Quantity("mm")]
Angle = Annotated[float, Quantity("rad", 0.0, math.pi)]
SignedAngle = Annotated[float, Quantity("rad", -math.pi, math.pi)]
Modulus = Annotated[float, Quantity("kPa", 0.0, low_open=True)]
Tension = Annotated[float, Quantity("kPa", 0.0)]
Density = Annotated[float, Quantity("kg/mm^3", 0.0)]
OptionalViscosity = Annotated[float | None, Quantity("kPa s", 0.0)]
Force = Annotated[float, Quantity("mN")]
Frequency = Annotated[float, Quantity("Hz", 0.0, low_open=True)]
Rate = Annotated[float, Quantity("1/s", 0.0, low_open=True)]
Eccentric = Annotated[float, Quantity("1", 1.0, low_open=True)]
PositiveTime = Annotated[float, Quantity("s", 0.0, low_open=True)]
OptionalTime = Annotated[float | None, Quantity("s", 0.0, low_open=True)]
OptionalFrequency = Annotated[float | None, Quantity("Hz", 0.0, low_open=True)]
Gain = Annotated[float, Quantity("1", 0.0, low_open=True)]
NonNegativeTime = Annotated[float, Quantity("s", 0.0)]
Fraction = Annotated[float, Quantity("1", 0.0, 1.0)]
Coefficient = Annotated[float, Quantity("1", 0.0)]
Concentration = Annotated[float, Quantity("mM", 0.0)]
PositiveConcentration = Annotated[float, Quantity("mM", 0.0, low_open=True)]
Consumption = Annotated[float, Quantity("mM/s", 0.0)]
Diffusivity = Annotated[float, Quantity("mm^2/s", 0.0, low_open=True)]
OptionalDiffusivity = Annotated[float | None, Quantity("mm^2/s", 0.0, low_open=True)]
OptionalTransfer = Annotated[float | None, Quantity("mm/s", 0.0, low_open=True)]
Poisson = Annotated[
    float,
    Quantity("1", 0.0, 0.5),
]
Spread = Annotated[float, Quantity("rad", 0.0, math.radians(51.5), note="fibres without preference have 51.96 deg")]
# a law's own parameter, left to the law's default where it is absent
OptionalModulus = Annotated[float | None, Quantity("kPa", 0.0)]
SignedModulus = Annotated[float | None, Quantity("kPa")]
OptionalNumber = Annotated[float | None, Quantity("1", 0.0)]
OptionalPositive = Annotated[float | None, Quantity("1", 0.0, low_open=True)]
OptionalShare = Annotated[float | None, Quantity("1", 0.0, 1.0)]
OptionalThird = Annotated[float | None, Quantity("1", 0.0, 1.0 / 3.0)]

OptionalText = str | None
# keys that may name a file, and the words that do not
FILE_KEYS: dict[str, tuple[str, ...]] = {
    "muscle.fibres": ("smooth", "piecewise"),
    "muscle.orientation": (),
    "muscle.activation.table": ("",),
    "muscle.activation.image": ("",),
}

Kind = Literal["bot", "strip", "cantilever", "walker"]
Law = Literal[
    "neo_hooke",
    "neo_hooke_isochoric",
    "mooney_rivlin",
    "yeoh",
    "gent",
    "guccione",
    "holzapfel_ogden",
    "blemker",
]
Layout = Literal["junction", "ring"]
Grading = Literal["even", "closing", "edges"]
Reference = Literal["as_moulded", "remodelled"]
Attachment = Literal["bonded", "contact"]
OptionalCoefficient = Annotated[float | None, Quantity("1", 0.0)]
GammaScales = Literal["both", "active"]
Convention = Literal["nominal", "second_piola", "kirchhoff", "cauchy", "active_strain"]
ForceLength = Literal["none", "blemker_2005", "gordon_1966"]
SpreadKind = Literal["planar", "planar_von_mises", "solid"]
Waveform = Literal["abs_sine", "constant", "pulse", "rc_biphasic", "twitch"]
AmplitudeBy = Literal["given", "paper_2018", "drennan_2025"]
Training = Literal["none", "ito_2014", "kim_2019"]
Fatigue = Literal["given", "mouse_fast_2009", "mouse_slow_2009"]
OxygenUse = Literal["field", "section", "none"]
Seeding = Literal["myotubes", "myoblasts"]
GelFace = Literal["sealed", "permeable"]
Immersion = Literal["air", "submerged"]
Element = Literal["P2", "P2-P1"]
LinearSystems = Literal["auto", "direct", "iterative"]


OdditySet = Literal["as_published", "corrected"]
WalkerStart = Literal["standing", "published"]
Switch = Literal["as_set", "yes", "no"]
# the parameters of each law besides the two moduli, and the laws that take the muscle's fibres
LAW_PARAMETERS: dict[str, tuple[str, ...]] = {
    "neo_hooke": (),
    "neo_hooke_isochoric": (),
    "mooney_rivlin": ("second_share",),
    "yeoh": ("c2", "c3"),
    "gent": ("chain_limit",),
    "guccione": ("exponent_fibre", "exponent_across", "exponent_shear"),
    "holzapfel_ogden": ("fibre_modulus", "fibre_exponent", "fibre_dispersion"),
    "blemker": ("ground", "fibre_peak", "fibre_onset", "fibre_exponent", "optimal_stretch", "straight_stretch"),
}
# parameters that waveforms cannot do without
DRIVE_NEEDS: dict[str, tuple[str, ...]] = {"pulse": ("pulse_width",), "rc_biphasic": ("pulse_width", "rc_time")}
FIBRE_LAWS = ("guccione", "holzapfel_ogden", "blemker")

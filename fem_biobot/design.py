"""The description of a machine: frozen records of floats in mm, mN, kPa, s, kg, rad, checked when put together.

`design_parts` holds the records of which a design is made. They check types and names; `Design` checks ranges and how
the parts fit, so that every message carries the full key. `keys` lists what exists, for the reader, the writer and the
JSON schema in `config`.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any, Literal, Self, get_args, get_origin

from pydantic import Field, ModelWrapValidatorHandler, ValidationError, model_validator
from pydantic.fields import FieldInfo

from fem_biobot.design_checks import check_fit
from fem_biobot.design_kinds import Kind, Quantity
from fem_biobot.design_parts import Drive, Ground, Load, MeshSettings, Muscle, Numerics, Record, Skeleton, Walker
from fem_biobot.design_tissue import completed, without_following
from fem_biobot.errors import DesignError
from fem_biobot.units import expected_text, format_quantity, one_line, shown

Point = tuple[float, float, float]


class Design(Record, frozen=True):
    """One machine, complete and consistent.

    Frame: x from the short to the long pillar with 0 at mid-span, y lateral with 0 at mid-width, z up with 0 at the
    sole of the longest pillar. A cantilever runs from x = 0 (clamp) to its length with its axis at z = 0; a strip is
    centred on x = y = 0. Floats are in mm, mN, kPa, s, kg, rad.

    Raises
    ------
    DesignError
        An unknown or missing key, a value out of its range, or parts that do not fit together; one line.
    """

    name: str = Field(default="unnamed", description="Name for titles; not part of the digest")
    description: str = Field(default="", description="One line about the design; not part of the digest")
    kind: Kind = Field(
        description="bot: skeleton and muscle; strip: muscle alone; cantilever: beam alone; walker: published rods"
    )
    skeleton: Skeleton | None = Field(default=None, description="Hydrogel beam and pillars")
    muscle: Muscle | None = Field(default=None, description="Muscle tissue")
    drive: Drive = Field(default_factory=Drive, description="Stimulation")
    ground: Ground = Field(default_factory=Ground, description="Surface and surroundings")
    mesh: MeshSettings = Field(default_factory=lambda: MeshSettings(size=1.0), description="Mesh")
    numerics: Numerics = Field(default_factory=Numerics, description="Solver settings")
    load: Load | None = Field(default=None, description="Load of a cantilever")
    walker: Walker | None = Field(default=None, description="The walker of the published rod code")

    @model_validator(mode="wrap")
    @classmethod
    def _checked(cls, data: Any, handler: ModelWrapValidatorHandler[Self]) -> Self:
        try:
            design = handler(completed(data))
        except ValidationError as error:
            raise DesignError(_complaint(error)) from None
        _check_ranges(design)
        check_fit(design)
        return design

    def with_values(self, values: Mapping[str, Any]) -> Design:
        """Checked copy with other values, given by full key in coherent units: ``{"muscle.theta": 1.2}``."""
        data = self.model_dump(exclude_unset=True)
        if self.value("muscle.tissue") is not None or any(name.startswith("muscle.tissue.") for name in values):
            data["muscle"] = without_following(data["muscle"])
        for name, value in values.items():
            if name not in keys():
                raise DesignError(unknown_key(name))
            *sections, last = name.split(".")
            inner = data
            for section in sections:
                if inner.get(section) is None:
                    inner[section] = {}
                inner = inner[section]
            inner[last] = value
        return Design.model_validate(data)

    def value(self, name: str) -> Any:
        """Value of a full key such as "muscle.theta", in coherent units; None where its section is absent."""
        found: Any = self
        for part in name.split("."):
            found = getattr(found, part) if found is not None else None
        return found

    def _skeleton(self, what: str) -> Skeleton:
        if self.skeleton is None:
            raise DesignError(f"skeleton: found none (kind {self.kind}), expected one for the {what}")
        return self.skeleton

    def _muscle(self, what: str) -> Muscle:
        if self.muscle is None:
            raise DesignError(f"muscle: found none (kind {self.kind}), expected one for the {what}")
        return self.muscle

    @property
    def span(self) -> float:
        """Flexible span of the beam, or the length of a strip or cantilever [mm]."""
        if self.kind == "strip":
            return self._muscle("span").junction_length
        skeleton = self._skeleton("span")
        return skeleton.beam_length - (2 * skeleton.pillar_length if self.kind == "bot" else 0.0)

    @property
    def beam_axis_height(self) -> float:
        """z of the beam's axis [mm]."""
        skeleton = self._skeleton("beam axis")
        return max(skeleton.short_pillar_height, skeleton.long_pillar_height)

    @property
    def moment_arm(self) -> float:
        """Distance of the muscle's mid-plane from the beam axis [mm]."""
        return self.beam_axis_height - self._muscle("moment arm").junction_height

    @property
    def junction_section(self) -> float:
        """Area of the muscle between the pillars in the plane x = 0: the junction's, or both strands' [mm^2]."""
        muscle = self._muscle("junction section")
        if muscle.layout == "ring":
            return 2.0 * muscle.ring_thickness * muscle.ring_height
        return muscle.junction_width * muscle.junction_thickness

    @property
    def second_moment(self) -> float:
        """Second moment of area of the beam's section for bending in the x-z plane [mm^4]."""
        skeleton = self._skeleton("second moment")
        return skeleton.beam_width * skeleton.beam_thickness**3 / 12.0

    @property
    def pillars(self) -> tuple[tuple[float, float], ...]:
        """Centre x and height below the beam axis of each pillar, from the short to the long one [mm]."""
        if self.kind != "bot":
            return ()
        skeleton = self._skeleton("pillars")
        reach = (skeleton.beam_length - skeleton.pillar_length) / 2
        low, high = skeleton.short_pillar_height, skeleton.long_pillar_height
        fractions = [i / (skeleton.pillar_count - 1) for i in range(skeleton.pillar_count)]
        return tuple((reach * (2 * s - 1), low + s * (high - low)) for s in fractions)

    @property
    def bay(self) -> float:
        """Clear distance between neighbouring pillars [mm]; with two pillars the span."""
        skeleton = self._skeleton("bay")
        return (skeleton.beam_length - skeleton.pillar_count * skeleton.pillar_length) / (skeleton.pillar_count - 1)

    def landmarks(self) -> dict[str, Point]:
        """Named points that every mesh of this design has as vertices [mm]."""
        if self.kind == "strip":
            muscle = self._muscle("landmarks")
            half, z = muscle.junction_length / 2, muscle.junction_height
            return {"end_minus_centre": (-half, 0.0, z), "end_plus_centre": (half, 0.0, z), "mid": (0.0, 0.0, z)}
        skeleton = self._skeleton("landmarks")
        z = self.beam_axis_height
        if self.kind == "cantilever":
            return {"clamp_centre": (0.0, 0.0, z), "tip_centre": (skeleton.beam_length, 0.0, z)}
        half, lower, side = self.span / 2, z - skeleton.beam_thickness / 2, skeleton.beam_width / 2
        # the middle of the fillet's arc lies this far inside the geometric corner, along x and along z
        inset = skeleton.fillet_radius * (1.0 - math.sqrt(0.5))
        (x_short, short), (x_long, long) = self.pillars[0], self.pillars[-1]
        return {
            "span_short": (-half, 0.0, z),
            "span_long": (half, 0.0, z),
            "span_mid": (0.0, 0.0, z),
            "corner_short": (-half + inset, 0.0, lower - inset),
            "corner_long": (half - inset, 0.0, lower - inset),
            "edge_short": (-half, side, lower),
            "edge_long": (half, side, lower),
            "foot_short_centre": (x_short, 0.0, z - short),
            "foot_long_centre": (x_long, 0.0, z - long),
        }

    def tension(self, drive: float) -> float:
        """Nominal tension along the fibre at a drive between 0 (passive) and 1 [kPa].

        Gamma scales both parts, or the active one alone where the standing tension is taken as that of all tissue.
        """
        muscle = self._muscle("tension")
        standing = 1.0 if muscle.gamma_scales == "active" else muscle.gamma
        return standing * muscle.passive_tension + muscle.gamma * drive * muscle.active_tension


@dataclass(frozen=True)
class Key:
    """What is known of one key of a design file."""

    name: str
    field: FieldInfo
    quantity: Quantity | None
    choices: tuple[str, ...]

    @property
    def expected(self) -> str:
        """What a value of this key looks like, for messages."""
        if self.quantity is not None:
            return expected_text(self.quantity.unit)
        if self.choices:
            return "one of: " + ", ".join(self.choices)
        return "a whole number" if self.field.annotation is int else "a text"


def section_type(field: FieldInfo) -> type[Record] | None:
    """Record that a field holds, also when it may be absent; None for a value."""
    candidates = (field.annotation, *get_args(field.annotation))
    return next((c for c in candidates if isinstance(c, type) and issubclass(c, Record)), None)


@cache
def keys() -> Mapping[str, Key]:
    """Every key of a design by its full name, in the order in which they are written."""
    return dict(_walk(Design, ""))


@cache
def sections() -> tuple[str, ...]:
    """Full names of all sections."""
    return tuple(dict.fromkeys(name.rpartition(".")[0] for name in keys() if "." in name))


def _walk(record: type[Record], prefix: str) -> list[tuple[str, Key]]:
    found: list[tuple[str, Key]] = []
    for name, field in record.model_fields.items():
        full = prefix + name
        inner = section_type(field)
        if inner is not None:
            found += _walk(inner, full + ".")
            continue
        quantity = next((m for m in field.metadata if isinstance(m, Quantity)), None)
        choices = get_args(field.annotation) if get_origin(field.annotation) is Literal else ()
        found.append((full, Key(full, field, quantity, choices)))
    return found


def first_key(section: str) -> str:
    """Full name of the first key of a section, as an example."""
    return next(name for name in keys() if name.startswith(section + "."))


def unknown_key(name: str, what: str = "key") -> str:
    """Message for a key or section that does not exist, with the nearest that does."""
    if name in sections():
        return f"{name}: found a single value, expected one of its keys, such as {first_key(name)}"
    candidates: list[str] = [*keys(), *sections()]
    section, _, last = name.rpartition(".")
    siblings = [k for k in candidates if k.rpartition(".")[0] == section]
    near = difflib.get_close_matches(name, siblings, 1, 0.75) if last else []
    if not near:
        # the right name in the wrong section, inner sections of the one that was written first
        elsewhere = sorted(candidates, key=lambda k: not k.startswith(section + "."))
        lasts = [k.rpartition(".")[2] for k in elsewhere]
        near = [elsewhere[lasts.index(m)] for m in difflib.get_close_matches(last, lasts, 1, 0.8)]
    written = one_line(name)
    if near:
        return f"{written}: unknown {what}; did you mean {near[0]}?"
    known = ", ".join(k.rpartition(".")[2] for k in siblings) or ", ".join(sections())
    return f"{written}: unknown {what}, expected one of: {known}"


def _complaint(error: ValidationError) -> str:
    """First thing that pydantic refused, in this package's words."""
    first = error.errors()[0]
    name = ".".join(str(part) for part in first["loc"])
    if first["type"] == "extra_forbidden":
        return unknown_key(name)
    key = keys().get(name)
    expected = key.expected if key else "a section"
    if first["type"] == "missing":
        return f"{name}: missing, expected {expected}"
    return f"{name}: found {shown(first['input'])}, expected {expected}"


def _check_ranges(design: Design) -> None:
    for name, key in keys().items():
        value = design.value(name)
        if value is None or key.quantity is None or key.quantity.allows(value):
            continue
        # an angle that was not read from degrees would show sixteen of its digits
        digits = 12 if key.quantity.unit == "rad" else None
        found = format_quantity(value, key.quantity.unit, digits=digits) if math.isfinite(value) else str(value)
        note = f" ({key.quantity.note})" if key.quantity.note and value > key.quantity.high else ""
        raise DesignError(f"{name}: found {found}, expected {key.quantity.interval()}{note}")

"""What the options of a command say, and how their texts are read: sizes, names of regions, walks.

Knows nothing of how arguments are parsed, and carries nothing out.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from fem_biobot.errors import DesignError

if TYPE_CHECKING:
    from fem_biobot.design import Design
    from fem_biobot.mesh.body import BodyMesh
    from fem_biobot.study.walking import WalkPlan

_BARE_NUMBER = re.compile(r"\s*[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?\s*")


@dataclass(frozen=True)
class Order:
    """What the options of a command say."""

    design: str
    out: Path | None = None
    size: str | None = None
    mesh_file: Path | None = None
    rename: Sequence[str] = ()
    sets: Sequence[str] = ()
    quiet: bool = False
    json: bool = False
    force: bool = False
    resume: bool = False
    walks: bool = True


@dataclass(frozen=True)
class WalkOrder:
    """What the options of `walk` say beside an `Order`."""

    frequencies: Sequence[str] = ()
    duration: str | None = None
    amplitude: str | None = None
    model: str = "rod"
    stroke_from: str = "rod"


@dataclass(frozen=True)
class VerifyOrder:
    """What the options of `verify` say."""

    cases: Sequence[str] = ()
    out: Path | None = None
    quiet: bool = False
    json: bool = False
    debug: bool = False


def given_mesh(order: Order, design: Design) -> BodyMesh | None:
    """The mesh file of an order, read and checked before anything is written; None where the mesh is generated."""
    from fem_biobot.mesh.files import read_mesh

    names = region_names(order.rename)
    return None if order.mesh_file is None else read_mesh(order.mesh_file, names or None, design=design)


def mesh_size(text: str | None) -> float | None:
    """Mesh size of the option [mm]; a bare number is in mm, as the option's help says."""
    from fem_biobot.design import keys
    from fem_biobot.units import shown

    if text is None:
        return None
    size = length(text, "--size")
    allowed = keys()["mesh.size"].quantity
    if allowed is not None and not allowed.allows(size):
        raise DesignError(f"--size: found {shown(text)}, expected {allowed.interval()}")
    return size


def length(text: str, option: str) -> float:
    """Length of an option [mm]; a bare number is in mm."""
    from fem_biobot.units import parse_quantity

    return parse_quantity(f"{text.strip()} mm" if _BARE_NUMBER.fullmatch(text) else text, "mm", option)


def region_names(texts: Sequence[str]) -> Mapping[str, str]:
    """Volume names of a mesh file to regions, from texts such as ``gel=skeleton``."""
    names: dict[str, str] = {}
    for text in texts:
        name, _, region = (part.strip() for part in text.rpartition("="))
        if not (name and region):
            raise DesignError(f"--rename: found {text!r}, expected NAME=REGION, such as gel=skeleton")
        if names.setdefault(name, region) != region:
            raise DesignError(f"--rename: found {name} for {names[name]} and for {region}, expected it once")
    return names


def walk_plan(order: Order, walking: WalkOrder) -> WalkPlan:
    """Frequencies, duration and amplitude of the options, with the design's where there are none."""
    from fem_biobot.config import load_design
    from fem_biobot.study.walking import WalkPlan
    from fem_biobot.units import parse_quantity, shown

    if walking.model not in ("rod", "solid", "both"):
        raise DesignError(f"--model: found {shown(walking.model)}, expected rod, solid or both")
    if walking.stroke_from not in ("rod", "solid"):
        raise DesignError(f"--stroke-from: found {shown(walking.stroke_from)}, expected rod or solid")
    if walking.stroke_from == "solid" and walking.model != "rod":
        raise DesignError(
            f"--stroke-from: found solid with --model {walking.model}, expected --model rod, which takes it"
        )
    if walking.model == "rod" and walking.stroke_from == "rod":
        for option, given in (("--size", order.size), ("--mesh", order.mesh_file)):
            if given is not None:
                raise DesignError(
                    f"{option}: found with --model rod, which has no mesh, expected --model solid or both"
                )

    def number(text: str, unit: str, option: str) -> float:
        value = parse_quantity(f"{text.strip()} {unit}" if _BARE_NUMBER.fullmatch(text) else text, unit, option)
        if not value > 0.0:
            raise DesignError(f"{option}: found {shown(text)}, expected above 0 {unit}")
        return value

    drive = load_design(order.design, order.sets).drive
    frequencies = tuple(
        number(part, "Hz", "--frequency") for text in walking.frequencies for part in text.split(",") if part.strip()
    )
    duration = drive.duration if walking.duration is None else number(walking.duration, "s", "--duration")
    amplitude: float | None = drive.amplitude
    if walking.amplitude == "paper":
        amplitude = None
    elif walking.amplitude is not None:
        try:
            amplitude = float(walking.amplitude)
        except ValueError:
            amplitude = -1.0
        if not 0.0 <= amplitude < float("inf"):
            raise DesignError(
                f"--amplitude: found {shown(walking.amplitude)}, expected a number of at least 0, or paper for the "
                "forces of the paper's simulation"
            )
    return WalkPlan(frequencies or (drive.frequency,), duration, amplitude)

"""How the parts of a design fit together: which keys a kind of machine has, and what touches what.

Called by `Design` when it is made; ranges of single values are checked there. Each refusal is one line with the key
(both, where two parts clash), what was found and what was expected.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from fem_biobot.design_kinds import DRIVE_NEEDS
from fem_biobot.design_tissue_checks import check_tissue
from fem_biobot.errors import DesignError
from fem_biobot.units import expected_text, format_quantity, shown

if TYPE_CHECKING:
    from fem_biobot.design import Design
    from fem_biobot.design_parts import Muscle, Skeleton

_PILLARS = (
    "skeleton.pillar_length",
    "skeleton.pillar_width",
    "skeleton.short_pillar_height",
    "skeleton.long_pillar_height",
)
_RING = ("muscle.ring_thickness", "muscle.ring_height")
_JUNCTION = ("muscle.junction_width", "muscle.junction_thickness")
_OPTIONAL = ("skeleton.pillar_count", "skeleton.fillet_radius", "muscle.ring_offset")
_PARTS = frozenset((*_PILLARS, *_RING, *_JUNCTION, *_OPTIONAL, "muscle.junction_length"))
# of what rods alone have no use for
_SOLID = ("mesh.size", "mesh.grading", "mesh.element", "numerics.tolerance", "numerics.linear")
_MEDIUM = ("ground.immersion", "ground.medium_density", "ground.viscosity")

# Smallest clearance worth meshing, relative to the beam's thickness: what only rounding separates is in touch.
_TOUCH = 1e-6
_MOST_PILLARS = 100
# nearer to 0.5 the displacement element only rarely finds an equilibrium
_MOST_POISSON = 0.499


def needed_keys(design: Design) -> tuple[str, ...]:
    """Keys of parts that this kind of machine must have and others lack."""
    if design.kind == "strip":
        return ("muscle.junction_length", *_JUNCTION)
    if design.kind in ("cantilever", "walker"):
        return ()
    if design.muscle is not None and design.muscle.layout == "ring":
        return (*_PILLARS, *_RING)
    return (*_PILLARS, *_JUNCTION, *_RING)


def unused_keys(design: Design) -> frozenset[str]:
    """Keys of parts that this kind of machine does not have; they keep their default and are not written."""
    optional: tuple[str, ...] = ()
    if design.kind == "walker":
        return _PARTS.union(_SOLID, _MEDIUM)
    if design.kind == "bot":
        ring = design.muscle is not None and design.muscle.layout == "ring"
        optional = ("skeleton.fillet_radius",) if ring else _OPTIONAL
    return _PARTS - set(needed_keys(design)) - set(optional)


def check_fit(design: Design) -> None:
    """Refuse a design whose parts are missing, superfluous or in each other's way."""
    _check_text(design)
    _check_sections(design)
    if design.muscle is not None and design.muscle.tissue is not None and design.muscle.layout != "junction":
        raise DesignError("muscle.tissue: found with muscle.layout ring, expected it with a junction only")
    _check_parts(design)
    _check_times_and_friction(design)
    _check_drive(design)
    _check_element(design)
    check_tissue(design)
    if design.kind == "bot" and design.skeleton is not None and design.muscle is not None:
        _check_skeleton(design, design.skeleton)
        _check_muscle(design, design.skeleton, design.muscle)


def refuse_without_solid(design: Design, what: str) -> None:
    """Refuse a machine of rods alone for `what` needs a solid."""
    if design.kind == "walker":
        raise DesignError(f"kind: found walker, rods without a solid, expected a bot, strip or cantilever to {what}")


def refuse_unbonded(design: Design, what: str) -> None:
    """Refuse rings that slide on their pillars for `what` is done with bonded ones only."""
    if design.muscle is not None and design.muscle.attachment != "bonded":
        raise DesignError(f"muscle.attachment: found {design.muscle.attachment}, expected bonded to {what}")


def refuse_without_muscle(design: Design, what: str, *, tissue: bool = True) -> None:
    """Refuse a machine without a muscle, or with `tissue` one whose muscles are rods without a volume."""
    if design.muscle is None and (tissue or design.walker is None):
        expected = "bot or strip" if tissue else "bot, strip or walker"
        raise DesignError(f"kind: found {design.kind}, expected a {expected} with a muscle to {what}")


def _mm(value: float) -> str:
    return format_quantity(value, "mm", digits=12)


def _check_text(design: Design) -> None:
    for name, text in (("name", design.name), ("description", design.description)):
        if not text.isprintable() or len(text) > 200 or (name == "name" and not text.strip()):
            raise DesignError(f"{name}: found {shown(text)}, expected printable text on one line, up to 200 characters")


def _check_sections(design: Design) -> None:
    has = {
        "bot": ("skeleton", "muscle"),
        "strip": ("muscle",),
        "cantilever": ("skeleton", "load"),
        "walker": ("walker",),
    }[design.kind]
    given = "mesh" in design.model_fields_set
    if design.kind != "walker" and not given:
        raise DesignError("mesh: missing, expected a section")
    if design.kind == "walker" and given:
        raise DesignError('mesh: found a section, expected none for kind "walker"')
    for section in ("skeleton", "muscle", "load", "walker"):
        present = getattr(design, section) is not None
        if section in has and not present:
            raise DesignError(f'{section}: missing, expected the section [{section}] for kind "{design.kind}"')
        if section not in has and present:
            raise DesignError(f'{section}: found a section, expected none for kind "{design.kind}"')


def _check_parts(design: Design) -> None:
    if design.kind == "strip" and design.muscle is not None and design.muscle.layout != "junction":
        raise DesignError('muscle.layout: found ring, expected junction for kind "strip"')
    for name in needed_keys(design):
        if design.value(name) == 0.0:
            section, _, last = name.rpartition(".")
            if last in design.value(section).model_fields_set:
                raise DesignError(f"{name}: found 0 mm, expected above 0 mm")
            raise DesignError(f"{name}: missing, expected {expected_text('mm')}")
    for name in sorted(unused_keys(design)):
        section, _, last = name.rpartition(".")
        record = design.value(section)
        if record is None or section not in design.model_fields_set:
            continue
        value = getattr(record, last)
        if value == type(record).model_fields[last].default:
            continue
        found = _mm(value) if isinstance(value, float) and name in _PARTS else shown(value)
        layout = " with muscle.layout ring" if design.muscle is not None and design.muscle.layout == "ring" else ""
        raise DesignError(f'{name}: found {found}, expected no such key for kind "{design.kind}"{layout}')


def _check_times_and_friction(design: Design) -> None:
    ground, drive, step = design.ground, design.drive, design.numerics.step
    if ground.kinetic_friction > ground.static_friction:
        raise DesignError(
            f"ground.kinetic_friction: found {ground.kinetic_friction:g}, "
            f"expected at most ground.static_friction ({ground.static_friction:g})"
        )
    if ground.viscosity is not None and ground.immersion != "submerged":
        raise DesignError(
            f"ground.viscosity: found {format_quantity(ground.viscosity, 'kPa s')} with ground.immersion "
            f'"{ground.immersion}", expected a viscosity of a medium ("submerged") only'
        )
    if step > drive.duration:
        raise DesignError(
            f"numerics.step: found {format_quantity(step, 's')}, "
            f"expected at most drive.duration ({format_quantity(drive.duration, 's')})"
        )


# waveforms that a parameter belongs to
_DRIVE_KEYS = {
    "pulse_width": ("pulse", "rc_biphasic"),
    "rc_time": ("rc_biphasic",),
    "pulse_rate": ("pulse", "rc_biphasic", "twitch"),
}
_MOST_PULSES = 1000


def _check_drive(design: Design) -> None:
    """Parameters of other waveforms, missing ones, and bursts that are not whole."""
    drive = design.drive
    for key in DRIVE_NEEDS.get(drive.waveform, ()):
        if getattr(drive, key) is None:
            raise DesignError(
                f'drive.{key}: missing, expected {expected_text("s")} for drive.waveform "{drive.waveform}"'
            )
    for key, owners in _DRIVE_KEYS.items():
        value = getattr(drive, key)
        if value is not None and drive.waveform not in owners:
            found = format_quantity(value, "Hz" if key == "pulse_rate" else "s")
            raise DesignError(
                f'drive.{key}: found {found} with drive.waveform "{drive.waveform}", expected it with '
                f"{' or '.join(owners)} only"
            )
    if not 1 <= drive.pulses <= _MOST_PULSES:
        raise DesignError(f"drive.pulses: found {shown(drive.pulses)}, expected between 1 and {_MOST_PULSES}")
    if drive.pulses > 1 and drive.waveform not in _DRIVE_KEYS["pulse_rate"]:
        raise DesignError(f'drive.pulses: found {drive.pulses} with drive.waveform "{drive.waveform}", expected 1')
    if (drive.pulses > 1) != (drive.pulse_rate is not None):
        raise DesignError(
            "drive.pulse_rate: missing, expected a frequency for the stimuli of a burst (drive.pulses)"
            if drive.pulses > 1
            else "drive.pulse_rate: found without drive.pulses, expected a burst of two stimuli or more with it"
        )
    if drive.fatigue != "given" and drive.fatigue_time is not None:
        raise DesignError(
            f"drive.fatigue_time: found {format_quantity(drive.fatigue_time, 's')} with drive.fatigue "
            f'"{drive.fatigue}", which has its own; expected one of the two'
        )
    if drive.fatigue_rest > 0.0 and drive.fatigue_time is None:
        raise DesignError(
            f"drive.fatigue_rest: found {drive.fatigue_rest:g} without drive.fatigue_time, expected both or none"
        )


def _check_element(design: Design) -> None:
    if design.numerics.linear == "iterative" and design.mesh.element != "P2":
        raise DesignError(
            f'numerics.linear: found "iterative" with mesh.element "{design.mesh.element}", expected "auto" or '
            '"direct": conjugate gradients solve systems without pressures only'
        )
    for name in ("skeleton", "muscle"):
        part = getattr(design, name)
        if part is not None and part.material.poisson > _MOST_POISSON and design.mesh.element == "P2":
            raise DesignError(
                f"{name}.material.poisson: found {part.material.poisson:.12g}, expected between 0 and "
                f'{_MOST_POISSON:g} with mesh.element "P2", which locks nearer to 0.5; mesh.element "P2-P1" does not'
            )


def _check_skeleton(design: Design, skeleton: Skeleton) -> None:
    count, length = skeleton.pillar_count, skeleton.pillar_length
    if not 2 <= count <= _MOST_PILLARS:
        raise DesignError(f"skeleton.pillar_count: found {shown(count)}, expected between 2 and {_MOST_PILLARS}")
    if count * length >= skeleton.beam_length * (1.0 - 1e-9):
        raise DesignError(
            f"skeleton.pillar_length: found {_mm(length)}, expected less than {_mm(skeleton.beam_length / count)}: "
            f"{count} pillars overlap on skeleton.beam_length {_mm(skeleton.beam_length)}"
        )
    if skeleton.pillar_width > skeleton.beam_width:
        raise DesignError(
            f"skeleton.pillar_width: found {_mm(skeleton.pillar_width)}, "
            f"expected at most skeleton.beam_width ({_mm(skeleton.beam_width)})"
        )
    short, long, half = skeleton.short_pillar_height, skeleton.long_pillar_height, skeleton.beam_thickness / 2
    if short > long:
        raise DesignError(
            f"skeleton.short_pillar_height: found {_mm(short)}, "
            f"expected at most skeleton.long_pillar_height ({_mm(long)})"
        )
    if short <= half:
        raise DesignError(
            f"skeleton.short_pillar_height: found {_mm(short)} below the beam axis, "
            f"expected more than half of skeleton.beam_thickness ({_mm(half)})"
        )
    room = min(design.bay / 2, short - half)
    if skeleton.fillet_radius >= room:
        raise DesignError(
            f"skeleton.fillet_radius: found {_mm(skeleton.fillet_radius)}, expected less than {_mm(room)}, "
            f"which fits between the pillars and above skeleton.short_pillar_height"
        )


def _check_muscle(design: Design, skeleton: Skeleton, muscle: Muscle) -> None:
    sole = design.beam_axis_height - skeleton.short_pillar_height
    ceiling = design.beam_axis_height - skeleton.beam_thickness / 2 - skeleton.fillet_radius
    limit = "fillet (skeleton.fillet_radius)" if skeleton.fillet_radius else "beam (skeleton.beam_thickness)"
    touch = _TOUCH * skeleton.beam_thickness
    middle = muscle.junction_height
    parts = [("ring", "muscle.ring_height", middle + muscle.ring_offset, muscle.ring_height)]
    if muscle.layout == "junction":
        parts.insert(0, ("junction", "muscle.junction_thickness", middle, muscle.junction_thickness))
    for part, size_key, z, extent in parts:
        top, bottom = z + extent / 2, z - extent / 2
        if top > ceiling - touch:
            raise DesignError(
                f"muscle.junction_height: found {_mm(middle)}, which with {size_key} {_mm(extent)} puts the {part}'s "
                f"top at z = {_mm(top)}, where it touches the {limit}, expected below z = {_mm(ceiling)}"
            )
        if bottom < sole + touch:
            raise DesignError(
                f"muscle.junction_height: found {_mm(middle)}, which with {size_key} {_mm(extent)} puts the {part}'s "
                f"bottom at z = {_mm(bottom)}, expected above the sole of the short pillar "
                f"(skeleton.short_pillar_height) at z = {_mm(sole)}"
            )
    if muscle.layout == "junction":
        _check_junction(design, skeleton, muscle)


def _check_junction(design: Design, skeleton: Skeleton, muscle: Muscle) -> None:
    if muscle.junction_width > skeleton.pillar_width:
        raise DesignError(
            f"muscle.junction_width: found {_mm(muscle.junction_width)}, "
            f"expected at most skeleton.pillar_width ({_mm(skeleton.pillar_width)})"
        )
    if 2 * muscle.ring_thickness >= design.bay * (1.0 - 1e-9):
        raise DesignError(
            f"muscle.ring_thickness: found {_mm(muscle.ring_thickness)}, expected less than {_mm(design.bay / 2)}, "
            f"half the distance between pillars (skeleton.beam_length, skeleton.pillar_length)"
        )
    if muscle.junction_thickness > muscle.ring_height:
        raise DesignError(
            f"muscle.junction_thickness: found {_mm(muscle.junction_thickness)}, "
            f"expected at most muscle.ring_height ({_mm(muscle.ring_height)})"
        )
    slack = (muscle.ring_height - muscle.junction_thickness) / 2
    if abs(muscle.ring_offset) > slack * (1.0 + 1e-9):
        raise DesignError(
            f"muscle.ring_offset: found {_mm(muscle.ring_offset)}, expected between {_mm(-slack)} and {_mm(slack)}, "
            f"so that the junction (muscle.junction_thickness) ends within the ring (muscle.ring_height)"
        )

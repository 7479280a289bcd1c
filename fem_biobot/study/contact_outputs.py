"""What a run says of rings that lie on their pillars: numbers of each pillar, fields for ParaView, the footprint."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from fem_biobot.design import Design
from fem_biobot.files import file_error
from fem_biobot.mesh.layout import pillar_names
from fem_biobot.solid.interface.results import footprint, part_forces
from fem_biobot.solid.model import SolidState
from fem_biobot.study.outputs import figures_folder, machine_of, shape_of
from fem_biobot.study.plan import Found
from fem_biobot.view.footprint import Pressed, footprint_pictures
from fem_biobot.view.pictures import draw_pictures
from fem_biobot.vtk import write_pvd, write_vtp

# beside the states' own files
_FOLDER = "solid_contact"
# share of the ring's thickness from which overlap is told
_DEEP = 0.1


def contact_numbers(design: Design, state: SolidState) -> dict[str, float]:
    """What each pillar bears, for the measures of a state; nothing where the tissue is bonded."""
    if state.touch is None:
        return {}
    parts = part_forces(state)
    names = [f"part_{k + 1}" for k in range(len(parts))]
    if len(parts) == len(design.pillars):
        names = pillar_names(len(parts))
    numbers: dict[str, float] = {}
    for name, part in zip(names, parts, strict=True):
        for axis, value in zip("xyz", part.force, strict=True):
            numbers[f"contact_{name}_force_{axis}_mN"] = float(value)
        numbers |= {
            f"contact_{name}_pressing_mN": part.pressing,
            f"contact_{name}_rubbing_mN": part.rubbing,
            f"contact_{name}_area_mm2": part.area,
            f"contact_{name}_max_pressure_kPa": part.max_pressure,
            f"contact_{name}_slid_mm": part.slid,
            f"contact_{name}_overlap_mm": part.overlap,
        }
    return numbers


def contact_rows(states: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """A row for each pillar of each state, for a table; none where the tissue is bonded."""
    rows = []
    for state in states:
        names = [key.removeprefix("contact_").removesuffix("_pressing_mN") for key in state if "_pressing_mN" in key]
        for name in names:
            own = {k.removeprefix(f"contact_{name}_"): v for k, v in state.items() if k.startswith(f"contact_{name}_")}
            rows.append({"state": state["label"], "pillar": name.replace("_", " "), **own})
    return rows


def contact_notes(design: Design, states: Sequence[dict[str, Any]]) -> list[str]:
    """What is to be said of sliding rings: what is not looked at, and overlap that asks for a finer mesh."""
    overlaps = [value for state in states for key, value in state.items() if key.endswith("_overlap_mm")]
    if design.muscle is None or not overlaps:
        return []
    notes = ["sliding rings: whether a state is stable is not looked at, nor tissue that has remodelled"]
    deepest, ring = max(overlaps), design.muscle.ring_thickness
    if deepest > _DEEP * ring:
        notes.append(
            f"sliding rings: at edges of the pillars single points overlap by up to {deepest:.2g} mm, "
            f"{deepest / ring:.0%} of the ring's thickness; a finer mesh (mesh.size) resolves them better"
        )
    return notes


def write_contact(folder: Path, files: Sequence[str], state: SolidState) -> None:
    """The footprint of the latest state as a surface beside it, and the series so far."""
    if state.touch is None:
        return
    try:
        (folder / _FOLDER).mkdir(exist_ok=True)
    except OSError as error:
        raise file_error(error, folder / _FOLDER) from None
    names = [f"{_FOLDER}/{Path(file).stem.removeprefix('solid_')}.vtp" for file in files]
    write_footprint(folder / names[-1], state)
    write_pvd(folder / f"{_FOLDER}.pvd", [(float(k), name) for k, name in enumerate(names)])


def write_footprint(path: Path, state: SolidState) -> None:
    """What presses on the pillars in a state, as a surface for ParaView."""
    found = footprint(state)
    write_vtp(
        path,
        found.points,
        found.triangles,
        point_data={
            "pressure_kPa": found.pressure,
            "friction_kPa": found.friction,
            "gap_mm": found.gap,
            "slip_mm": found.slip,
            "stick_slip_1": found.state,
            "cover_1": found.cover,
        },
    )


def draw_contact(folder: Path, design: Design, shown: Sequence[Found]) -> list[tuple[Path, str]]:
    """Pictures of the footprint in the states shown, with captions; by the renderer of the run's other pictures."""
    with_contact = [found for found in shown if found.state.touch is not None]
    if not with_contact:
        return []
    machine = machine_of(design, with_contact[0].state)
    pressed = []
    for found in with_contact:
        shape = shape_of(design, found.state, found.wanted.key, found.wanted.label, stands=False)
        seen = footprint(found.state)
        pressed.append(Pressed(shape, seen.points, seen.triangles, seen.pressure))
    drawn = draw_pictures(footprint_pictures(machine, pressed), figures_folder(folder))
    return [(file, file.stem.replace("_", " ")) for file in drawn.files]

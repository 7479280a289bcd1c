"""What a sliding contact says: footprint, forces of the parts, numbers and files of a run, the picture."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import pyvista as pv

from fem_biobot import SolidState, load_design
from fem_biobot.errors import FileError, ModelError
from fem_biobot.solid.interface.results import footprint, part_forces
from fem_biobot.solid.interface.state import LIFTED
from fem_biobot.study.contact_outputs import contact_notes, contact_numbers, contact_rows, write_contact
from fem_biobot.verification.sliding import PULL, THICKNESS, WIDTH, pulled
from fem_biobot.view.footprint import Pressed, footprint_pictures
from fem_biobot.view.machine import Machine, Shape


@cache
def band() -> SolidState:
    """A band that slides on a drum with friction 0.4."""
    return pulled(0.4).last


def test_force_on_the_part_is_what_its_fields_add_up_to() -> None:
    """The drum bears the pull; pressing and rubbing are the integrals of the footprint, which obeys Coulomb's law.

    Catches: the force on the body in place of that on its bearing; friction of the wrong sign; a share of the area.
    """
    state = band()
    (part,), seen = part_forces(state), footprint(state)
    tension = PULL * THICKNESS * WIDTH
    assert part.force[2] == pytest.approx(-tension, rel=1e-6)
    friction = np.linalg.norm(seen.friction, axis=0)
    np.testing.assert_allclose(friction, 0.4 * seen.pressure, rtol=1e-6, atol=1e-12)
    assert part.rubbing == pytest.approx(0.4 * part.pressing, rel=1e-3)
    # the band slides toward its pulled end, down on the right, and drags the drum along
    middle = np.argmin(np.abs(seen.points[0] - seen.points[2]))
    assert seen.friction[0, middle] > 0.0 > seen.friction[2, middle]
    assert seen.slip[:, middle] @ seen.friction[:, middle] > 0.0
    assert part.max_pressure == seen.pressure.max()
    assert 0.9 < part.area / (0.5 * np.pi * 5.0 * WIDTH) <= 1.0
    assert part.slid == pytest.approx(np.abs(state.u).max(), rel=0.1)
    assert 0.0 <= part.overlap < 0.01
    assert np.all(seen.cover <= 1.0 + 1e-12)
    assert np.all(seen.pressure[seen.state == LIFTED] == pytest.approx(0.0, abs=1e-9))


def test_a_state_without_contact_has_no_footprint() -> None:
    """It is refused for fields, and leaves numbers and files out.

    Catches: zeros told as if they were found.
    """
    state = SolidState(band().model, band().step, band().u)
    with pytest.raises(ModelError, match="contact"):
        footprint(state)
    with pytest.raises(ModelError, match="contact"):
        part_forces(state)
    assert contact_numbers(load_design("junction_bot"), state) == {}
    write_contact(Path("/nowhere"), ["solid_00_rest.vtu"], state)


def test_numbers_and_files_of_a_run(tmp_path: Path) -> None:
    """One part is told under its own name, in one row; the surface reads back with its fields.

    Catches: a component of the force under another's name; a field left out; a file that no reader takes.
    """
    state = band()
    numbers = contact_numbers(load_design("junction_bot"), state)
    assert numbers["contact_part_1_force_z_mN"] == pytest.approx(-PULL * THICKNESS * WIDTH, rel=1e-6)
    assert json.dumps(numbers)
    (row,) = contact_rows([{"label": "pulled", "tension_kPa": 1.0, **numbers}])
    assert row["state"] == "pulled"
    assert row["pillar"] == "part 1"
    assert row["slid_mm"] == numbers["contact_part_1_slid_mm"]
    assert contact_rows([{"label": "bonded", "tension_kPa": 1.0}]) == []
    write_contact(tmp_path, ["solid_00_rest.vtu", "solid_01_pulled.vtu"], state)
    surface = pv.read(tmp_path / "solid_contact" / "01_pulled.vtp")
    seen = footprint(state)
    np.testing.assert_array_equal(surface["pressure_kPa"], seen.pressure)
    assert {"friction_kPa", "gap_mm", "slip_mm", "stick_slip_1", "cover_1"} <= set(surface.array_names)
    assert "solid_contact/01_pulled.vtp" in (tmp_path / "solid_contact.pvd").read_text(encoding="utf-8")
    (tmp_path / "file").write_text("", encoding="utf-8")
    with pytest.raises(FileError, match="file"):
        write_contact(tmp_path / "file", ["solid_00_rest.vtu"], state)


def test_notes_say_what_is_not_looked_at_and_when_edges_overlap() -> None:
    """Nothing of bonded tissue; overlap above a tenth of the ring's thickness (0.5 mm) is told with its size.

    Catches: a note on every run; the smallest overlap in place of the deepest.
    """
    bot = load_design("junction_bot")
    shallow = {"contact_short_overlap_mm": 0.04, "contact_long_overlap_mm": 0.01}
    assert contact_notes(bot, [{"label": "bonded"}]) == []
    assert len(contact_notes(bot, [shallow])) == 1
    _, told = contact_notes(bot, [shallow, {**shallow, "contact_short_overlap_mm": 0.2}, shallow])
    assert "0.2 mm" in told
    assert "40%" in told


def test_the_picture_colours_what_presses() -> None:
    """Its coloured layer has the facets with pressure alone, on one bar up to the largest of all states.

    Catches: the bare surface coloured as pressed; each state on a scale of its own.
    """
    state, seen = band(), footprint(band())
    mesh, space = state.model.mesh, state.model.system.space
    machine = Machine(space.points, space.nodes, dict(mesh.regions), "band")
    half = seen.pressure.copy()
    half[seen.points[0] < 2.5] = 0.0
    states = [
        Pressed(Shape(key, key, state.u), seen.points, seen.triangles, pressure)
        for key, pressure in (("whole", seen.pressure), ("half", 0.5 * half))
    ]
    whole, part = footprint_pictures(machine, states)
    assert whole.name == "footprint_whole"
    assert whole.bar == part.bar
    assert whole.bar is not None
    assert whole.bar.limits == (0.0, seen.pressure.max())
    coloured = part.panels[0].layers[1]
    assert coloured.values is not None
    assert np.all((coloured.values[coloured.triangles] > 0.0).any(axis=0))
    assert coloured.triangles.shape[1] < whole.panels[0].layers[1].triangles.shape[1]
    # it lies just outside of the surface
    out = np.linalg.norm((coloured.points - seen.points)[[0, 2]], axis=0)
    assert np.all(out < 0.02)
    assert footprint_pictures(machine, []) == []

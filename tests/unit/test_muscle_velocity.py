"""The force-velocity curve of a design: its command, its place in a run's findings, what states at rest say of it."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest

from fem_biobot.config import load_design
from fem_biobot.design_tissue import at_rest
from fem_biobot.mesh.files import read_mesh
from fem_biobot.solid.model import SolidModel, SolidState
from fem_biobot.solid.records import Step
from fem_biobot.solid.stress import probe
from tests.command import call

ROOT = Path(__file__).resolve().parents[2]
KEYS = ("muscle.force_velocity.fastest=4 1/s", "muscle.force_velocity.curvature=0.3")
SETS = [part for key in KEYS for part in ("--set", key)]


def test_the_command_tells_force_and_power(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """Numbers by Hill's closed forms: at half speed ``0.5 / (1 + 0.5 / k)``, most power at ``sqrt(k^2 + k) - k``.

    Catches: velocities in lengths taken for millimetres, power of the isometric force, a key that is not passed on.
    """
    out = tmp_path / "velocity"
    said = call(capsys, "muscle", "velocity", "junction_bot", *SETS, "--out", out, "--json")
    assert said.code == 0
    found = json.loads(said.out)["velocity"]
    k, bay = 0.3, load_design("junction_bot").bay
    best = np.sqrt(k * k + k) - k
    assert found["fastest_mm_per_s"] == pytest.approx(4.0 * bay)
    assert found["share_at_half_1"] == pytest.approx(0.5 / (1.0 + 0.5 / k))
    assert found["strongest_1_per_s"] == pytest.approx(4.0 * best)
    force = found["isometric_mN"] * (1.0 - best) / (1.0 + best / k)
    assert found["greatest_power_uW"] == pytest.approx(4.0 * best * bay * force)
    rows = list(csv.DictReader((out / "tables" / "force_velocity.csv").open()))
    assert [float(rows[i]["share_1"]) for i in (0, len(rows) // 2)] == pytest.approx([0.0, 1.0], abs=0.02)
    assert (out / "figures" / "force_velocity.png").is_file()
    none = call(capsys, "muscle", "velocity", "junction_bot", "--out", tmp_path / "none")
    assert (none.code, len(none.err.splitlines())) == (2, 1)
    assert "muscle.force_velocity: found none, expected a section" in none.complaint


def test_states_at_rest_say_that_they_have_no_velocity(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """A solve notes it on the screen and in the summary; muscle work is told as ever.

    Catches: a curve that is passed over in silence, a tension taken for one whose parts differ at rest.
    """
    said = call(capsys, "solve", "strip", "--size", "2", *SETS, "--out", tmp_path / "strip", "--json")
    assert said.code == 0
    assert "equilibria have no velocity" in said.err
    summary = json.loads(said.out)
    assert at_rest(load_design("strip", KEYS).muscle) in summary["notes"]
    assert at_rest(load_design("strip").muscle) is None
    assert all(state["muscle_work_uJ"] is not None for state in summary["solid"]["states"])


def test_a_moving_state_has_the_stress_of_its_rate() -> None:
    """Two thirds of the fastest shortening everywhere: at the points and at a place, only what is stimulated is less.

    Catches: a velocity that states forget, a probe at rest, the rate of a body that turns.
    """
    design = load_design("strip", KEYS)
    assert design.muscle is not None
    model = SolidModel.from_design(design, read_mesh(ROOT / "meshes" / "strip_small.msh"))
    X = model.system.space.points
    u, rate = 0.02 * X, -4.0 * 2.0 / 3.0
    share = (1.0 / 3.0) / (1.0 + 2.0 / 3.0 / 0.3)
    v = rate / 1.02 * (X + u) + np.cross(np.array([0.3, -1.1, 0.7]), X + u, axisb=0, axisc=0)
    still, moving = (SolidState(model, Step(1.0, 1.0), u, velocity=w) for w in (None, v))
    standing = design.tension(0.0)
    whole = design.tension(1.0)
    lost = (1.0 - share) * (whole - standing) / whole
    passive = model.system.points(still.F, 0.0, moduli=False)
    np.testing.assert_allclose(
        moving.points.S - passive.S, (1.0 - lost) * (still.points.S - passive.S), rtol=1e-9, atol=1e-12
    )
    inside = probe(model.system, model.mesh.points[:, model.mesh.cells[:, :3]].mean(axis=1))
    at_points = [state.points.S[0].mean() for state in (still, moving)]
    at_places = [inside.cauchy_stress(state)[0, 0].mean() for state in (still, moving)]
    ratio = (at_places[0] - at_places[1]) / (at_points[0] - at_points[1])
    assert ratio == pytest.approx(1.02**2 / 1.02**3, rel=1e-9)

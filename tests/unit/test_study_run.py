"""The main job on the junction bot at a coarse size: its numbers, its files, going on, the scripts of the README."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyvista as pv

from fem_biobot.config import digest, load_design
from fem_biobot.design import Design
from fem_biobot.errors import FileError, SolveError
from fem_biobot.mesh.committed import committed_mesh
from fem_biobot.mesh.files import write_mesh
from fem_biobot.mesh.geometry import GmshMissing, import_gmsh
from fem_biobot.study.plan import Solver, wanted_states
from fem_biobot.study.reporter import Silent
from fem_biobot.study.run import run
from fem_biobot.study.run_crosscheck import run_crosscheck

ROOT = Path(__file__).resolve().parents[2]


def gmsh_missing() -> bool:
    """Whether Gmsh cannot start here."""
    try:
        import_gmsh()
    except GmshMissing:
        return True
    return False


class Told(Silent):
    """A reporter that remembers, and may interrupt after a given part."""

    def __init__(self, stop_after: str = "") -> None:
        self.notes: list[str] = []
        self.parts: list[str] = []
        self.stop_after = stop_after

    def note(self, text: str) -> None:
        self.notes.append(text)

    def advance(self, done: str = "") -> None:
        self.parts.append(done)
        if self.stop_after and done.startswith(self.stop_after):
            raise KeyboardInterrupt


@pytest.fixture(scope="module")
def design() -> Design:
    return load_design("junction_bot", ["mesh.size=2 mm"])


@pytest.fixture(scope="module")
def result(design: Design, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    out = tmp_path_factory.mktemp("run") / "out"
    return out, run(design, out)


def states(summary: dict[str, Any]) -> dict[str, dict[str, Any]]:
    return {s["key"]: s for s in summary["solid"]["states"]}


def test_the_summary_on_disk_is_what_run_returns(result: tuple[Path, dict[str, Any]], design: Design) -> None:
    """summary.json is the returned object, names the design's digest, and has the promised keys.

    Catches: a key that is renamed or lost, a summary written before the last number.
    """
    out, summary = result
    assert json.loads((out / "summary.json").read_text()) == json.loads(json.dumps(summary))
    promised = {"design_digest", "versions", "timings_s", "mesh", "solid", "walks", "crosscheck", "notes"}
    assert promised <= set(summary)
    assert summary["design_digest"] == digest(design)
    per_state = {
        "tension_kPa", "muscle_force_mN", "eq3_force_mN", "tip_closing_mm", "sagitta_mm", "fibre_stretch_1",
        "max_von_mises_kPa", "ball_von_mises_kPa", "strain_energy_uJ", "muscle_work_uJ", "newton_iterations_1",
        "factorisations_1",
    }  # fmt: skip
    for state in summary["solid"]["states"]:
        assert per_state <= set(state)
        assert all(isinstance(state[name], float | int) for name in per_state)


def test_forces_of_the_paper_are_met_from_the_unstressed_state(result: tuple[Path, dict[str, Any]]) -> None:
    """The three states carry 0.5, 1.0 and 1.4 mN, and stand beside the printed deflections.

    Catches: interpolating the closing instead of solving for the force, comparing with the wrong row.
    """
    _, summary = result
    by_key = states(summary)
    printed = {"force_0p5": (0.5, 0.3), "force_1": (1.0, 0.5), "force_1p4": (1.4, 1.0)}
    rows = [row for row in summary["solid"]["comparison"] if row["quantity"].startswith("tip closing")]
    assert len(rows) == 3
    for (key, (force, deflection)), row in zip(printed.items(), rows, strict=True):
        assert by_key[key]["muscle_force_mN"] == pytest.approx(force, rel=2e-4)
        assert row["ours"] == by_key[key]["tip_closing_mm"]
        assert row["paper"] == deflection
        # linear theory, closing = F h L (h1 + h2) / (2 E I), within a tenth: pillars bend, the beam is a plate
        linear = force * 2.0 * 7.0 * (2.8 + 3.4) / (2.0 * 319.4 * 7.0 * 0.68**3 / 12.0)
        assert row["ours"] == pytest.approx(linear, rel=0.1)


def test_work_of_the_muscle_is_stored_as_strain_energy(result: tuple[Path, dict[str, Any]]) -> None:
    """Along the moulded path the muscle's work equals the passive strain energy: nothing else is loaded.

    Catches: a wrong sign of the work, counting the active energy as passive. Tolerance: the spline through few states.
    """
    _, summary = result
    for key in ("force_1", "force_1p4", "passive", "peak"):
        state = states(summary)[key]
        assert state["muscle_work_uJ"] == pytest.approx(state["strain_energy_uJ"], rel=2e-3)


def test_remodelled_tissue_puts_its_whole_tension_on_the_skeleton(
    result: tuple[Path, dict[str, Any]], design: Design
) -> None:
    """In the remodelled passive state the force is tension times reference section; as moulded it is much less.

    Catches: a natural stretch that is not found, a tension that shrinks with the section.
    """
    _, summary = result
    whole = design.tension(0.0) * design.junction_section
    passive = states(summary)["remodelled_passive"]
    # the passive stress left is 2e-3 of the tension at most; the ends of the strip hold it across the fibres
    assert passive["muscle_force_mN"] == pytest.approx(whole, rel=6e-3)
    assert states(summary)["passive"]["muscle_force_mN"] < 0.6 * whole
    stroke = summary["solid"]["stroke"]
    assert set(stroke) == {"as_moulded", "remodelled"}
    assert stroke["as_moulded"]["stroke_mm"] == pytest.approx(
        states(summary)["peak"]["tip_closing_mm"] - states(summary)["passive"]["tip_closing_mm"], rel=1e-12
    )


def test_parts_that_touch_are_told(result: tuple[Path, dict[str, Any]]) -> None:
    """Where a state touches itself, a note says so; where it does not, none does.

    Catches: an event that is computed and dropped.
    """
    _, summary = result
    for state in summary["solid"]["states"]:
        told = any(note.startswith(state["label"]) and "touches itself" in note for note in summary["notes"])
        assert told == bool(state["touching"])


def test_the_error_estimate_compares_two_meshes(result: tuple[Path, dict[str, Any]]) -> None:
    """Every moulded state has its closing on both meshes and an error above their difference.

    Catches: comparing a mesh with itself, dividing by a ratio below one.
    """
    _, summary = result
    if "error_estimate" not in summary["solid"]:
        # without Gmsh there is no coarser mesh than the smallest committed one, and the run says so
        assert gmsh_missing()
        assert any("error not estimated" in note for note in summary["notes"])
        pytest.skip("needs Gmsh for a coarser mesh")
    rows = [r for r in summary["solid"]["error_estimate"] if r["quantity"] == "tip_closing_mm"]
    assert {r["state"] for r in rows} >= {states(summary)[k]["label"] for k in ("force_1", "passive", "peak")}
    for row in rows:
        gap = abs(row["this mesh"] - row["coarser mesh"])
        assert 0.0 < gap < 0.2 * row["this mesh"]
        assert row["estimated error"] >= gap


def test_a_run_sets_rods_beside_its_own_states(result: tuple[Path, dict[str, Any]]) -> None:
    """The summary's cross-check has every moulded state under tension, with the run's own numbers, within 3 %.

    Parts are loaded on a coarser mesh: 1 % beside those of the same mesh.

    Catches: the solid solved again, tensions of other states, rods in closed form alone, figures drawn and not shown.
    """
    out, summary = result
    rows = [row for row in summary["crosscheck"]["rows"] if row["rods"] == "mesh_at_load"]
    own = {
        s["tension_kPa"]: s for s in summary["solid"]["states"] if s["reference"] == "as_moulded" and s["tension_kPa"]
    }
    closing = {row["tension_kPa"]: row for row in rows if row["quantity"] == "tip_closing_mm"}
    assert len(closing) == len(own)
    for (tension, row), (other, state) in zip(sorted(closing.items()), sorted(own.items()), strict=True):
        assert tension == pytest.approx(other, rel=1e-12)
        assert row["solid_value"] == pytest.approx(state["tip_closing_mm"], rel=1e-12)
        assert abs(row["difference_1"]) < 0.03
    (stroke,) = [row for row in rows if row["quantity"] == "stroke_mm"]
    assert stroke["solid_value"] == pytest.approx(
        states(summary)["peak"]["tip_closing_mm"] - states(summary)["passive"]["tip_closing_mm"], rel=1e-9
    )
    assert (out / "tables" / "crosscheck.csv").is_file()
    page = (out / "report.html").read_text()
    assert "Largest difference that is left" in page
    assert "Both from the side" in page


def test_a_machine_without_a_cross_check_is_said(design: Design, tmp_path: Path) -> None:
    """Three pillars: one note, no numbers, and the run goes on.

    Catches: a run that fails because of its last part, a cross-check that is silently none.
    """
    other = design.with_values({"skeleton.pillar_count": 3})
    mesh = committed_mesh(design)
    assert mesh is not None
    found = run_crosscheck(other, mesh, [], tmp_path, Silent(), given=True)
    assert not found.numbers
    assert len(found.notes) == 1
    assert "cross-check: left out" in found.notes[0]
    assert "two pillars" in found.notes[0]


def test_every_file_is_there_and_opens(result: tuple[Path, dict[str, Any]], design: Design) -> None:
    """The series opens in one step with quadratic cells; pictures, tables and report exist; no leftovers remain.

    Catches: a series naming a missing file, linear cells, temporary or unfinished files left behind.
    """
    out, summary = result
    reader = pv.get_reader(str(out / "solid.pvd"))
    assert len(reader.time_values) == len(summary["solid"]["states"])
    grid = pv.read(out / states(summary)["peak"]["file"])
    assert set(np.unique(grid.celltypes)) == {pv.CellType.QUADRATIC_TETRA}
    for name in ("cauchy_stress_kPa", "von_mises_kPa", "fibre_stretch_1", "fibre_stress_kPa", "region"):
        assert name in grid.cell_data
    assert np.abs(grid.point_data["displacement_mm"]).max() > 1.0
    # the mean of the fibre stretch over the middle fifth, from the file alone
    centre = grid.cell_centers().points
    middle = (np.abs(centre[:, 0]) < 0.7) & (np.abs(centre[:, 1]) < 1.1) & (np.abs(centre[:, 2] - 1.4) < 0.2)
    stretch = grid.cell_data["fibre_stretch_1"][middle].mean()
    assert stretch == pytest.approx(states(summary)["peak"]["fibre_stretch_1"], rel=0.01)
    page = (out / "report.html").read_text()
    assert page.count("data:image/png;base64") == len(list((out / "figures").glob("*.png"))) >= 7
    tables = {"states.csv", "comparison.csv", "stroke.csv", "walks.csv", "drive.csv", "fibres.csv", "design_check.csv"}
    rows = {(row["name"], row["by"]): row for row in summary["design_check"]}
    assert "Will it work?" in page
    assert {by for _, by in rows} == {"closed form", "solid", "rods"}
    peak = states(summary)["peak"]
    assert rows["the tissue bears its shortening", "solid"]["value"] == peak["fibre_stretch_1"]
    assert 0.01 < rows["the gel bears its strain", "solid"]["value"] < 0.3
    tables |= {"crosscheck.csv", "curvature.csv", "modes.csv", "roots.csv"}
    assert summary["muscle"]["drive"]["peak_1"] == pytest.approx(1.0)
    assert summary["muscle"]["fibres"]["along_middle_1"] == pytest.approx(1.0, abs=1e-12)
    if not gmsh_missing():
        tables.add("error_estimate.csv")
    assert {p.name for p in (out / "tables").iterdir() if not p.name.startswith("walk_")} == tables
    assert not (out / ".unfinished").exists()
    assert not [p for p in out.rglob("*") if ".tmp" in p.name]
    again = load_design(out / "design.toml")
    assert digest(again) == digest(design)


def test_a_whole_result_is_reused_and_another_design_refused(
    result: tuple[Path, dict[str, Any]], design: Design
) -> None:
    """The same design returns at once with a note; another one touches nothing.

    Catches: solving again, or writing before the check.
    """
    out, summary = result
    stamp = {p: p.stat().st_mtime_ns for p in out.rglob("*")}
    told = Told()
    again = run(design, out, reporter=told)
    assert again["solid"] == json.loads(json.dumps(summary["solid"]))
    assert told.parts == []
    assert any("--force redoes" in note for note in told.notes)
    with pytest.raises(FileError, match="another design"):
        run(design.with_values({"muscle.gamma": 0.9}), out)
    assert {p: p.stat().st_mtime_ns for p in out.rglob("*")} == stamp


def test_an_interrupted_run_goes_on_to_the_same_numbers(design: Design, tmp_path: Path) -> None:
    """Interrupted after a state and run again, it keeps what it has and ends like an uninterrupted one.

    Catches: losing states, a predictor that changes the converged answer, a stale summary. Tolerance: the solver's.
    """
    out = tmp_path / "out"
    with pytest.raises(KeyboardInterrupt):
        run(design, out, complete=False, reporter=Told("1 mN"))
    partial = json.loads((out / "summary.json").read_text())
    assert partial["complete"] is False
    assert [s["key"] for s in partial["solid"]["states"]] == ["rest", "force_0p5", "force_1"]
    assert pv.get_reader(str(out / "solid.pvd")).time_values == [0.0, 1.0, 2.0]
    with pytest.raises(FileError, match="no unfinished result"):
        run(design, tmp_path / "empty", complete=False, resume=True)
    stamp = (out / ".unfinished" / "force_1.npz").stat().st_mtime_ns
    kept = {}

    class Watch(Told):
        def advance(self, done: str = "") -> None:
            super().advance(done)
            if done.startswith("1 mN"):
                kept["stamp"] = (out / ".unfinished" / "force_1.npz").stat().st_mtime_ns

    resumed = run(design, out, complete=False, resume=True, reporter=Watch())
    assert kept["stamp"] == stamp
    whole = run(design, tmp_path / "whole", complete=False)
    for a, b in zip(resumed["solid"]["states"], whole["solid"]["states"], strict=True):
        assert a["key"] == b["key"]
        assert a["tip_closing_mm"] == pytest.approx(b["tip_closing_mm"], rel=1e-3, abs=1e-9)
    assert not (out / ".unfinished").exists()


def test_a_strangers_mesh_gives_the_same_machine(design: Design, tmp_path: Path) -> None:
    """The same mesh from a file, its volumes under other names, gives the same closing; no error can be estimated.

    Catches: ignoring the file, ignoring the names, a digest that does not see the mesh.
    """
    mesh = committed_mesh(design)
    assert mesh is not None
    file = tmp_path / "mine.msh"
    write_mesh(file, mesh)
    text = file.read_text().replace('"skeleton"', '"gel"').replace('"muscle"', '"tissue"')
    file.write_text(text)
    summary = run(
        design, tmp_path / "out", mesh_file=file, names={"gel": "skeleton", "tissue": "muscle"}, complete=False
    )
    solver = Solver(design, mesh, Silent())
    for wanted in wanted_states(design)[:4]:
        closing = solver.measurer.tip_closing(solver.solve(wanted).state)
        assert states(summary)[wanted.key]["tip_closing_mm"] == pytest.approx(closing, rel=1e-7, abs=1e-9)
    assert summary["job"]["mesh"].startswith("mine.msh ")


def test_an_impossible_tension_leaves_what_was_reached(design: Design, tmp_path: Path) -> None:
    """At 1e4 kPa the solve fails with what was reached and why, and the states before are on disk.

    Catches: an empty folder after a failure, a failure reported as a result.
    """
    strong = design.with_values({"muscle.passive_tension": 1e4})
    with pytest.raises(SolveError, match="reached"):
        run(strong, tmp_path / "out", complete=False)
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["complete"] is False
    assert "no equilibrium" in summary["failure"]
    assert len(pv.get_reader(str(tmp_path / "out" / "solid.pvd")).time_values) == len(summary["solid"]["states"]) >= 1


@pytest.mark.parametrize("number", [0, 1, 2])
def test_the_scripts_of_the_readme_run(number: int, tmp_path: Path) -> None:
    """Each Python block of the README runs as it stands, in an empty folder; the first two have at most 16 lines.

    Catches: a README that has drifted from the package.
    """
    blocks = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(), re.DOTALL)
    assert len(blocks) == 3
    if number and gmsh_missing():
        pytest.skip("the scripts of the solid make their meshes by Gmsh, which cannot start")
    done = subprocess.run(
        [sys.executable, "-c", f"import sys; sys.path.insert(0, {str(ROOT)!r})\n" + blocks[number]],
        cwd=tmp_path, capture_output=True, text=True, timeout=300, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    if number < 2:
        assert len([line for line in blocks[number].splitlines() if line.strip()]) <= 16
    if number == 0:
        speeds = [float(x) for x in re.findall(r"step, ([-0-9.]+) mm/s", done.stdout)]
        assert len(speeds) == 3
        # at 4 Hz most starts go backward, the one at rest among them
        assert speeds[2] < 0.0 < speeds[0] < speeds[1]
    elif number == 1:
        assert len(pv.get_reader(str(tmp_path / "states.pvd")).time_values) == 4
        forces = [float(x) for x in re.findall(r"kPa: ([0-9.]+) mN", done.stdout)]
        assert len(forces) == 4
        assert forces == sorted(forces)
    else:
        assert "reaction" in done.stdout

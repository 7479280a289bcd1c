"""Sweeps: rows as cases end, nothing lost or done twice, the same rows whoever does the cases."""

from __future__ import annotations

import csv
import json
import math
import os
import shutil
import signal
import subprocess
import time
from dataclasses import replace
from pathlib import Path

import pytest

from fem_biobot.errors import DesignError, DiskError, FileError, MeshError, SolveError
from fem_biobot.mesh import store
from fem_biobot.mesh.store import stored_file, stored_mesh
from fem_biobot.study import sweep_case, sweep_runner
from fem_biobot.study.run import run
from fem_biobot.study.sweep import sweep
from fem_biobot.study.sweep_case import CaseOrder, MeshOrder, kept_row, needs_mesh
from fem_biobot.study.sweep_file import SweepPlan, Task, read_sweep
from fem_biobot.study.sweep_findings import column, rank_correlations, told
from fem_biobot.study.sweep_runner import LocalRunner
from fem_biobot.view.report import views_of
from tests.command import call, command, environment
from tests.sweeps import Dies, Fails, Inline, Mumbles, Says, walks

STRIPS = """
base = "strip"
task = "solve"
[set]
mesh.size = "0.8 mm"
[grid]
muscle.passive_tension = ["2 kPa", "3 kPa"]
"""


def strips(folder: Path, more: str = "") -> SweepPlan:
    file = folder / "strips.toml"
    file.write_text(STRIPS + more)
    return read_sweep(file)


def table(folder: Path) -> list[dict[str, str]]:
    with (folder / "tables" / "cases.csv").open() as file:
        return list(csv.DictReader(file))


def test_failing_cases_are_rows_and_a_grown_sweep_does_only_what_is_new(tmp_path: Path) -> None:
    """Two of four designs cannot be: they stand in the table with the reason. Two new tensions make two new cases.

    Catches: a failure that ends the sweep, rows in the order in which cases end, finished cases done again, other cases
    shown than the extreme ones.
    """
    out, first = tmp_path / "out", Inline()
    summary = sweep(read_sweep(walks(tmp_path)), out, runner=lambda folder: first)
    assert (summary["sweep"]["done_1"], summary["sweep"]["failed_1"]) == (2, 2)
    rows = table(out)
    assert [row["case"] for row in rows] == ["1", "2", "3", "4"]
    assert [row["status"] for row in rows] == ["done", "failed"] * 2
    assert [float(row["muscle.passive_tension_kPa"]) for row in rows] == [0.9, 0.9, 1.7, 1.7]
    assert "skeleton.short_pillar_height" in rows[1]["reason"]
    assert float(rows[2]["stroke_mm"]) > 0.05
    assert [row["works"] for row in rows] == ["good", "", "good", ""]
    assert first.closed
    assert sorted(first.names) == sorted(row["key"] for row in rows if row["status"] == "done")
    strokes = {float(row["speed_mm_per_s"]): row["case"] for row in rows if row["status"] == "done"}
    titles = [view.title for view in views_of(out / "report.html")]
    assert [title.split(" speed")[0] for title in titles] == [
        f"Case {strokes[max(strokes)]}: largest", f"Case {strokes[min(strokes)]}: smallest"
    ]  # fmt: skip
    # the case's folder is the command's own result
    assert json.loads((out / "cases" / rows[0]["key"] / "summary.json").read_text())["job"]["kind"] == "walk"
    again = Inline()
    assert sweep(read_sweep(walks(tmp_path)), out, runner=lambda folder: again)["sweep"] == summary["sweep"]
    assert again.names == []
    grown = read_sweep(walks(tmp_path, '"0.9 kPa", "1.3 kPa", "1.7 kPa"', '"0.68 mm"'))
    sweep(grown, out, runner=lambda folder: again)
    assert again.names == [grown.cases[1].key]
    assert [row["stroke_mm"] for row in table(out)[::2]] == [row["stroke_mm"] for row in rows[::2]]
    everything = Inline()
    sweep(grown, out, runner=lambda folder: everything, force=True)
    assert len(everything.names) == 3


def test_workers_die_with_a_killed_sweep_and_no_finished_case_is_lost_or_done_again(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """SIGKILL once two of six rows are there: no process is left; the same command brings the rest, these untouched.

    Catches: a table that only the end writes, orphans that go on writing, cases done again after a kill.
    """
    file, out = walks(tmp_path, ", ".join(f'"{k / 10} kPa"' for k in range(9, 15)), '"0.68 mm"'), tmp_path / "out"
    mark = f"sweep_{os.getpid()}_{time.monotonic_ns()}"
    given = ("study", "sweep", file, "--out", out, "--workers", "2", "--quiet")
    process = subprocess.Popen(command(*given), env=environment(SWEEP_TEST_MARK=mark))
    try:
        deadline = time.monotonic() + 240.0
        while len(list((out / "cases").glob("[0-9a-f]*.json")) if out.exists() else []) < 2:
            assert process.poll() is None, "the sweep ended before it was killed"
            assert time.monotonic() < deadline, "no case ended"
            time.sleep(0.005)
    finally:
        process.send_signal(signal.SIGKILL)
        process.wait()
    if Path("/proc/self/environ").exists():
        deadline = time.monotonic() + 20.0
        while _marked(mark):
            assert time.monotonic() < deadline, "workers outlived the sweep"
            time.sleep(0.05)
    kept = {row.name: row.stat().st_mtime_ns for row in (out / "cases").glob("[0-9a-f]*.json")}
    assert 2 <= len(kept) < 6
    assert not (out / "summary.json").exists()
    said = call(capsys, "study", "sweep", file, "--out", out, "--workers", "1", "--resume")
    assert said.code == 0
    assert f"{len(kept)} of 6 cases were finished before" in said.err
    assert len(table(out)) == 6
    for name, when in kept.items():
        assert (out / "cases" / name).stat().st_mtime_ns == when


def _marked(mark: str) -> list[str]:
    """Processes whose environment has a mark."""
    found = []
    for process in Path("/proc").glob("[0-9]*"):
        try:
            if mark.encode() in (process / "environ").read_bytes():
                found.append(process.name)
        except OSError:
            continue
    return found


def test_a_dask_cluster_gives_the_same_table(tmp_path: Path) -> None:
    """A scheduler and two workers on 127.0.0.1, by address: the table is the one of this machine, byte for byte.

    Catches: rows that tell who did them or when, an order that a cluster cannot carry.
    """
    distributed = pytest.importorskip("distributed")
    from fem_biobot.study.sweep_cluster import ClusterRunner

    plan = read_sweep(walks(tmp_path))
    sweep(plan, tmp_path / "here", runner=lambda folder: Inline())
    cluster = distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, host="127.0.0.1", dashboard_address=None, silence_logs=50
    )
    with cluster:
        assert cluster.scheduler_address.startswith("tcp://127.0.0.1:")
        summary = sweep(
            plan, tmp_path / "there", runner=lambda folder: ClusterRunner(cluster.scheduler_address, folder)
        )
        runner = ClusterRunner(cluster.scheduler_address, tmp_path)
        runner.submit("a", Fails())
        assert runner.wait() == [("a", "its worker gave no answer: no such luck")]
        runner.close()
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr("fem_biobot.__version__", "9.9")
            with pytest.raises(DesignError, match=r"runs fem_biobot .*, expected 9\.9"):
                ClusterRunner(cluster.scheduler_address, tmp_path)
            patch.setattr("fem_biobot.study.sweep_cluster._seen", _sees_nothing)
            with pytest.raises(FileError, match="not seen by the worker"):
                ClusterRunner(cluster.scheduler_address, tmp_path)
    assert summary["sweep"]["done_1"] == 2
    here, there = ((tmp_path / name / "tables" / "cases.csv").read_bytes() for name in ("here", "there"))
    assert here == there


def _sees_nothing(mark: str) -> tuple[str, str]:
    return "", mark


def test_clusters_that_are_none_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An address where nobody answers, a scheduler without workers, no Dask at all: one line each.

    Catches: waiting for ever, a traceback of an optional package.
    """
    from fem_biobot.study import sweep_cluster

    distributed = pytest.importorskip("distributed")
    monkeypatch.setattr(sweep_cluster, "_PATIENCE", 1)
    with pytest.raises(DesignError, match="where no scheduler answers within 1 s"):
        sweep_cluster.ClusterRunner("tcp://127.0.0.1:9", tmp_path)
    cluster = distributed.LocalCluster(n_workers=0, host="127.0.0.1", dashboard_address=None, silence_logs=50)
    with cluster, pytest.raises(DesignError, match="a scheduler without workers"):
        sweep_cluster.ClusterRunner(cluster.scheduler_address, tmp_path)
    monkeypatch.setitem(__import__("sys").modules, "distributed", None)
    with pytest.raises(DesignError, match=r'pip install "fem_biobot\[cluster\]"'):
        sweep_cluster.ClusterRunner("tcp://127.0.0.1:9", tmp_path)


def test_a_worker_that_answers_nonsense_is_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its order is told to have no answer.

    Catches: waiting for the end of a process that does not end.
    """
    monkeypatch.setattr(sweep_runner, "_LAST_WORDS", 0.2)
    runner = LocalRunner(1)
    try:
        runner.submit("a", Mumbles())
        assert runner.wait() == [("a", "its worker process gave no answer that can be read")]
    finally:
        runner.close()


def test_a_worker_that_dies_costs_its_order_alone() -> None:
    """It is told how it ended, and another takes its place; a worker has one thread, and what it prints is no answer.

    Catches: a pool that breaks as a whole, threads that multiply, answers torn by what libraries print.
    """
    runner = LocalRunner(1)
    try:
        for name, order in (("a", Says("x")), ("b", Dies()), ("c", Says("y"))):
            runner.submit(name, order)
        found = {}
        while len(found) < 3:
            found |= dict(runner.wait())
    finally:
        runner.close()
    assert "signal 9" in str(found["b"])
    first, second = found["a"], found["c"]
    assert isinstance(first, dict)
    assert isinstance(second, dict)
    assert (first["word"], second["word"]) == ("x", "y")
    assert first["pid"] != second["pid"]
    assert os.getpid() not in (first["pid"], second["pid"])
    assert first["threads"] == "1"


def test_meshes_of_equal_geometry_are_made_once_and_change_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two tensions, one mesh; rows are those of the command on a mesh of its own, to what rounding does to a solve.

    Catches: a mesh a case, a file that rounds coordinates, the state of another drive taken for the peak.
    """
    made = []
    real = store.mesh_for
    monkeypatch.setattr(store, "mesh_for", lambda design: made.append(design.mesh.size) or real(design))
    plan, runner = strips(tmp_path), Inline()
    sweep(plan, tmp_path / "out", runner=lambda folder: runner)
    assert made == [0.8]
    assert len(list((tmp_path / "out" / "meshes").iterdir())) == 1
    design = plan.cases[1].design
    assert design is not None
    direct = run(design, tmp_path / "direct", complete=False)["solid"]["states"]
    peak = next(state for state in direct if state["key"] == "peak")
    row = table(tmp_path / "out")[1]
    for name in ("tension_kPa", "muscle_force_mN", "fibre_stretch_1", "tip_closing_mm"):
        assert float(row[name]) == pytest.approx(peak[name], rel=1e-9)


def test_a_store_tells_shapes_and_sizes_apart(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Another size or length is another file, another tension is not; a substitute is not stored.

    Catches: a key of the whole design, a key without the size, a note that later cases miss.
    """
    design = strips(tmp_path).base
    file = stored_file(design, tmp_path)
    assert stored_file(design.with_values({"muscle.passive_tension": 5.0}), tmp_path) == file
    for change in ({"mesh.size": 0.81}, {"muscle.junction_length": 5.1}):
        assert stored_file(design.with_values(change), tmp_path) != file
    mesh, _ = stored_mesh(design, tmp_path)
    monkeypatch.setattr(store, "mesh_for", lambda design: (mesh, ["another was used"]))
    other = design.with_values({"mesh.size": 0.81})
    assert stored_mesh(other, tmp_path)[1] == ["another was used"]
    assert not stored_file(other, tmp_path).exists()


def test_a_case_keeps_what_its_design_decides_and_tries_again_what_chance_did(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A failed solve is a row for good; a missing file, no memory, a defect are told, not kept; a full disk ends all.

    Catches: an accident kept for ever, a failed solve done again at every start, a sweep that goes on on a full disk.
    """
    (tmp_path / "cases").mkdir()
    design = strips(tmp_path).base
    order = CaseOrder("0123456789abcdef", Task.solve, design, tmp_path / "cases", tmp_path)
    for error, word, kept in (
        (SolveError("no equilibrium"), "no equilibrium", True),
        (FileError("gone"), "gone", False),
        (MemoryError(), "out of memory", False),
        (ZeroDivisionError("x"), "internal error: ZeroDivisionError: x", False),
    ):
        monkeypatch.setitem(sweep_case._JOBS, Task.solve, _raising(error))
        row = order.perform()
        assert row["status"] == "failed"
        assert word in row["reason"]
        assert (kept_row(order.cases, order.key) is not None) == kept
        (order.cases / f"{order.key}.json").unlink(missing_ok=True)
    monkeypatch.setitem(sweep_case._JOBS, Task.solve, _raising(DiskError("full")))
    with pytest.raises(DiskError, match="full"):
        sweep(strips(tmp_path), tmp_path / "out", runner=lambda folder: Inline())
    monkeypatch.setitem(sweep_case._JOBS, Task.solve, _raising(SolveError("too thin")))
    with pytest.raises(SolveError, match="none of 2 cases came to a result; the first: too thin"):
        sweep(strips(tmp_path), tmp_path / "out", runner=lambda folder: Inline())
    monkeypatch.setitem(sweep_case._JOBS, Task.solve, lambda order: {})
    monkeypatch.setattr(sweep_case, "write_json", _raising(DiskError("no room for a row")))
    assert order.perform()["status"] == "disk"


def _raising(error: Exception):
    def job(*given: object) -> None:
        raise error

    return job


def test_a_mesh_that_cannot_be_made_is_left_to_its_cases(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The order for the mesh says so and the case, tried all the same, fails with that reason; a full disk ends all.

    Catches: a case that waits for a mesh for ever.
    """
    monkeypatch.setattr(sweep_case, "stored_mesh", _raising(MeshError("too coarse")))
    monkeypatch.setitem(sweep_case._JOBS, Task.solve, _raising(MeshError("too coarse")))
    order = MeshOrder(strips(tmp_path).base, tmp_path)
    assert order.perform() == {"status": "failed", "reason": "too coarse"}
    with pytest.raises(SolveError, match="too coarse"):
        sweep(strips(tmp_path), tmp_path / "out", runner=lambda folder: Inline())
    monkeypatch.setattr(sweep_case, "stored_mesh", _raising(DiskError("full")))
    assert order.perform() == {"status": "disk", "reason": "full"}
    shutil.rmtree(tmp_path / "out")
    with pytest.raises(DiskError, match="full"):
        sweep(strips(tmp_path), tmp_path / "out", runner=lambda folder: Inline())


def test_walks_need_no_mesh(tmp_path: Path) -> None:
    """And what is solved does.

    Catches: rods that wait for a mesh of theirs.
    """
    design = strips(tmp_path).base
    order = CaseOrder("0123456789abcdef", Task.walk, design, tmp_path, tmp_path)
    assert needs_mesh(order) is None
    assert needs_mesh(replace(order, task=Task.solve)) == stored_file(design, tmp_path)


def test_a_row_that_is_no_row_is_refused(tmp_path: Path) -> None:
    """Its file is named.

    Catches: half a row taken for a finished case.
    """
    (tmp_path / "a.json").write_text("{")
    with pytest.raises(FileError, match=r"a\.json: cannot be read"):
        kept_row(tmp_path, "a")


def test_rank_correlations_see_what_matters() -> None:
    """Of y = exp(a) - b / 5 over a Latin square: 1 with a, little with b, none with a word; none from four rows.

    Catches: Pearson's correlation, texts ranked by the alphabet, correlations of nothing.
    """
    rows = [{"a": float(k), "b": float(3 * k % 7), "word": "x", "y": math.exp(k) - 3 * k % 7 / 5} for k in range(7)]
    (found,) = rank_correlations(rows, ["a", "b", "word"], ["y"])
    assert found["a"] == 1.0
    assert abs(found["b"]) < 0.5
    assert "word" not in found
    assert rank_correlations(rows[:4], ["a"], ["y"]) == []
    constant = [{**row, "y": 1.0} for row in rows]
    assert rank_correlations(constant, ["a"], ["y"])[0]["a"] is None


def test_columns_carry_their_units() -> None:
    """Angles in degrees, compound units in words, texts without.

    Catches: radians under the name of degrees, a column without a unit.
    """
    assert column("skeleton.beam_width") == "skeleton.beam_width_mm"
    assert column("muscle.theta") == "muscle.theta_deg"
    assert column("muscle.material.density") == "muscle.material.density_kg_per_mm3"
    assert column("muscle.reference") == "muscle.reference"
    assert told("muscle.theta", math.radians(70.0)) == 70.0
    assert told("muscle.reference", "remodelled") == "remodelled"
    assert told("skeleton.beam_width", 7.0) == 7.0


@pytest.mark.parametrize(
    ("options", "word"),
    [
        (["--workers", "0"], "--workers: found 0"),
        (["--workers", "2", "--scheduler", "tcp://127.0.0.1:9"], "found together with --scheduler"),
        (["--force", "--resume"], "found together with --force"),
    ],
)
def test_bad_options_are_refused(
    options: list[str], word: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Exit code 2 and one line, nothing written.

    Catches: a folder made before the refusal.
    """
    said = call(capsys, "study", "sweep", walks(tmp_path), "--out", tmp_path / "out", *options)
    assert said.code == 2
    assert word in said.complaint
    assert not (tmp_path / "out").exists()


def test_rods_alone_are_not_solved(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A walker has no solid, which is said before anything is done; another sweep's base is refused in its folder.

    Catches: as many failed rows as cases, two sweeps mixed in one folder.
    """
    file = tmp_path / "walker.toml"
    file.write_text('base = "elastica_walker"\ntask = "solve"\n[grid]\ndrive.frequency = ["1 Hz"]\n')
    said = call(capsys, "study", "sweep", file, "--out", tmp_path / "out")
    assert (said.code, "kind: found walker" in said.complaint) == (2, True)
    sweep(strips(tmp_path), tmp_path / "out", runner=lambda folder: Inline())
    with pytest.raises(FileError, match="another design"):
        sweep(read_sweep(walks(tmp_path)), tmp_path / "out", runner=lambda folder: Inline())


@pytest.mark.slow
def test_a_cross_check_is_a_case(tmp_path: Path) -> None:
    """Both models at full drive and their differences, as columns.

    Catches: numbers of another tension, the rods with sections from the mesh.
    """
    file = tmp_path / "cross.toml"
    file.write_text(
        'base = "junction_bot"\ntask = "crosscheck"\n[set]\nmesh.size = "3 mm"\n[grid]\nmuscle.theta = ["80 deg"]\n'
    )
    sweep(read_sweep(file), tmp_path / "out", runner=lambda folder: Inline())
    (row,) = table(tmp_path / "out")
    assert float(row["tension_kPa"]) == pytest.approx(10.39)
    solid, rods = float(row["solid_tip_closing_mm"]), float(row["rods_tip_closing_mm"])
    assert float(row["tip_closing_difference_1"]) == pytest.approx(solid / rods - 1.0, rel=1e-9)
    assert 0.0 < float(row["solid_stroke_mm"]) < 1.0

"""Solves of a sweep that begin at a neighbour's states: which one follows from the file, and the rows tell nothing."""

from __future__ import annotations

import csv
import json
import math
import shutil
import signal
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from fem_biobot.errors import SolveError
from fem_biobot.study import sweep_case, sweep_findings
from fem_biobot.study.neighbour import STATES
from fem_biobot.study.reporter import Silent
from fem_biobot.study.sweep import sweep
from fem_biobot.study.sweep_case import CaseOrder
from fem_biobot.study.sweep_file import Start, SweepPlan, Task, read_sweep
from fem_biobot.study.sweep_forest import _spread, forest
from tests.command import call, command, environment
from tests.sweeps import Inline, one_thread

STRIPS = """
base = "strip"
task = "solve"
{head}
[set]
mesh.size = "{size} mm"
[grid]
muscle.passive_tension = [{tensions}]
{more}
"""
TENSIONS = '"2 kPa", "2.2 kPa", "2.5 kPa", "2.9 kPa", "3.1 kPa"'


def strips(folder: Path, tensions: str = TENSIONS, head: str = "", more: str = "", size: float = 1.1) -> SweepPlan:
    """Strips of one mesh or more, under some tensions."""
    file = folder / "strips.toml"
    file.write_text(STRIPS.format(head=head, tensions=tensions, more=more, size=size))
    return read_sweep(file)


def table(folder: Path) -> bytes:
    return (folder / "tables" / "cases.csv").read_bytes()


def rows(folder: Path) -> list[dict[str, str]]:
    with (folder / "tables" / "cases.csv").open() as file:
        return list(csv.DictReader(file))


@pytest.fixture(autouse=True)
def _no_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pictures of sweeps are others' matter and take as long as the solves."""
    monkeypatch.setattr(sweep_findings, "_draw", lambda *given: [])


@pytest.fixture(autouse=True, scope="module")
def _as_workers() -> Iterator[None]:
    with one_thread():
        yield


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of the sweep done in one go, one case after the other."""
    folder = tmp_path_factory.mktemp("whole")
    sweep(strips(folder), folder / "out", runner=lambda place: Inline(1))
    return folder / "out"


def unfinished(whole: Path, out: Path, key: str) -> None:
    """A copy of a sweep as if it had been killed before a case ended."""
    shutil.copytree(whole, out)
    (out / ".unfinished").mkdir()
    (out / ".unfinished" / "job.json").write_text(json.dumps(json.loads((out / "summary.json").read_text())["job"]))
    (out / "summary.json").unlink()
    (out / "cases" / f"{key}.json").unlink()


def kept(folder: Path, key: str) -> dict:
    return json.loads((folder / "cases" / f"{key}.json").read_text())


def far(one: list[dict[str, str]], other: list[dict[str, str]], name: str) -> float:
    """Largest relative difference of a number in two tables."""
    return max(abs(float(a[name]) / float(b[name]) - 1.0) for a, b in zip(one, other, strict=True))


def test_trees_are_shallow_and_parents_are_the_nearest_before(tmp_path: Path) -> None:
    """Of 64 random points eight begin alone, spread out, and the rest at the nearest before it, at most five deep.

    Catches: a chain along the file, parents after their children, a parent that is not the nearest, clustered roots.
    """
    points = np.random.default_rng(97).random((64, 3))
    order, nearest = _spread(points)
    assert sorted(order) == list(range(64))
    depth = dict.fromkeys(order[:8], 0)
    for place, number in enumerate(order[1:], start=1):
        before = order[:place]
        apart = np.linalg.norm(points[before] - points[number], axis=1)
        assert nearest[number] in before
        assert np.linalg.norm(points[nearest[number]] - points[number]) == pytest.approx(apart.min(), abs=1e-9)
        if place >= 8:
            depth[number] = depth[nearest[number]] + 1
    assert 2 <= max(depth.values()) <= 5
    roots = points[order[:8]]
    gaps = np.linalg.norm(roots[:, None] - roots[None], axis=2)[np.triu_indices(8, 1)]
    assert gaps.min() > 2.0 * np.median([np.sort(np.linalg.norm(points - point, axis=1))[1] for point in points])


def test_a_forest_follows_from_values_not_from_their_order(tmp_path: Path) -> None:
    """The tensions written the other way round give every design the same parent; ranges are of each key.

    Catches: trees by number, a key in Pa that outweighs all others, a key that does not count.
    """
    tensions = [f'"{t} kPa"' for t in (2, 2.2, 2.5, 2.9, 3.1)]
    there = forest(strips(tmp_path, ", ".join(tensions)).cases)
    back = forest(strips(tmp_path, ", ".join(tensions[::-1])).cases)
    assert dict(there.parent) == dict(back.parent)
    assert len(there.parent) == 2
    assert there.depth() == 1
    # each key over its range: the nearest in kPa is another case for some
    stiffness = '"9 kPa", "9.07 kPa", "9.13 kPa", "9.2 kPa"'
    two = strips(tmp_path, '"2 kPa", "2.6 kPa", "3.5 kPa", "4 kPa"', more=f"muscle.material.young = [{stiffness}]")
    by_key = {case.key: tuple(case.values.values()) for case in two.cases}
    found = forest(two.cases)
    assert len(found.parent) == 12
    others = 0
    for child, parent in found.parent.items():
        (t0, e0), before = by_key[child], [key for key in by_key if found.rank[key] < found.rank[child]]
        over = {k: math.hypot((t0 - by_key[k][0]) / 2.0, (e0 - by_key[k][1]) / 0.2) for k in before}
        raw = {k: math.hypot(t0 - by_key[k][0], e0 - by_key[k][1]) for k in before}
        assert over[parent] == pytest.approx(min(over.values()), abs=1e-9)
        others += raw[parent] > min(raw.values()) + 1e-6
    assert others >= 3


def test_trees_stay_on_their_mesh(tmp_path: Path) -> None:
    """Two lengths and two kinds of element are four meshes; words are a distance; rings that slide have no parents.

    Catches: states of another mesh, of other nodes, or of a path with friction taken over.
    """
    plan = strips(
        tmp_path,
        '"2 kPa", "2.4 kPa", "3 kPa"',
        more='muscle.junction_length = ["5 mm", "5.5 mm"]\nmesh.element = ["P2", "P2-P1"]',
    )
    found = forest(plan.cases)
    values = {case.key: case.values for case in plan.cases}
    assert len(found.parent) == 4
    for child, parent in found.parent.items():
        for key in ("muscle.junction_length", "mesh.element"):
            assert values[child][key] == values[parent][key]
    words = strips(tmp_path, '"2 kPa", "2.4 kPa", "3 kPa"', more='muscle.convention = ["nominal", "kirchhoff"]')
    same = [words.cases, forest(words.cases)]
    values = {case.key: case.values for case in same[0]}
    assert all(values[a]["muscle.convention"] == values[b]["muscle.convention"] for a, b in same[1].parent.items())
    file = tmp_path / "rings.toml"
    file.write_text(
        'base = "ring_bot"\ntask = "solve"\n[set]\nmuscle.attachment = "contact"\nmuscle.pillar_friction = 0.1\n'
        '[grid]\nmuscle.passive_tension = ["2 kPa", "2.4 kPa", "3 kPa"]\n'
    )
    assert not forest(read_sweep(file).cases).rank


def test_a_file_says_where_solves_begin(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """At neighbours unless it says cold; other words and other tasks are refused in one line.

    Catches: a misspelt word that changes nothing, walks that claim to have neighbours.
    """
    assert strips(tmp_path).start is Start.neighbour
    assert strips(tmp_path, head='start = "cold"').start is Start.cold
    assert strips(tmp_path, head='start = "neighbour"').start is Start.neighbour
    body = '[grid]\nmuscle.theta = ["70 deg"]\n'
    for head, words in (
        ('task = "solve"\nstart = "warm"\n', 'start: found "warm", expected one of: neighbour, cold'),
        (
            'task = "walk"\nstart = "neighbour"\n',
            'start: found "neighbour" with task walk, expected it with task solve',
        ),
    ):
        file = tmp_path / "some.toml"
        file.write_text(f'base = "junction_bot"\n{head}{body}')
        said = call(capsys, "study", "sweep", file, "--out", tmp_path / "none")
        assert said.code == 2
        assert words in said.complaint
    file.write_text(f'base = "junction_bot"\ntask = "walk"\n{body}')
    assert read_sweep(file).start is Start.cold


def test_when_cases_end_is_not_seen(tmp_path: Path, whole: Path) -> None:
    """One by one, and three at a time with the latest first: the same bytes; cold rows agree within the tolerance.

    A child is given out after its parent's end, and begins at its states.

    Catches: a child given out with its parent, the nearest that happens to have ended taken for the parent, rows that
    are another equilibrium's, states kept for nobody.
    """
    plan = strips(tmp_path)
    runner = Inline(3)
    summary = sweep(plan, tmp_path / "three", runner=lambda folder: runner)["sweep"]
    assert (summary["done_1"], summary["begun_beside_1"]) == (5, 2)
    for child, parent in forest(plan.cases).parent.items():
        assert runner.names.index(child) > runner.names.index(parent)
        assert kept(tmp_path / "three", child)["parent"] == parent
    assert table(whole) == table(tmp_path / "three")
    cold = strips(tmp_path, head='start = "cold"')
    summary = sweep(cold, tmp_path / "cold", runner=lambda folder: Inline())["sweep"]
    assert summary["begun_beside_1"] == 0
    assert not list((tmp_path / "cold" / "cases").rglob(STATES))
    for name in ("fibre_stretch_1", "strain_energy_uJ"):
        assert far(rows(whole), rows(tmp_path / "cold"), name) < 1e-8


@pytest.mark.slow
def test_a_cluster_gives_the_same_bytes(tmp_path: Path, whole: Path) -> None:
    """A scheduler and two workers on 127.0.0.1.

    Catches: children that a cluster is given before their parents have ended.
    """
    distributed = pytest.importorskip("distributed")
    from fem_biobot.study.sweep_cluster import ClusterRunner

    cluster = distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, host="127.0.0.1", dashboard_address=None, silence_logs=50
    )
    with cluster:
        sweep(
            strips(tmp_path), tmp_path / "out", runner=lambda folder: ClusterRunner(cluster.scheduler_address, folder)
        )
    assert table(whole) == table(tmp_path / "out")


def test_a_killed_sweep_goes_on_to_the_same_bytes(tmp_path: Path, whole: Path) -> None:
    """SIGKILL with two workers once two rows are there; these stay, and the table is that of one go by one worker.

    Catches: children that begin elsewhere after a resume, finished cases done again.
    """
    plan, out = strips(tmp_path), tmp_path / "out"
    file = tmp_path / "strips.toml"
    given = ("study", "sweep", file, "--out", out, "--workers", "2", "--quiet")
    process = subprocess.Popen(command(*given), env=environment())
    try:
        deadline = time.monotonic() + 240.0
        while len(list((out / "cases").glob("[0-9a-f]*.json")) if out.exists() else []) < 2:
            assert process.poll() is None, "the sweep ended before it was killed"
            assert time.monotonic() < deadline, "no case ended"
            time.sleep(0.002)
    finally:
        process.send_signal(signal.SIGKILL)
        process.wait()
    before = {row.name: row.stat().st_mtime_ns for row in (out / "cases").glob("[0-9a-f]*.json")}
    assert 2 <= len(before) < 5
    sweep(plan, out, runner=lambda folder: Inline(3))
    assert table(out) == table(whole)
    for name, when in before.items():
        assert (out / "cases" / name).stat().st_mtime_ns == when


def test_a_case_that_was_begun_begins_anew(tmp_path: Path, whole: Path) -> None:
    """Of its first state another one was kept when it was cut short; its row is that of one go all the same.

    Catches: states of before and of after put together, which rows would tell in their digits.
    """
    plan, out = strips(tmp_path), tmp_path / "out"
    child, parent = next(iter(forest(plan.cases).parent.items()))
    unfinished(whole, out, child)
    folder = out / "cases" / child
    left = folder / ".unfinished"
    left.mkdir()
    (left / "job.json").write_text(json.dumps(json.loads((folder / "summary.json").read_text())["job"]))
    (folder / "summary.json").unlink()
    with np.load(out / "cases" / parent / STATES) as states:
        u = states["peak.u"]
    np.savez(left / "peak.npz", u=u, step=[1.0, 1.0], natural_stretch=1.0, work=[0.0, 1, 1, 1])
    runner = Inline()
    sweep(plan, out, runner=lambda place: runner)
    assert runner.names == [child]
    assert table(out) == table(whole)


def test_children_of_a_failure_begin_by_themselves(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A parent that comes to nothing leaves its children the undeformed body; so does one known from before.

    Catches: children that wait for ever, that fail with their parent, or look for states that are not there.
    """
    plan = strips(tmp_path)
    parents = forest(plan.cases).parent
    bad = set(parents.values())
    begun: dict[str, str | None] = {}

    def job(order: CaseOrder) -> dict:
        if order.key in bad:
            raise SolveError("no equilibrium")
        begun[order.key] = order.parent
        return {"outputs": {}, "parent": order.parent}

    monkeypatch.setitem(sweep_case._JOBS, Task.solve, job)
    summary = sweep(plan, tmp_path / "out", runner=lambda folder: Inline())["sweep"]
    assert summary["failed_1"] == len(bad)
    assert summary["done_1"] == 5 - len(bad)
    assert begun == {key: None for key in begun}
    child = next(iter(parents))
    unfinished(tmp_path / "out", tmp_path / "again", child)
    begun.clear()
    sweep(plan, tmp_path / "again", runner=lambda folder: Inline())
    assert begun == {child: None}


@pytest.mark.parametrize("harm", ["gone", "cut"])
def test_states_that_were_lost_are_made_again(harm: str, tmp_path: Path, whole: Path) -> None:
    """The parent of a case still to do is done again where its states are gone or cut short; its row stays as it was.

    Catches: a child that begins elsewhere and says nothing, half a file taken for states, a finished row written anew,
    states that nobody asks for made again.
    """
    plan, out = strips(tmp_path), tmp_path / "out"
    child, parent = next(iter(forest(plan.cases).parent.items()))
    unfinished(whole, out, child)
    when = (out / "cases" / f"{parent}.json").stat().st_mtime_ns
    for case in plan.cases:
        states = out / "cases" / case.key / STATES
        if harm == "gone":
            states.unlink()
        else:
            states.write_bytes(states.read_bytes()[:-900])
    runner = Inline()
    sweep(plan, out, runner=lambda folder: runner)
    assert runner.names == [parent, child]
    assert table(out) == table(whole)
    assert kept(out, child)["parent"] == parent
    assert (out / "cases" / f"{parent}.json").stat().st_mtime_ns == when


def test_added_cases_begin_at_finished_ones(tmp_path: Path, whole: Path) -> None:
    """Two more tensions: only they are done, at the parents that the file as it is now gives them.

    Their rows are those of the whole file done at once, within the tolerance of the states.

    Catches: finished cases done again because their parent is another one now, new ones without neighbours.
    """
    out = tmp_path / "out"
    shutil.copytree(whole, out)
    grown = strips(tmp_path, TENSIONS + ', "2.35 kPa", "2.7 kPa"')
    runner = Inline()
    sweep(grown, out, runner=lambda folder: runner)
    new = [case.key for case in grown.cases[5:]]
    assert sorted(runner.names) == sorted(new)
    parents = forest(grown.cases).parent
    assert [kept(out, key)["parent"] for key in new] == [parents.get(key) for key in new]
    assert any(key in parents for key in new)
    sweep(grown, tmp_path / "fresh", runner=lambda folder: Inline())
    for name in ("fibre_stretch_1", "strain_energy_uJ"):
        assert far(rows(out), rows(tmp_path / "fresh"), name) < 1e-8


def test_a_finished_row_outlives_its_redo(tmp_path: Path, whole: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Done again for its lost states, a parent comes to nothing: its row stays to the byte, its child begins by itself.

    Catches: a failure written over a finished row, a child that begins at states that are gone.
    """
    plan, out = strips(tmp_path), tmp_path / "out"
    child, parent = next(iter(forest(plan.cases).parent.items()))
    unfinished(whole, out, child)
    (out / "cases" / parent / STATES).unlink()
    row = (out / "cases" / f"{parent}.json").read_bytes()

    def job(order: CaseOrder) -> dict:
        if order.key == parent:
            raise SolveError("no equilibrium")
        return {"parent": order.parent}

    monkeypatch.setitem(sweep_case._JOBS, Task.solve, job)
    runner = Inline()
    summary = sweep(plan, out, runner=lambda folder: runner)
    assert runner.names == [parent, child]
    assert (out / "cases" / f"{parent}.json").read_bytes() == row
    assert (kept(out, child)["status"], kept(out, child)["parent"]) == ("done", None)
    assert (summary["complete"], summary["sweep"]["done_1"]) == (True, 5)


class Dying(Inline):
    """Loses the worker of one case."""

    bad = ""

    def wait(self) -> list[tuple[str, dict | str]]:
        """No answer from that case."""
        if self.waiting[-1][0] != self.bad:
            return super().wait()
        return [(self.waiting.pop()[0], "its worker process ended with signal 9")]


@pytest.mark.parametrize("how", ["memory", "worker"])
def test_children_of_what_may_go_well_next_time_wait_for_it(
    how: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No memory, or a worker that dies, over a parent: it and all after it are left without rows, and the same command
    does them then, each at its parent.

    Catches: children that begin cold and keep that, grandchildren forgotten, a sweep that calls itself whole.
    """
    tensions = ", ".join(f'"{2 + 0.07 * k:.2f} kPa"' for k in range(16))
    plan, out = strips(tmp_path, tensions), tmp_path / "out"
    parents = forest(plan.cases).parent
    bad = next(p for c, p in parents.items() if p not in parents and c in parents.values())
    after = {bad}
    while more := {c for c, p in parents.items() if p in after} - after:
        after |= more
    assert 3 <= len(after) < 16
    ill = how == "memory"

    def job(order: CaseOrder) -> dict:
        if order.key == bad and ill:
            raise MemoryError
        return {"parent": order.parent}

    monkeypatch.setitem(sweep_case._JOBS, Task.solve, job)
    monkeypatch.setattr("fem_biobot.study.sweep.kept_states", lambda folder: {})
    runner = Dying()
    runner.bad = bad if how == "worker" else ""
    summary = sweep(plan, out, runner=lambda folder: runner)
    assert summary["complete"] is False
    assert (summary["sweep"]["failed_1"], summary["sweep"]["done_1"]) == (len(after), 16 - len(after))
    assert f"{len(after)} cases are still to be done: the same command does them" in summary["remarks"]
    reasons = {row["key"]: row["reason"] for row in rows(out) if row["status"] == "failed"}
    assert {key for key, reason in reasons.items() if reason == "its neighbour is still to be done"} == after - {bad}
    assert not any((out / "cases" / f"{key}.json").exists() for key in after)
    ill, again = False, Inline()
    summary = sweep(plan, out, runner=lambda folder: again, resume=True)
    assert set(again.names) == after
    assert all(kept(out, key)["parent"] == parents.get(key) for key in after)
    assert (summary["complete"], summary["sweep"]["done_1"]) == (True, 16)


def test_rows_are_all_of_one_start(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Another `start` in the file makes all rows anew, in a finished folder and for rows that do not say theirs, which
    are cold; the same start makes none.

    Catches: the old result handed back, rows sought to 2e-3 beside rows sought to 1e-7, walks done again.
    """
    out = tmp_path / "out"
    monkeypatch.setitem(sweep_case._JOBS, Task.solve, lambda order: {"parent": order.parent})
    monkeypatch.setattr("fem_biobot.study.sweep.kept_states", lambda folder: {})
    plans = {start: strips(tmp_path, head=f'start = "{start}"') for start in Start}
    assert plans[Start.cold].digest != plans[Start.neighbour].digest
    for start, asked in ((Start.cold, 5), (Start.neighbour, 5), (Start.neighbour, 0), (Start.cold, 5)):
        runner = Inline()
        sweep(plans[start], out, runner=lambda folder, runner=runner: runner)
        assert sum(not name.startswith("mesh") for name in runner.names) == asked
        for case in plans[start].cases:
            row = kept(out, case.key)
            assert row["start"] == start
            assert (row["parent"] is not None) == (
                start is Start.neighbour and case.key in forest(plans[start].cases).parent
            )
    for case in plans[Start.cold].cases:
        row = kept(out, case.key)
        del row["start"]
        (out / "cases" / f"{case.key}.json").write_text(json.dumps(row))
    (out / "summary.json").write_text((out / "summary.json").read_text().replace(plans[Start.cold].digest, "before"))
    for start, asked in ((Start.cold, 0), (Start.neighbour, 5)):
        runner = Inline()
        sweep(plans[start], out, runner=lambda folder, runner=runner: runner)
        assert len(runner.names) == asked


def test_many_cases_are_told_to_wait(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A stage of its own where more cases than some have their neighbours found, none below.

    Catches: minutes of silence before the first case.
    """
    monkeypatch.setitem(sweep_case._JOBS, Task.solve, lambda order: {})

    class Told(Silent):
        def __init__(self) -> None:
            self.stages: list[str] = []

        def stage(self, name: str, total: int | None = None) -> None:
            self.stages.append(name)

    for most, expected in ((5, False), (4, True)):
        monkeypatch.setattr("fem_biobot.study.sweep._MANY", most)
        told = Told()
        sweep(strips(tmp_path), tmp_path / f"{most}", runner=lambda folder: Inline(), reporter=told)
        assert ("neighbours" in told.stages) == expected

"""The command `walk` and its job: what it writes, what it refuses, going on as if it had not stopped."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fem_biobot.config import digest, load_design
from fem_biobot.design import Design
from fem_biobot.errors import DesignError, FileError, SolveError
from fem_biobot.rod.dynamics.integrate import Motion
from fem_biobot.rod.walk import walk
from fem_biobot.study.reporter import Silent
from fem_biobot.study.walking import WalkPlan, walk_design

# moves enough at a low standing tension for its strokes to differ
SETS = ["muscle.passive_tension=0.9 kPa", "muscle.active_tension=2.7 kPa", "numerics.step=2 ms"]
PLAN = WalkPlan((2.0,), 1.5, 1.0)


class Stops(Silent):
    """A reporter that interrupts after so many strokes."""

    def __init__(self, after: int) -> None:
        self.left = after

    def advance(self, done: str = "") -> None:
        if done.startswith("stroke"):
            self.left -= 1
            if self.left == 0:
                raise KeyboardInterrupt


@pytest.fixture(scope="module")
def design() -> Design:
    return load_design("junction_bot", SETS)


@pytest.fixture(scope="module")
def result(design: Design, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    out = tmp_path_factory.mktemp("walk") / "out"
    return out, walk_design(design, out, PLAN)


def samples(out: Path) -> np.ndarray:
    """Position of the centre of mass over time, as written."""
    return np.genfromtxt(out / "tables" / "walk_2Hz_air.csv", delimiter=",", names=True)["position_x_mm"]


def test_a_walk_leaves_a_whole_result(result: tuple[Path, dict[str, Any]], design: Design) -> None:
    """Summary, resolved design, tables, rods over time, plots, animation and report are there, and nothing else.

    Catches: a file that is named and not written, unfinished strokes left behind.
    """
    out, summary = result
    assert json.loads((out / "summary.json").read_text()) == json.loads(json.dumps(summary))
    assert digest(load_design(out / "design.toml")) == digest(design) == summary["design_digest"]
    names = {str(p.relative_to(out)) for p in out.rglob("*") if p.is_file()}
    assert {"report.html", "rod.pvd", "tables/walks.csv", "tables/walk_strokes.csv", "tables/walk_2Hz_air.csv"} <= names
    assert any(n.endswith(".gif") for n in names)
    assert sum(n.endswith(".png") for n in names) >= 2
    assert not any(".unfinished" in n or ".tmp" in n for n in names)


def test_the_summary_of_a_walk_has_the_keys_of_the_contract(result: tuple[Path, dict[str, Any]]) -> None:
    """Every walk has its model, speed, step, stroke, slip, work and efficiencies.

    What a walk is to be read with is among the notes of the result. Catches: a key renamed, a note of the walk that no
    report shows.
    """
    _, summary = result
    (walk,) = summary["walks"]
    assert set(walk) >= {
        "model", "frequency_Hz", "speed_mm_per_s", "step_mm", "step_spread_mm", "stroke_mm", "slip_fraction_1",
        "work_pillar_uJ", "work_walk_uJ", "efficiency_1", "mechanical_efficiency_1", "energy_error_1",
    }  # fmt: skip
    assert walk["model"] == "rod"
    assert summary["notes"] == [f"walking: {walk['notes'][0]}"]
    assert walk["stroke_mm"] > 0.1
    assert abs(walk["energy_error_1"]) < 1e-2


def test_an_interrupted_walk_goes_on_as_if_it_had_not_stopped(
    result: tuple[Path, dict[str, Any]], design: Design, tmp_path: Path
) -> None:
    """Stopped after its second stroke and run again, a walk has the same samples to the last digit.

    Catches: a checkpoint without impulses or slip, a drive that begins anew, a stroke lost or walked twice.
    """
    out = tmp_path / "out"
    with pytest.raises(KeyboardInterrupt):
        walk_design(design, out, PLAN, reporter=Stops(2))
    assert json.loads((out / "summary.json").read_text())["complete"] is False
    walk_design(design, out, PLAN, resume=True)
    assert (out / "tables" / "walk_2Hz_air.csv").read_bytes() == (
        result[0] / "tables" / "walk_2Hz_air.csv"
    ).read_bytes()
    assert samples(out).size > 100


def test_a_resumed_walk_that_fails_keeps_the_strokes_before(design: Design, tmp_path: Path) -> None:
    """What an earlier try walked is part of what a failure leaves, and a fall that ended it is not walked past.

    Catches: a failure after going on that reports the last stroke alone, a fallen machine driven further.
    """
    kept: list[Motion] = []
    walk(design, frequency=2.0, duration=1.0, keeper=kept.append)
    wild = design.with_values({"muscle.active_tension": 4e7})
    with pytest.raises(SolveError) as failure:
        walk(wild, frequency=2.0, duration=1.5, before=kept)
    assert failure.value.best.motion.times[0] == 0.0
    assert failure.value.best.motion.times[-1] >= kept[-1].final.time
    whole = walk(design, frequency=2.0, duration=1.0, before=kept)
    assert len(whole.times) == len(kept[0].times) + len(kept[1].times) - 1
    assert whole.motion.final is kept[-1].final


def test_a_whole_walk_is_reused_and_another_refused(result: tuple[Path, dict[str, Any]], design: Design) -> None:
    """The same walk is read back; another one of this design, or of another design, is refused and loses nothing.

    Catches: a result written over by a walk at another frequency.
    """
    out, summary = result
    before = {p: p.read_bytes() for p in out.rglob("*") if p.is_file()}
    assert walk_design(design, out, PLAN)["timings_s"] == json.loads(json.dumps(summary["timings_s"]))
    with pytest.raises(FileError, match="another job"):
        walk_design(design, out, WalkPlan((4.0,), 1.5, 1.0))
    with pytest.raises(FileError, match="another design"):
        walk_design(design.with_values({"muscle.gamma": 0.9}), out, PLAN)
    assert {p: p.read_bytes() for p in out.rglob("*") if p.is_file()} == before


def test_a_walk_that_cannot_go_on_leaves_what_was_reached(design: Design, tmp_path: Path) -> None:
    """A muscle that tears the machine apart ends with a failure, and the summary says how far it got.

    Catches: a failure that leaves nothing, or a result that calls itself whole.
    """
    wild = design.with_values({"muscle.active_tension": 4e7})
    with pytest.raises(SolveError):
        walk_design(wild, tmp_path / "out", PLAN)
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["complete"] is False
    assert summary["failure"]


@pytest.mark.parametrize(
    ("values", "plan", "word"),
    [
        ({}, {"frequencies": ()}, "frequency"),
        ({}, {"frequencies": (-1.0,)}, "frequency"),
        ({}, {"frequencies": (2.0, 2.0)}, "frequency"),
        ({}, {"duration": 0.1}, "duration"),
        ({"numerics.step": 0.6}, {}, "numerics.step"),
    ],
)
def test_a_walk_that_makes_no_sense_is_refused(
    design: Design, tmp_path: Path, values: dict[str, Any], plan: dict[str, Any], word: str
) -> None:
    """Frequencies, duration and step are checked before anything is written.

    Catches: a walk of no stroke, a step longer than the drive's period.
    """
    given = {"frequencies": (2.0,), "duration": 1.5, "amplitude": 1.0, **plan}
    with pytest.raises(DesignError, match=word):
        walk_design(design.with_values(values), tmp_path / "out", WalkPlan(**given))
    assert not (tmp_path / "out").exists()


def test_only_machines_with_feet_walk(tmp_path: Path) -> None:
    """A strip and a cantilever are refused by their kind.

    Catches: a walk of a muscle without ground.
    """
    for name in ("strip", "cantilever"):
        with pytest.raises(DesignError, match="kind"):
            walk_design(load_design(name), tmp_path / "out", PLAN)

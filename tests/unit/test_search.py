"""The inverse question: crossings are found, all of them, and what cannot be reached is said to be so."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path

import pytest

from fem_biobot.config import load_design
from fem_biobot.design import Design
from fem_biobot.errors import DesignError, DiskError, SolveError
from fem_biobot.study import search as searching
from fem_biobot.study import search_models
from fem_biobot.study.reporter import Silent
from fem_biobot.study.search import Range, SearchPlan, Solution, Target, closest_to, parse_range, parse_target, search
from fem_biobot.study.search_models import Answer, Model, answer
from fem_biobot.view.report import views_of
from tests.command import call

THICKNESS, WIDTH = "skeleton.beam_thickness", "muscle.junction_width"


def answers(monkeypatch: pytest.MonkeyPatch, numbers: Callable[[float, float], dict[str, float] | None]) -> list[float]:
    """Let a formula of thickness and width answer in place of a model; the thicknesses asked for."""
    asked = []

    def of(design: Design, model: Model) -> Answer:
        t, w = design.value(THICKNESS), design.value(WIDTH)
        asked.append(t)
        found = numbers(t, w)
        return Answer({}, "no equilibrium") if found is None else Answer(found)

    monkeypatch.setattr(searching, "answer", of)
    return asked


def one(value: float, points: int = 5, low: float = 0.4, high: float = 1.0) -> SearchPlan:
    return SearchPlan((Range(THICKNESS, low, high),), (Target("stroke", value),), points=points)


def test_every_crossing_between_the_values_tried_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """A stroke that rises and falls is met twice; each lies in its bracket, with the target between its ends.

    Catches: the first crossing only, a bracket of the first values tried, a sign of the difference lost.
    """
    asked = answers(monkeypatch, lambda t, w: {"stroke": 0.5 - (t - 0.73) ** 2})
    found, tried = search(load_design("junction_bot"), one(0.46), Silent())
    # 0.73 -+ 0.2
    assert [s.values[0] for s in found] == pytest.approx([0.53, 0.93], abs=1e-4 * 0.6)
    for s in found:
        assert s.bracket is not None
        low, high = s.bracket
        assert low <= s.values[0] <= high
        assert high - low < 0.02
        ends = [0.5 - (t - 0.73) ** 2 - 0.46 for t in s.bracket]
        assert ends[0] * ends[1] <= 0.0
    assert len(asked) == len(set(asked)) == len(tried)


def test_what_is_met_at_a_value_tried_is_found_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """An end of the range that gives exactly what is wanted.

    Catches: strict signs only, one solution twice.
    """
    answers(monkeypatch, lambda t, w: {"stroke": t})
    found, _ = search(load_design("junction_bot"), one(0.4), Silent())
    assert [s.values for s in found] == [(0.4,)]


def test_designs_that_fail_are_rows_and_no_crossing(monkeypatch: pytest.MonkeyPatch) -> None:
    """Between a stroke too small and a design without equilibrium nothing is crossed; nor where the middle fails.

    Catches: a failed design taken for zero, a solver's error that ends the search.
    """
    answers(monkeypatch, lambda t, w: None if t < 0.5 else {"stroke": t})
    found, tried = search(load_design("junction_bot"), one(0.45), Silent())
    assert found == []
    assert tried[0].answer.reason == "no equilibrium"
    answers(monkeypatch, lambda t, w: {"stroke": t} if t in (0.4, 1.0) else None)
    found, tried = search(load_design("junction_bot"), one(0.7, points=2), Silent())
    assert found == []
    assert len(tried) == 3
    # a design that cannot be is one that fails
    found, tried = search(load_design("junction_bot"), one(0.7, points=2, high=9.0), Silent())
    assert "skeleton.short_pillar_height" in tried[1].answer.reason


def test_two_keys_and_one_target_give_a_line_of_designs(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of force = w / t^3 each width has its thickness; the one that changes the design least is chosen.

    Catches: keys exchanged, the first of the line, changes measured in millimetres instead of ranges.
    """
    answers(monkeypatch, lambda t, w: {"force": w / t**3})
    vary = (Range(THICKNESS, 0.4, 1.0), Range(WIDTH, 1.0, 3.0))
    design = load_design("junction_bot")
    found, _ = search(design, SearchPlan(vary, (Target("force", 5.0),), points=5), Silent())
    assert [s.values[1] for s in found] == [1.0, 1.5, 2.0, 2.5, 3.0]
    for s in found:
        assert s.values[0] == pytest.approx((s.values[1] / 5.0) ** (1.0 / 3.0), abs=1e-4)
    chosen = closest_to(found, design, vary)
    assert chosen is not None
    # 0.68 and 2.2 as drawn: (0.737, 2.0) is nearer than (0.794, 2.5) and (0.669, 1.5)
    assert chosen.values[1] == 2.0


def test_two_keys_meet_two_targets_or_do_not(monkeypatch: pytest.MonkeyPatch) -> None:
    """Force and stroke with one design that has both; a pair that no design has ends without a solution.

    Catches: one target forgotten, the best of the grid taken for met.
    """

    def both(t: float, w: float) -> dict[str, float]:
        return {"force": w / t**3, "stroke": w * math.exp(-t)}

    answers(monkeypatch, both)
    vary = (Range(THICKNESS, 0.4, 1.0), Range(WIDTH, 1.0, 3.0))
    wanted = both(0.617, 1.83)
    targets = tuple(Target(name, wanted[name]) for name in ("force", "stroke"))
    design = load_design("junction_bot")
    (found,), _ = search(design, SearchPlan(vary, targets, points=3), Silent())
    assert found.values == pytest.approx((0.617, 1.83), rel=2e-3)
    far = (Target("force", 5.0), Target("stroke", 9.0))
    assert search(design, SearchPlan(vary, far, points=3), Silent())[0] == []


def test_rods_answer_and_the_answer_holds(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The thickness found gives the force that was wanted, asked for in its own words; the rest is in the rows.

    Catches: a quantity of the passive state, units lost between the answer and `--set`, a report without its view.
    """
    given = ("study", "search", "junction_bot", "--vary", f"{THICKNESS}=0.5mm..0.8mm", "--target", "force=3mN")
    said = call(capsys, *given, "--points", "2", "--out", tmp_path / "out", "--json")
    assert said.code == 0
    summary = json.loads(said.out)
    words = summary["remarks"][0]
    assert words.startswith('force 3 mN: --set skeleton.beam_thickness="0.59')
    override = words.split("--set ")[1].split(", between")[0].replace('"', "")
    found = answer(load_design("junction_bot", [override]), Model.rod).numbers
    assert found["force"] == pytest.approx(3.0, rel=1e-3)
    assert found["stroke_force"] == pytest.approx(found["force"] - found["passive_force"])
    # without active tension full drive is the passive state
    passive = answer(load_design("junction_bot", [override, "muscle.active_tension=0 kPa"]), Model.rod).numbers
    assert found["stroke"] == pytest.approx(found["closing"] - passive["closing"], rel=1e-6)
    assert passive["stroke"] == 0.0
    assert len(summary["search"]["rows"]) >= 4
    assert {"Will it work?", "What gives it"} <= {t["title"] for t in summary["tables"]}
    assert (tmp_path / "out" / "figures" / "search.png").stat().st_size > 5_000
    (shown,) = views_of(tmp_path / "out" / "report.html")
    assert shown.title.startswith("The design found, skeleton.beam_thickness 0.59")
    # the same again is there already, another in its place is not
    assert call(capsys, *given, "--points", "2", "--out", tmp_path / "out").code == 0
    other = call(capsys, *given, "--points", "3", "--out", tmp_path / "out")
    assert (other.code, "give another --out" in other.complaint) == (2, True)


def test_a_target_out_of_reach_is_told_plainly(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Ends with 1, and says what the range gives, where it comes nearest, and how many designs failed.

    Catches: the nearest passed off as the answer.
    """
    answers(
        monkeypatch, lambda t, w: None if t < 0.5 else {**dict.fromkeys(search_models.QUANTITIES, 0.0), "stroke": t}
    )
    given = ("study", "search", "junction_bot", "--vary", f"{THICKNESS}=0.4mm..1mm", "--target", "stroke=1.7mm")
    said = call(capsys, *given, "--points", "4", "--out", tmp_path / "a")
    assert said.code == 1
    assert said.complaint == (
        "stroke 1.7 mm: cannot be reached with skeleton.beam_thickness from 0.4 mm to 1 mm: stroke goes from 0.6 to "
        "1 mm, nearest at 1 mm; 1 of 4 designs tried have no answer"
    )
    answers(monkeypatch, lambda t, w: None)
    said = call(capsys, *given, "--out", tmp_path / "b")
    assert said.code == 1
    assert "no design found an equilibrium" in said.complaint


def test_the_solid_answers_like_the_rods(monkeypatch: pytest.MonkeyPatch) -> None:
    """On a coarse mesh within a quarter, which is what the models differ by; a full disk is no answer.

    Catches: the passive state of a solid for its full drive, a model that is not asked.
    """
    design = load_design("junction_bot", ["mesh.size=3 mm", "muscle.passive_tension=4 kPa"])
    solid, rods = (answer(design, model).numbers for model in (Model.solid, Model.rod))
    for name in search_models.QUANTITIES:
        assert solid[name] == pytest.approx(rods[name], rel=0.25), name
        assert solid[name] != rods[name]

    def fails(error: Exception) -> Callable[[Design], None]:
        def states(design: Design) -> None:
            raise error

        return states

    monkeypatch.setattr(
        search_models, "_STATES", {Model.solid: fails(SolveError("too thin")), Model.rod: fails(DiskError("full"))}
    )
    assert answer(design, Model.solid) == Answer({}, "too thin")
    with pytest.raises(DiskError, match="full"):
        answer(design, Model.rod)


def test_without_standing_tension_the_passive_state_is_the_drawing() -> None:
    """Its numbers are nothing, and the stroke is the whole closing; tension beyond what rods bear is a reason.

    Catches: a state at no tension that is solved for, fewer states than were asked for taken for all.
    """
    found = answer(load_design("junction_bot", ["muscle.passive_tension=0 kPa"]), Model.rod).numbers
    assert found["passive_force"] == 0.0
    assert found["stroke"] == found["closing"] > 0.2
    thin = [f"{THICKNESS}=0.409 mm", "muscle.reference=remodelled"]
    failed = answer(load_design("junction_bot", thin), Model.rod)
    assert failed.numbers == {}
    assert "no equilibrium" in failed.reason


@pytest.mark.parametrize(
    ("options", "word"),
    [
        (["--target", "stroke=1mm"], "--vary: found 0 keys"),
        (["--vary", "muscle.theta=60deg..90deg"], "--target: found 0 with 1 keys"),
        (
            ["--vary", "muscle.theta=60deg..90deg", "--target", "stroke=1mm", "--target", "force=1mN"],
            "found 2 with 1 keys",
        ),
        (["--vary", "muscle.theta=60deg", "--target", "stroke=1mm"], "expected KEY=FROM..TO"),
        (["--vary", "muscle.thetta=60deg..90deg", "--target", "stroke=1mm"], "did you mean muscle.theta?"),
        (["--vary", "muscle.reference=a..b", "--target", "stroke=1mm"], "expected a key that is a quantity"),
        (["--vary", "muscle.theta=90deg..60deg", "--target", "stroke=1mm"], "expected a range that rises"),
        (["--vary", "muscle.theta=60..90deg", "--target", "stroke=1mm"], "(no unit)"),
        (["--vary", "muscle.theta=60deg..90deg", "--target", "speed=1mm"], "expected one of: stroke"),
        (["--vary", "muscle.theta=60deg..90deg", "--target", "stroke=1"], "(no unit)"),
        (["--vary", "muscle.theta=60deg..90deg", "--target", "stroke=1mm", "--model", "fem"], "--model: found fem"),
        (["--vary", "muscle.theta=60deg..90deg", "--target", "stroke=1mm", "--points", "1"], "--points: found 1"),
    ],
)
def test_bad_options_are_refused_in_one_line(
    options: list[str], word: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Exit code 2 and what was expected, nothing written.

    Catches: a range without units, a target that nobody computes.
    """
    said = call(capsys, "study", "search", "junction_bot", "--out", tmp_path / "no", *options)
    assert said.code == 2
    assert word in said.complaint
    assert len(said.err.strip().splitlines()) == 1
    assert not (tmp_path / "no").exists()


def test_plans_that_ask_twice_and_machines_without_a_stroke() -> None:
    """One key twice, one target twice; a strip; a muscle that never pulls. Ranges and targets as they are written.

    Catches: a search of nothing.
    """
    theta = parse_range("muscle.theta = 60 deg .. 1.5 rad")
    assert (theta.key, theta.high) == ("muscle.theta", 1.5)
    assert theta.low == pytest.approx(math.radians(60.0))
    stroke = parse_target("stroke = 400 um")
    assert stroke == Target("stroke", 0.4)
    width = Range(WIDTH, 1.0, 2.0)
    with pytest.raises(DesignError, match=r"--vary: found muscle\.theta twice"):
        SearchPlan((theta, theta), (stroke,))
    with pytest.raises(DesignError, match="--target: found stroke twice"):
        SearchPlan((theta, width), (stroke, stroke))
    with pytest.raises(DesignError, match="expected a bot"):
        search_models.refuse_without_stroke(load_design("strip"))
    with pytest.raises(DesignError, match="found no tension"):
        search_models.refuse_without_stroke(
            load_design("junction_bot", ["muscle.passive_tension=0 kPa", "muscle.active_tension=0 kPa"])
        )
    assert closest_to(list[Solution](), load_design("junction_bot"), (theta,)) is None


def test_the_least_change_is_measured_in_the_ranges() -> None:
    """Ten millimetres of a range of a hundred are less than half of a range of 0.1 mm.

    Catches: millimetres added up.
    """
    design, none = load_design("junction_bot"), Answer({})
    vary = (Range(THICKNESS, 0.6, 0.7), Range(WIDTH, 1.0, 101.0))
    thicker, wider = (Solution(values, None, none) for values in ((0.63, 2.2), (0.68, 12.2)))
    assert closest_to([thicker, wider], design, vary) is wider

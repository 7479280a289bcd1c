"""The validation against the paper: verdicts, predictions between states, and the command once on a coarse mesh."""

from __future__ import annotations

import csv
import json
import re
from pathlib import Path
from typing import Any

import pytest

from fem_biobot.cli import main
from fem_biobot.config import load_design
from fem_biobot.link.observed import Observed, drawn_points
from fem_biobot.study.claims import Claim, Verdict
from fem_biobot.study.paper import Printed
from fem_biobot.study.validation import closing_at, sensitivities

DESIGN = load_design("junction_bot")


@pytest.mark.parametrize(
    ("value", "verdict"),
    [
        (1.0, Verdict.within_one),
        (1.29, Verdict.within_one),
        (0.69, Verdict.within_two),
        (1.61, Verdict.outside),
        (float("nan"), Verdict.not_predicted),
        (None, Verdict.not_predicted),
    ],
)
def test_a_prediction_is_judged_by_the_deviation(value: float | None, verdict: Verdict) -> None:
    """Within one, within two, outside, on both sides; nothing where nothing is predicted.

    Catches: a distance without its absolute value, limits exchanged, a number that is none judged.
    """
    assert Claim("x", Printed(1.0, "mN", "here", 0.3)).verdict(value) is verdict


def test_bounds_and_numbers_without_a_deviation_are_judged_as_such() -> None:
    """A bound holds or fails; without a deviation only the ratio is told.

    Catches: a bound taken for a mean, a verdict out of nothing.
    """
    above = Claim("speed", Printed(0.5, "mm/s", "here"), rods=0.4, bound=">")
    assert above.verdict(0.4) is Verdict.fails
    assert above.verdict(0.6) is Verdict.holds
    assert above.failed == ("rods",)
    assert Claim("force", Printed(0.2, "mN", "here"), bound="<").verdict(0.1) is Verdict.holds
    plain = Claim("size", Printed(0.2, "mm^4", "here"), equations=0.3)
    assert plain.verdict(0.3) is Verdict.no_deviation
    assert plain.failed == ()
    assert plain.row()["equations_z_1"] is None


def _state(force: float, closing: float) -> Observed:
    points = drawn_points(DESIGN)
    return Observed(1.0, {"muscle_force_mN": force, "tip_closing_mm": closing}, points, points.turns)


def test_closings_are_read_between_states_only() -> None:
    """Exact at states and on a straight path from rest, none beyond the last.

    Catches: a path that does not begin at rest, a value made up beyond it.
    """
    states = [_state(0.5, 0.35), _state(1.0, 0.70), _state(1.5, 1.05)]
    assert closing_at(states, 1.0) == pytest.approx(0.70, rel=1e-12)
    assert closing_at(states, 0.25) == pytest.approx(0.175, rel=1e-9)
    assert closing_at(states, 1.51) is None


def test_assumed_inputs_move_predictions_the_way_they_must() -> None:
    """A stiffer skeleton deflects less, a wider muscle infers more, a part that does not fit has no number.

    Catches: ends of a range exchanged, the experimenter's stiffness changed with the machine.
    """
    found = {(s.quantity, s.key): s for s in sensitivities(DESIGN)}
    stiffness = found["deflection at 1 mN [mm]", "skeleton.material.young"]
    assert stiffness.low is not None
    assert stiffness.high is not None
    # in proportion to the skeleton's compliance, but for finite rotation
    assert stiffness.low / stiffness.high == pytest.approx(1.1 / 0.9, rel=0.05)
    width = found["passive force by Eq. 3 [mN]", "muscle.junction_width"]
    assert width.low is not None
    assert width.high is not None
    assert width.low < width.as_is < width.high
    low = sensitivities(DESIGN.with_values({"muscle.junction_height": 1.27}))
    assert next(s.low for s in low if s.key == "muscle.junction_height") is None


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any], int]:
    """Folder, summary and exit code of the command."""
    out = tmp_path_factory.mktemp("validate") / "bot"
    code = main(["validate", "--size", "2.0", "--out", str(out), "--quiet"])
    return out, json.loads((out / "summary.json").read_text()), code


def test_every_printed_number_has_a_verdict_or_a_reason(result: tuple[Path, dict[str, Any], int]) -> None:
    """The table names each, and the exit code says whether one that is predicted lies outside.

    Catches: a number left out in silence, a failure that ends with 0.
    """
    out, summary, code = result
    rows = summary["validate"]["rows"]
    assert len(rows) >= 30
    for row in rows:
        predicted = any(row[model] is not None for model in ("solid", "rods", "equations"))
        assert predicted or row["why"], row["claim"]
    outside = [row for row in rows if any(row[f"{m}_verdict"] in ("outside", "fails") for m in ("solid", "rods"))]
    assert code == (1 if outside or summary["validate"]["failed_1"] else 0)
    with (out / "tables" / "validation.csv").open() as file:
        assert len(list(csv.DictReader(file))) == len(rows)
    assert {p.name for p in (out / "figures").glob("*.png")} == {"validation.png", "sensitivity.png"}


def test_numbers_outside_are_told_and_end_with_1(
    result: tuple[Path, dict[str, Any], int], capsys: pytest.CaptureFixture[str]
) -> None:
    """The same command on the same folder: the tables again, and one line on standard error that says how many.

    Catches: an exit code of 1 without a word.
    """
    out, summary, code = result
    assert code == 1
    assert main(["validate", "--size", "2.0", "--out", str(out)]) == 1
    told = capsys.readouterr()
    assert f", {summary['validate']['failed_1']} lie outside what was printed" in told.err
    assert "outside: passive force, 15 days" in told.out


def test_other_machines_are_judged_too(result: tuple[Path, dict[str, Any], int]) -> None:
    """The ring bot by both models, its solid between both readings of the ring; Raman's ring; trains of twitches.

    Catches: a machine's rods for its solid, the section of another ring, trains that the twitch was fitted to.
    """
    rows = {row["claim"]: row for row in result[1]["validate"]["rows"]}
    ring = rows["force of the ring bot"]
    stuck = rows["force of the ring bot, its ring stuck"]
    assert ring["solid"] == pytest.approx(2.76, abs=0.1)
    assert stuck["rods"] < ring["rods"] < ring["solid"]
    closings = [float(found) for found in re.findall(r"by (\d\.\d+) mm", ring["why"])]
    assert closings[2] < closings[0] < closings[1]
    assert rows["active force of Raman's ring"]["equations"] == pytest.approx(0.56 * 1.7 / 3.2, rel=1e-12)
    trains = [row for claim, row in rows.items() if "swimmer's ring" in claim]
    assert len(trains) == 8
    assert all(0.6 < row["equations"] / row["printed"] < 1.3 for row in trains)
    assert rows["force expected of 1 mm^2 of muscle"]["equations_verdict"] == "holds"
    assert all(row["why"] for row in rows.values())


def test_deflections_are_those_of_the_machine(result: tuple[Path, dict[str, Any], int]) -> None:
    """At the simulated forces both models lie within a third of the printed deflections, and near linear theory.

    Linear: 0.74 mm at 1 mN with the muscle's height for the soles'; the soles lie 1.55 times as far from the axis in
    the mean, and the solid is a plate.

    Catches: the passive state taken for rest, a force of another section.
    """
    rows = {row["claim"]: row for row in result[1]["validate"]["rows"]}
    linear = 1.0 * 2.0 * 7.0 / (319.4 * 7.0 * 0.68**3 / 12.0) * 3.1
    row = rows["pillar deflection at 1 mN"]
    assert row["rods"] == pytest.approx(linear, rel=0.15)
    assert 0.7 * row["rods"] < row["solid"] < row["rods"]
    forces = [rows[f"pillar deflection at {f:g} mN"]["solid"] for f in (0.5, 1.0, 1.4)]
    assert forces == sorted(forces)

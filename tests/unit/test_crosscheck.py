"""The cross-check as a command, once, on a coarse mesh: what it says, writes and refuses."""

from __future__ import annotations

import csv
import json
import re
from pathlib import Path
from typing import Any

import pytest

from fem_biobot.cli import main
from fem_biobot.link import crosscheck as module

SIZE = "2.0"
NOTED = "junction: not measured that far"


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    """Folder and summary of the reference machine at one fifth of its tension, where differences are those stated."""
    out = tmp_path_factory.mktemp("crosscheck") / "bot"
    sets = ["--set", "muscle.passive_tension=1.8 kPa", "--set", "muscle.active_tension=0.26 kPa"]
    whole = module.parts_of

    def noting(*given: Any) -> Any:
        for _ in range(2):
            given[-1].note(NOTED)
        return whole(*given)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "parts_of", noting)
        assert main(["crosscheck", "junction_bot", "--size", SIZE, "--out", str(out), "--quiet", *sets]) == 0
    return out, json.loads((out / "summary.json").read_text())


def _rows(summary: dict[str, Any], rods: str) -> list[dict[str, Any]]:
    return [row for row in summary["crosscheck"]["rows"] if row["rods"] == rods]


def test_differences_lie_where_they_were_expected(result: tuple[Path, dict[str, Any]]) -> None:
    """Every quantity at every tension, with rods in closed form.

    Catches: the reaction of another section, a measure of another point, another tension in one model.
    """
    judged = [row for row in _rows(result[1], "closed_form") if row["within"] is not None]
    assert len(judged) == 43
    for row in judged:
        low, high = row["expected_low_1"], row["expected_high_1"]
        assert low <= row["difference_1"] <= high, f"{row['quantity']} at {row['tension_kPa']:.3g} kPa"


def test_the_mesh_gives_sections_between_their_bounds(result: tuple[Path, dict[str, Any]]) -> None:
    """Mid-span the beam bends between E I and E I / (1 - nu^2); with the ends' yield it is softer as a whole.

    Catches: a moment of another arm, turns of one pillar for those of both, stiffness across for that in the plane.
    """
    mesh, closed = (result[1]["crosscheck"]["sections"][name] for name in ("mesh", "closed_form"))
    middle, whole = (mesh[k] / closed["EI_mN_mm2"] for k in ("EI_middle_mN_mm2", "EI_mN_mm2"))
    assert 1.0 < middle < 1.0 / (1.0 - 0.45**2)
    assert 0.85 * middle < whole < middle
    # warping held at both ends stiffens torsion; the pillars down to the bonds shear when they are pushed apart
    assert 1.2 < mesh["GJ_mN_mm2"] / closed["GJ_mN_mm2"] < 2.5
    assert 0.4 < mesh["EA_mN"] / closed["EA_mN"] < 1.0


def test_sections_from_the_mesh_bring_the_models_together(result: tuple[Path, dict[str, Any]]) -> None:
    """Sagitta and curvature at the lowest tension: a third of the difference that closed forms leave, or less.

    Catches: sections that are computed and not used, bending given to the wrong director.
    """
    lowest = min(row["tension_kPa"] for row in result[1]["crosscheck"]["rows"])
    for name in ("sagitta_mm", "curvature_1_per_mm"):
        plain, mesh = (
            next(
                abs(r["difference_1"])
                for r in _rows(result[1], rods)
                if r["quantity"] == name and r["tension_kPa"] == lowest
            )
            for rods in ("closed_form", "mesh_beam")
        )
        assert mesh < plain / 3.0


def test_parts_from_the_mesh_agree_over_the_stroke(result: tuple[Path, dict[str, Any]]) -> None:
    """Closing, force, sagitta, turn, curvature, shortening, energy, stroke within 3 %, motions within 5 %.

    Catches: a junction without its rings, ends of it that turn freely, tension and resistance of another section;
    energy of a load's tangent, or with what rings store in their pillars.
    """
    rows = _rows(result[1], "mesh_at_load")
    assert len(rows) == 43
    worst = max(rows, key=lambda row: abs(row["difference_1"]))
    assert abs(worst["difference_1"]) < 0.03, f"{worst['quantity']} at {worst['tension_kPa']:.3g} kPa"
    pairs = [pair for pair in result[1]["crosscheck"]["frequencies"] if pair["rods"] == "mesh_at_load"]
    assert max(abs(pair["solid_Hz"] / pair["rods_Hz"] - 1.0) for pair in pairs) < 0.05


def test_a_camera_films_both_models(result: tuple[Path, dict[str, Any]]) -> None:
    """Stroke and forces of solid and rods, true and filmed; the true stroke is that of the rows.

    Catches: a film of one model for both, films of other tensions.
    """
    films = {(film["model"], film["quantity"]): film for film in result[1]["crosscheck"]["camera"]}
    assert len(films) == 6
    stroke = next(row for row in _rows(result[1], "mesh_at_load") if row["quantity"] == "stroke_mm")
    assert films["solid", "stroke_mm"]["true"] == pytest.approx(stroke["solid_value"], rel=1e-2)
    assert films["rods", "stroke_mm"]["true"] == pytest.approx(stroke["rods_value"], rel=1e-2)
    assert all(0.5 < film["filmed_over_true_1"] < 1.2 for film in films.values())


def test_natural_motions_are_of_one_kind(result: tuple[Path, dict[str, Any]]) -> None:
    """The slowest motions of both models are alike, and their frequencies near.

    Catches: shapes seen in frames that differ, mass left out of one model.
    """
    pairs = result[1]["crosscheck"]["frequencies"]
    assert len(pairs) == 12
    assert min(pair["likeness_1"] for pair in pairs) > 0.98
    assert all(0.8 < pair["solid_Hz"] / pair["rods_Hz"] < 1.4 for pair in pairs)


def test_the_folder_holds_tables_pictures_and_a_report(result: tuple[Path, dict[str, Any]]) -> None:
    """CSV of every row, four pictures, a page with them, and the resolved design.

    Catches: a picture that is drawn and not written, rows without their band.
    """
    out, summary = result
    assert {path.name for path in (out / "figures").glob("*.png")} == {
        "crosscheck.png", "curvature.png", "differences.png", "overlaid.png",
    }  # fmt: skip
    with (out / "tables" / "crosscheck.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(summary["crosscheck"]["rows"])
    assert float(rows[0]["expected_low_1"]) < float(rows[0]["expected_high_1"])
    with (out / "tables" / "curvature.csv").open() as file:
        along = list(csv.DictReader(file))
    with (out / "tables" / "roots.csv").open() as file:
        roots = {row["model"]: float(row["short_deg"]) for row in csv.DictReader(file)}
    # rods whose roots yield have the solid's, and their beam then bends at its ends as beside them, to a fifth
    assert roots["rods_closed_form"] == pytest.approx(0.0, abs=1e-9)
    assert roots["rods_mesh_at_load"] == pytest.approx(roots["solid"], rel=0.1)
    at_load = [float(row["rods_mesh_at_load_1_per_mm"]) for row in along]
    assert at_load[0] == pytest.approx(at_load[1], rel=0.2)
    page = (out / "report.html").read_text()
    assert "Why they differ" in page
    assert "Where the strain energy is" in page
    assert (out / "design.toml").is_file()


def test_a_result_that_is_there_is_shown_again(
    result: tuple[Path, dict[str, Any]], capsys: pytest.CaptureFixture[str]
) -> None:
    """The same command on the same folder prints the tables and computes nothing.

    Catches: a result made twice, tables that need the models.
    """
    out, summary = result
    before = (out / "summary.json").stat().st_mtime_ns
    sets = ["--set", "muscle.passive_tension=1.8 kPa", "--set", "muscle.active_tension=0.26 kPa"]
    assert main(["crosscheck", "junction_bot", "--size", SIZE, "--out", str(out), *sets]) == 0
    told = capsys.readouterr().out
    assert "solid/rods - 1" in told
    assert "differences lie where they were expected" in told
    assert (out / "summary.json").stat().st_mtime_ns == before
    assert summary["complete"]


def test_other_machines_are_refused_in_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A strip has no rods to be checked against: exit code 2, nothing written.

    Catches: a mesh made before the refusal, a traceback.
    """
    assert main(["crosscheck", "strip", "--out", str(tmp_path / "no")]) == 2
    told = capsys.readouterr().err.strip().splitlines()
    assert len(told) == 1
    assert "two pillars" in told[0]
    assert not (tmp_path / "no").exists()


def test_a_mesh_without_muscle_is_refused_before_anything_is_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A given mesh is read before the folder of the result is made, by every command that takes one.

    Catches: a folder left behind by bad input.
    """
    assert main(["mesh", "cantilever", "--out", str(tmp_path), "--quiet"]) == 0
    file = tmp_path / "cantilever.msh"
    capsys.readouterr()
    for command in (["crosscheck"], ["validate"], ["muscle", "oxygen"], ["muscle", "fibres"]):
        out = tmp_path / command[-1]
        assert main([*command, "junction_bot", "--mesh", str(file), "--out", str(out)]) == 2
        told = capsys.readouterr().err.strip().splitlines()
        assert len(told) == 1
        assert "found no muscle" in told[0]
        assert not out.exists()


def test_the_report_turns_both_models_at_every_tension(result: tuple[Path, dict[str, Any]]) -> None:
    """Catches: a view of one state, of one model, or none."""
    text = (result[0] / "report.html").read_text(encoding="utf-8")
    (data,) = re.findall(r'<script type="application/json">(.*?)</script>', text, re.DOTALL)
    view = json.loads(data)
    tensions = sorted({row["tension_kPa"] for row in _rows(result[1], "closed_form")})
    assert view["labels"] == [f"{tension:.3g} kPa" for tension in tensions]
    assert {part["name"].split(":")[0] for part in view["parts"]} == {"solid", "rods"}
    assert "[kPa]" in view["fields"][0]["label"]


def test_what_parts_were_noted_for_stands_in_the_result(result: tuple[Path, dict[str, Any]]) -> None:
    """A note that is made while parts are measured is kept, once, in summary and report.

    Catches: a junction that was not measured up to the last tension, of which the report says nothing.
    """
    assert result[1]["notes"].count(NOTED) == 1
    assert NOTED in (result[0] / "report.html").read_text()

"""The stroke of the solid for its rods: the tensions that give it, the walks beside each other, what is refused."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from fem_biobot.cli import main
from fem_biobot.config import load_design
from fem_biobot.errors import DesignError, ModelError
from fem_biobot.link import stroke
from fem_biobot.link.rod_side import RodSide
from fem_biobot.link.stroke import MEASURES, StrokeLaw, stroke_law
from fem_biobot.mesh.committed import mesh_for
from fem_biobot.rod.reduce import reduce
from fem_biobot.study.reporter import Silent
from fem_biobot.study.stroke_walking import walk_with_stroke
from fem_biobot.study.walking import WalkPlan

SETS = ("muscle.passive_tension=0.9 kPa", "muscle.active_tension=2.7 kPa", "mesh.size=14 mm", "numerics.step=5 ms")
DESIGN = load_design("junction_bot", SETS)


@pytest.fixture(scope="module")
def law() -> StrokeLaw:
    return stroke_law(DESIGN, mesh_for(DESIGN)[0])


def test_rods_with_the_stroke_of_the_solid_close_as_it_does(law: StrokeLaw) -> None:
    """Rods of the returned design, solved anew, at no drive and at full drive; in between nearly.

    Read between 16 states of the rods: a thousandth of the closing.

    Catches: the inverse of the solid's curve, the passive tension scaled as the active one, a share of gamma lost.
    """
    name = MEASURES[0]
    tensions = [law.design.tension(d) for d in (0.0, 1.0)]
    states = RodSide(law.design, reduce(law.design)).states(tensions, Silent())[0]
    for state, want in zip(states, law.solid[name][[0, -1]], strict=True):
        assert state.numbers[name] == pytest.approx(want, rel=1e-3)
    np.testing.assert_allclose(law.adapted[name][[0, -1]], law.solid[name][[0, -1]], rtol=1e-9)
    assert 0.0 < law.departure < 0.03
    assert (law.rods[name] > law.solid[name]).all()  # a plate is stiffer than the rods' beam
    assert (law.rods_tension < law.tension).all()
    assert len(law.rows()) == len(law.drive) == 5
    # feet turn by what they close by, whatever bends them
    turn = MEASURES[1]
    np.testing.assert_allclose(law.adapted[turn], law.solid[turn], rtol=0.05)


def test_a_design_without_a_passive_tension_has_a_stroke_from_rest() -> None:
    """Catches: a ratio of no tensions."""
    design = DESIGN.with_values({"muscle.passive_tension": 0.0})
    found = stroke_law(design, mesh_for(design)[0])
    assert found.solid[MEASURES[0]][0] == found.rods_tension[0] == 0.0
    assert found.design.tension(1.0) == pytest.approx(found.rods_tension[-1])


def test_a_stroke_that_is_none_or_too_long_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """No active tension; rods asked too low a tension to close as far.

    Catches: a division by no stroke, a tension at the end of the table taken for an answer.
    """
    mesh = mesh_for(DESIGN)[0]
    with pytest.raises(ModelError, match=r"muscle\.active_tension: found a stroke of 0 kPa"):
        stroke_law(DESIGN.with_values({"muscle.active_tension": 0.0}), mesh)
    monkeypatch.setattr(stroke, "_MOST", 0.5)
    with pytest.raises(ModelError, match="stroke: found a solid that closes by"):
        stroke_law(DESIGN, mesh)


def test_both_walks_stand_in_one_result(law: StrokeLaw, tmp_path: Path) -> None:
    """Two walks of one drive, the second with a shorter stroke; tables, pictures and page; seen again, not redone.

    Catches: one design walked twice, a table of the wrong walk.
    """
    out, plan = tmp_path / "out", WalkPlan((4.0,), 0.5, 1.0)
    summary = walk_with_stroke(DESIGN, out, plan)
    own, taken = summary["walks"]
    assert (own["stroke_from"], taken["stroke_from"]) == ("own stroke", "stroke of the solid")
    assert taken["stroke_mm"] < own["stroke_mm"]
    # standing, weight and friction hold them more open than afloat
    assert 0.5 * law.solid[MEASURES[0]][0] < taken["passive_closing_mm"] < own["passive_closing_mm"]
    assert summary["stroke"]["departure_1"] == pytest.approx(law.departure)
    names = {str(p.relative_to(out)) for p in out.rglob("*") if p.is_file()}
    assert names >= {
        "report.html", "design.toml", "tables/walks.csv", "tables/stroke.csv", "figures/stroke.png",
        "figures/together_4Hz.png", "figures/phase_4Hz.png", "own_stroke/summary.json", "stroke_of_solid/summary.json",
    }  # fmt: skip
    assert json.loads((out / "summary.json").read_text()) == json.loads(json.dumps(summary))
    assert walk_with_stroke(DESIGN, out, plan) == json.loads((out / "summary.json").read_text())


def test_options_that_do_not_go_with_a_stroke_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Another model, no word, forces of the paper, loose rings, another kind of machine: one line, nothing written.

    Catches: an option that is read and not used, a stroke of loose rings given to rods that keep them bonded.
    """
    out = str(tmp_path / "out")
    for options, word in (
        (["--stroke-from", "solid", "--model", "both"], "--stroke-from"),
        (["--stroke-from", "paper"], "--stroke-from"),
    ):
        assert main(["walk", "junction_bot", "--out", out, *options]) == 2
        assert word in capsys.readouterr().err
    with pytest.raises(DesignError, match="--amplitude"):
        walk_with_stroke(DESIGN, tmp_path / "out", WalkPlan((4.0,), 0.5, None))
    loose = DESIGN.with_values({"muscle.attachment": "contact", "muscle.pillar_friction": 0.3})
    with pytest.raises(DesignError, match=r"muscle.attachment: found contact, expected bonded to give its rods"):
        walk_with_stroke(loose, tmp_path / "out", WalkPlan((4.0,), 0.5, 1.0))
    with pytest.raises(ModelError, match="two pillars"):
        walk_with_stroke(load_design("strip"), tmp_path / "out", WalkPlan((4.0,), 0.5, 1.0))
    assert not (tmp_path / "out").exists()

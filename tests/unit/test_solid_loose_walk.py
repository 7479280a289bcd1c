"""Walks of machines whose rings are not bonded: what is refused, a whole result, going on after an interruption."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fem_biobot.config import load_design
from fem_biobot.errors import DesignError, FileError
from fem_biobot.study import solid_walking
from fem_biobot.study.reporter import Silent
from fem_biobot.study.solid_walking import walk_solid
from fem_biobot.study.walking import WalkPlan

# the coarsest mesh, a weak muscle and two short strokes, for properties and no numbers
SETS = (
    "muscle.passive_tension=0.3 kPa", "muscle.active_tension=0.9 kPa", "numerics.step=2.5 ms", "mesh.size=14 mm",
    "muscle.attachment=contact", "muscle.pillar_friction=0.3",
)  # fmt: skip
PLAN = WalkPlan((10.0,), 0.2, 1.0)


class Stops(Silent):
    """A reporter that interrupts in the middle of the second stroke."""

    def advance(self, done: str = "") -> None:
        if done == "stroke 2":
            raise KeyboardInterrupt


def test_loose_rings_are_not_walked_beside_rods(tmp_path: Path) -> None:
    """Rods keep the muscle bonded: both together are refused in one line, before anything is written.

    Catches: two machines drawn over each other as one.
    """
    with pytest.raises(DesignError, match=r"muscle.attachment: found contact, expected bonded to walk beside its rods"):
        walk_solid(load_design("junction_bot", SETS), tmp_path / "out", PLAN, rods=True)
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
def test_a_walk_with_loose_rings_is_whole_and_goes_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Table, footprints and numbers are there, the book closes; interrupted and resumed it ends bit by bit the same.

    A stroke that an earlier version saved, without the rings' entries in its book, is told.
    Catches: slip forgotten at a stroke's end, a footprint of the wrong instant, friction that gives, work that is not
    accounted for, or under another name.
    """
    design = load_design("junction_bot", SETS)
    out, parts = tmp_path / "whole", tmp_path / "parts"
    (walk,) = walk_solid(design, out, PLAN)["walks"]
    assert walk["energy_error_1"] < 1e-6
    assert walk["work_rings_friction_uJ"] > 0.0
    names = {str(p.relative_to(out)) for p in out.rglob("*") if p.is_file()}
    name = "tables/walk_10Hz_air_solid.csv"
    assert names >= {"solid.pvd", "solid_rings.pvd", "solid/rings_0000.vtp", name}
    rows = list(csv.DictReader((out / name).open()))
    numbers = [key for key in rows[0] if key.endswith(("_mN", "_kPa", "_mm2", "_uJ"))]
    columns = {key: np.array([float(row[key]) for row in rows]) for key in numbers}
    # friction opposes the slip of every step at every point: it only takes
    assert np.diff(columns["rubbing_uJ"]).max() <= 0.0, np.diff(columns["rubbing_uJ"])
    last = np.diff(columns["pressing_uJ"][[len(rows) // 2, -1]])[0]
    assert walk["work_rings_normal_uJ"] == pytest.approx(-last, rel=1e-6)
    for foot in ("short", "long"):
        # no mean is above the largest value; numbers of a table have nine digits
        mean = columns[f"contact_{foot}_pressing_mN"] / columns[f"contact_{foot}_area_mm2"]
        assert np.all(columns[f"contact_{foot}_max_pressure_kPa"] >= mean * (1.0 - 1e-8))
        assert mean.min() > 0.0
        # points that lie below the pillar's surface by more than the ring is thick would be through it
        assert 0.0 < walk[f"largest_contact_{foot}_overlap_mm"] < design.value("muscle.ring_thickness")
    with pytest.raises(KeyboardInterrupt):
        walk_solid(design, parts, PLAN, reporter=Stops())
    kept = solid_walking.ResultFolder.kept

    def older(folder: Any, key: str) -> Any:
        found = kept(folder, key)
        return found if found is None or "times" not in found else {**found, "book": found["book"][:, :11]}

    with monkeypatch.context() as patch:
        patch.setattr(solid_walking.ResultFolder, "kept", older)
        with pytest.raises(FileError, match="a saved stroke lacks 'rubbing'; --force starts anew"):
            walk_solid(design, parts, PLAN, resume=True)
    walk_solid(design, parts, PLAN, resume=True)
    assert (parts / name).read_text() == (out / name).read_text()

"""The study of the accuracy of gaits at smoke size: it runs, what it expects holds, and what it expects can fail."""

from __future__ import annotations

import copy
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tests.studies.loading import load_study, refuses, smoke_of


def study() -> ModuleType:
    """The study as a module."""
    return load_study("gait_accuracy")


def smoke() -> Any:
    """What it finds at smoke size; not to be changed."""
    return smoke_of("gait_accuracy")


def test_starts_find_one_gait_that_explicit_steps_confirm() -> None:
    """With equal coefficients both starts take the same steps toward the long pillar, whatever integrates them.

    Catches: nudges that stay in the means, an explicit twin on another ground, a drive that starts over with it.
    """
    module, found = study(), smoke()
    module.expect(found, "smoke")
    assert [row["variant"] for row in found.gaits] == [v.name for v in module.LEVELS["smoke"].variants]
    assert all(row["advance_mm"] > 0.0 for row in found.gaits + found.witness)
    assert "off_explicit_pct" in found.witness[0]


def test_the_study_shows_and_writes_what_it_found(tmp_path: Path) -> None:
    """Tables with rows as long as their header, two CSV files and a picture.

    Catches: a column that a row lacks, a picture of nothing.
    """
    module, found = study(), smoke()
    shown = module.tables(found)
    assert all(table.rows and all(len(row) == len(table.header) for row in table.rows) for table in shown)
    module.write(found, tmp_path / "below")
    written = {path.name: path.stat().st_size for path in (tmp_path / "below").iterdir()}
    assert set(written) == {"gaits.csv", "witness.csv", "gait_accuracy.png"}
    assert written["gait_accuracy.png"] > 10_000


def test_the_study_refuses_steps_that_did_not_converge_and_gaits_that_part() -> None:
    """Its expectations fail on a residual above the tolerance, an open book, scattered starts, a witness that differs.

    Catches: a limit that is never compared.
    """
    module = study()
    for rows, change, word in (
        ("gaits", {"residual_1": 1.1e-8}, "accepted at a residual"),
        ("gaits", {"energy_error_1": 2e-3}, "unexplained"),
        ("gaits", {"share_1": 0.5}, "starts part"),
        ("gaits", {"spread_mm": 1e-3}, "scatter"),
        ("witness", {"off_explicit_pct": 6.0}, "off explicit steps"),
    ):
        found = copy.deepcopy(smoke())
        getattr(found, rows)[0].update(change)
        refuses(lambda found=found: module.expect(found, "smoke"), word)
    for change, word in (
        ({"change_pct": 0.6}, "advance changes"),
        ({"change_pct": 0.1, "stroke_change_pct": 0.6}, "stroke"),
    ):
        found = copy.deepcopy(smoke())
        found.gaits[1].update({"variant": module.FINE_MESH.name} | change)
        refuses(lambda found=found: module.expect(found, "full"), word)


def test_groups_of_strokes_are_compared_kind_by_kind_and_settled_ones_are_limited(tmp_path: Path) -> None:
    """Groups of three of two meshes, 3 % apart where they settled: shown, written, and refused unless few.

    Catches: kinds compared in the order of their shares, walks that go backward grouped, a limit never compared.
    """
    module = study()
    three, other = [0.12, 0.1, -0.04], [0.11, 0.12, 0.1, -0.05]

    def ensemble(*parts: list[float]) -> Any:
        advances = np.concatenate([[-0.1], *parts])
        forward = SimpleNamespace(advances=advances, step_mm=float(advances.mean()), frequency=1.0)
        backward = SimpleNamespace(advances=-np.abs(advances), step_mm=-0.1, frequency=1.0)
        return SimpleNamespace(walks=(forward, backward))

    base = module.group_rows(ensemble(*[three] * 14, other), 0, "a", module.PUBLISHED, [])
    assert [row["strokes"] for row in base] == ["3", "others"]
    assert base[0]["starts_1"] == 1
    more = [1.03 * v for v in three]
    fine = module.group_rows(ensemble(other, other, *[more] * 14), 0, module.FINE_MESH.name, module.PUBLISHED, base)
    assert fine[0]["change_pct"] == pytest.approx(3.0, rel=1e-9)
    assert fine[0]["settled_change_pct"] == pytest.approx(3.0, rel=1e-9)
    assert "settled_change_pct" not in fine[1]
    found = copy.deepcopy(smoke())
    found.groups = [*base, *fine]
    titles = [table.title for table in module.tables(found)]
    assert "Groups of strokes" in titles
    module.write(found, tmp_path)
    assert len((tmp_path / "groups.csv").read_text().splitlines()) == 1 + len(found.groups)
    refuses(lambda: module.expect(found, "full"), "settled advance changes by 3 %")
    few = module.group_rows(ensemble(*[more] * 5), 0, module.FINE_MESH.name, module.PUBLISHED, base)
    assert few[0]["least_settled_1"] < module.WORTH
    found.groups = [*base, *few]
    module.expect(found, "full")


def test_a_gait_is_compared_with_the_nearest_of_the_other_variant() -> None:
    """Two gaits: changes are against the near one, of its advance and of its stroke; a far one has no counterpart.

    Catches: gaits compared in the order of their shares, per cent of the changed instead of the compared.
    """
    module = study()
    others = [
        {"advance_mm": 0.2, "stroke_mm": 0.5, "reach_mm": 0.003},
        {"advance_mm": -0.04, "stroke_mm": 0.4, "reach_mm": None},
    ]
    row = {"advance_mm": -0.03, "stroke_mm": 0.41, "reach_mm": 0.002}
    module.compare(row, others)
    assert row["counterpart"]
    assert row["change_pct"] == pytest.approx(25.0, rel=1e-12)  # 0.01 of 0.04
    assert row["change_of_stroke_pct"] == pytest.approx(2.5, rel=1e-12)  # 0.01 of 0.4
    assert row["stroke_change_pct"] == pytest.approx(2.5, rel=1e-12)
    assert "reach_pct" not in row
    row = {"advance_mm": 0.21, "stroke_mm": 0.5, "reach_mm": 0.004}
    module.compare(row, others)
    assert row["reach_pct"] == pytest.approx(2.5, rel=1e-12)  # 0.005 of 0.2
    row = {"advance_mm": 0.1, "stroke_mm": 0.5, "reach_mm": 0.004}
    module.compare(row, others)
    assert not row["counterpart"]
    assert "change_pct" not in row

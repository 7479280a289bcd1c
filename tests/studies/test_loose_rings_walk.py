"""The study of walks with loose rings at smoke size: it runs, what it expects holds, and can fail."""

from __future__ import annotations

import copy
from pathlib import Path

import pytest

from tests.studies.loading import load_study as study
from tests.studies.loading import refuses
from tests.studies.loading import smoke_of as smoke

pytestmark = pytest.mark.slow


def test_the_study_shows_what_it_found(tmp_path: Path) -> None:
    """Its expectations hold; it prints a whole table, writes CSV and a picture, and says what was found.

    Catches: a column that a row lacks, a picture of nothing, a study without its findings.
    """
    module, found = study("loose_rings_walk"), smoke("loose_rings_walk")
    module.expect(found)
    (table,) = module.tables(found)
    assert len(table.rows) == 2
    assert all(len(row) == len(table.header) for row in table.rows)
    module.write(found, tmp_path / "found")
    written = {path.suffix: path.stat().st_size for path in (tmp_path / "found").iterdir()}
    assert set(written) == {".csv", ".png"}
    assert written[".png"] > 10_000
    assert len(module.FOUND) > 300
    assert len(module.NOT_LOOKED_AT) > 50


def test_what_the_study_expects_can_fail() -> None:
    """A book that stays open, friction that gives, rings that rub though bonded, or do not slide, or pull as bonded.

    At level full also loose ones that go on walking, or never do.

    Catches: a limit that is never compared.
    """
    module = study("loose_rings_walk")
    for row, change, word in (
        (0, {"energy_error_1": 1e-3}, "unexplained"),
        (0, {"work_friction_uJ": 1.0}, "friction on the ground gives"),
        (0, {"work_rubbing_uJ": -1.0}, "rings rub"),
        (1, {"work_rubbing_uJ": 1.0}, "rings that slide give"),
        (1, {"contact_short_slid_mm": 0.0}, "nothing slid"),
        (1, {"passive_closing_mm": 100.0}, "standing closing"),
        (1, {"stroke_mm": 100.0}, "of the bonded machine"),
    ):
        found = copy.deepcopy(smoke("loose_rings_walk"))
        found.rows[row].update(change)
        refuses(lambda found=found: module.expect(found), word)
    for change, word in (
        ({"stroke_mm": 0.2 * smoke("loose_rings_walk").rows[0]["stroke_mm"]}, "after the first, stroke"),
        ({"stroke_mm": 1e-3, "step_mm": -2e-3}, "still walks"),
        ({"stroke_mm": 1e-3, "step_mm": 0.0, "first_step_mm": 0.0}, "first step"),
    ):
        found = copy.deepcopy(smoke("loose_rings_walk"))
        found.level = "full"
        found.rows[1].update(change)
        refuses(lambda found=found: module.expect(found), word)

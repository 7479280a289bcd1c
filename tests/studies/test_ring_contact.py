"""The study of rings that lie on their pillars at smoke size: it runs, what it expects holds, and can fail."""

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
    module, found = study("ring_contact"), smoke("ring_contact")
    module.expect(found)
    for table in module.tables(found):
        assert len(table.rows) == 2
        assert all(len(row) == len(table.header) for row in table.rows)
    module.write(found, tmp_path / "found")
    written = {path.suffix: path.stat().st_size for path in (tmp_path / "found").iterdir()}
    assert set(written) == {".csv", ".png"}
    assert written[".png"] > 10_000
    assert len(module.FOUND) > 300
    assert len(module.NOT_LOOKED_AT) > 50


def test_what_the_study_expects_can_fail() -> None:
    """Forces that do not balance, rings that pull as bonded ones, closing without its force, nothing slid, a wild mesh,
    edges on which finer elements do nothing.

    Catches: a limit that is never compared.
    """
    module = study("ring_contact")
    for change, word in (
        ({"unbalanced_1": 1e-4}, "balance"),
        ({"passive_muscle_force_mN": 100.0}, "of the bonded one"),
        ({"passive_tip_closing_mm": 100.0}, "does not follow"),
        ({"slid_mm": 0.0}, "nothing slid"),
    ):
        found = copy.deepcopy(smoke("ring_contact"))
        found.rows[1].update(change)
        refuses(lambda found=found: module.expect(found), word)
    found = copy.deepcopy(smoke("ring_contact"))
    found.finer = [dict(found.rows[0], passive_muscle_force_mN=100.0)]
    refuses(lambda: module.expect(found), "off the finer one")
    for change, word in (({"overlap_mm": 1.0}, "of the overlap"), ({"muscle_force_mN": 100.0}, "of the force")):
        found = copy.deepcopy(smoke("ring_contact"))
        found.edges[1].update(change)
        refuses(lambda found=found: module.expect(found), word)
    found = copy.deepcopy(smoke("ring_contact"))
    found.edges += [dict(row, asked_size_mm=0.5 * row["asked_size_mm"]) for row in found.edges]
    refuses(lambda: module.expect(found), "falls with order")

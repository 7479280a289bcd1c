"""The studies of muscle as tissue at smoke size: each runs, what it expects holds, and what it expects can fail."""

from __future__ import annotations

import copy
from pathlib import Path

import pytest

from tests.studies.loading import load_study as study
from tests.studies.loading import refuses
from tests.studies.loading import smoke_of as smoke

NAMES = ["twitch", "oxygen"]


@pytest.mark.parametrize("name", NAMES)
def test_a_study_of_tissue_shows_what_it_found(name: str, tmp_path: Path) -> None:
    """Its expectations hold; it prints whole tables, writes CSV and a picture, and says what was found.

    Catches: a column that a row lacks, a picture of nothing, a study without its findings.
    """
    module, found = study(name), smoke(name)
    module.expect(found)
    shown = module.tables(found)
    assert all(table.rows and all(len(row) == len(table.header) for row in table.rows) for table in shown)
    module.write(found, tmp_path / name)
    written = {path.suffix: path.stat().st_size for path in (tmp_path / name).iterdir()}
    assert set(written) == {".csv", ".png"}
    assert written[".png"] > 10_000
    assert len(module.FOUND) > 300
    assert len(module.NOT_LOOKED_AT) > 50


def test_the_study_of_twitches_refuses_trains_that_do_not_fuse() -> None:
    """Its expectations fail on a kernel that does not fit, fused slow trains, fast ones that stay apart, a wrong size.

    Catches: a limit that is never compared.
    """
    module = study("twitch")
    for rate, change, word in (
        (2.0, {"filmed_trough_um": 10.0}, "too early"),
        (8.0, {"filmed_trough_um": 1.0}, "do not fuse"),
        (8.0, {"sized_middle_error_percent": -30.0}, "middle of the train is 30"),
        (20.0, {"peak_error_percent": 20.0}, "fastest train"),
    ):
        found = copy.deepcopy(smoke("twitch"))
        next(row for row in found.rows if row["rate_Hz"] == rate).update(change)
        refuses(lambda found=found: module.expect(found), word)


def test_the_study_of_oxygen_refuses_wrong_fields_and_fractions_that_clash() -> None:
    """Its expectations fail on an error left, a lost order, two consumptions far apart, a rule below constant use, a
    share that moves with the mesh.

    Catches: a limit that is never compared.
    """
    module = study("oxygen")

    def changed(part: str, row: int, change: dict[str, object], word: str) -> None:
        found = copy.deepcopy(smoke("oxygen"))
        found.meshes = [{"machine": "junction_bot", "gamma_whole_1": g} for g in (0.85, 0.84)]
        module.expect(found)
        getattr(found, part)[row].update(change)
        refuses(lambda: module.expect(found), word)

    changed("errors", -1, {"error_1": 1e-2}, "error of 1.0e-02")
    changed("errors", -1, {"order_1": 1.9}, "order 1.90")
    changed("needs", 1, {"consumption_mM_per_s": 0.05}, "no consumption gives both")
    changed("rule", 0, {"gamma_0.95_mm": 0.1}, "thinner")
    changed("meshes", 1, {"gamma_whole_1": 0.7}, "moves from 0.850")

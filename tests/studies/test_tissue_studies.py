"""The studies of muscle as tissue at smoke size: each runs, what it expects holds, and what it expects can fail."""

from __future__ import annotations

import copy
from pathlib import Path

import pytest

from tests.studies.loading import load_study as study
from tests.studies.loading import refuses
from tests.studies.loading import smoke_of as smoke

SOLID = [pytest.param(name, marks=pytest.mark.slow) for name in ("width", "age")]
NAMES = ["twitch", "oxygen", *SOLID]


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


def test_the_study_of_width_tells_what_is_left() -> None:
    """Eq. 1 grows with the section; the study fails on a prediction that explains the fall, one that grows with the
    section, an inferred force above the true one, and a coarse mesh far from a finer one.

    Catches: a ratio upside down, limits that are never compared.
    """
    module = study("width")
    row = {"volume": module.DEPTH, "spread_deg": module.ALIGNED, "active_mN": 0.4, "passive_stretch_1": 0.7}
    rows = [
        {**row, "W0_mm": w, "active_eq3_mN": a, "passive_eq3_mN": p}
        for w, a, p in ((3.5, 0.33, 3.2), (14.0, 0.34, 3.8))
    ]
    sound = module.Study(module.equation_rows(), rows, [dict(rows[0])])
    module.expect(sound)
    by_case = {r["case"]: r for r in module.ratios(sound)}
    # sections of 14 mm over 3.5 mm: (14 / 3.08) / (3.5 / 1.58)
    assert by_case[f"Eq. 1, aligned, {module.DEPTH}"]["active_1"] == pytest.approx(4.0 * 1.58 / 3.08)
    assert by_case["measured"]["active_1"] == pytest.approx(0.47 / 0.97)

    def changed(part: str, change: dict[str, object], word: str) -> None:
        found = copy.deepcopy(sound)
        getattr(found, part)[-1].update(change)
        refuses(lambda: module.expect(found), word)

    changed("continuum", {"active_eq3_mN": 0.1}, "explains the fall")
    changed("continuum", {"active_eq3_mN": 0.55}, "grows with the section")
    changed("continuum", {"active_mN": 0.3}, "infers more")
    changed("continuum", {"passive_stretch_1": 1.2}, "stretch 1.20")
    changed("finer", {"active_eq3_mN": 0.5}, "coarse mesh")


def test_the_study_of_age_splits_the_rise() -> None:
    """The rise is alignment times what is left; the study fails where alignment explains all.

    Catches: moments of the other day, limits that are never compared.
    """
    module = study("age")
    moments = [module.moment_row(day, spread) for day, spread in module.SPREADS.items()]
    # chi_mean_sin and axial_cos2 of the facts on dispersion, 29.60 and 15 degrees
    assert module.moment_row(5.0, 29.6)["first_moment_1"] == pytest.approx(0.8747 / 0.9663, abs=3e-3)
    assert module.moment_row(5.0, 29.6)["second_moment_1"] == pytest.approx(0.7910 / 0.9360, abs=3e-3)
    row = {"day_1": 5.0, "case": "alignment", "active_ratio_1": 0.8, "left_1": 0.25}
    sound = module.Study(moments, [row])
    module.expect(sound)
    for part, change, word in (
        ("moments", {"second_moment_1": 0.3}, "moments"),
        ("moments", {"rise_left_1": 9.0}, "factors"),
        ("moments", {"left_first_1": 0.5}, "explains day 5"),
        ("continuum", {"active_ratio_1": 1.3}, "spread fibres"),
        ("continuum", {"left_1": 0.9}, "explains all"),
    ):
        found = copy.deepcopy(sound)
        getattr(found, part)[0].update(change)
        refuses(lambda found=found: module.expect(found), word)

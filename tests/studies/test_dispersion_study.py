"""The study of dispersed fibres at smoke size: it runs, what it expects holds, and what it expects can fail."""

from __future__ import annotations

import copy
from pathlib import Path

from tests.studies.loading import load_study, refuses, smoke_of


def test_tensor_and_sum_differ_as_found(tmp_path: Path) -> None:
    """Equal for constant second Piola tension and at rest, within the bounds found elsewhere; tables and a picture.

    Catches: a density normalised differently in the two forms, a tensor of the wrong moment.
    """
    study, found = load_study("dispersion"), smoke_of("dispersion")
    study.expect(found)
    assert all(table.rows and all(len(row) == len(table.header) for row in table.rows) for table in study.tables(found))
    study.write(found, tmp_path / "d")
    assert {path.name for path in (tmp_path / "d").iterdir()} == {"states.csv", "free.csv", "dispersion.png"}
    assert "TO BE" not in study.FOUND


def test_the_study_refuses_other_differences() -> None:
    """Each expectation fails on a changed row.

    Catches: a bound that is never compared.
    """
    study = load_study("dispersion")
    for chosen, value, word in (
        ({"convention": "second_piola", "density": "solid"}, 1e-9, "second Piola"),
        ({"convention": "nominal", "state": "at rest"}, 1e-9, "at rest"),
        ({"convention": "nominal", "state": "shortened to 0.7", "spread_deg": 45.0}, 0.1, "shortened to 0.7"),
        (
            {"convention": "nominal", "density": "planar", "spread_deg": 15.0, "state": "stretched to 1.3"},
            0.02,
            "15 deg",
        ),
    ):
        found = copy.deepcopy(smoke_of("dispersion"))
        next(row for row in found.states if all(row[k] == v for k, v in chosen.items()))["difference_1"] = value
        refuses(lambda found=found: study.expect(found), word)
    found = copy.deepcopy(smoke_of("dispersion"))
    found.free[0]["difference_1"] = 0.05
    refuses(lambda: study.expect(found), "free stretches")

"""The study of limits of the cross-check at smoke size."""

from __future__ import annotations

import copy
import math
from pathlib import Path

import pytest

from tests.studies.loading import load_study, refuses, smoke_of

pytestmark = pytest.mark.slow


def test_differences_vanish_at_their_rates() -> None:
    """Of slender and long beams, stiff pillars, thin rings and strips, rings about them, small strain; whole tables.

    Catches: a difference of two meshes, moduli of the wrong part, a couple about another point.
    """
    module, found = load_study("crosscheck_limits"), smoke_of("crosscheck_limits")
    module.expect(found)
    assert all(
        table.rows and all(len(row) == len(table.header) for row in table.rows) for table in module.tables(found)
    )


def test_the_study_writes_a_table_and_a_picture(tmp_path: Path) -> None:
    """One CSV file and a picture with something in it.

    Catches: a picture of nothing, rows of unequal keys.
    """
    load_study("crosscheck_limits").write(smoke_of("crosscheck_limits"), tmp_path / "below")
    written = {path.name: path.stat().st_size for path in (tmp_path / "below").iterdir()}
    assert set(written) == {"limits.csv", "crosscheck_limits.png"}
    assert written["crosscheck_limits.png"] > 10_000


def test_the_study_refuses_other_rates_and_what_was_not_stated() -> None:
    """One that stays, that falls too fast or at another rate than stated, beyond what was stated, left at no strain.

    Catches: expectations that hold for anything.
    """
    module = load_study("crosscheck_limits")
    for limit, k, key, factor, word in (
        ("slender beam", -1, "difference_1", 3.0, "does not fall"),
        ("long beam", -1, "difference_1", 0.5, "falls with power"),
        ("stiff pillars", 0, "stated_1", 0.1, "beyond what was stated"),
        ("thin rings", 0, "stated_1", 0.7, "falls with power"),
        ("thin strip", 0, "stated_1", 0.8, "off what was stated"),
        ("thin roots", -1, "difference_1", 0.5, "falls with power"),
        ("rings about the strip", -1, "difference_1", 2.5, "does not fall"),
        ("small strain", 0, "left_1", 10.0, "is left at none"),
    ):
        found = copy.deepcopy(smoke_of("crosscheck_limits"))
        found.of(limit)[k][key] *= factor
        refuses(lambda found=found: module.expect(found), word)


def test_powers_come_from_the_two_points_nearest_the_limit() -> None:
    """Of values that fall with the square at the end and with something else before.

    Catches: a slope over all points, a logarithm of one side.
    """
    module = load_study("crosscheck_limits")
    rows = [{"limit": "x", "at": at, "difference_1": d} for at, d in ((4.0, 3.0), (2.0, -0.4), (1.0, -0.1))]
    assert module.Study(rows).slope("x") == pytest.approx(math.log(4.0) / math.log(2.0))

"""The study of parts that are moved and loaded as rods move and load them, at smoke size."""

from __future__ import annotations

import copy
from pathlib import Path

import pytest

from tests.studies.loading import load_study, refuses, smoke_of

pytestmark = pytest.mark.slow


def test_firm_ends_hold_the_line_of_the_muscles_pull() -> None:
    """At full tension, as bending by unit loads does not; the table has whole rows, and its file is written.

    Catches: a muscle moved the other way round, a couple about the bond instead of the beam's end, an arm of the
    drawing.
    """
    module, found = load_study("parts_alone"), smoke_of("parts_alone")
    module.expect(found)
    assert all(
        table.rows and all(len(row) == len(table.header) for row in table.rows) for table in module.tables(found)
    )


def test_the_study_writes_a_table_and_a_picture(tmp_path: Path) -> None:
    """One CSV file with a row for each kind of rods, and a picture with something in it.

    Catches: rows of unequal keys, a picture of nothing.
    """
    load_study("parts_alone").write(smoke_of("parts_alone"), tmp_path / "below")
    lines = (tmp_path / "below" / "parts_alone.csv").read_text().splitlines()
    assert len(lines) == 3
    assert (tmp_path / "below" / "parts_alone.png").stat().st_size > 10_000


def test_the_study_refuses_parts_that_are_off() -> None:
    """Each of its expectations fails on a number that is not the rods'.

    Catches: expectations that hold for anything.
    """
    module = load_study("parts_alone")
    for k, key, value, word in (
        (0, "muscle_arm_over_rods_1", -0.01, "the arm is right"),
        (0, "muscle_force_over_rods_1", 0.03, "the muscle itself is off"),
        (1, "muscle_arm_over_rods_1", -0.02, "the arm is off"),
        (1, "muscle_force_over_rods_1", -0.03, "the muscle's force is off"),
        (1, "skeleton_turn_over_rods_1", 0.02, "the skeleton is off"),
    ):
        found = copy.deepcopy(smoke_of("parts_alone"))
        found.rows[k][key] = value
        refuses(lambda found=found: module.expect(found), word)

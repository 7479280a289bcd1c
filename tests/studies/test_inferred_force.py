"""The study of inferred forces at smoke size."""

from __future__ import annotations

import copy
import math
from pathlib import Path

import numpy as np
import pytest

from tests.studies.loading import load_study, refuses, smoke_of


def test_eq_3_is_exact_for_rods_at_no_bending() -> None:
    """And reads less than the truth in the solid, which bends as a plate; both tables have whole rows.

    Catches: a stiffness of another arm, the sagitta of the wrong model.
    """
    module, found = load_study("inferred_force"), smoke_of("inferred_force")
    module.expect(found)
    assert {row["model"] for row in found.answers} == set(module.MODELS)
    assert all(
        table.rows and all(len(row) == len(table.header) for row in table.rows) for table in module.tables(found)
    )


def test_the_study_writes_tables_and_a_picture(tmp_path: Path) -> None:
    """Two CSV files and a picture with something in it.

    Catches: a picture of nothing.
    """
    load_study("inferred_force").write(smoke_of("inferred_force"), tmp_path / "below")
    written = {path.name: path.stat().st_size for path in (tmp_path / "below").iterdir()}
    assert set(written) == {"path.csv", "answers.csv", "inferred_force.png"}
    assert written["inferred_force.png"] > 10_000


def test_the_study_refuses_another_stiffness() -> None:
    """Its expectations fail on rods off Eq. 3 at no bending, and on a solid that is no plate.

    Catches: expectations that hold for anything.
    """
    module = load_study("inferred_force")
    for model, word in (("rods", "off at no bending"), ("solid", "expected what a plate")):
        found = copy.deepcopy(smoke_of("inferred_force"))
        found.of(model)[0]["inferred_over_true_1"] *= 1.2
        refuses(lambda found=found: module.expect(found), word)


def test_crossings_are_found_between_states_or_not_at_all() -> None:
    """Linear between the states around the level; no number where it is not reached.

    Catches: the state before for the crossing, an index out of range.
    """
    module = load_study("inferred_force")
    at = np.array([0.0, 1.0, 3.0])
    assert module._crossing(np.array([0.0, 0.04, 0.08]), at, 0.05) == pytest.approx(1.5)
    assert math.isnan(module._crossing(np.array([0.0, 0.01, 0.02]), at, 0.05))

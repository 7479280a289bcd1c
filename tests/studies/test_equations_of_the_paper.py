"""The study of the paper's equations at smoke size."""

from __future__ import annotations

import copy
import math
from pathlib import Path

import numpy as np
import pytest

from tests.studies.loading import load_study, refuses, smoke_of

NAME = "equations_of_the_paper"


def test_equations_are_where_they_are_expected(tmp_path: Path) -> None:
    """Eq. 1 for a held muscle, Eq. 2 for rods, Eq. 3 for rods at no strain; tables and a picture with something in it.

    Catches: tension with gamma twice, strain of another sign, a picture of nothing.
    """
    module, found = load_study(NAME), smoke_of(NAME)
    module.expect(found)
    assert len(found.answers) == 6
    assert all(
        table.rows and all(len(row) == len(table.header) for row in table.rows) for table in module.tables(found)
    )
    module.write(found, tmp_path / "below")
    written = {path.name: path.stat().st_size for path in (tmp_path / "below").iterdir()}
    assert set(written) == {"path.csv", "answers.csv", "held.csv", f"{NAME}.png"}
    assert written[f"{NAME}.png"] > 10_000


def test_the_study_refuses_other_forces() -> None:
    """Of rods that do not obey Eq. 2, a solid that is no plate, a held muscle that pulls with less.

    Catches: expectations that hold for anything.
    """
    module = load_study(NAME)
    for change, word in (
        (lambda study: study.of("rods")[1].update(eq2_over_true_1=1.001), "not their own law"),
        (lambda study: study.of("rods")[0].update(eq3_over_true_1=1.03), "off at no strain"),
        (lambda study: study.of("solid")[0].update(eq3_over_true_1=1.01), "what a plate is"),
        (lambda study: study.of("solid")[0].update(eq1_over_true_1=1.0), "times the force"),
        (lambda study: study.held[0].update(eq1_over_true_1=1.05), "Eq. 1 is off"),
    ):
        found = copy.deepcopy(smoke_of(NAME))
        change(found)
        refuses(lambda found=found: module.expect(found), word)


def test_crossings_begin_at_none_or_never_come() -> None:
    """Linear between states; 0 where the first is beyond the level; no number where none is.

    Catches: the state before for the crossing.
    """
    crossing = load_study(NAME).crossing
    at = np.array([0.1, 0.2, 0.4])
    assert crossing(np.array([0.0, 0.04, 0.08]), at, 0.06) == pytest.approx(0.3)
    assert crossing(np.array([0.5, 0.6, 0.7]), at, 0.06) == 0.0
    assert math.isnan(crossing(np.array([0.0, 0.01, 0.02]), at, 0.06))

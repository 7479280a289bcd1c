"""The study of designs drawn at random, at smoke size: it finds what it expects, and its expectations can fail."""

from __future__ import annotations

import copy
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fem_biobot.errors import ModelError, SolveError
from fem_biobot.mesh.geometry import GmshMissing
from tests.studies.loading import load_study as study
from tests.studies.loading import refuses
from tests.studies.loading import smoke_of as smoke

NAME = "random_designs"


def test_designs_converge_or_say_why(tmp_path: Path) -> None:
    """Each reaches all states or is refused in one line, and no state that is handed back is out of balance.

    Catches: a crash; a state called an equilibrium that is none.
    """
    module, found = study(NAME), smoke(NAME)
    module.expect(found, "smoke")
    assert len(found.rows) == 8
    assert sum(row["left_over_1"] is not None for row in found.rows) >= 4
    assert all(table.rows for table in module.tables(found)[:1])
    module.write(found, tmp_path / "below")
    assert (tmp_path / "below" / "random_designs.png").stat().st_size > 10_000


def test_the_same_number_is_the_same_design() -> None:
    """A design is drawn from its number alone, whatever was drawn before; another number is another design.

    Catches: one stream for all designs.
    """
    module = study(NAME)
    assert module.drawn(17) == module.drawn(17)
    assert module.drawn(17) != module.drawn(18)
    assert module.drawn(17) != module.drawn(17, 1)
    kinds = {module.drawn(number)["preset"] for number in range(40)}
    assert kinds == set(module.KINDS)


def test_the_independent_residual_sees_a_state_that_is_none() -> None:
    """A state moved by a thousandth of its displacement, or of its pressure, is far more out of balance than allowed.

    Catches: a check that passes whatever it is given.
    """
    module = study(NAME)
    try:
        model = module._model(module.load_design("strip", ["mesh.size=1.2 mm", "mesh.element=P2-P1"]))
    except GmshMissing as missing:
        pytest.skip(f"Gmsh cannot start: {missing}")
    state = module.solve(model, [0.7]).last
    gap, rounding, least = module.left_over(state)
    allowed = module.TOLERANCE_FACTOR * 1e-9 + module.ROUNDING_FACTOR * rounding
    assert gap < allowed
    assert 0.5 < least < 1.1
    X = state.X
    moved = replace(state, u=state.u + 1e-3 * np.abs(state.u).max() * np.sin(3.0 * X[::-1]))
    assert module.left_over(moved)[0] > 100.0 * allowed
    assert state.pressure is not None
    pressed = replace(state, pressure=1.001 * state.pressure)
    assert module.left_over(pressed)[0] > 100.0 * allowed


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"left_over_1": 1e-3}, "out of balance in a state called an equilibrium"),
        ({"least_volume_1": -0.1}, "a point is inverted"),
        ({"states_1": 1}, "1 states of"),
        ({"ended": "crashed", "said": "ZeroDivisionError"}, "crashed: ZeroDivisionError"),
        ({"ended": "refused, solve", "said": ""}, "gives no reason"),
        ({"ended": "refused, solve", "said": "a\nb"}, "several lines"),
    ],
)
def test_the_study_refuses_what_it_is_there_to_find(change: dict[str, Any], word: str) -> None:
    """Catches: an expectation that is never compared."""
    module, found = study(NAME), copy.deepcopy(smoke(NAME))
    next(row for row in found.rows if row["ended"] == "converged").update(change)
    refuses(lambda: module.expect(found, "smoke"), word)


@pytest.mark.parametrize(
    ("error", "ended"),
    [
        (SolveError("no luck"), "refused, solve"),
        (ModelError("odd"), "crashed"),
        (ZeroDivisionError("by zero"), "crashed"),
    ],
)
def test_refusals_and_crashes_are_told_apart(error: Exception, ended: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """A refusal on purpose has its class; anything else a design can cause is a crash, with its last line.

    Catches: a defect counted as a refusal.
    """
    module = study(NAME)

    def fails(*_: object) -> None:
        raise error

    monkeypatch.setattr(module, "_solved", fails)
    row = module.tried(3)
    assert row["ended"] == ended
    assert str(error) in row["said"]

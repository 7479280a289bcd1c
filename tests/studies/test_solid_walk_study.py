"""The study of the walking solid at smoke size: it runs, what it expects holds, and what it expects can fail."""

from __future__ import annotations

import copy
from types import ModuleType
from typing import Any

import pytest

from tests.studies.loading import load_study, refuses, smoke_of


def study() -> ModuleType:
    """The study as a module."""
    return load_study("solid_walk")


def smoke() -> Any:
    """What it finds at smoke size; not to be changed."""
    return smoke_of("solid_walk")


def test_the_solid_walks_beside_the_rods() -> None:
    """Both schemes walk, the rods beside them, and the time is told part by part.

    Catches: a scheme that is not passed on, a walk left out, a profile of another function.
    """
    module, found = study(), smoke()
    module.expect(found, "smoke")
    assert [row["model"] for row in found.walks] == ["solid", "solid", "rods", "rods"]
    assert all(row["share_1"] >= 0.0 for row in found.profile)
    for table in module.tables(found):
        assert all(len(row) == len(table.header) for row in table.rows)


@pytest.mark.parametrize(
    ("key", "value", "word"),
    [
        ("energy_error_1", 1.0, "book"),
        ("largest_friction_mN", 100.0, "friction"),
        ("stroke_mm", 10.0, "stroke"),
        ("work_integrator_uJ", 1e3, "soft_landing"),
    ],
)
def test_what_is_expected_can_fail(key: str, value: float, word: str) -> None:
    """A walk that goes wrong is told by its key.

    Catches: an expectation that cannot fail.
    """
    wrong = copy.deepcopy(smoke())
    wrong.walks[1][key] = value
    refuses(lambda: study().expect(wrong, "smoke"), word)

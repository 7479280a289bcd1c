"""The study of the published walker at smoke size: it runs, what it expects holds, and what it expects can fail."""

from __future__ import annotations

import copy
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from fem_biobot.config import load_design
from fem_biobot.rod.published.description import AS_PUBLISHED, CORRECTED, Oddity
from fem_biobot.rod.published.design import walker_of
from tests.studies.loading import load_study, refuses, smoke_of


def study() -> ModuleType:
    """The study as a module."""
    return load_study("published_walker")


def smoke() -> Any:
    """What it finds at smoke size; not to be changed."""
    return smoke_of("published_walker")


def test_each_oddity_stands_alone_and_is_left_out_once() -> None:
    """The full study has every oddity over the corrected machine, and each of the published ones left out.

    Catches: an oddity forgotten, one that is switched the wrong way.
    """
    module = study()
    found = {
        name: walker_of(load_design(module.DESIGN, settings)).oddities
        for name, settings in module.machines("full").items()
    }
    assert found[module.PUBLISHED] == found[module.COURSE] == AS_PUBLISHED
    assert found[module.CORRECTED] == CORRECTED
    for oddity in Oddity:
        assert found[f"corrected, {oddity}"] == {oddity}
        if oddity in AS_PUBLISHED:
            assert found[f"published without {oddity}"] == AS_PUBLISHED - {oddity}


@pytest.mark.slow
def test_it_walks_as_expected_and_shows_it(tmp_path: Path) -> None:
    """What the study expects holds; tables, courses at 120 samples a second and a picture are written.

    Catches: a machine that does not move, a column that a row lacks, a picture of nothing.
    """
    module, found = study(), smoke()
    module.expect(found)
    (shown,) = module.tables(found)
    assert all(len(row) == len(shown.header) for row in shown.rows)
    module.write(found, tmp_path / "below")
    written = {path.name: path.stat().st_size for path in (tmp_path / "below").iterdir()}
    assert set(written) == {
        "machines.csv", "published_walker.png", "course_as_published.csv", "course_as_published_from_the_drawing.csv",
        "course_corrected.csv",
    }  # fmt: skip
    assert written["published_walker.png"] > 10_000
    course = np.genfromtxt(tmp_path / "below" / "course_as_published.csv", delimiter=",", names=True)
    assert len(course) == 61


@pytest.mark.slow
def test_it_refuses_what_cannot_be() -> None:
    """Its expectations fail on a machine that stands still, on one that costs as much as the original, and on others.

    Catches: a limit that is never compared.
    """
    module = study()
    for change, word in (
        ({"stroke_mm": 0.0}, "a stroke of 0 mm"),
        ({"step_mm": 2.0}, "beyond its stroke"),
        ({"energy_error_1": 0.1}, "not explained"),
        ({"cost_s_per_s": 500.0}, "a simulated second"),
        ({"fibre_force_mN": 4.0}, "more than they have"),
        ({"weight_mN": 2.0}, "the start changes the weight"),
    ):
        found = copy.deepcopy(smoke())
        found.rows[0].update(change)
        refuses(lambda found=found: module.expect(found), word)
    found = copy.deepcopy(smoke())
    found.courses[module.PUBLISHED]["ring_push_long_mN"][:] = 0.0
    refuses(lambda: module.expect(found), "no grip")

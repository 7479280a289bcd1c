"""The study of the solid's gaits, at smoke size."""

from __future__ import annotations

import copy
from pathlib import Path

import pytest

from tests.studies.loading import load_study, refuses, smoke_of

pytestmark = pytest.mark.slow


def test_every_start_walks_and_is_in_a_gait(tmp_path: Path) -> None:
    """Solid and rods walk on both grounds from as many starts as asked for, each in one gait; tables are whole, and
    what is expected holds.

    Catches: a ground that is not passed on, a half step that is a whole one, a gait that loses members.
    """
    module, found = load_study("solid_gaits"), smoke_of("solid_gaits")
    module.expect(found, "smoke")
    level = module.LEVELS["smoke"]
    for machine, friction, count in (
        (module.SOLID, module.JUMP, level.solid_starts),
        (module.HALF, module.JUMP, level.half),
        (module.RODS, module.JUMP, level.rod_starts),
        (module.SOLID, module.EQUAL, level.equal),
        (module.RODS, module.EQUAL, level.equal),
    ):
        assert list(module.steps(found, machine, friction, "start")) == list(range(count))
    assert len(found.starts) == sum(row["starts"] for row in found.gaits)
    whole, half = (module.steps(found, machine)[0] for machine in (module.SOLID, module.HALF))
    assert abs(half - whole) > 1e-4
    for table in module.tables(found):
        assert table.rows
        assert all(len(row) == len(table.header) for row in table.rows)
    module.write(found, tmp_path)
    assert (tmp_path / "solid_gaits.png").stat().st_size > 10_000


def test_what_the_study_expects_can_fail() -> None:
    """A start that is missing, one that hardly closes, a book that does not close, a solid that outruns its rods,
    shares that do not add up.

    Catches: expectations that hold for anything.
    """
    module = load_study("solid_gaits")
    for change, word in (
        ({"machine": "none"}, "starts walked"),
        ({"stroke_mm": 0.01}, "closes by"),
        ({"energy_error_1": 1.0}, "unexplained"),
        ({"step_mm": 0.5}, "the solid steps up to"),
    ):
        found = copy.deepcopy(smoke_of("solid_gaits"))
        row = next(r for r in found.starts if (r["machine"], r["friction"]) == (module.SOLID, "0.42 / 0.3"))
        row.update(change)
        refuses(lambda found=found: module.expect(found, "smoke"), word)
    found = copy.deepcopy(smoke_of("solid_gaits"))
    next(row for row in found.gaits if row["machine"] == module.RODS)["share_1"] = 0.1
    refuses(lambda: module.expect(found, "smoke"), "add up")

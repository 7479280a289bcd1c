"""The study of the solid's gaits, at smoke size."""

from __future__ import annotations

import copy
from pathlib import Path
from types import ModuleType
from typing import Any

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


def found_of_full(module: ModuleType) -> Any:
    """Rows as `FOUND` tells them, in the form of those that a run makes."""
    size, found = module.LEVELS["full"], module.Study()
    for machine, friction, count, step, stroke in (
        (module.SOLID, "0.42 / 0.3", size.solid_starts, 0.034, 0.276),
        (module.HALF, "0.42 / 0.3", size.half, 0.050, 0.269),
        (module.RODS, "0.42 / 0.3", size.rod_starts, 0.085, 0.272),
        (module.SOLID, "0.3 / 0.3", size.equal, 0.053, 0.309),
        (module.RODS, "0.3 / 0.3", size.equal, 0.055, 0.304),
    ):
        row = {"machine": machine, "friction": friction, "step_mm": step, "stroke_mm": stroke}
        found.starts += [row | {"start": k, "energy_error_1": 1e-9} for k in range(count)]
        found.gaits.append(row | {"gait": 1, "share_1": 1.0})
    return found


def test_what_is_expected_at_level_full_is_what_was_found() -> None:
    """One gait of the solid, forward, a stroke like the rods' and steps shorter than all of theirs, and one step with
    one coefficient: rows that say so are taken, and each is refused where it does not hold.

    Catches: a main finding that nothing asserts.
    """
    module = load_study("solid_gaits")
    module.expect(found_of_full(module), "full")
    for machine, friction, change, word in (
        (module.SOLID, "0.42 / 0.3", {"stroke_mm": 0.290}, "the solid's stroke is"),
        (module.RODS, "0.42 / 0.3", {"stroke_mm": 0.262}, "the solid's stroke is"),
        (module.SOLID, "0.3 / 0.3", {"step_mm": 0.040}, "one coefficient"),
        (module.RODS, "0.42 / 0.3", {"step_mm": 0.033}, "the solid steps up to"),
    ):
        found = found_of_full(module)
        for row in found.starts:
            if (row["machine"], row["friction"]) == (machine, friction):
                row.update(change)
        refuses(lambda found=found: module.expect(found, "full"), word)
    found = found_of_full(module)
    found.gaits[0]["step_mm"] = -0.01
    refuses(lambda: module.expect(found, "full"), "a step forward")
    found = found_of_full(module)
    found.gaits[0]["share_1"] = 0.5
    found.gaits.append(found.gaits[0] | {"gait": 2})
    refuses(lambda: module.expect(found, "full"), "has 2 gaits")

"""The study of what parts the walks of solid and rods, at smoke size."""

from __future__ import annotations

import copy
from pathlib import Path

import pytest

from tests.studies.loading import load_study, refuses, smoke_of

pytestmark = pytest.mark.slow


def test_every_cause_has_its_share(tmp_path: Path) -> None:
    """Each machine walks in each limit, what is expected holds, shares of a limit add up, a picture is drawn.

    Catches: a limit that is not passed on, corners that are not chosen, a share over another difference.
    """
    module, found = load_study("walking_gap"), smoke_of("walking_gap")
    module.expect(found, "smoke")
    walked = [(row["machine"], row["limit"]) for row in found.rows]
    rods = (module.RODS, module.LOADED, module.CLOSING)
    assert walked == [
        *((name, module.SLOW_ONE.name) for name in (*rods, module.SOLID)),
        *((name, module.PUBLISHED.name) for name in (*rods, module.STIFF, module.CORNERS, module.SOLID)),
    ]
    causes = module.causes(found)
    for row in causes:
        shares = [row[cause] for cause, _, _ in module.CHAIN if row[cause] is not None]
        assert sum(shares) == pytest.approx(1.0, abs=1e-9)
    assert all(
        table.rows and all(len(row) == len(table.header) for row in table.rows) for table in module.tables(found)
    )
    module.write(found, tmp_path)
    assert (tmp_path / "walking_gap.png").stat().st_size > 10_000


def test_the_study_refuses_what_parts_no_walks() -> None:
    """Parts that close nothing, soles that hold as they must not, and a machine that creeps without a cause.

    Catches: expectations that hold for anything.
    """
    module = load_study("walking_gap")
    for machine, limit, key, value, word in (
        (module.LOADED, module.SLOW_ONE, "stroke_mm", 0.39, "close"),
        (module.SOLID, module.SLOW_ONE, "step_mm", 0.1, "without inertia"),
        (module.CORNERS, module.PUBLISHED, "friction_swing_mN", 1.0, "corners: friction"),
        (module.CORNERS, module.PUBLISHED, "step_mm", 0.1, "corners: step"),
        (module.CORNERS, module.PUBLISHED, "across_over_normal_1", 0.1, "corners: bear"),
        (module.STIFF, module.PUBLISHED, "friction_over_normal_1", 0.31, "stiff corners"),
        (module.RODS, module.PUBLISHED, "friction_over_normal_1", 0.5, "more friction"),
    ):
        found = copy.deepcopy(smoke_of("walking_gap"))
        next(row for row in found.rows if (row["machine"], row["limit"]) == (machine, limit.name))[key] = value
        refuses(lambda found=found: module.expect(found, "smoke"), word)
    for machine, key, value, word in (
        (module.SOLID, "full_mm", 5.0, "afloat: the solid"),
        (module.LOADED, "full_mm", 1.9, "afloat: parts"),
        (module.CLOSING, "full_mm", 1.4, "closing:"),
    ):
        found = copy.deepcopy(smoke_of("walking_gap"))
        next(row for row in found.afloat if row["machine"] == machine)[key] = value
        refuses(lambda found=found: module.expect(found, "smoke"), word)
    for k, word in ((0, "soles: become"), (1, "rings: make")):
        found = copy.deepcopy(smoke_of("walking_gap"))
        found.soles[k]["narrowing_mm"] = 0.0
        refuses(lambda found=found: module.expect(found, "smoke"), word)

"""The study of the speed of sweeps: it runs, and what it expects can fail."""

from __future__ import annotations

import copy
from pathlib import Path

import pytest

from tests.studies.loading import load_study as study
from tests.studies.loading import refuses
from tests.studies.loading import smoke_of as smoke


@pytest.mark.slow
def test_two_workers_give_the_rows_of_one(tmp_path: Path) -> None:
    """Walks and solves at smoke size; tables and a picture.

    Catches: workers with other threads, a row that tells who made it.
    """
    module, found = study("sweep_speed"), smoke("sweep_speed")
    module.expect(found, "smoke")
    assert {row["sweep"] for row in found.rows} == {"walks", "solves"}
    assert all(row["wall_s"] > 0.0 and row["processor_s"] > 0.0 for row in found.rows)
    module.write(found, tmp_path / "below")
    assert (tmp_path / "below" / "sweep_speed.png").stat().st_size > 10_000
    assert all(table.rows for table in module.tables(found))
    assert {(row["neighbours"], row["start"]) for row in found.starts} == {("near", "cold"), ("near", "neighbour")}


def test_the_study_refuses_lost_cases_other_rows_and_slow_workers(monkeypatch: pytest.MonkeyPatch) -> None:
    """A case that is not done, rows that differ, and on an idle machine a ratio below 1.6; on a busy one it only tells.

    And neighbours that spare less than a quarter of the iterations, or lead elsewhere.

    Catches: an expectation that nothing breaks, a ratio upside down.
    """
    module = study("sweep_speed")
    monkeypatch.setattr(module, "usable_processors", lambda: 2)

    def row(workers: int, wall: float, processor: float) -> dict[str, object]:
        numbers = {"workers_1": workers, "cases_1": 4, "done_1": 4, "wall_s": wall, "processor_s": processor}
        return {"sweep": "walks", "part": 0, **numbers}

    good = module.Speed([row(1, 10.0, 9.0), row(2, 5.5, 9.9)], {"walks": True}, (0.2, 1.0))
    module.expect(good, "full")
    assert good.ratio("walks") == pytest.approx(10.0 / 5.5)
    assert good.busier("walks") == pytest.approx(1.1)
    good.starts = [
        {"neighbours": "near", "start": start, "cases_1": 4, "done_1": 4, "newton_iterations_1": n, "processor_s": 9.0}
        for start, n in (("cold", 200), ("neighbour", 120))
    ]
    good.apart = {"near": 3e-9}
    module.expect(good, "full")
    assert good.spared("near") == pytest.approx(0.4)
    assert "spare 40% of the iterations" in module.verdict(good)[-1]
    away, dear, gone = (copy.deepcopy(good) for _ in range(3))
    away.apart["near"] = 2e-6
    dear.starts[1]["newton_iterations_1"] = 160
    gone.starts[1]["done_1"] = 3
    refuses(lambda: module.expect(away, "smoke"), "rows beside neighbours differ by 2.0e-06")
    refuses(lambda: module.expect(dear, "full"), "spare 20% of the iterations")
    module.expect(dear, "smoke")
    refuses(lambda: module.expect(gone, "smoke"), "neighbour: 3 of 4 cases done")
    lost, other, slow = (copy.deepcopy(good) for _ in range(3))
    lost.rows[1]["done_1"] = 3
    other.same["walks"] = False
    slow.rows[1]["wall_s"] = 6.4
    refuses(lambda: module.expect(lost, "smoke"), "3 of 4 cases done")
    refuses(lambda: module.expect(other, "smoke"), "other rows")
    refuses(lambda: module.expect(slow, "full"), "only 1.56 times")
    assert "falls short of 1.6" in module.verdict(slow)[0]
    slow.load = (3.0, 3.0)
    module.expect(slow, "full")

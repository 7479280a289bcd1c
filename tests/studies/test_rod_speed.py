"""The study of speed at smoke size: our machine with strands as rods and as members, the bot, and what is expected."""

from __future__ import annotations

import copy
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from tests.studies.loading import load_study, refuses, smoke_of


def study() -> ModuleType:
    """The study as a module."""
    return load_study("rod_speed")


def smoke() -> Any:
    """What it finds at smoke size; not to be changed."""
    return smoke_of("rod_speed")


def test_all_contenders_stroke_alike() -> None:
    """Strands as rods and as members, and PyElastica where installed, close the soles by the same stroke.

    Catches: a joint at another node, a pull on one strand only, weight left out in one of them.
    """
    module, found = study(), smoke()
    module.expect(found, "smoke")
    names = {row["contender"] for row in found.contenders}
    assert {module.FIVE, module.MEMBERS, module.BOT_IMPLICIT, module.BOT_EXPLICIT} <= names
    assert (module.SOFT in names) == (not module.pyelastica_missing())
    assert all(row["cost_1"] > 0.0 for row in found.contenders)


def test_the_study_shows_and_writes_what_it_found(tmp_path: Path) -> None:
    """Tables with rows as long as their header, two CSV files and a picture.

    Catches: a column that a row lacks, a picture of nothing.
    """
    module, found = study(), smoke()
    shown = module.tables(found)
    assert all(table.rows and all(len(row) == len(table.header) for row in table.rows) for table in shown)
    module.write(found, tmp_path / "below")
    written = {path.name: path.stat().st_size for path in (tmp_path / "below").iterdir()}
    assert set(written) == {"contenders.csv", "ladder.csv", "rod_speed.png"}
    assert written["rod_speed.png"] > 10_000


def test_the_study_refuses_a_coarse_step_another_machine_and_a_small_ratio() -> None:
    """Its expectations fail on a stroke off its refinement, on strokes that differ, on a ratio below the floor.

    Catches: a comparison that is made and not looked at, a ratio of the wrong way round.
    """
    module = study()

    def changed(contender: str, **values: float) -> Any:
        found = copy.deepcopy(smoke())
        found.row(contender).update(values)
        return found

    refuses(lambda: module.expect(changed(module.FIVE, off_1=0.011), "smoke"), "off its refinement")
    stroke = smoke().row(module.FIVE)["refined_mm"]
    refuses(lambda: module.expect(changed(module.MEMBERS, refined_mm=1.02 * stroke), "smoke"), "strands as members")
    cost = smoke().row(module.FIVE)["cost_1"]
    for name, theirs, word in (
        ("refined_mm", 1.07 * stroke, "differs from ours"),
        ("cost_1", 299.0 * cost, "takes only 299"),
    ):
        found = copy.deepcopy(smoke())
        row = {"contender": module.PUBLISHED, "off_1": 0.0, "refined_mm": stroke, "cost_1": 400.0 * cost, name: theirs}
        found.contenders.append(row)
        refuses(lambda found=found: module.expect(found, "full"), word)


def test_the_largest_settled_step_is_taken() -> None:
    """A first-order stroke that ends in numbers that are none at large steps: the first step within one per cent.

    Catches: a refinement compared with itself, an unstable step taken, the finest step taken.
    """
    module = study()

    def curve(steps: int) -> Any:
        return np.array([0.0, np.nan if steps < 3 else 1.0 + 0.1 / steps])

    # 0.1 (1 / n - 1 / 2n) / (1 + 0.1 / 2n) is within 0.01 from n = 5 on; against 1 + 0.1 / 80 from n = 9
    for ladder, against_finest, taken in (((2, 3, 4, 5, 8), False, 5), ((2, 3, 8, 9, 80), True, 9)):
        found = module.Speed("")
        assert module.settled(found, "x", curve, ladder, against_finest=against_finest) == taken
        assert found.row("x")["off_1"] < module.TOLERANCE
    found = module.Speed("")
    assert module.settled(found, "x", curve, (3, 4)) == 4
    assert "no step" in found.notes[0]


def test_the_ground_of_the_other_code_pushes_and_holds_back() -> None:
    """A sole pressed in and sliding: weight of its springs up, kinetic friction back, no moment but their lever's.

    Catches: friction along the motion, corners not turned with the element, pull from corners above the ground.
    """
    module = study()
    stand = module._stand.py_func
    # an element that stands: its rows are y, -x, z, so corners in its frame are turned by a quarter
    Q = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])[:, :, None]
    corners = module.SOLE @ Q[..., 0].T
    force, torque = np.zeros((3, 2)), np.zeros((3, 1))
    x, v, w = np.array([[5.0, 0.0], [1.0, 0.0], [-0.01, 1.0]]), np.zeros((3, 2)), np.zeros((3, 1))
    v[0, 0] = 3.0
    stand(x, v, Q, w, force, torque, corners, 200.0, 0.05, 0.42, 0.3, 0.1)
    # four corners of 200 mN/mm pressed in by 0.01 mm: 8 mN
    np.testing.assert_allclose(force[:, 0], [-0.3 * 8.0, 0.0, 8.0], rtol=0.0, atol=1e-14 * 8.0)
    np.testing.assert_allclose(torque[:, 0], 0.0, rtol=0.0, atol=1e-14 * 8.0 * 3.5)
    w[0, 0] = 1.0  # about y: corners at x < 0 rise at 1.75 mm/s, the others sink
    force[:], torque[:] = 0.0, 0.0
    stand(x, v, Q, w, force, torque, corners, 200.0, 0.05, 0.42, 0.3, 0.1)
    # dashpots: 4 * 0.05 * 1.75^2 = 0.6125 uJ against the turn, about the element's first axis
    np.testing.assert_allclose(torque[:, 0], [-0.6125, 0.0, 0.0], rtol=0.0, atol=1e-13)

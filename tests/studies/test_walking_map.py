"""The map of walking at smoke size: it runs, what it expects holds, and what it expects can fail."""

from __future__ import annotations

import copy
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from fem_biobot.rod.reduce import reduce
from tests.studies.loading import load_study, refuses, smoke_of


def study() -> ModuleType:
    """The study as a module."""
    return load_study("walking_map")


def smoke() -> Any:
    """What it finds at smoke size; not to be changed."""
    return smoke_of("walking_map")


def test_equal_pillars_and_frictionless_ground_give_no_step() -> None:
    """What the study expects: no step without friction or asymmetry, hardly one without inertia, else a direction.

    Catches: a ground with a direction of its own, friction left on a frictionless ground, forward and reverse swapped.
    """
    module, found = study(), smoke()
    module.expect(found)
    names = {row["mechanisms"] for row in found.mechanisms}
    assert {module.SMOOTH, module.SLOW_SMOOTH, module.EVEN_SMOOTH, module.FRICTIONLESS} < names


def test_the_study_shows_and_writes_what_it_found(tmp_path: Path) -> None:
    """Tables with rows as long as their header, three CSV files and a picture.

    Catches: a column that a row lacks, a picture of nothing.
    """
    module, found = study(), smoke()
    shown = module.tables(found)
    assert all(table.rows and all(len(row) == len(table.header) for row in table.rows) for table in shown)
    module.write(found, tmp_path / "below")
    written = {path.name: path.stat().st_size for path in (tmp_path / "below").iterdir()}
    assert set(written) == {"map.csv", "unequal.csv", "mechanisms.csv", "walking_map.png"}
    assert written["walking_map.png"] > 10_000


def test_the_study_refuses_steps_out_of_nothing() -> None:
    """Its expectations fail on a step without friction, asymmetry or inertia, and on a walk the wrong way.

    Catches: a limit that is never compared.
    """
    module = study()
    for name, change, word in (
        (module.FRICTIONLESS, {"step_mm": 1e-5}, "centre of mass"),
        (module.EVEN_SMOOTH, {"step_mm": 1e-2}, "equal pillars"),
        (module.SLOW_SMOOTH, {"step_mm": 1e-2}, "without inertia"),
        (module.SMOOTH, {"direction": "toward short"}, "walks toward short"),
    ):
        found = copy.deepcopy(smoke())
        next(row for row in found.mechanisms if row["mechanisms"] == name).update(change)
        refuses(lambda found=found: module.expect(found), word)
    found = copy.deepcopy(smoke())
    found.unequal[0]["direction"] = "toward short"
    refuses(lambda: module.expect(found), "against the less resisted")
    found = copy.deepcopy(smoke())
    del found.mechanisms[0]["step_mm"]
    found.mechanisms[0]["remark"] = "it fell"
    refuses(lambda: module.expect(found), "it fell")


def test_mechanisms_are_switched_off_one_at_a_time() -> None:
    """Less inertia keeps weight, stiffness and feet; point feet keep mass and width, and lose their length.

    Catches: gravity scaled the wrong way, a foot of one point that could fall sideways, buoyancy that grows.
    """
    module = study()
    whole = reduce(module.design_of(module.PUBLISHED, "submerged"), beam_elements=4)
    light, pointed = module.weightless_inertia(whole, 0.03), module.point_feet(whole)
    a, b = whole.assembly, light.assembly
    np.testing.assert_allclose(b.inertia.mass, 0.03 * a.inertia.mass, rtol=1e-12, atol=0.0)
    scale = float(np.abs(a.inertia.J).max())
    np.testing.assert_allclose(b.inertia.J, 0.03 * a.inertia.J, rtol=1e-12, atol=1e-12 * scale)
    np.testing.assert_allclose(b.inertia.mass[:, None] * b.gravity, a.inertia.mass[:, None] * a.gravity, rtol=1e-12)
    np.testing.assert_allclose(b.loads.force, a.loads.force, rtol=1e-12, atol=0.0)
    assert np.abs(a.loads.force).max() > 0.0
    np.testing.assert_array_equal(b.elements.stiffness, a.elements.stiffness)
    for before, after in zip(whole.contacts, pointed.contacts, strict=True):
        old, new = np.array(before.points), np.array(after.points)
        assert len(new) == 2
        assert np.ptp(new[:, 0]) == 0.0
        assert new[0, 0] == pytest.approx(old[:, 0].mean(), rel=1e-15)
        assert np.ptp(new[:, 1]) == np.ptp(old[:, 1])
    assert pointed.mass == whole.mass

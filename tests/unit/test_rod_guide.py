"""Guides: joints that hold some coordinates of a place beside another part."""

from __future__ import annotations

import numpy as np
import pytest

from fem_biobot.errors import ModelError
from fem_biobot.rod.guide import Guide
from fem_biobot.rod.model import RodModel
from fem_biobot.rod.records import Body, Hold, PointLoad, Rod
from fem_biobot.rod.section import RodMaterial, Section
from fem_biobot.rod.statics import statics
from tests.rods import straight

MATERIAL = RodMaterial(young=10.0, density=1e-6, poisson=0.3)


def test_a_guide_holds_its_coordinates_alone() -> None:
    """The tip of a loaded rod moves with that of its twin along z, by half of what it would alone, and apart along x.

    Catches: rows of other axes held, a guide that ties rotations, one that pulls the parts together.
    """
    section = Section.circle(0.1)
    low = Rod(straight(6, 5.0), section, MATERIAL, "low")
    high = Rod(straight(6, 5.0) + np.array([0.0, 0.3, 0.0]), section, MATERIAL, "high")
    holds = [Hold(("low", 0)), Hold(("high", 0))]
    loads = [PointLoad(("low", -1), force=(2e-7, 0.0, 2e-8))]
    guided = RodModel([low, high], [Guide(("low", -1), ("high", -1), "z")], supports=holds, loads=loads)
    alone = RodModel([low], supports=holds[:1], loads=loads)
    there, single = statics(guided, [1.0]).last, statics(alone, [1.0]).last
    down, up = (there.displacement((name, -1)) for name in ("low", "high"))
    assert down[2] == pytest.approx(up[2], rel=1e-9)
    assert down[2] == pytest.approx(0.5 * single.displacement(("low", -1))[2], rel=5e-3)
    assert down[0] == pytest.approx(2e-7 * 5.0 / (10.0 * section.area), rel=0.05)
    assert abs(up[0]) < 0.05 * down[0]


def test_the_guiding_point_turns_with_its_part() -> None:
    """A body that is turned by its support carries the guided coordinate along on an arm of that part.

    Catches: a guide to the place itself instead of the level at which the guided place was drawn, an arm kept in the
    world.
    """
    body = Body((0.0, 0.0, 0.0), 1.0, (1.0, 1.0, 1.0), "wheel")
    rod = Rod(straight(4, 2.0, (0.0, 1.0, 0.0)) + np.array([1.5, -2.0, 0.4]), Section.circle(0.1), MATERIAL)
    angle = 0.3
    model = RodModel(
        [rod],
        [Guide(("rod", -1), ("wheel", (0.2, 0.0, -0.1)), "xz")],
        [body],
        [Hold(("rod", 0)), Hold(("wheel", (0.0, 0.0, 0.0)), turn=(0.0, angle, 0.0))],
    )
    tip = statics(model, [0.5, 1.0]).last.at(("rod", -1))
    # the point of the wheel that the tip was drawn level with, turned about y
    x, z = 1.5, 0.4
    np.testing.assert_allclose(
        tip[[0, 2]], [x * np.cos(angle) + z * np.sin(angle), z * np.cos(angle) - x * np.sin(angle)], rtol=1e-9
    )


@pytest.mark.parametrize("along", ["", "xx", "u"])
def test_letters_that_are_no_axes_are_refused(along: str) -> None:
    """By name.

    Catches: a guide that holds nothing.
    """
    with pytest.raises(ModelError, match="guide: along: found"):
        Guide(("a", 0), ("b", 0), along)


def test_a_guide_within_one_part_is_refused() -> None:
    """A place cannot be guided by its own rigid part.

    Catches: a singular constraint.
    """
    body = Body((0.0, 0.0, 0.0), 1.0, (1.0, 1.0, 1.0), "wheel")
    with pytest.raises(ModelError, match="one rigid part already"):
        RodModel(bodies=[body], joints=[Guide(("wheel", (0, 0, 0)), ("wheel", (1, 0, 0)), "x")])

"""Records of rod assemblies: what they refuse, what they make of what they are given."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from fem_biobot.errors import ModelError
from fem_biobot.rod.ground import ContactPoints, Ground
from fem_biobot.rod.records import Body, DistributedLoad, Gravity, Hinge, Hold, Muscle, PointLoad, Rod, Spring
from fem_biobot.rod.section import RodMaterial, Section
from tests.rods import straight

SECTION, MATERIAL = Section.circle(0.3), RodMaterial(young=10.0, density=1e-6, poisson=0.3)
A, B = ("rod", 0), ("rod", -1)
NAN = float("nan")


def _muscle(**changed: Any) -> Muscle:
    return Muscle(A, B, **{"area": 1.0, "young": 10.0, **changed})


@pytest.mark.parametrize(
    ("make", "word"),
    [
        (lambda: Rod([[0, 0, 0]], SECTION, MATERIAL), "points of shape"),
        (lambda: Rod([[0, 0], [1, 0]], SECTION, MATERIAL), "points of shape"),
        (lambda: Rod([[0, 0, NAN], [1, 0, 0]], SECTION, MATERIAL), "points of shape"),
        (lambda: Rod([[0, 0, 0], [1, 0, 0], [1, 0, 0]], SECTION, MATERIAL, "beam"), "rod beam: element 1 has zero"),
        (lambda: Rod(straight(3), [SECTION] * 2, MATERIAL), "found 2 sections, expected 1 or 3"),
        (lambda: Rod(straight(3), SECTION, MATERIAL, normal=(1.0, 2.0)), "normal"),  # type: ignore[arg-type]
        (lambda: Rod(straight(3), SECTION, MATERIAL, mass=-1.0), "mass"),
        (lambda: Rod(straight(3), SECTION, MATERIAL, mass=[1.0, 2.0]), "found 2 factors of mass, expected 1 or 3"),
        (lambda: Rod(straight(2), SECTION, MATERIAL, mass=[1.0, -2.0]), "mass: found -2.0"),
        (lambda: Rod(straight(3), SECTION, MATERIAL, damping_time=NAN), "damping_time"),
        (lambda: Body((0, 0, 0), 0.0, (1, 1, 1)), "mass: found 0.0, expected a finite number above 0"),
        (lambda: Body((0, 0, 0), True, (1, 1, 1)), "mass: found True"),
        (lambda: Body((0, 0, 0), 1.0, (1, -1, 1)), "inertia"),
        (lambda: Body((0, 0, 0), 1.0, (1, 1)), "inertia"),
        (lambda: Body((0, 0, NAN), 1.0, (1, 1, 1)), "centre"),
        (lambda: Body((0, "a", 0), 1.0, (1, 1, 1)), "centre"),  # type: ignore[arg-type]
        (lambda: Body((0, 0, 0), 1.0, (1, 1, 1), boxes=[((0, 0, 0), (1, 0, 1))]), "box with edges"),
        (lambda: Body.box((0, 0, 0), (1, 1, 0), 1e-6), "size"),
        (lambda: Body.box((0, 0, 0), (1, 1, 1), 0.0), "density"),
        (lambda: Hinge(A, B, (0, 0, 0)), "axis"),
        (lambda: Hold(A, "xx"), "translation 'xx'"),
        (lambda: Hold(A, "xyz", "w"), "rotation 'w'"),
        (lambda: Hold(A, "", ""), "neither translation nor rotation"),
        (lambda: Hold(A, displacement=(1.0, NAN, 0.0)), "displacement"),
        (lambda: Hold(A, turn=(1.0, 0.0)), "turn"),  # type: ignore[arg-type]
        (lambda: Hold(A, rotation="xy", turn=(1.0, 0.0, 0.0)), "found a turn with rotation 'xy'"),
        (lambda: PointLoad(A, (0, 0, NAN)), "point load: force"),
        (lambda: PointLoad(A, moment=(0, 0)), "point load: moment"),  # type: ignore[arg-type]
        (lambda: DistributedLoad("rod", (0, 0, NAN)), "distributed load: force"),
        (lambda: DistributedLoad("rod", moment=(0, 0, NAN)), "distributed load: moment"),
        (lambda: Gravity((0, 0, NAN)), "gravity: acceleration"),
        (lambda: Gravity(medium_density=-1.0), "medium_density"),
        (lambda: Spring(A, B, -1.0), "spring: stiffness"),
        (lambda: Spring(A, B, 1.0, rest_length=-1.0), "rest_length"),
        (lambda: Spring(A, B, 1.0, damping=NAN), "damping"),
        (lambda: _muscle(area=0.0), "muscle muscle: area"),
        (lambda: _muscle(young=-1.0), "young"),
        (lambda: _muscle(passive=NAN), "passive"),
        (lambda: _muscle(active=-1.0), "active"),
        (lambda: _muscle(viscosity=-1.0), "viscosity"),
        (lambda: _muscle(mass=-1.0), "mass"),
        (lambda: _muscle(gamma=1.5), "gamma: found 1.5, expected at most 1"),
        (lambda: _muscle(theta=4.0), "theta: found 4 rad"),
        (lambda: _muscle(rest_length=0.0), "rest_length"),
        (lambda: _muscle(resistance="hooke"), "resistance: found 'hooke', expected one of: eq2, neo_hooke"),
        (lambda: ContactPoints("foot", [[0, 0]]), "contact points: found shape"),
        (lambda: ContactPoints("foot", [[0, 0, 0]], radius=-1.0), "radius"),
        (lambda: ContactPoints("foot", [[0, 0, 0]], axis=(0, 0, 0)), "axis"),
        (lambda: ContactPoints("foot", [[0, 0, 0]], acts_at=(0, 0, NAN)), "contact points: acts_at"),
        (lambda: Ground(-0.1), "static_friction"),
        (lambda: Ground(0.4, 0.5), "kinetic_friction: found 0.5 above the static 0.4"),
        (lambda: Ground(0.4, 0.3, 0.2, 0.3), "kinetic_friction: found 0.3 above the static 0.2"),
        (lambda: Ground(normal=(0, 0, 2)), "normal"),
        (lambda: Ground(forward=(0, 0, 1)), "forward"),
    ],
)
def test_what_fits_nothing_is_refused(make: Callable[[], object], word: str) -> None:
    """By the name of the record and the key, in one line.

    Catches: a check left out, or passed by a number that is none.
    """
    with pytest.raises(ModelError, match=word) as refusal:
        make()
    assert "\n" not in str(refusal.value)


def test_a_box_has_its_mass_and_inertia() -> None:
    """``m / 12 (b^2 + c^2)`` about each edge's direction.

    Catches: an edge with its own moment, half sizes.
    """
    box = Body.box((1.0, 2.0, 3.0), (2.0, 3.0, 4.0), 0.5)
    assert box.mass == 12.0
    np.testing.assert_allclose(box.inertia, np.diag([25.0, 20.0, 13.0]), rtol=1e-15)


def test_a_rod_keeps_its_points() -> None:
    """Given points may change afterwards; the record's do not.

    Catches: a record that shares its array.
    """
    points = straight(3)
    rod = Rod(points, SECTION, MATERIAL)
    points[:] = 7.0
    np.testing.assert_allclose(rod.points, straight(3), rtol=0.0, atol=0.0)
    with pytest.raises(ValueError, match="read-only"):
        rod.points[0, 0] = 1.0


def test_reverse_friction_is_the_forward_one_unless_given() -> None:
    """A kinetic coefficient of its own is bounded by the reverse static one.

    Catches: a default taken from the wrong direction.
    """
    assert (Ground(0.5, 0.3).reverse_static_friction, Ground(0.5, 0.3).reverse_kinetic_friction) == (0.5, 0.3)
    assert Ground(0.5, 0.3, 0.2).reverse_kinetic_friction == 0.2
    axes = Ground(normal=(0.6, 0.0, 0.8), forward=(1.0, 0.0, 0.0)).axes
    np.testing.assert_allclose(axes, [[0.6, 0, 0.8], [0.8, 0, -0.6], [0, 1, 0]], rtol=0.0, atol=1e-15)

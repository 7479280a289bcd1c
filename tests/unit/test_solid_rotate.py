"""Prescribed rotations: the record, the way between load steps, reaction moments, supports that meet."""

from __future__ import annotations

import numpy as np
import pytest

from fem_biobot.errors import ModelError
from fem_biobot.material import NeoHooke
from fem_biobot.solid.model import SolidModel, SolidState, buckling, solve
from fem_biobot.solid.records import Fix, Rotate, Step, Traction
from tests.helpers import TIGHT, box_mesh, unit

SIZE = (1.0, 1.2, 2.5)
MESH = box_mesh(2, SIZE)
LAW = {"muscle": NeoHooke(10.0, 0.3)}
AXIS, POINT = (0.4, -0.3, 0.8), (0.3, 2.0, -0.5)


def _matrix(axis: tuple[float, float, float], angle: float) -> np.ndarray:
    """Rotation matrix by the exponential of the spin, summed as a series: not the formula of the record."""
    x, y, z = unit(*axis) * angle
    spin = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    total, term = np.eye(3), np.eye(3)
    for k in range(1, 60):
        term = term @ spin / k
        total = total + term
    return total


def test_a_body_turned_by_one_end_turns_rigidly() -> None:
    """Its end turned by 170 degrees about an oblique axis, the whole body follows: no energy, no force, no moment.

    At half the load factor it has turned by half the angle. Catches: displacements scaled in place of the angle (at
    half of it the end would be squeezed to cos(angle / 2)), a left-handed turn, the point of the axis left out.
    """
    angle = np.deg2rad(170.0)
    model = SolidModel(MESH, LAW, supports=[Rotate("z0", AXIS, POINT, angle)])
    X, centre = model.system.space.points, np.array(POINT)[:, None]
    found = solve(model, [0.5, 1.0], settings=TIGHT)
    scale = LAW["muscle"].young * np.prod(SIZE)
    for state, share in zip(found.states, (0.5, 1.0), strict=True):
        turned = centre + _matrix(AXIS, share * angle) @ (X - centre)
        np.testing.assert_allclose(X + state.u, turned, rtol=0.0, atol=1e-11)
        assert abs(state.energy) < 1e-14 * scale  # what rounding of mu/2 (I1 - 3) - mu ln J leaves
        assert np.abs(state.reaction("z0")).max() < 1e-10 * scale
        assert np.abs(state.reaction_moment("z0", POINT)).max() < 1e-10 * scale
    assert found.halvings == 0


def test_more_than_a_turn_comes_round() -> None:
    """A turn and a third is a turn more than a third, and a whole turn brings the body back.

    Catches: the angle wrapped to half a turn.
    """
    third = 2.0 * np.pi / 3.0
    more, less = (Rotate("z0", AXIS, POINT, a) for a in (2.0 * np.pi + third, third))
    X = MESH.points
    np.testing.assert_allclose(more.displacement(X, 1.0), less.displacement(X, 1.0), atol=1e-13)
    np.testing.assert_allclose(more.displacement(X, 6.0 / 8.0), 0.0, atol=1e-13)
    assert np.abs(more.displacement(X, 3.0 / 8.0)).max() > 1.0


def test_small_angles_keep_their_digits() -> None:
    """An angle of 1e-6 displaces by the cross product, and by its square, to the last digit but a few.

    Catches: 1 - cos, and R - I, by subtraction.
    """
    X = np.array([[0.7], [-0.2], [0.4]])
    got = Rotate("z0", AXIS, POINT, 1e-6).displacement(X, 1.0)
    arm = X[:, 0] - np.array(POINT)
    linear = 1e-6 * np.cross(unit(*AXIS), arm)
    # the part along the arm is of second order: -angle^2 / 2 of what is across the axis
    across = arm - unit(*AXIS) * (unit(*AXIS) @ arm)
    np.testing.assert_allclose(got[:, 0] - linear, -0.5e-12 * across, rtol=1e-5)


def test_a_screw_advances_while_it_turns() -> None:
    """With an advance the end moves along the axis by its share, whatever the length of the axis given.

    Catches: the advance along the unscaled axis, the advance at factor 1 at every factor.
    """
    screw = Rotate("z0", tuple(3.0 * np.array(AXIS)), POINT, 0.8, advance=0.6)  # type: ignore[arg-type]
    X = MESH.points
    plain = Rotate("z0", AXIS, POINT, 0.8).displacement(X, 0.4)
    moved = screw.displacement(X, 0.4) - plain
    np.testing.assert_allclose(moved, np.outer(0.24 * unit(*AXIS), np.ones(X.shape[1])), atol=1e-14)


@pytest.mark.parametrize("axis", [(0.0, 0.0, 2.0), (0.0, -1.0, 0.0), AXIS])
def test_a_free_advance_leaves_the_surface_to_slide_along_the_axis(axis: tuple[float, float, float]) -> None:
    """Without an advance the end takes no force along the axis, and turns as asked across it.

    A dead force along the axis moves the whole body; the three rows of the other end hold it. Catches: the axis held,
    own axes turned the wrong way, the direction along the axis held in place of one across it.
    """
    n = unit(*axis)
    supports = [Rotate("z1", axis, POINT, 0.5, advance=None), Fix((0.0, 0.0, 0.0))]
    state = solve(SolidModel(MESH, LAW, supports=supports), [1.0], settings=TIGHT).last
    assert abs(n @ state.reaction("z1")) < 1e-9
    top = MESH.surfaces["z1"]
    nodes = np.unique(top)
    asked = Rotate("z1", axis, POINT, 0.5).displacement(MESH.points[:, nodes], 1.0)
    gap = state.u[:, nodes] - asked
    np.testing.assert_allclose(gap - np.outer(n, n @ gap), 0.0, atol=1e-12)
    assert np.abs(n @ gap).max() > 1e-3


def test_turning_about_an_edge_agrees_with_a_support_that_holds_it() -> None:
    """Two supports that meet may both ask for what the rotation leaves in place; elsewhere they contradict each other.

    Catches: agreement asked at load factor 1 only (a whole turn), or of displacements scaled with the factor.
    """
    hinge = Rotate("z1", (1.0, 0.0, 0.0), (0.0, SIZE[1], SIZE[2]), 0.3)
    SolidModel(MESH, LAW, supports=[hinge, Fix((0.0, SIZE[1], SIZE[2]))])
    with pytest.raises(ModelError, match="contradicting displacements"):
        SolidModel(MESH, LAW, supports=[hinge, Fix((0.0, 0.0, SIZE[2]))])
    whole = Rotate("z1", (0.0, 0.0, 1.0), (0.2, 0.1, 0.0), 2.0 * np.pi)
    with pytest.raises(ModelError, match="contradicting displacements"):
        SolidModel(MESH, LAW, supports=[whole, Fix("x0", "xy")])


def test_the_reaction_moment_balances_that_of_the_loads() -> None:
    """About any point the moment of the support is minus that of the dead loads where these have moved to.

    Catches: arms of the reference body, arms from the origin whatever the point, the moment's sign.
    """
    model = SolidModel(MESH, LAW, supports=[Fix("z0")], loads=[Traction("z1", (0.3, 0.2, -0.25))])
    state = solve(model, settings=TIGHT).last
    about = (0.5, -1.0, 2.0)
    x = model.system.space.points + state.u
    f = model.system.dead_load.T
    expected = -np.cross(x - np.array(about)[:, None], f, axis=0).sum(axis=1)
    np.testing.assert_allclose(state.reaction_moment("z0", about), expected, rtol=1e-9)
    from_origin = -np.cross(x, f, axis=0).sum(axis=1)
    np.testing.assert_allclose(state.reaction_moment("z0"), from_origin, rtol=1e-9)


def test_the_moment_of_a_rotation_is_the_slope_of_the_energy() -> None:
    """The work of the reaction moment along the axis over a small turn is the change of the strain energy.

    Central difference over steps of 0.01: its error is of the step squared. Catches: the moment per half the angle,
    the component along another axis.
    """
    axis = (0.2, 0.1, 1.0)
    model = SolidModel(MESH, LAW, supports=[Fix("z0"), Rotate("z1", axis, POINT, 1.0)])
    low, middle, high = solve(model, [0.29, 0.30, 0.31], settings=TIGHT).states
    moment = unit(*axis) @ middle.reaction_moment("z1", POINT)
    assert (high.energy - low.energy) / 0.02 == pytest.approx(moment, rel=1e-4)


def test_a_rotation_is_driven_by_its_name() -> None:
    """The lower end turned back by itself twists as the upper end turned on by itself, and as both by half.

    Catches: rotations driven by the common factor only.
    """
    ends = [Rotate("z0", (0.0, 0.0, 1.0), (0.5, 0.6, 0.0), -0.2), Rotate("z1", (0.0, 0.0, 1.0), (0.5, 0.6, 0.0), 0.4)]
    model = SolidModel(MESH, LAW, supports=ends)
    one, two = solve(model, [Step(1.0, loads={"z1": 0.0}), Step(0.0, loads={"z1": 0.5})], settings=TIGHT).states
    assert one.energy == pytest.approx(two.energy, rel=1e-6)  # the same twist, turned as a whole
    assert one.energy > 1e-3


def test_long_turns_are_made_in_several_steps() -> None:
    """The first iterate of a step moves along chords; no step on the way turns by more than 0.3 rad.

    Catches: one step of 170 degrees, in which chords run through the body.
    """
    factors: list[float] = []
    model = SolidModel(MESH, LAW, supports=[Rotate("z0", AXIS, POINT, 3.0)])
    found = solve(model, [1.0], observe=lambda kind, v: factors.append(v["iteration"]) if kind == "iteration" else None)
    assert sum(i == 0 for i in factors) == 10
    assert found.halvings == 0
    assert found.newton_iterations <= 10 * 7


def test_the_way_to_a_turned_state_is_told_to_the_search_for_buckling() -> None:
    """The change of the matrix on the way to more twist is that between two nearby equilibria.

    A twisted slab under compression: the critical factor predicted from 70 % of it is near that from 90 %.
    Catches: chords of the whole remaining turn in place of the tangent of the path.
    """
    thin = box_mesh((2, 1, 6), (1.0, 0.15, 6.0), shift=0.0)
    model = SolidModel(
        thin, LAW, supports=[Fix("z0"), Rotate("z1", (0.0, 0.0, 1.0), (0.5, 0.075, 0.0), 1.0, advance=-0.02)]
    )
    rest = solve(model, [1e-3]).last
    first = buckling(rest, 1.0)
    assert first is not None
    critical = first.step.load
    ways = [buckling(solve(model, [share * critical]).last, 1.0) for share in (0.7, 0.9)]
    factors = [found.step.load for found in ways if found is not None]
    assert len(factors) == 2
    assert abs(factors[1] - factors[0]) < abs(factors[0] - critical) + 0.05 * critical


@pytest.mark.parametrize(
    ("given", "word"),
    [
        ({"axis": (0.0, 0.0, 0.0)}, "axis: found .*, expected a direction"),
        ({"axis": (0.0, 1.0)}, "axis: found .*, expected a vector of three"),
        ({"point": (0.0, "1", 0.0)}, "point: found .*, expected a vector of three"),
        ({"angle": float("nan")}, "angle"),
        ({"angle": (0.1, 0.2)}, "angle: found .*, expected one number"),
        ({"advance": (0.1, 0.2)}, "advance: found .*, expected one number"),
        ({"advance": "far"}, "advance"),
    ],
)
def test_rotations_that_are_none_are_refused(given: dict[str, object], word: str) -> None:
    """Catches: a division by a length of zero; an angle per axis; text."""
    with pytest.raises(ModelError, match=f"rotate, {word}"):
        Rotate(**{"where": "z0", "axis": AXIS, "point": POINT, "angle": 0.1, **given})  # type: ignore[arg-type]


def test_a_moment_about_no_point_is_refused() -> None:
    """Catches: a pair of numbers broadcast over three components."""
    model = SolidModel(MESH, LAW, supports=[Fix("z0")])
    state = SolidState(model, Step(0.0, 0.0), np.zeros_like(model.system.space.points))
    with pytest.raises(ModelError, match=r"about: found .*, expected a position of three finite numbers"):
        state.reaction_moment("z0", (1.0, 2.0))

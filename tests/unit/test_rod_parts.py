"""Members, loads, joints and contact points: forces and their exact derivatives; compiled and as plain Python."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fem_biobot.rod.arrays import Constraints, Contacts, Loads, Members
from fem_biobot.rod.joint_stiffness import joint_stiffness
from fem_biobot.rod.parts import kernels
from fem_biobot.rod.rotation.kernels import turn
from tests.helpers import generator, plain_python, taylor_slope

Array = np.ndarray
NAMES = tuple(name for name, value in vars(kernels).items() if hasattr(value, "py_func"))


@pytest.fixture(params=["compiled", "plain"])
def mode(request: pytest.FixtureRequest) -> Iterator[str]:
    """Run the kernels compiled, and as the Python they were compiled from."""
    with ExitStack() as stack:
        if request.param == "plain":
            stack.enter_context(plain_python(kernels, *NAMES))
        yield request.param


def _nodes(seed: int = 17) -> tuple[Array, Array, Array]:
    """Two nodes, generic, and increments of both (2, 6)."""
    draw = generator(seed)
    x = draw.normal(size=(2, 3)) * 2.0
    Q = Rotation.random(2, rng=draw).as_matrix()
    return x, Q, draw.normal(size=(2, 6))


def _after(x: Array, Q: Array, step: Array) -> tuple[Array, Array]:
    moved = np.empty_like(Q)
    turn(Q, np.ascontiguousarray(step[:, 3:]), moved)
    return x + step[:, :3], moved


def _members(law: int) -> Members:
    draw = generator(5)
    one = np.array([1.0])
    return Members(np.array([[0, 1]]), draw.normal(size=(1, 2, 3)), np.array([law]), 3.0 * one, 1.7 * one, 0.0 * one)


@pytest.mark.parametrize("law", [0, 1, 2])
def test_member_tangents_are_the_derivative_of_their_forces(mode: str, law: int) -> None:
    """With active tension, at arms from the nodes, for every law.

    Catches: the change of direction or of the moment's arm left out, a slope per stretch for one per length.
    """
    members, (x, Q, step) = _members(law), _nodes()

    def force(eps: float) -> Array:
        x1, Q1 = _after(x, Q, eps * step)
        lengths, out = np.empty(1), np.zeros((2, 6))
        kernels.member_lengths(members, x1, Q1, lengths)
        passive, _, _ = kernels.passive_tension(law, 3.0, 1.7, lengths[0])
        kernels.add_member_forces(members, x1, Q1, np.array([0.6 + passive]), out)
        return out.reshape(12, 1)

    lengths, K = np.empty(1), np.empty((12, 12))
    kernels.member_lengths(members, x, Q, lengths)
    passive, slope, _ = kernels.passive_tension(law, 3.0, 1.7, lengths[0])
    kernels.member_tangent(members, 0, x, Q, np.array([0.6 + passive]), slope, K)
    np.testing.assert_allclose(taylor_slope(force, -(K @ step.reshape(12, 1))), 2.0, atol=0.1)


@pytest.mark.parametrize("law", [0, 1, 2])
def test_member_tension_is_the_slope_of_its_energy(mode: str, law: int) -> None:
    """And its own slope is what is returned; zero at the rest length.

    Catches: energy and force of different laws, a constant in the energy.
    """
    tension, _, energy = kernels.passive_tension(law, 3.0, 1.7, 1.7)
    assert (tension, energy) == (0.0, 0.0)
    tension, slope, _ = kernels.passive_tension(law, 3.0, 1.7, 1.2)

    def energies(eps: float) -> Array:
        return np.array([[kernels.passive_tension(law, 3.0, 1.7, 1.2 + eps)[2]]])

    def tensions(eps: float) -> Array:
        return np.array([[kernels.passive_tension(law, 3.0, 1.7, 1.2 + eps)[0]]])

    np.testing.assert_allclose(taylor_slope(energies, np.array([[tension]])), 2.0, atol=0.1)
    if law:
        np.testing.assert_allclose(taylor_slope(tensions, np.array([[slope]])), 2.0, atol=0.1)
    else:
        assert slope == 3.0


@pytest.mark.parametrize("following", [0, 1])
def test_load_tangents_are_the_derivative_of_their_forces(mode: str, following: int) -> None:
    """Force and moment at an arm, dead and following, with a factor.

    Catches: a sign of the following part, the factor forgotten, the arm's turn left out.
    """
    draw = generator(8)
    loads = Loads(np.array([0]), *draw.normal(size=(3, 1, 3)), np.array([following]))
    x, Q, step = _nodes()

    def force(eps: float) -> Array:
        out = np.zeros((2, 6))
        kernels.add_loads(loads, np.array([1.7]), _after(x, Q, eps * step)[1], out)
        return out[:1].reshape(6, 1)

    K = np.empty((6, 6))
    kernels.load_tangent(loads, 0, 1.7, Q, K)
    np.testing.assert_allclose(taylor_slope(force, -(K @ step[0][:, None])), 2.0, atol=0.1)


ROWS = [
    (1, 1, 1, 0, 0, 0),
    (1, 1, 1, 1, 1, 0),
    (0, 1, 1, 1, 0, 1),
    (1, 0, 0, 0, 1, 1),
    (1, 1, 1, 1, 1, 1),
    (0, 0, 0, 0, 0, 1),
]


def _joint(rows: tuple[int, ...], world: bool) -> Constraints:
    draw = generator(9)
    frame = Rotation.random(2, rng=draw).as_matrix()[None]
    ends = np.array([[0, -1 if world else 1]])
    return Constraints(ends, draw.normal(size=(1, 2, 3)), np.array([rows]), frame, np.zeros((1, 6)))


@pytest.mark.parametrize("world", [False, True])
@pytest.mark.parametrize("rows", ROWS)
def test_joint_rows_are_the_derivative_of_their_gaps(mode: str, rows: tuple[int, ...], world: bool) -> None:
    """For parts far out of place, all kinds of joints, between two parts and against the world.

    Catches: a sign, a cyclic index, the world moving along.
    """
    joint, (x, Q, step) = _joint(rows, world), _nodes()

    def gap(eps: float) -> Array:
        value, slopes = np.empty(6), np.empty((6, 12))
        kernels.constraint(joint, 0, *_after(x, Q, eps * step), value, slopes)
        return value[np.array(rows) == 1].reshape(-1, 1)

    value, slopes = np.empty(6), np.empty((6, 12))
    kernels.constraint(joint, 0, x, Q, value, slopes)
    assert not slopes[np.array(rows) == 0].any()
    exact = (slopes @ step.reshape(12))[np.array(rows) == 1].reshape(-1, 1)
    np.testing.assert_allclose(taylor_slope(gap, exact), 2.0, atol=0.1)


@pytest.mark.parametrize("world", [False, True])
@pytest.mark.parametrize("rows", ROWS)
def test_joint_stiffness_is_the_derivative_of_the_joints_forces(rows: tuple[int, ...], world: bool) -> None:
    """Multipliers fixed, rows turning.

    Catches: a row's own change left out, the second part's sign.
    """
    joint, (x, Q, step) = _joint(rows, world), _nodes()
    multiplier = generator(3).normal(size=(1, 6))

    def force(eps: float) -> Array:
        value, slopes = np.empty(6), np.empty((6, 12))
        kernels.constraint(joint, 0, *_after(x, Q, eps * step), value, slopes)
        return (multiplier[0] @ slopes).reshape(12, 1)

    K = joint_stiffness(joint, Q, multiplier)[0]
    np.testing.assert_allclose(taylor_slope(force, -(K @ step.reshape(12, 1))), 2.0, atol=0.1)


def test_a_hinge_has_rows_at_every_angle(mode: str) -> None:
    """Turned by any angle about its axis there is no gap, and five independent rows remain, at half a turn too.

    Catches: the axial vector of the relative turn, whose rows vanish at pi.
    """
    x = np.zeros((2, 3))
    rows, frame = np.array([[1, 1, 1, 1, 1, 0]]), np.tile(np.eye(3), (1, 2, 1, 1))
    joint = Constraints(np.array([[0, 1]]), np.zeros((1, 2, 3)), rows, frame, np.zeros((1, 6)))
    for angle in (0.4, 2.0, np.pi, 5.0):
        Q = np.stack([Rotation.from_rotvec([0.0, 0.0, angle]).as_matrix().T, np.eye(3)])
        value, slopes = np.empty(6), np.empty((6, 12))
        kernels.constraint(joint, 0, x, Q, value, slopes)
        np.testing.assert_allclose(value, 0.0, atol=1e-15)
        np.testing.assert_allclose(np.linalg.svd(slopes[:5], compute_uv=False)[-1], np.sqrt(2.0), rtol=1e-12)


@pytest.mark.parametrize(("radius", "axis"), [(0.0, None), (0.7, None), (0.7, (0.3, 0.2, 1.0))])
def test_contact_rows_are_the_derivative_of_the_gap(
    mode: str, radius: float, axis: tuple[float, float, float] | None
) -> None:
    """A point, a sphere, a cylinder: the first row is the gap's derivative.

    For a cylinder the lowest generator moves on the part; its height changes to second order only across the axis.

    Catches: the arm without the radius, a plane's height with the wrong sign.
    """
    draw = generator(4)
    direction = np.zeros(3) if axis is None else np.array(axis) / np.linalg.norm(axis)
    contacts = Contacts(
        np.array([1]), draw.normal(size=(1, 3)), np.array([radius]), direction[None], np.array([0]), np.zeros((1, 3))
    )
    axes = Rotation.random(rng=draw).as_matrix()
    x, Q, step = _nodes()

    def gap(eps: float) -> Array:
        return np.array(
            [[kernels.contact(contacts, 0, *_after(x, Q, eps * step), axes, 0.3, False, np.empty((3, 1, 6)))]]
        )

    rows = np.empty((3, 1, 6))
    kernels.contact(contacts, 0, x, Q, axes, 0.3, False, rows)
    np.testing.assert_allclose(taylor_slope(gap, np.array([[rows[0, 0] @ step[1]]])), 2.0, atol=0.1)
    np.testing.assert_allclose(rows[:, 0, :3], axes, rtol=1e-15)


def test_a_force_that_acts_elsewhere_has_rows_of_its_own(mode: str) -> None:
    """The gap stays the point's; along the ground, and where impulses act, it is the other point that moves.

    Catches: the force left at the point, a gap taken at the other one.
    """
    draw = generator(6)
    points = draw.normal(size=(2, 3))
    axes = Rotation.random(rng=draw).as_matrix()
    x, Q, _ = _nodes()

    def found(offset: Array, acting: Array | None, pushing: bool) -> tuple[float, Array]:
        there = np.zeros((1, 3)) if acting is None else acting[None]
        flags = np.array([0 if acting is None else 1])
        contacts = Contacts(np.array([1]), offset[None], np.zeros(1), np.zeros((1, 3)), flags, there)
        rows = np.empty((3, 1, 6))
        return kernels.contact(contacts, 0, x, Q, axes, 0.3, pushing, rows), rows[:, 0]

    (gap, at_point), (_, at_other) = (found(p, None, False) for p in points)
    for pushing in (False, True):
        there, rows = found(points[0], points[1], pushing)
        assert there == gap
        np.testing.assert_array_equal(rows[0], at_other[0] if pushing else at_point[0])
        np.testing.assert_array_equal(rows[1:], at_other[1:])

"""The rule of stick and slip: which friction a point has, and what it is called at the end of a step."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from fem_biobot.friction.kernels import LIFTED, SLIP, STICK, settle, solve_friction
from fem_biobot.friction.scratch import scratch
from tests.helpers import unchanged
from tests.oracles.contact import rigid_foot

Array = NDArray[np.float64]

TOLERANCE = 1e-12
CORNERS = np.array([[1.3, 0.7, -2.1], [-1.1, 0.7, -2.1], [1.3, -0.9, -2.1], [-1.1, -0.9, -2.1]])
MASS = 2e-5
FOOT, JACOBIAN = rigid_foot(CORNERS, MASS, np.diag([3.1e-5, 2.4e-5, 1.7e-5]))
BUFFERS = scratch(8)
STATIC, KINETIC = 0.8, 0.4


def step(W: Array, b: Array, state: list[int], slip: Array | None = None) -> tuple[Array, Array, list[int], list[int]]:
    """One step: impulses, velocities, states in force, states afterwards; kinetic friction is half the static."""
    c = len(b)
    force = np.array(state)
    moved = np.zeros((c, 2)) if slip is None else slip.copy()
    p, w = np.zeros_like(b), np.zeros_like(b)
    static, kinetic = np.full((c, 4), STATIC), np.full((c, 4), KINETIC)
    with unchanged(W, b, static, kinetic, moved):
        residual, _ = solve_friction(W, b, static, kinetic, force, moved, p, w, BUFFERS, TOLERANCE, 500)
    assert residual <= TOLERANCE
    after = force.copy()
    settle(b, w, after, moved, TOLERANCE)
    np.testing.assert_array_equal(moved, np.where((after == SLIP)[:, None], w[:, 1:], 0.0))
    return p, w, force.tolist(), after.tolist()


@pytest.mark.parametrize("start", [STICK, LIFTED])
def test_static_friction_holds_until_it_is_exceeded_then_kinetic_friction_acts(start: int) -> None:
    """Demand 0.7 of the weight is held; 0.9 slips with 0.4 in the same step; a landing point counts as sticking.

    Catches: kinetic friction one step late, static friction kept in slip, a landing point taken for slipping.
    """
    W = np.eye(3)
    p, w, _, after = step(W, np.array([[-1.0, 0.7, 0.0]]), [start])
    assert after == [STICK]
    assert np.abs(w).max() <= 1e-14
    p, w, force, after = step(W, np.array([[-1.0, 0.9, 0.0]]), [start])
    assert force == after == [SLIP]
    np.testing.assert_allclose(p, [[1.0, -KINETIC, 0.0]], rtol=0.0, atol=1e-14)
    np.testing.assert_allclose(w, [[0.0, 0.5, 0.0]], rtol=0.0, atol=1e-14)


def test_a_slipping_point_that_comes_to_rest_sticks() -> None:
    """Stopped within the bound of kinetic friction; driven harder it goes on slipping, though static would hold.

    Catches: SLIP for ever; static friction given to what slips.
    """
    ahead = np.array([[1.0, 0.0]])
    _, w, force, after = step(np.eye(3), np.array([[-1.0, 0.3, 0.0]]), [SLIP], ahead)
    assert (force, after) == ([SLIP], [STICK])
    assert np.abs(w).max() <= 1e-14
    _, w, _, after = step(np.eye(3), np.array([[-1.0, 0.7, 0.0]]), [SLIP], ahead)
    assert after == [SLIP]
    np.testing.assert_allclose(w[0, 1], 0.3, rtol=0.0, atol=1e-14)


def test_a_point_that_turns_back_is_held_by_static_friction_first() -> None:
    """Slipping forwards, pushed backwards by 0.7 of the weight: it stops; by 0.9: it slips back with kinetic friction.

    Catches: a slip that passes through rest within a step without meeting static friction.
    """
    ahead = np.array([[1.0, 0.2]])
    _, w, _, after = step(np.eye(3), np.array([[-1.0, -0.7, 0.0]]), [SLIP], ahead)
    assert after == [STICK]
    assert np.abs(w).max() <= 1e-14
    _, w, _, after = step(np.eye(3), np.array([[-1.0, -0.9, 0.0]]), [SLIP], ahead)
    assert after == [SLIP]
    np.testing.assert_allclose(w[0, 1], -0.5, rtol=0.0, atol=1e-14)


def test_a_foot_that_slides_slides_at_all_its_corners() -> None:
    """With kinetic friction the load stands over two corners: the other two touch without impulse and still slip.

    Catches: stick read from an impulse of zero.
    """
    # moment about the centre, by unit weight: load at x = 1.3 and friction 0.4 towards +x at z = -2.1; under static
    # friction the load would stand at x = 1.3 - 0.84, so nothing tips first
    moment = (1.3 + 2.1 * KINETIC) * MASS
    b = (JACOBIAN @ np.array([-0.9, 0.0, -1.0, 0.0, moment / 2.4e-5, 0.0])).reshape(4, 3)
    p, w, _, after = step(FOOT, b, [STICK] * 4)
    assert np.abs(p[[1, 3], 0]).max() <= 1e-9 * MASS
    assert np.abs(w[:, 0]).max() <= 1e-11
    assert after == [SLIP] * 4
    np.testing.assert_allclose(w[:, 1], -0.9 + KINETIC, rtol=0.0, atol=1e-10)


def test_a_foot_that_pivots_sticks_where_it_turns_and_slips_elsewhere() -> None:
    """A twist about one loaded corner, made by hand: it keeps static friction; touching corners that move slip.

    Catches: one state for a whole body; kinetic friction for a point because its neighbours slip.
    """
    omega = np.array([0.0, 0.0, 0.3])
    moving = np.concatenate([np.cross(omega, -CORNERS[0]), omega])
    p = np.zeros((4, 3))
    p[0] = MASS * np.array([1.0, -0.5, 0.3])  # between kinetic and static friction
    b = (JACOBIAN @ moving - FOOT @ p.ravel()).reshape(4, 3)
    found, w, _, after = step(FOOT, b, [STICK] * 4)
    assert after == [STICK, SLIP, SLIP, SLIP]
    np.testing.assert_allclose(w.ravel(), JACOBIAN @ moving, rtol=0.0, atol=1e-10)
    np.testing.assert_allclose(found, p, rtol=0.0, atol=1e-9 * MASS)


def test_points_in_the_air_are_lifted() -> None:
    """A point that leaves is lifted whatever its tangential velocity; its friction is none.

    Catches: slip called at a distance.
    """
    p, _, _, after = step(np.eye(6), np.array([[0.1, 3.0, 1.0], [-1.0, 0.1, 0.0]]), [SLIP, STICK])
    assert after == [LIFTED, STICK]
    p, _, force, after = step(np.eye(6), np.array([[0.1, 3.0, 1.0], [-1.0, 0.1, 0.0]]), [LIFTED, STICK])
    assert force == after == [LIFTED, STICK]
    assert np.all(p[0] == 0.0)


def test_an_unsolved_problem_is_not_judged() -> None:
    """States stay as they were and the residual says why.

    Catches: slip read from velocities that solve nothing.
    """
    b = (JACOBIAN @ np.array([1.3, 0.4, -1.0, 0.2, -0.1, 0.5])).reshape(4, 3)
    state, mu = np.full(4, STICK), np.full((4, 4), 0.8)
    p, w = np.zeros((4, 3)), np.zeros((4, 3))
    residual, _ = solve_friction(FOOT, b, mu, 0.5 * mu, state, np.zeros((4, 2)), p, w, BUFFERS, TOLERANCE, 1)
    assert residual > TOLERANCE
    assert state.tolist() == [STICK] * 4

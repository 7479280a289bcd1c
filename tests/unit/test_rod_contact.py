"""The condensed contact problem: closed forms, the law checked as inequalities, rank, scale, warm starts, rest."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from fem_biobot.friction.friction_set.kernels import admissible, farthest, project
from fem_biobot.friction.kernels import solve_cones
from fem_biobot.friction.one_point.kernels import solve_point
from fem_biobot.friction.scratch import ContactScratch, scratch
from tests.helpers import generator, taylor_slope, unchanged
from tests.oracles.contact import broken_law, nearest_admissible, projected_sweeps, rigid_foot
from tests.oracles.contact import farthest as support

Array = NDArray[np.float64]

EPS = 2.0**-52
TOLERANCE = 1e-12
UNEQUAL = np.array([0.31, 0.74, 0.52, 1.23])
CORNERS = np.array([[1.3, 0.7, -2.1], [-1.1, 0.7, -2.1], [1.3, -0.9, -2.1], [-1.1, -0.9, -2.1]])
INERTIA = np.array([[3.1, 0.2, -0.1], [0.2, 2.4, 0.3], [-0.1, 0.3, 1.7]]) * 1e-5
BUFFERS: ContactScratch = scratch(12)


def solved(
    W: Array, b: Array, mu: Array, first: Array | None = None, most: int = 2000
) -> tuple[Array, Array, float, int]:
    """Impulses, velocities, residual, iterations; the inputs stay as they are."""
    p = np.zeros_like(b) if first is None else first.copy()
    w = np.full_like(b, np.nan)
    with unchanged(W, b, mu):
        residual, iterations = solve_cones(W, b, mu, p, w, BUFFERS, TOLERANCE, most)
    return p, w, residual, iterations


def velocity_scale(b: Array) -> float:
    return float(max(np.abs(b[:, 1:]).max(), -b[:, 0].min()))


def two_feet(seed: int, mu: float, spread: float = 1.0) -> tuple[Array, Array, Array]:
    """Two rigid feet of four corners on a body that couples them: W of rank 12 at 8 points; feet land obliquely."""
    draw = generator(seed)
    H = np.zeros((24, 12))
    M = np.zeros((12, 12))
    for f in range(2):
        _, H[12 * f : 12 * f + 12, 6 * f : 6 * f + 6] = rigid_foot(CORNERS + 0.3 * f, 1.0, INERTIA)
        mass = 2e-5 * spread**f
        M[6 * f : 6 * f + 6, 6 * f : 6 * f + 6] = mass * np.diag([1.0, 1.0, 1.0, 1.4, 2.2, 1.9])
    size = np.sqrt(np.diag(M))
    A = draw.normal(size=(12, 12))
    M += 0.2 * (A @ A.T) * np.outer(size, size)
    v = draw.normal(size=12)
    v[[2, 8]] = -2.0 - np.abs(v[[2, 8]])
    v[[3, 4, 5, 9, 10, 11]] *= 0.2
    W = H @ np.linalg.solve(M, H.T)
    return 0.5 * (W + W.T), (H @ v).reshape(8, 3), np.full((8, 4), mu)


@pytest.mark.parametrize("z", [(0.9, 1.4), (-1.2, 0.3), (-0.4, -2.2), (3.0, -0.02), (0.7, -0.9)])
@pytest.mark.parametrize("mu", [UNEQUAL, np.full(4, 0.6)])
def test_projection_finds_the_nearest_point_of_the_edge(z: tuple[float, float], mu: Array) -> None:
    """As a search along the whole edge does, from every quadrant.

    Catches: a radius of the wrong side, Newton left too early, an angle taken for a direction.
    """
    found = np.array(project(*z, 0.8, *mu)[:2])
    # a search over distances squared sees the place to the root of rounding
    np.testing.assert_allclose(found, nearest_admissible(np.array(z), 0.8, mu), rtol=0.0, atol=1e-7)


@pytest.mark.parametrize("mu", [UNEQUAL, np.full(4, 0.6)])
def test_slope_of_the_projection_is_its_derivative(mu: Array) -> None:
    """Taylor remainder of the projection falls with slope two, also in the normal impulse by homogeneity.

    Catches: the curvature of the edge left out, a lost off-diagonal term.
    """
    z, s = np.array([-0.9, 1.4]), 0.8
    dz, ds = np.array([0.4, 0.3]), -0.2
    x1, x2, A11, A12, A22 = project(*z, s, *mu)
    x, A = np.array([x1, x2]), np.array([[A11, A12], [A12, A22]])
    slope = A @ dz + (x - A @ z) / s * ds
    rate = taylor_slope(lambda t: np.array(project(*(z + t * dz), s + t * ds, *mu)[:2]), slope)
    assert np.all(np.abs(rate - 2.0) < 0.1)


def test_friction_sets_without_width_keep_what_they_have() -> None:
    """A half ellipse, a segment and the origin: projections by hand.

    Catches: division by a zero radius; a one-way foot held in its free direction.
    """
    assert project(-0.7, 0.2, 1.0, 0.0, 0.5, 0.4, 0.4)[:2] == (0.0, 0.2)
    assert project(-0.7, 0.9, 1.0, 0.0, 0.5, 0.4, 0.4)[:2] == (0.0, 0.4)
    assert project(0.7, 0.9, 2.0, 0.3, 0.3, 0.0, 0.0)[:2] == (0.6, 0.0)
    assert project(-0.1, 0.9, 2.0, 0.3, 0.3, 0.0, 0.0)[:2] == (-0.1, 0.0)
    assert project(0.7, 0.9, 2.0, 0.0, 0.0, 0.0, 0.0) == (0.0, 0.0, 0.0, 0.0, 0.0)
    assert admissible(0.0, 0.3, 1.0, 0.0, 0.0, 0.4, 0.4)
    assert not admissible(-1e-9, 0.3, 1.0, 0.0, 0.5, 0.4, 0.4)
    assert farthest(-1.0, 0.0, 0.0, 0.5, 0.4, 0.4) == (0.0, 0.0)


@pytest.mark.parametrize("slip", [(1.1, 0.4), (-0.8, 0.5), (-0.3, -1.7), (0.6, -0.2)])
def test_one_point_slips_where_friction_dissipates_most(slip: tuple[float, float]) -> None:
    """A solution made by hand with unequal friction and a full 3 by 3 operator is found, alone and by the solver.

    Catches: friction along the slip instead of along the normal of its set, sides exchanged, lifting of a sliding body.
    """
    v = np.array(slip)
    a2 = np.array([UNEQUAL[0] if v[0] > 0 else UNEQUAL[1], UNEQUAL[2] if v[1] > 0 else UNEQUAL[3]]) ** 2
    p = 0.7 * np.array([1.0, *(-a2 * v / support(-v, UNEQUAL))])
    W = np.array([[2.0, 0.3, -0.2], [0.3, 1.4, 0.25], [-0.2, 0.25, 0.9]])
    b = np.array([0.0, *v]) - W @ p
    alone = solve_point(W, *b, *UNEQUAL)
    assert alone[3]
    np.testing.assert_allclose(alone[:3], p, rtol=0.0, atol=50 * EPS * np.abs(b).max())
    found, w, residual, _ = solved(W, b[None], UNEQUAL[None])
    assert residual <= TOLERANCE
    np.testing.assert_allclose(found[0], p, rtol=0.0, atol=50 * EPS * np.abs(b).max())
    np.testing.assert_allclose(w[0], [0.0, *v], rtol=0.0, atol=50 * EPS * np.abs(b).max())


def test_one_mass_lifts_sticks_and_slips_by_the_cone() -> None:
    """Free flight keeps the velocity; a push inside the cone stops; outside it friction is mu times the normal impulse.

    Catches: adhesion, a bound not scaled by the normal impulse, friction in flight.
    """
    W, mu = np.eye(3) / 0.4, np.full((1, 4), 0.6)
    p, w, _, _ = solved(W, np.array([[0.2, 1.0, -3.0]]), mu)
    assert np.all(p == 0.0)
    assert w.tolist() == [[0.2, 1.0, -3.0]]
    p, w, _, _ = solved(W, np.array([[-2.0, 0.5, -1.0]]), mu)
    np.testing.assert_allclose(p, [[0.8, -0.2, 0.4]], rtol=0.0, atol=4 * EPS)
    assert np.abs(w).max() <= 4 * EPS * 2.0
    p, w, _, _ = solved(W, np.array([[-2.0, 1.5, -2.0]]), mu)
    np.testing.assert_allclose(p, [[0.8, -0.8 * 0.36, 0.8 * 0.48]], rtol=0.0, atol=4 * EPS)
    np.testing.assert_allclose(w, [[0.0, 1.5 - 0.72, -2.0 + 0.96]], rtol=0.0, atol=8 * EPS * 2.0)


def test_a_foot_that_holds_one_way_only_slides_freely_the_other_way() -> None:
    """No friction against slip along +t1, much against -t1; friction across does not care.

    Catches: sides exchanged; a set without width taken for a singular system.
    """
    W, mu = np.eye(3), np.array([[0.0, 5.0, 0.3, 0.3]])
    _, w, residual, _ = solved(W, np.array([[-1.0, 2.0, 0.1]]), mu)
    np.testing.assert_allclose(w, [[0.0, 2.0, 0.0]], rtol=0.0, atol=8 * EPS)
    assert residual <= TOLERANCE
    _, w, residual, _ = solved(W, np.array([[-1.0, -2.0, 0.1]]), mu)
    np.testing.assert_allclose(w, np.zeros((1, 3)), rtol=0.0, atol=8 * EPS)
    assert residual <= TOLERANCE


@pytest.mark.parametrize("mu", [0.0, 0.3, 0.8, 1.6])
@pytest.mark.parametrize("seed", range(300, 312))
def test_rigid_feet_obey_the_law_at_every_corner(mu: float, seed: int) -> None:
    """Eight corners of rank twelve: complementarity and greatest dissipation hold to the tolerance.

    Catches: a regularised answer, the associated cone, corners counted as independent.
    """
    W, b, friction = two_feet(seed, mu)
    p, _, residual, _ = solved(W, b, friction)
    assert residual <= TOLERANCE
    # the law's measures are the natural map's up to the two mobilities of a point and friction, all near one
    assert broken_law(W, b, friction, p) <= 20 * TOLERANCE


@pytest.mark.parametrize("seed", range(340, 352))
def test_feet_with_friction_that_depends_on_direction_obey_the_law(seed: int) -> None:
    """Unequal radii at every corner, each corner its own.

    Catches: derivative of the projection of another quadrant; radii of another point.
    """
    W, b, _ = two_feet(seed, 0.0)
    friction = generator(seed).uniform(0.1, 1.2, size=(8, 4))
    p, _, residual, _ = solved(W, b, friction)
    assert residual <= TOLERANCE
    assert broken_law(W, b, friction, p) <= 20 * TOLERANCE


@pytest.mark.parametrize("seed", [411, 412, 413])
def test_velocities_agree_with_long_projected_sweeps(seed: int) -> None:
    """Another method, which knows no Newton, moves the corners alike: two feet on three corners each, rank 12 of 18.

    With four corners how they share the load is open, and how a foot turns while it slides depends on that.
    Catches: a wrong root that satisfies the solver's own residual.
    """
    W, b, friction = two_feet(seed, 0.25)
    points = np.array([0, 1, 2, 4, 5, 6])
    rows = (3 * points[:, None] + np.arange(3)).ravel()
    W, b, friction = np.ascontiguousarray(W[np.ix_(rows, rows)]), b[points], friction[points]
    _, w, residual, _ = solved(W, b, friction)
    assert residual <= TOLERANCE
    slow = projected_sweeps(W, b, 0.25, 4000)
    np.testing.assert_allclose(w, slow, rtol=0.0, atol=1e-8 * velocity_scale(b))


@pytest.mark.parametrize("seed", [421, 422, 423])
def test_corners_renumbered_move_alike(seed: int) -> None:
    """Impulses of corners are not unique; velocities are, in any order of the points.

    Catches: an answer that depends on the order of sweeps, a row mixed with another point's.
    """
    W, b, friction = two_feet(seed, 0.3)
    order = generator(seed).permutation(8)
    rows = (3 * order[:, None] + np.arange(3)).ravel()
    _, w, _, _ = solved(W, b, friction)
    _, other, _, _ = solved(np.ascontiguousarray(W[np.ix_(rows, rows)]), b[order], friction[order])
    # the operator's smallest mobility that is not zero amplifies the tolerance
    np.testing.assert_allclose(other, w[order], rtol=0.0, atol=1e3 * TOLERANCE * velocity_scale(b))


def test_scale_of_impulses_and_velocities_does_not_matter() -> None:
    """Heavier by 2^40 and slower by 2^20: the same numbers in proportion, bit by bit.

    Catches: an absolute tolerance or proximal term.
    """
    W, b, friction = two_feet(431, 0.4)
    p, w, residual, iterations = solved(W, b, friction)
    p2, w2, residual2, iterations2 = solved(W * 2.0**-40, b * 2.0**-20, friction)
    assert residual <= TOLERANCE
    assert (residual2, iterations2) == (residual, iterations)
    np.testing.assert_array_equal(w2 * 2.0**20, w)
    np.testing.assert_array_equal(p2 * 2.0**-20, p)


def test_a_light_and_a_heavy_foot_are_solved_together() -> None:
    """Masses a million times apart in one operator.

    Catches: one impulse scale for all points.
    """
    for seed in range(440, 446):
        W, b, friction = two_feet(seed, 0.4, spread=1e6)
        p, _, residual, _ = solved(W, b, friction)
        assert residual <= TOLERANCE
        assert broken_law(W, b, friction, p) <= 20 * TOLERANCE


def test_a_slightly_unsymmetric_operator_is_no_obstacle() -> None:
    """An operator condensed with an unsymmetric tangent (1e-3) converges as well.

    Catches: a factorisation or an argument that needs symmetry.
    """
    for seed in range(450, 458):
        W, b, friction = two_feet(seed, 0.4)
        turned = np.eye(24) + 1e-3 * generator(seed).normal(size=(24, 24)) / 5.0
        W = W @ turned @ np.linalg.pinv(W, rcond=1e-10) @ W
        assert np.abs(W - W.T).max() > 1e-4 * np.abs(W).max()
        p, _, residual, _ = solved(W, b, friction)
        assert residual <= TOLERANCE
        assert broken_law(W, b, friction, p) <= 20 * TOLERANCE


def test_the_last_answer_is_a_good_start() -> None:
    """The same problem needs no iteration; one a little further on, with the same points slipping, at most three.

    Catches: a solver that forgets its start, Gauss-Seidel before the start was looked at.
    """
    for seed in range(460, 466):
        W, b, friction = two_feet(seed, 0.3)
        p, _, _, _ = solved(W, b, friction)
        _, _, residual, iterations = solved(W, b, friction, p)
        assert residual <= TOLERANCE
        assert iterations <= 1
        further = b + 1e-6 * (W @ generator(seed).normal(size=24)).reshape(8, 3) * np.abs(b).max() / np.abs(W).max()
        _, _, residual, iterations = solved(W, further, friction, p)
        assert residual <= TOLERANCE
        assert iterations <= 3


def test_a_foot_at_rest_does_not_move_at_all() -> None:
    """Pressed down obliquely within its cone: no velocity beyond rounding, from any first guess; then nothing to do.

    Catches: creep by a proximal term left in the answer, work on a start that is the answer.
    """
    W, H = rigid_foot(CORNERS, 2e-5, INERTIA)
    b = (H @ np.array([2.3, -1.1, -9.8, 0.02, -0.03, 0.4])).reshape(4, 3)
    for seed in range(470, 480):
        first = np.abs(generator(seed).normal(size=(4, 3))) * 1e-4
        p, w, _, _ = solved(W, b, np.full((4, 4), 0.7), first)
        assert np.all(p[:, 0] >= 0.0)
        assert np.abs(w).max() <= 1e-14 * velocity_scale(b)
        again, _, _, iterations = solved(W, b, np.full((4, 4), 0.7), p)
        assert iterations == 0
        np.testing.assert_array_equal(again, p)


def test_buffers_may_be_larger_than_the_problem() -> None:
    """A front of larger arrays is solved as alone.

    Catches: loops over the size of a buffer.
    """
    W, b, friction = two_feet(481, 0.3)
    large = np.full((30, 30), np.nan)
    large[:24, :24] = W
    _, w, _, _ = solved(W, b, friction)
    _, other, _, _ = solved(large, b, friction)
    np.testing.assert_array_equal(other, w)


def test_what_is_not_reached_is_said() -> None:
    """Too few iterations, a point that nothing can move, and input that is not finite give an honest residual.

    Catches: the tolerance returned as residual; a NaN that compares as converged.
    """
    W, b, friction = two_feet(491, 0.8)
    p, _, residual, iterations = solved(W, b, friction, most=1)
    assert iterations == 1
    assert residual > TOLERANCE
    assert broken_law(W, b, friction, p) > TOLERANCE
    _, w, residual, _ = solved(np.zeros((3, 3)), np.array([[-1.0, 0.2, 0.1]]), friction[:1], most=30)
    assert residual == 1.0
    assert w.tolist() == [[-1.0, 0.2, 0.1]]
    assert solved(W, np.where(b == b[3, 1], np.nan, b), friction)[2] == np.inf
    assert solved(np.eye(3), np.array([[np.inf, 0.0, 0.0]]), friction[:1])[2] == np.inf
    spoiled = W.copy()
    spoiled[4, 7] = np.nan
    assert solved(spoiled, b, friction, most=30)[2] == np.inf
    assert solved(W, b, friction, np.full((8, 3), np.nan))[2] <= TOLERANCE

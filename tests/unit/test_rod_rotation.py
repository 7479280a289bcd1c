"""Rotations: exponential, logarithm and the update of directors, compiled and as plain Python."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fem_biobot.rod.rotation import kernels
from tests.helpers import generator, plain_python, unchanged

EPS = np.finfo(float).eps
ANGLES = (0.0, 1e-200, 1e-12, 1e-5, 0.3, 1.4, 2.2, 3.0, np.pi - 1e-9)
# close to each axis in turn, so that every component of the quaternion is once the largest; and a generic one
AXES = [(-0.9, 0.2, 0.1), (0.1, -0.8, 0.3), (0.2, 0.3, 0.95), (0.5, -0.6, 0.4)]
NAMES = ("quaternion", "angle_per_sine", "exp", "log", "turned", "turn", "rotation_between", "add", "add_outer", "dot")
NAMES += ("matrix_of", "multiple", "product", "skew", "transpose")


@pytest.fixture(params=["compiled", "plain"])
def mode(request: pytest.FixtureRequest) -> Iterator[str]:
    """Run the kernels compiled, and as the Python they were compiled from."""
    with ExitStack() as stack:
        if request.param == "plain":
            stack.enter_context(plain_python(kernels, *NAMES))
        yield request.param


def _vectors() -> list[np.ndarray]:
    return [angle * np.array(axis) / np.linalg.norm(axis) for angle in ANGLES for axis in AXES]


def _directors(n: int, seed: int = 9) -> np.ndarray:
    return Rotation.random(n, rng=generator(seed)).as_matrix()


def test_exponential_is_the_rotation(mode: str) -> None:
    """It agrees with another library's, beyond half and full turns too.

    Catches: the transposed rotation; w and 2 w mixed up; an angle wrapped.
    """
    for phi in [*_vectors(), np.array([3.0, -4.0, 5.5])]:
        expected = Rotation.from_rotvec(phi).as_matrix().ravel()
        # entries are sums of three products of rounded factors, and the angle's sine carries |phi| roundings
        np.testing.assert_allclose(kernels.exp(tuple(phi)), expected, rtol=0.0, atol=(8 + np.linalg.norm(phi)) * EPS)


def test_logarithm_undoes_the_exponential_in_every_digit(mode: str) -> None:
    """Relative to its length, from tiny turns to just below pi, whatever the axis.

    Catches: acos of the trace, a lost branch of Shepperd's choice, a sign turned when w comes out negative.
    """
    for phi in _vectors():
        back = np.array(kernels.log(kernels.exp(tuple(phi))))
        np.testing.assert_allclose(back, phi, rtol=0.0, atol=16 * EPS * np.linalg.norm(phi))


def test_logarithm_of_half_a_turn_is_one_of_the_two(mode: str) -> None:
    """Where both signs are right, the vector is pi long and its rotation is the one given.

    Catches: a division by w; a NaN at pi.
    """
    for axis in AXES:
        n = np.array(axis) / np.linalg.norm(axis)
        R = 2.0 * np.outer(n, n) - np.eye(3)
        phi = np.array(kernels.log(tuple(R.ravel())))
        assert abs(np.linalg.norm(phi) - np.pi) < 8 * EPS
        np.testing.assert_allclose(np.abs(phi @ n), np.pi, rtol=8 * EPS)


def test_logarithm_of_the_inverse_is_the_negative(mode: str) -> None:
    """Exactly, below pi: an element seen from its other end has the same strains.

    Catches: rounding that depends on the sign of w; normalisation of one branch alone.
    """
    for phi in _vectors():
        R = kernels.exp(tuple(phi))
        forward, backward = kernels.log(R), kernels.log(kernels.transpose(R))
        assert forward == tuple(-component for component in backward)


def test_turn_is_a_spatial_rotation_of_the_directors(mode: str) -> None:
    """The frame R, whose columns are the directors, becomes exp([dtheta]x) R; in place as well.

    Catches: a turn in material components, the wrong sign, one node's increment used for all.
    """
    Q, dtheta = _directors(5), generator(12).normal(size=(5, 3))
    expected = (Rotation.from_rotvec(dtheta) * Rotation.from_matrix(Q.transpose(0, 2, 1))).as_matrix()
    out = np.empty_like(Q)
    with unchanged(Q, dtheta):
        kernels.turn(Q, dtheta, out)
    np.testing.assert_allclose(out.transpose(0, 2, 1), expected, rtol=0.0, atol=16 * EPS)
    kernels.turn(Q, dtheta, Q)
    assert np.array_equal(Q, out)


def test_directors_stay_orthonormal_over_many_turns() -> None:
    """However many updates, rounding alone separates the rows from unit and mutual right angle.

    Catches: the correction left out, or of the wrong size or sign (drift grows with the number of turns).
    """
    Q, steps = _directors(3), generator(8).normal(size=(50, 3, 3))
    for k in range(100_000):
        kernels.turn(Q, steps[k % 50], Q)
    np.testing.assert_allclose(Q @ Q.transpose(0, 2, 1), np.tile(np.eye(3), (3, 1, 1)), rtol=0.0, atol=8 * EPS)


def test_many_small_turns_add_up() -> None:
    """About a fixed axis the angle is the sum of the increments, so the correction adds no turn of its own.

    Catches: rows made orthonormal one after the other, which turns the frame; a first-order exponential.
    """
    n, step = 20_000, 3e-4
    axis = np.array([0.48, -0.6, 0.64])
    Q = _directors(1)
    expected = Q[0] @ Rotation.from_rotvec(n * step * axis).as_matrix().T
    for _ in range(n):
        kernels.turn(Q, step * axis[None], Q)
    # one rounding a step, all of one sign at worst
    np.testing.assert_allclose(Q[0], expected, rtol=0.0, atol=n * EPS)


def test_rotation_between_undoes_turn(mode: str) -> None:
    """Turning by it leads from one set of directors to the other.

    Catches: the inverse; material instead of spatial components.
    """
    Q, dtheta = _directors(4, seed=3), 0.9 * generator(5).normal(size=(4, 3))
    after, found = np.empty_like(Q), np.empty((4, 3))
    kernels.turn(Q, dtheta, after)
    with unchanged(Q, after):
        kernels.rotation_between(Q, after, found)
    np.testing.assert_allclose(found, dtheta, rtol=0.0, atol=32 * EPS)

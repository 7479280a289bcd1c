"""S3: the blocked muscle pulls with T A sin^2 along and T A sin cos across.

Problem: block of muscle with its faces held, nominal tension along a fibre at theta from the lateral axis.
Exact answer: F = I is an equilibrium, P = T a0 x a0; force on the end face T A sin^2(theta) along the actuation and
    T A sin(theta) cos(theta) across it; sum of reactions times positions T V a0 x a0 (virial).
Measured: reactions of the end faces, the virial of all reactions, displacement of inner nodes.
Tolerance: 1e-12 of T A; rounding of sums, the residual is solved to 1e-13.
Cannot see: the passive law (by design), the tangent, anything at a stretch other than one.
"""

from __future__ import annotations

import numpy as np
import pytest

from fem_biobot.material import ActiveStress, NeoHooke
from fem_biobot.muscle.fibres import junction_direction
from fem_biobot.solid.model import SolidModel, SolidState, solve
from tests.helpers import TIGHT, box_mesh, hold_everywhere, unit

SIZE = (1.7, 0.9, 0.6)
TENSION = 8.3


def _blocked(a0: np.ndarray, law: NeoHooke) -> SolidState:
    """Reactions on one face sum to the face's traction because opposite side faces are meshed alike and cancel."""
    mesh = box_mesh((3, 2, 2), SIZE)
    model = SolidModel(mesh, {"muscle": law}, {"muscle": ActiveStress(TENSION, a0)}, hold_everywhere())
    return solve(model, settings=TIGHT).last


@pytest.mark.parametrize("theta", np.radians([35.0, 72.0, 118.0]))
def test_blocked_muscle_pulls_with_sin_squared_theta(theta: float) -> None:
    """The ends are held by T A sin^2 along x and T A sin cos along y, in opposite senses.

    Catches: theta measured from the actuation, degrees for radians, the dyad's second factor dropped.
    """
    area = SIZE[1] * SIZE[2]
    state = _blocked(junction_direction(theta), NeoHooke(10.0, 0.47))
    expected = TENSION * area * np.sin(theta) * np.array([np.sin(theta), np.cos(theta), 0.0])
    np.testing.assert_allclose(state.reaction("x1"), expected, rtol=0.0, atol=1e-12 * TENSION * area)
    np.testing.assert_allclose(state.reaction("x0"), -expected, rtol=0.0, atol=1e-12 * TENSION * area)
    assert np.abs(state.u).max() < 1e-12


def test_the_virial_of_the_reactions_is_the_tension_in_any_direction() -> None:
    """Sum of reaction times position is T V a0 x a0, for a fibre out of every plane.

    Catches: a component of the fibre exchanged, a transposed stress.
    """
    a0 = unit(0.3, -0.5, 0.7)
    state = _blocked(a0, NeoHooke(10.0, 0.3))
    X = state.model.system.space.points
    virial = state.internal_force @ X.T
    volume = float(np.prod(SIZE))
    np.testing.assert_allclose(virial, TENSION * volume * np.outer(a0, a0), rtol=0.0, atol=1e-12 * TENSION * volume)


def test_the_blocked_force_does_not_know_the_passive_law() -> None:
    """Moduli a thousand times apart give the same reactions.

    Catches: active stress scaled by a modulus, passive stress at F = I.
    """
    a0 = junction_direction(np.radians(41.0))
    reactions = [_blocked(a0, law).reaction("x1") for law in (NeoHooke(0.1, 0.1), NeoHooke(100.0, 0.49))]
    np.testing.assert_allclose(reactions[0], reactions[1], rtol=0.0, atol=1e-12 * TENSION)

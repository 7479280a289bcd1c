"""S3: the blocked muscle pulls with T A sin^2 along and T A sin cos across.

Problem: block of muscle with its faces held, tension along a fibre at theta from the lateral axis; undeformed, or
    held at a stretch.
Exact answer: F = I is an equilibrium, P = T a0 x a0 in every convention of active stress; force on the end face
    T A sin^2(theta) along the actuation and T A sin(theta) cos(theta) across it; sum of reactions times positions
    T V a0 x a0 (virial). Held at a stretch, the tension adds T p(s, J) V a x a0 with the convention's factor p. Active
    strain in neo-Hooke, natural stretch s: P = mu (s - 1) (I - a0 x a0) + mu (s^-2 - 1) a0 x a0 at F = I.
Measured: reactions of the end faces, the virial of all reactions, displacement of inner nodes.
Tolerance: 1e-12 of T A; rounding of sums, the residual is solved to 1e-13.
Cannot see: the passive law (by design), the tangent.
"""

from __future__ import annotations

import numpy as np
import pytest

from fem_biobot.material import Convention, NeoHooke
from fem_biobot.muscle.fibres import junction_direction
from fem_biobot.verification.solid_states import ANGLES, blocked, virial
from fem_biobot.verification.solid_states import BLOCK as SIZE
from fem_biobot.verification.solid_states import PULL as TENSION
from tests.helpers import unit
from tests.oracles.free_muscle import incompressible_stretch

STRESSES = [c.value for c in Convention if c is not Convention.active_strain]


@pytest.mark.parametrize("convention", STRESSES)
@pytest.mark.parametrize("theta", np.radians(ANGLES))
def test_blocked_muscle_pulls_with_sin_squared_theta(theta: float, convention: str) -> None:
    """The ends are held by T A sin^2 along x and T A sin cos along y, in opposite senses.

    Catches: theta measured from the actuation, degrees for radians, the dyad's second factor dropped.
    """
    area = SIZE[1] * SIZE[2]
    state = blocked(junction_direction(theta), NeoHooke(10.0, 0.47), convention)
    expected = TENSION * area * np.sin(theta) * np.array([np.sin(theta), np.cos(theta), 0.0])
    np.testing.assert_allclose(state.reaction("x1"), expected, rtol=0.0, atol=1e-12 * TENSION * area)
    np.testing.assert_allclose(state.reaction("x0"), -expected, rtol=0.0, atol=1e-12 * TENSION * area)
    assert np.abs(state.u).max() < 1e-12


def test_the_virial_of_the_reactions_is_the_tension_in_any_direction() -> None:
    """Sum of reaction times position is T V a0 x a0, for a fibre out of every plane.

    Catches: a component of the fibre exchanged, a transposed stress.
    """
    a0 = unit(0.3, -0.5, 0.7)
    volume = float(np.prod(SIZE))
    found = virial(blocked(a0, NeoHooke(10.0, 0.3)))
    np.testing.assert_allclose(found, TENSION * volume * np.outer(a0, a0), rtol=0.0, atol=1e-12 * TENSION * volume)


@pytest.mark.parametrize("convention", STRESSES)
def test_held_at_a_stretch_muscle_pulls_by_its_convention(convention: str) -> None:
    """Held deformed, the tension adds T p a x a0 to the passive stress: p = 1, s, 1/s or J/s at the fibre's stretch.

    Catches: the convention's factor at the undeformed length, the traction along the undeformed fibre.
    """
    F = np.array([[0.83, 0.14, -0.07], [0.05, 1.12, 0.11], [0.09, -0.04, 1.06]])
    a0, law = unit(0.3, -0.5, 0.7), NeoHooke(10.0, 0.3)
    a = F @ a0
    s, J = float(np.linalg.norm(a)), float(np.linalg.det(F))
    p = {"nominal": 1.0, "second_piola": s, "kirchhoff": 1.0 / s, "cauchy": J / s}[convention]
    ln_J, inverse = np.log(J), np.linalg.inv(F).T
    passive = law.mu * (F - inverse) + law.lmbda * ln_J * inverse
    volume = float(np.prod(SIZE))
    expected = volume * (passive + TENSION * p * np.outer(a / s, a0))
    found = virial(blocked(a0, law, convention, F))
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-11 * TENSION * volume)


def test_blocked_active_strain_pulls_along_and_pushes_across() -> None:
    """Held undeformed, active strain pulls with mu (s^-2 - 1) along the fibre and pushes with mu (1 - s) across it.

    Catches: a natural state put on the wrong side of F, a natural stretch found with the passive stress counted twice.
    """
    a0, law = unit(0.3, -0.5, 0.7), NeoHooke(10.0, 0.3)
    s = incompressible_stretch(TENSION / law.mu)
    volume, dyad = float(np.prod(SIZE)), np.outer(a0, a0)
    expected = volume * law.mu * ((s - 1.0) * (np.eye(3) - dyad) + (s**-2 - 1.0) * dyad)
    found = virial(blocked(a0, law, "active_strain"))
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-11 * TENSION * volume)


def test_the_blocked_force_does_not_know_the_passive_law() -> None:
    """Moduli a thousand times apart give the same reactions.

    Catches: active stress scaled by a modulus, passive stress at F = I.
    """
    a0 = junction_direction(np.radians(41.0))
    reactions = [blocked(a0, law).reaction("x1") for law in (NeoHooke(0.1, 0.1), NeoHooke(100.0, 0.49))]
    np.testing.assert_allclose(reactions[0], reactions[1], rtol=0.0, atol=1e-12 * TENSION)

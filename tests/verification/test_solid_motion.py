"""Solids in motion without a ground: what is kept, how fast they swing, and the order of the schemes.

Problem: a tumbling soft block; a cantilever let go; the same over ever shorter steps.
Exact answers: conservation of momentum, angular momentum and energy; natural frequencies of the static tangent with the
    consistent mass (`solid.modes`); the declared orders, one and two.
Measured: momenta and the book of energies of `solid_dynamics`; zero crossings; errors against a run of many steps.
Tolerance: conservation up to the tolerance of the steps (1e-12 of the forces); the frequency 0.2 % (a step of a 60th
    of the period, order two: 0.1 %); orders within 0.15.
Cannot see: contact, pressures.
"""

from __future__ import annotations

import numpy as np
import pytest

from fem_biobot.solid.dynamics.settings import DynamicsSettings, Scheme
from fem_biobot.verification.solid_moving import ORDERS, observed, swinging, tumbling

TIGHT = 1e-11
MIDDLE = DynamicsSettings(Scheme.energy_momentum, tolerance=TIGHT)


def test_free_flight_keeps_momentum_angular_momentum_and_energy() -> None:
    """A soft block tumbles through more than half a turn; the mean strain's stress keeps all three.

    Catches: internal forces at the end of the step, a correction of the wrong size, mass lumped in one place.
    """
    found = tumbling(MIDDLE)
    size = np.linalg.norm(found.angular_momentum[0])
    assert np.abs(found.momentum - found.momentum[0]).max() <= 1e-10 * np.linalg.norm(found.momentum[0])
    assert np.abs(found.angular_momentum - found.angular_momentum[0]).max() <= 1e-7 * size
    energy = found.energy("kinetic") + found.energy("strain")
    assert found.energy("strain").max() > 1e-5 * energy[0]
    assert np.abs(energy - energy[0]).max() <= 1e-8 * energy[0]


def test_muscle_inside_a_free_body_changes_no_momentum() -> None:
    """The muscle contracts in flight: momenta stay, its work is in the book, and the book closes.

    Catches: active stress left out of the force's balance, its work entered with the wrong sign.
    """
    found = tumbling(MIDDLE, 10.0, 2e-4)
    size = np.linalg.norm(found.angular_momentum[0])
    assert np.abs(found.angular_momentum - found.angular_momentum[0]).max() <= 1e-7 * size
    work = found.energy("muscle")
    assert work[-1] > 1e-3 * found.book[0, 0]
    assert found.energy("viscous")[-1] < 0.0
    assert np.abs(found.energy_error).max() <= 1e-7 * np.abs(work).max()


def test_backward_euler_tells_what_it_takes() -> None:
    """It takes energy from the tumbling, all of which its own entry shows; linear momentum stays.

    Catches: dissipation that is booked as what is left over, an entry without the stress's part.
    """
    found = tumbling(DynamicsSettings(tolerance=TIGHT), 10.0, 2e-4)
    assert np.abs(found.momentum - found.momentum[0]).max() <= 1e-10 * np.linalg.norm(found.momentum[0])
    lost = found.energy("integrator")
    assert lost[-1] < -0.01 * found.book[0, 0]
    assert np.all(np.diff(lost) < 0.0)
    assert np.abs(found.energy_error).max() <= 1e-7 * abs(lost[-1])


def test_cantilever_swings_with_its_natural_frequency() -> None:
    """Let go from its first mode it crosses zero at the frequency that the static tangent and mass give.

    Catches: mass that is half or lumped, a step's length squared where it is not.
    """
    assert swinging() == pytest.approx(1.0, rel=2e-3)


@pytest.mark.parametrize("scheme", ORDERS)
def test_schemes_have_their_orders(scheme: Scheme) -> None:
    """The error of a damped, driven motion falls with the declared power of the step.

    Catches: drive taken at the wrong instant, viscosity of the wrong step, a velocity that is that of the chord.
    """
    assert observed(scheme) == pytest.approx(ORDERS[scheme][0], abs=0.15)

"""Feet whose force acts elsewhere than where the ground stops them."""

from __future__ import annotations

import numpy as np
import pytest

from fem_biobot.rod.dynamics.integrate import Integrator, Settings, dynamics
from fem_biobot.rod.ground import ContactPoints, Ground
from fem_biobot.rod.model import RodModel, RodState
from fem_biobot.rod.records import Body, Gravity

G = 9810.0


def block(acts_at: tuple[float, float, float] | None) -> RodModel:
    """A block of 1 mm with one contact point under one corner of its sole."""
    body = Body.box((0.0, 0.0, 0.5), (1.0, 1.0, 1.0), 1e-6, "block")
    foot = ContactPoints("block", [(0.5, 0.3, 0.0)], acts_at=acts_at)
    return RodModel(bodies=[body], loads=[Gravity((0.0, 0.0, -G))], contacts=[foot])


@pytest.mark.parametrize("integrator", list(Integrator))
def test_a_force_through_the_centre_of_mass_does_not_tip(integrator: Integrator) -> None:
    """A block stopped at a corner by a force under its centre stays level and bears its weight; at the corner it tips.

    Catches: a moment of the force left, impulses along the rows of the velocity.
    """
    step = 1e-4
    settings = Settings(integrator=integrator)
    steady, tipping = (
        dynamics(block(at), 100 * step, step, ground=Ground(0.3), sample_every=10, settings=settings)
        for at in ((0.0, 0.0, 0.0), None)
    )
    np.testing.assert_allclose(steady.Q[-1, 0], np.eye(3), atol=1e-9)
    assert steady.contact_force[-1, 0, 0] == pytest.approx(1e-6 * G, rel=1e-6)
    assert np.abs(tipping.Q[-1, 0] - np.eye(3)).max() > 1e-2


@pytest.mark.parametrize("integrator", list(Integrator))
def test_friction_sees_the_motion_where_it_acts(integrator: Integrator) -> None:
    """A block that spins about the vertical through the point of action goes on spinning; it is that point that brakes.

    Catches: slip taken at the corner, friction that turns the block.
    """
    model = block((0.0, 0.0, 0.5))
    start = model.drawn()
    spin, speed, mu, step = 3.0, 40.0, 0.3, 1e-5
    v = np.array([[speed, 0.0, 0.0, 0.0, 0.0, spin]])
    moving = RodState(model, start.x, start.Q, v)
    motion = dynamics(
        model, 100 * step, step, ground=Ground(mu), start=moving, sample_every=100,
        settings=Settings(integrator=integrator),
    )  # fmt: skip
    assert motion.v[-1, 0, 5] == pytest.approx(spin, rel=1e-9)
    assert motion.v[-1, 0, 0] == pytest.approx(speed - mu * G * 100 * step, rel=1e-3)

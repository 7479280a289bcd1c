"""R7: a free rod tumbles and swings; a free jointed assembly.

Problem: a straight rod of unequal stiffness, thrown with a spin about a generic axis and set swinging, without any
    load; the same hinged to a body and tied by a spring.
Exact answer: momentum and angular momentum are constant; energy is constant without damping.
Measured: all three over 1 s, or some hundred periods, in both integrators; their change with the step.
Tolerance: rounding of sums over the steps for what a scheme keeps; the declared order for what it does not.
Cannot see: forces that are wrong but derive from an energy of their own.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from fem_biobot.rod.dynamics.integrate import Integrator, Settings, dynamics
from fem_biobot.rod.model import RodModel
from fem_biobot.rod.records import Body, Hinge, Spherical, Spring
from fem_biobot.verification.rod_systems import EXPLICIT, drift, flight, gel_strip, thrown


def test_explicit_steps_keep_both_momenta_to_rounding_and_energy_bounded() -> None:
    """Over 1 s: momenta to rounding of a hundred thousand sums, energy within 1e-3, no better late than early.

    Catches: rotational update in the body frame, resultants at another configuration than forces, a scheme that drifts.
    """
    motion = flight(1.0, 1e-5, EXPLICIT, 500)
    steps = 100_000
    linear, angular, energy = drift(motion)
    assert linear <= 1e-16 * steps
    assert angular <= 1e-16 * steps
    assert energy <= 1e-3
    error = np.abs(motion.book[:, :2].sum(axis=1) / motion.book[0, :2].sum() - 1.0)
    assert error[100:].max() <= 3.0 * error[:100].max()
    # and it did swing
    assert np.ptp(motion.energy("elastic")) > 0.02 * motion.book[0, 0]


def test_a_body_that_turns_without_any_force_goes_on() -> None:
    """Nothing acts on a lopsided body: its angular momentum stays, and it tumbles as Euler's equations say.

    Catches: a tolerance relative to forces alone, which nothing could meet here; a step without gyroscopic turns.
    """
    J = np.array([3e-6, 5e-6, 7e-6])
    model = RodModel(bodies=[Body((1.0, 2.0, 3.0), 1e-5, J)])
    start = replace(model.drawn(), v=np.array([[1.0, -2.0, 3.0, 2.0, 20.0, -1.0]]))
    rate = lambda t, w: np.cross(J * w, w) / J  # noqa: E731
    exact = solve_ivp(rate, (0.0, 1.0), start.v[0, 3:], rtol=1e-11, atol=1e-11).y[:, -1]
    errors = []
    for h in (2e-3, 1e-3):
        motion = dynamics(model, 1.0, h, start=start, sample_every=100, settings=Settings(dissipation=0.0))
        np.testing.assert_allclose(motion.x[-1, 0], [2.0, 0.0, 6.0], rtol=0.0, atol=1e-10)
        errors.append(np.abs(motion.Q[-1, 0] @ motion.v[-1, 0, 3:] - exact).max())
    assert errors[1] <= 1e-2 * np.abs(exact).max()
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.1)


@pytest.mark.parametrize("hinged", [False, True])
@pytest.mark.parametrize("integrator", list(Integrator))
def test_a_free_jointed_assembly_keeps_momenta_and_energy(integrator: Integrator, hinged: bool) -> None:
    """A rod hinged to a body, with a spring across: joints neither push nor turn nor work, and stay together.

    Catches: unequal impulses on the two parts, arms of the wrong part, joints that drift apart.
    """
    strip = gel_strip()
    end = tuple(float(c) for c in strip.points[-1])
    centre = tuple(float(c) for c in strip.points[-1] + [1.0, 1.5, -0.5])
    body = Body(centre, 8e-6, np.array([2e-6, 5e-6, 4e-6]), "body")
    places = (("rod", -1), ("body", end))
    joint = Hinge(*places, (0.3, 0.5, -1.0)) if hinged else Spherical(*places)  # type: ignore[arg-type]
    spring = Spring(("rod", 3), ("body", centre), stiffness=0.3)
    model = RodModel([strip], [joint], [body], members=[spring])
    start = thrown(model)
    # velocities that the joint allows: those of a rigid body
    spin = np.array([9.0, -5.0, 14.0])
    start = replace(start, v=np.concatenate([np.cross(spin, start.x), np.tile(spin, (len(start.x), 1))], axis=1))
    explicit = integrator is Integrator.explicit
    settings = Settings(integrator=integrator, dissipation=0.0, tolerance=1e-11)
    found = []
    for h in (1e-5, 0.5e-5) if explicit else (4e-4, 2e-4):
        motion = dynamics(model, 0.05, h, start=start, sample_every=round(1e-3 / h), settings=settings)
        last = motion.state(len(motion.times) - 1)
        apart = np.linalg.norm(last.at(places[0]) - last.at(places[1]))  # type: ignore[arg-type]
        linear, angular, energy = drift(motion)
        found.append(angular)
        assert linear <= 1e-11
        assert energy <= 1e-7
        assert apart <= 1e-6
        assert np.abs(motion.energy_error).max() <= 1e-7 * motion.book[0, 0]
        # it bends and the spring is stretched
        assert motion.energy("elastic").max() > 1e-5 * motion.book[0, 0]
    assert np.log2(found[0] / found[1]) == pytest.approx(2.0, abs=0.15)

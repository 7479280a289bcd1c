"""Incompressible solids in motion: pressures beside displacements, without mass, in the steps of every scheme for them.

Problem: a block of Poisson's ratio 1/2 with muscle fibres, settling, swinging, resting on a ground; one whose ratio is
    small, beside the displacement element.
Exact answer: the static solver's equilibrium; the frequency of the static tangent with the consistent mass; declared
    orders; its weight.
Measured: displacements and pressures at rest; time of a swing; ends of runs of ever shorter steps; the ground's force.
Tolerance: the steps' (1e-11 of the forces); 0.3 % of the swing (a step of a 60th of it, order two: 0.1 %); orders
    within 0.2.
Cannot see: waves of pressure, which an incompressible body does not have.
"""

from __future__ import annotations

from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from fem_biobot.friction.ground import Ground
from fem_biobot.material import ActiveStress, ForceVelocity, NeoHooke
from fem_biobot.solid.dynamics.body import moving_body
from fem_biobot.solid.dynamics.contact import untouched
from fem_biobot.solid.dynamics.integrate import solid_dynamics
from fem_biobot.solid.dynamics.motion import SolidMotion
from fem_biobot.solid.dynamics.settings import DynamicsSettings, Scheme
from fem_biobot.solid.dynamics.step import Interval, State, Stepper
from fem_biobot.solid.model import SolidModel, SolidState, solve
from fem_biobot.solid.modes import modes
from fem_biobot.solid.records import Fix, Step
from tests.helpers import TIGHT, box_mesh, generator, on_three_corners, slope, taylor_slope

SIZE = (1.0, 0.8, 0.6)
DENSITY = {"muscle": 1.1e-6}
MIXED = "P2-P1"
SCHEMES = [Scheme.backward_euler, Scheme.soft_landing]
G = 9810.0


@cache
def block(poisson: float = 0.5, element: str = MIXED, young: float = 8.0) -> SolidModel:
    """A block with muscle fibres across it."""
    fibres = ActiveStress(2.0, np.array([0.6, 0.8, 0.0]), force_velocity=ForceVelocity(60.0))
    return SolidModel(
        box_mesh(1, SIZE), {"muscle": NeoHooke(young, poisson)}, {"muscle": fibres}, on_three_corners(SIZE),
        element=element,
    )  # fmt: skip


def moved(model: SolidModel, duration: float, step: float, **more: Any) -> SolidMotion:
    """Of the block, under its muscle at full drive."""
    given: dict[str, Any] = {"densities": DENSITY, "drive": lambda t: Step(tension=1.0, time=t), **more}
    return solid_dynamics(model, duration, step, **given)


@pytest.mark.parametrize("poisson", [0.42, 0.5])
def test_the_tangent_with_pressures_is_the_derivative(poisson: float) -> None:
    """Of unbalanced force and volume residual, by displacements and pressures, in a step of backward Euler.

    Catches: a coupling of one of the two, pressures that are not scaled back, mass of a pressure.
    """
    model = block(poisson)
    system = model.system
    stepper = Stepper(moving_body(model, DENSITY, damping_time=2e-3, free=True), None, DynamicsSettings())
    draw, n, m = generator(), system.space.n_nodes, system.n_pressures
    u0, u = (0.012 * draw.normal(size=(n, 3)) for _ in range(2))
    p0, p = (0.5 * draw.normal(size=m) for _ in range(2))
    state = State(u0, draw.normal(size=(n, 3)), np.zeros((n, 3)), untouched(0), p0)
    interval = Interval(3e-3, Step(tension=0.7), Step(tension=0.7))
    x = np.concatenate([0.01 * draw.normal(size=3 * n), 0.3 * draw.normal(size=m)])
    du, dp = system.parts(x)
    here = stepper.forces(state, u, interval, p)
    data = stepper._tangent(here, here.points.S, u, interval)

    def force(eps: float) -> np.ndarray:
        return stepper.forces(state, u + eps * du, interval, p + eps * dp).unbalanced[:, None]

    assert taylor_slope(force, system.product(data, x)[:, None]) == pytest.approx(2.0, abs=0.1)


@pytest.mark.parametrize("scheme", SCHEMES)
def test_it_settles_where_the_static_solver_finds_it(scheme: Scheme) -> None:
    """Displacements and pressures of the equilibrium under its tension, by steps beyond all its periods.

    Catches: pressures of another instant, a compliance that stays in, a residual of the volume that is not met.
    """
    model = block()
    settings = DynamicsSettings(scheme, tolerance=1e-12, dissipation=1e3)
    found = moved(model, 2.0, 0.05, damping_time=0.02, settings=settings)
    wanted = solve(model, [0.5, 1.0], settings=TIGHT).states[-1]
    assert wanted.pressure is not None
    np.testing.assert_allclose(found.u[-1], wanted.u, atol=1e-8)
    np.testing.assert_allclose(found.p[-1], wanted.pressure, atol=1e-6 * np.abs(wanted.pressure).max())
    assert np.abs(wanted.u).max() > 0.02
    assert np.abs(found.energy_error).max() <= 1e-8 * found.energy("muscle").max()
    J = np.linalg.det(np.moveaxis(found.state(-1).F, (0, 1), (-2, -1)))
    assert abs(np.sum(J * model.system.space.dV) / np.sum(model.system.space.dV) - 1.0) <= 1e-9


def test_an_incompressible_cantilever_swings_with_its_natural_frequency() -> None:
    """Let go from its first mode; steps of the midpoint rule.

    Catches: pressures with inertia, a volume that yields within the step.
    """
    model = SolidModel(
        box_mesh((1, 1, 3), (1.0, 0.8, 5.0), shift=0.0), {"muscle": NeoHooke(100.0, 0.5)}, supports=[Fix("z0")],
        element=MIXED,
    )  # fmt: skip
    rest = SolidState(model, Step(0.0, 0.0), np.zeros_like(model.system.space.points))
    first = modes(rest, DENSITY, 1)
    shape = first.shapes[0] / np.abs(first.shapes[0]).max()
    period = 1.0 / first.frequencies[0]
    found = moved(
        model, 1.3 * period, period / 60.0, start=SolidState(model, Step(0.0, 0.0), 1e-4 * shape),
        settings=DynamicsSettings(Scheme.soft_landing, tolerance=1e-10, dissipation=0.0),
    )  # fmt: skip
    tip, t = np.einsum("sin,in->s", found.u, shape), found.times
    at = np.flatnonzero(tip[1:] * tip[:-1] < 0.0)
    crossing = t[at] - tip[at] * (t[at + 1] - t[at]) / (tip[at + 1] - tip[at])
    assert (crossing[2] - crossing[0]) / period == pytest.approx(1.0, rel=3e-3)


@pytest.mark.slow
@pytest.mark.parametrize("scheme", SCHEMES)
def test_schemes_keep_their_orders_with_pressures(scheme: Scheme) -> None:
    """Ends of a damped, driven motion under gravity settle with the declared power of the step.

    Catches: pressures that lag by a step, a constraint at the wrong instant.
    """
    counts = (10, 20, 40) if scheme is Scheme.backward_euler else (20, 40, 80)

    def end(n: int) -> np.ndarray:
        return moved(
            block(), 0.02, 0.02 / n, gravity=(0.0, 50.0, -G), damping_time=3e-3, sample_every=n,
            drive=lambda t: np.sin(150.0 * t) ** 2, settings=DynamicsSettings(scheme, tolerance=1e-11),
        ).u[-1]  # fmt: skip

    ends = [end(n) for n in (*counts, 2 * counts[-1])]
    found = slope([1.0 / n for n in counts], [float(np.linalg.norm(a - b)) for a, b in pairwise(ends)])
    assert found == pytest.approx(1.0 if scheme is Scheme.backward_euler else 2.0, abs=0.2)


def test_both_elements_move_alike_where_both_are_sound() -> None:
    """A compressible block by the mixed form and by displacements alone, without viscosity: alike within 2 %.

    Catches: mass or tension counted twice in one of the two.
    """
    ends = []
    for element in (MIXED, "P2"):
        found = moved(block(0.3, element), 0.004, 2e-4, gravity=(0.0, 0.0, -G), drive=lambda t: 100.0 * t)
        ends.append(found.u[-1])
    assert np.linalg.norm(ends[0] - ends[1]) <= 0.02 * np.linalg.norm(ends[1])


def test_an_incompressible_block_rests_on_the_ground() -> None:
    """Put down it bears its weight, sticks on a slope below its friction, and lies nowhere below the plane.

    Catches: compliance of the feet without the pressures' part, contact forces on pressures.
    """
    found = moved(
        block(young=60.0), 0.2, 5e-3, gravity=(0.3 * G, 0.0, -G), free=True, ground=Ground(0.5, 0.4), feet=["z0"],
        damping_time=2e-3, drive=lambda t: 0.0, settings=DynamicsSettings(Scheme.soft_landing, tolerance=1e-10),
    )  # fmt: skip
    weight = found.body.total_mass * G
    force = found.foot_force(0)[-1]
    assert force[0] == pytest.approx(weight, rel=1e-4)
    assert force[1] == pytest.approx(-0.3 * weight, rel=1e-3)
    assert found.feet is not None
    lowest = (found.body.system.space.points[2] + found.u[:, 2])[:, found.feet.nodes].min()
    assert lowest >= -1e-9
    assert np.abs(found.energy_error).max() <= 1e-7 * weight
    # it moves no more: its last quarter against the way that it has settled
    assert np.abs(found.u[-1] - found.u[-10]).max() <= 1e-3 * np.abs(found.u[-1]).max()

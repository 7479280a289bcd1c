"""The force-velocity curve of a design in solid and rods.

Problem: one design's curve in both; a strip that shortens at constant velocity; a strip and a muscle member under the
    same constant load, let go at full drive.
Exact answer: Hill's hyperbola, solved for force and for velocity; its inverse integrated over time.
Measured: reactions and the book of energies; the rate of stretch over the stretch; the stretch over time.
Tolerance: the steps' 1e-9; inertia and the tissue's own stiffness, less than 2e-4 of the tension; the rods' table 1e-7.
Cannot see: whether engineered tissue obeys Hill's curve, or with which numbers.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from fem_biobot.config import load_design
from fem_biobot.material import NeoHooke
from fem_biobot.material.force_velocity import ForceVelocity
from fem_biobot.rod.activation import kernels
from fem_biobot.rod.activation.build import activations
from fem_biobot.rod.dynamics.integrate import dynamics
from fem_biobot.rod.model import RodModel
from fem_biobot.rod.records import Body, Hold, Muscle, PointLoad
from fem_biobot.rod.reduce import reduce
from fem_biobot.solid.dynamics.integrate import solid_dynamics
from fem_biobot.solid.dynamics.motion import SolidMotion
from fem_biobot.solid.dynamics.settings import DynamicsSettings, Scheme
from fem_biobot.solid.from_design import tension_of, tension_step
from fem_biobot.solid.model import SolidModel
from fem_biobot.solid.records import Fix, Step, Symmetry, Traction
from tests.helpers import box_mesh

Array = NDArray[np.float64]

PASSIVE, ACTIVE = 1.5, 6.0
FASTEST, K, ECCENTRIC = 3.0, 0.2, 1.6
KEYS = [
    f"muscle.passive_tension={PASSIVE} kPa",
    f"muscle.active_tension={ACTIVE} kPa",
    f"muscle.force_velocity.fastest={FASTEST} 1/s",
    f"muscle.force_velocity.curvature={K}",
    f"muscle.force_velocity.eccentric={ECCENTRIC}",
]
DESIGN = load_design("junction_bot", KEYS)
CURVE = ForceVelocity(FASTEST, K, ECCENTRIC)
SIZE = (1.0, 0.8, 0.5)  # of the strip along its fibres, and across [mm]
SECTION = SIZE[1] * SIZE[2]
SCHEMES = list(Scheme)


def hill(rate: float) -> float:
    """In shortening and lengthening, on its own."""
    y, c = rate / FASTEST, (ECCENTRIC - 1.0) * K / (1.0 + K)
    return max(1.0 + y, 0.0) / (1.0 - y / K) if y < 0.0 else 1.0 + (ECCENTRIC - 1.0) * y / (y + c)


def strip(young: float, end: Any, loads: Any = ()) -> SolidModel:
    """A block of the design's muscle along x, without lateral contraction, held at its left face."""
    supports = [Symmetry("x0"), Symmetry("y0"), Symmetry("z0"), *end]
    muscle = tension_of(DESIGN, np.eye(3)[0])
    return SolidModel(
        box_mesh(1, SIZE), {"muscle": NeoHooke(young, 0.0)}, {"muscle": muscle}, supports, loads, element="P1"
    )


def moved(model: SolidModel, duration: float, step: float, load: Any, **more: Any) -> SolidMotion:
    """At full drive, of tissue that weighs almost nothing."""
    full = tension_step(DESIGN, DESIGN.tension(1.0)).tension
    return solid_dynamics(
        model, duration, step, densities={"muscle": 1e-12}, drive=lambda t: Step(load(t), full, time=t), **more
    )


def stretches(motion: SolidMotion) -> Array:
    """Of the strip, over the samples."""
    far = motion.body.model.mesh.landmarks["corner_100"]
    return 1.0 + motion.u[:, 0, far] / SIZE[0]


def test_rods_and_solid_read_the_same_curve() -> None:
    """The rods' table of the reduced design is the curve of the solid's muscle, in shortening and lengthening.

    Catches: a parameter taken for another in one of the two, no cut in one of them.
    """
    muscle = reduce(DESIGN).members[0]
    assert isinstance(muscle, Muscle)
    table = activations([muscle])
    solid = tension_of(DESIGN, np.eye(3)[0]).force_velocity
    assert solid is not None
    assert solid == CURVE
    rates = np.linspace(-1.3, 3.6, 71) * FASTEST
    read = [kernels.factor(table, table.curve[0, 1], float(r))[0] for r in rates]
    np.testing.assert_allclose(read, solid(rates), rtol=0.0, atol=1e-5)
    near = np.linspace(-0.9, 0.9, 31) * FASTEST  # away from the corners
    read = [kernels.factor(table, table.curve[0, 1], float(r))[0] for r in near]
    np.testing.assert_allclose(read, [hill(r) for r in near], rtol=0.0, atol=1e-6)


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("rate", [-2.0, -0.6, 1.5])
def test_a_strip_shortening_at_constant_velocity_pulls_with_hills_force(rate: float, scheme: Scheme) -> None:
    """``A (E/2 (s - 1/s) + T_p + g(rate) T_a)``; the muscle's work in the book is what T does over the way.

    The reaction of the last sample, and the supports' work over the whole way. Catches: a rate relative to the
    length reached, the standing tension slowed, work of the isometric force, a stress at rest in the states.
    """
    young, duration = 9.0, 0.1
    change = rate * duration * SIZE[0]
    model = strip(young, [Fix("x1", "x", change)])
    X = model.system.space.points
    motion = moved(
        model, duration, duration / 8, lambda t: t / duration, settings=DynamicsSettings(scheme, tolerance=1e-12),
        velocity=np.stack([rate * X[0], 0 * X[0], 0 * X[0]]),
    )  # fmt: skip
    tension = PASSIVE + hill(rate) * ACTIVE
    s = stretches(motion)
    np.testing.assert_allclose(s, 1.0 + rate * motion.times, rtol=1e-12)
    wanted = SECTION * (0.5 * young * (s[-1] - 1.0 / s[-1]) + tension)
    assert -motion.state(-1).reaction("x0")[0] == pytest.approx(wanted, rel=1e-8)
    volume = SECTION * SIZE[0]
    # the stress of a step is that at a share of its change of strain
    squares = np.diff(s**2)
    acting = np.sqrt(s[:-1] ** 2 + DynamicsSettings(scheme).theta(duration / 8) * squares)
    work = -tension * volume * float(np.sum(0.5 * squares / acting))
    assert motion.energy("muscle")[-1] == pytest.approx(work, rel=1e-8)
    assert work == pytest.approx(-tension * (s[-1] - 1.0) * volume, rel=0.02)
    stored = volume * 0.25 * young * (s[-1] ** 2 - 1.0 - 2.0 * np.log(s[-1]))
    assert motion.energy("strain")[-1] == pytest.approx(stored, rel=1e-8)
    done = motion.energy("supports")[-1] + motion.energy("integrator")[-1]
    assert done == pytest.approx(stored - work, rel=1e-7)


@pytest.mark.parametrize("load", [0.1, 0.35, 0.8, 1.25])
def test_a_strip_lifts_or_lets_down_a_load_at_hills_velocity(load: float) -> None:
    """``r = -v_max (1 - P) / (1 + P / k)`` for a load of P times the stimulated tension beyond the standing one.

    Soft tissue (a ten-thousandth of the tension). Catches: the hyperbola's sign or curvature, a curve of what has
    another velocity than the fibre's, an eccentric branch without bound.
    """
    young = 1e-4 * ACTIVE
    model = strip(young, [], [Traction("x1", (PASSIVE + load * ACTIVE, 0.0, 0.0))])
    motion = moved(model, 0.04, 4e-3, lambda t: 1.0)
    c = (ECCENTRIC - 1.0) * K / (1.0 + K)
    rate = -(1.0 - load) / (1.0 + load / K) if load <= 1.0 else c * (load - 1.0) / (ECCENTRIC - load)
    np.testing.assert_allclose(np.diff(stretches(motion)) / 4e-3, rate * FASTEST, rtol=2e-3)
    assert np.abs(motion.energy_error).max() <= 1e-7 * np.abs(motion.energy("loads")).max() + 1e-12


def test_solid_and_rods_contract_alike_against_a_spring_of_tissue_and_a_load() -> None:
    """The stretch over time of a strip and of a muscle member, and of the scalar equation with Hill's inverse.

    ``T_p + g(ds/dt) T_a + E/2 (s - 1/s) = P`` for the solid, whose tissue resists by neo-Hooke's law without lateral
    contraction; the member after Eq. 2, ``E (s - 1) / s``. Both start isometric and end at rest.
    Catches: different rates in the two, a lag, an inertia that is not theirs.
    """
    young, load, duration, step = 4.0, 5.0, 0.4, 5e-3
    full = PASSIVE + ACTIVE

    def path(resistance: Any) -> Array:
        def rate(_: float, s: Array) -> list[float]:
            return [CURVE.rate_at(float((load - PASSIVE - resistance(s[0])) / ACTIVE))]

        found = solve_ivp(rate, (0.0, duration), [1.0], rtol=1e-10, atol=1e-12, t_eval=np.arange(0, 81) * step)
        return found.y[0]

    of_solid, of_rods = path(lambda s: 0.5 * young * (s - 1.0 / s)), path(lambda s: young * (s - 1.0) / s)
    assert full > load
    model = strip(young, [], [Traction("x1", (load, 0.0, 0.0))])
    motion = moved(model, duration, step, lambda t: 1.0, settings=DynamicsSettings(Scheme.soft_landing))
    solid = stretches(motion)
    post, ball = ("post", (0.0, 0.0, 0.0)), ("ball", (SIZE[0], 0.0, 0.0))
    made = reduce(DESIGN).members[0]
    assert isinstance(made, Muscle)
    member = Muscle(post, ball, SECTION, young, PASSIVE, ACTIVE, force_velocity=made.force_velocity)
    rods = RodModel(
        bodies=[Body(p, 1e-8, (1e-8,) * 3, n) for n, p in (post, ball)], supports=[Hold(post)],
        loads=[PointLoad(ball, force=(load * SECTION, 0.0, 0.0))], members=[member],
    )  # fmt: skip
    swung = dynamics(rods, duration, step, drive=lambda t: 1.0)
    rod = swung.x[:, rods.atlas.node_of["ball", 0], 0] / SIZE[0]
    for found, wanted in ((solid, of_solid), (rod, of_rods)):
        np.testing.assert_allclose(found, wanted, atol=3e-3 * (1.0 - wanted[-1]))
        assert wanted[-1] < 0.95
    assert np.abs((solid - rod) - (of_solid - of_rods)).max() <= 3e-3 * (1.0 - of_rods[-1])

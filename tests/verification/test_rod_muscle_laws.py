"""Muscles whose active tension depends on their length and on its rate.

Problem: a muscle held at a length, against a spring, under a constant load, and swinging a mass.
Exact answer: closed forms (Gaussian, Hill's hyperbola); a scalar equation; Runge-Kutta of order 8 on the same law.
Measured: reactions, equilibrium, frequency, steady velocity, way and work against the step.
Tolerance: the table's 1e-7; the solver's; declared orders within 0.15.
Cannot see: whether engineered tissue obeys these laws.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from fem_biobot.rod.activation.curve import MuscleCurve
from fem_biobot.rod.anatomy import added_forces, anatomy, muscle_forces
from fem_biobot.rod.dynamics.integrate import Integrator, Settings, dynamics
from fem_biobot.rod.ground import ContactPoints, Ground
from fem_biobot.rod.model import RodModel
from fem_biobot.rod.modes import modes
from fem_biobot.rod.records import Body, Hold, Muscle, PointLoad, Rigid, Rod, Spring
from fem_biobot.rod.section import RodMaterial, Section
from fem_biobot.rod.statics import reaction, statics
from tests.helpers import slope

Array = NDArray[np.float64]

REST, AREA, YOUNG, PASSIVE, ACTIVE, MASS = 5.0, 0.8, 10.0, 1.2, 8.0, 2e-3
OPTIMUM, WIDTH, FASTEST, K, ECCENTRIC = 0.9, 0.5, 3.0, 0.25, 1.4
GAUSS, HILL = MuscleCurve.gaussian(OPTIMUM, WIDTH), MuscleCurve.hill(FASTEST, K, ECCENTRIC)
EXPLICIT = Settings(integrator=Integrator.explicit)
ORIGIN, END = ("post", (0.0, 0.0, 0.0)), ("ball", (REST, 0.0, 0.0))


def by_length(s: float) -> float:
    """The Gaussian."""
    return float(np.exp(-(((s / OPTIMUM - 1.0) / WIDTH) ** 2)))


def by_rate(r: float) -> float:
    """Hill's hyperbola, and the one that goes on from it."""
    y = r / FASTEST
    c = (ECCENTRIC - 1.0) * K / (1.0 + K)
    return max(1.0 + y, 0.0) / (1.0 - y / K) if y < 0.0 else 1.0 + (ECCENTRIC - 1.0) * y / (y + c)


def pulled(supports: Any = (), loads: Any = (), extra: Any = (), **more: Any) -> RodModel:
    """A ball on a muscle of length 5 mm from a held post; `more` are keys of the muscle."""
    keys: dict[str, Any] = {"young": YOUNG, "passive": PASSIVE, "active": ACTIVE, **more}
    bodies = [Body(p, MASS, (1e-3,) * 3, n) for n, p in (ORIGIN, END)]
    muscle = Muscle(ORIGIN, END, AREA, **keys)
    return RodModel(bodies=bodies, supports=[Hold(ORIGIN), *supports], loads=loads, members=[muscle, *extra])


@pytest.mark.parametrize("s", [0.55, 0.9, 1.3])
def test_the_isometric_force_at_a_stretch_is_the_curves(s: float) -> None:
    """Reaction of the held end: ``A (T_p + d T_a exp(-((s/s_opt - 1)/w)^2) + E (s - 1)/s)`` at drive d.

    Catches: a factor on the standing tension or the passive resistance, a stretch from the drawing.
    """
    held = Hold(END, displacement=((s - 1.0) * REST, 0.0, 0.0))
    for hill in (None, HILL):  # nothing moves: the factor of velocity is 1
        model = pulled([held], force_length=GAUSS, force_velocity=hill)
        state = statics(model, [1.0], drive=0.7).last
        wanted = AREA * (PASSIVE + 0.7 * ACTIVE * by_length(s) + YOUNG * (s - 1.0) / s)
        assert reaction(state, END)[0] == pytest.approx(wanted, rel=1e-7)
        assert state.muscle_force("muscle") == pytest.approx(wanted, rel=1e-7)


def test_equilibrium_and_frequency_against_a_spring_follow_the_active_slope() -> None:
    """A scalar equation for the stretch; ``w^2 m`` is the slope of all forces there, the active one's included.

    The muscle stands beyond its optimum, where shortening strengthens it: active stiffness is negative.
    Catches: a tension that lags behind its length, its slope left out of the modes.
    """
    stiffness = 4.0
    spring = Spring(END, (3.0 * REST, 0.0, 0.0), stiffness, rest_length=1.5 * REST)
    along = [Hold(END, "yz", "xyz")]
    model = pulled(along, extra=[spring], force_length=GAUSS)
    state = statics(model, [0.25, 0.5, 1.0], drive=1.0).last

    def force(s: float) -> float:
        tension = AREA * (PASSIVE + ACTIVE * by_length(s) + YOUNG * (s - 1.0) / s)
        return stiffness * ((3.0 - s) * REST - 1.5 * REST) - tension

    root: Any = brentq(force, 0.5, 1.6, xtol=1e-14)
    s = float(root)
    assert s > 1.05
    assert state.stretch("muscle") == pytest.approx(s, rel=1e-7)
    eps = 1e-5
    rigidity = -(force(s + eps) - force(s - eps)) / (2.0 * eps * REST)
    w = 2.0 * np.pi * modes(model, state, 1).frequencies[0]
    assert w * w * MASS == pytest.approx(rigidity, rel=1e-6)
    passive = stiffness + AREA * YOUNG / s**2 / REST
    assert rigidity < 0.95 * passive


@pytest.mark.parametrize("integrator", list(Integrator))
@pytest.mark.parametrize("load", [0.3, 0.8, 1.2])
def test_a_constant_load_is_lifted_or_let_down_at_hills_velocity(integrator: Integrator, load: float) -> None:
    """``u = (1 - P) / (1 + P / k)`` of the fastest velocity for a load P of the isometric force; beyond 1 it lengthens.

    ``y = c (P - 1) / (e - P)`` there. Half the time for the transient, without the passive resistance.
    Catches: the hyperbola's sign, curvature and fastest velocity exchanged, an eccentric branch without bound.
    """
    full = AREA * ACTIVE
    weight = PointLoad(END, force=(load * full, 0.0, 0.0))
    model = pulled(loads=[weight], young=0.0, passive=0.0, force_velocity=HILL)
    explicit = integrator is Integrator.explicit
    step = 2e-5 if explicit else 5e-4
    motion = dynamics(
        model, 0.12, step, drive=lambda t: 1.0, sample_every=round(0.03 / step), settings=Settings(integrator)
    )
    c = (ECCENTRIC - 1.0) * K / (1.0 + K)
    y = -(1.0 - load) / (1.0 + load / K) if load < 1.0 else c * (load - 1.0) / (ECCENTRIC - load)
    velocity = motion.v[-1, model.atlas.node_of["ball", 0], 0]
    assert velocity == pytest.approx(y * FASTEST * REST, rel=1e-6)
    state = motion.state(-1)
    assert state.muscle_force("muscle") == pytest.approx(load * full, rel=1e-5)
    if not explicit:  # forty relaxation times in a step
        motion = dynamics(model, 0.24, 0.04, drive=lambda t: 1.0, settings=Settings(dissipation=1e3))
        assert motion.halved == 0
        assert motion.v[-1, model.atlas.node_of["ball", 0], 0] == pytest.approx(y * FASTEST * REST, rel=1e-5)


def test_the_swinging_muscle_follows_its_equation_and_its_work_is_entered() -> None:
    """Both curves and a drive that changes, against Runge-Kutta: way and muscle work at order two in implicit steps.

    In explicit ones, too, but for the rate of the last half step: order one, as of other damping there.
    Catches: a rate at the wrong time, the factor of the step's end in the work, work of the isometric force.
    """
    duration = 0.15
    drive = lambda t: float(np.sin(20.0 * t) ** 2)  # noqa: E731

    def active(t: float, x: float, v: float) -> float:
        return AREA * (PASSIVE + ACTIVE * drive(t) * by_length(x / REST) * by_rate(v / REST))

    def rate(t: float, y: Array) -> list[float]:
        x, v, _ = y
        tension = active(t, x, v)
        return [v, (-tension - AREA * YOUNG * (x / REST - 1.0) / (x / REST) + 0.9) / MASS, -tension * v]

    exact = solve_ivp(rate, (0.0, duration), [REST, 0.0, 0.0], method="DOP853", rtol=1e-11, atol=1e-11, max_step=1e-3)
    x, _, work = exact.y[:, -1]
    weight = PointLoad(END, force=(0.9, 0.0, 0.0))
    model = pulled(loads=[weight], force_length=GAUSS, force_velocity=HILL)
    ball = model.atlas.node_of["ball", 0]
    for settings, steps, order in (
        (Settings(dissipation=0.0, tolerance=1e-11), [2e-3, 1e-3, 5e-4], 2.0),
        (EXPLICIT, [1e-4, 5e-5, 2.5e-5], 1.0),
    ):
        ways, works = [], []
        for h in steps:
            motion = dynamics(model, duration, h, drive=drive, sample_every=100_000, settings=settings)
            ways.append(abs(motion.x[-1, ball, 0] - x))
            works.append(abs(motion.energy("muscle")[-1] - work))
            assert abs(motion.energy_error[-1]) <= 2e-3 * abs(work)
        assert slope(steps, ways) == pytest.approx(order, abs=0.15)
        assert slope(steps, works) == pytest.approx(order, abs=0.2)
        assert ways[-1] <= 2e-3 * REST
        assert works[-1] <= 2e-3 * abs(work)


def test_a_machine_tells_the_same_forces_by_sample_and_by_state() -> None:
    """And what the drive adds stays below the isometric force where the muscle shortens, above zero always.

    Catches: rates of the wrong sign or end, a factor in one of two places.
    """
    points = np.stack([np.linspace(-3.5, 3.5, 5), np.zeros(5), np.full(5, 3.4)], axis=1)
    gel = RodMaterial(young=319.4, poisson=0.45, density=1.12e-6)
    beam = Rod(points, Section.rectangle(0.68, 7.0), gel, "beam", normal=(0.0, 0.0, 1.0))
    bodies, joints, contacts = [], [], []
    for name, at, node in (("short", -5.25, 0), ("long", 5.25, -1)):
        bodies.append(Body.box((at, 0.0, 1.87), (3.5, 7.0, 3.74), 1.12e-6, name))
        joints.append(Rigid(("beam", node), (name, (at, 0.0, 1.87))))
        contacts.append(ContactPoints(name, [(at + a, b, 0.0) for a in (-1.75, 1.75) for b in (-3.5, 3.5)]))
    a, b = ("short", (-3.5, 0.0, 1.4)), ("long", (3.5, 0.0, 1.4))
    muscle = Muscle(a, b, 0.88, 10.0, 0.9, 2.7, force_length=GAUSS, force_velocity=MuscleCurve.hill(1.0))
    model = RodModel([beam], joints, bodies, (), (), [muscle], contacts, 1e-3)
    drive = lambda t: float(np.abs(np.sin(6.0 * np.pi * t)))  # noqa: E731
    motion = dynamics(model, 0.2, 1e-3, ground=Ground(), drive=drive, sample_every=10)
    found = anatomy(model)
    forces, added = muscle_forces(motion, found)[:, 0], added_forces(motion, found)[:, 0]
    for i in range(len(motion.times)):
        assert motion.state(i).muscle_force("muscle") == pytest.approx(forces[i], rel=1e-12)
    isometric = 0.88 * 2.7 * motion.drive
    assert added.min() >= 0.0
    rate = np.gradient([motion.state(i).stretch("muscle") for i in range(len(motion.times))], motion.times)
    shortens = (rate < -0.05) & (motion.drive > 0.1)
    assert shortens.any()
    assert (added[shortens] < 0.95 * isometric[shortens]).all()

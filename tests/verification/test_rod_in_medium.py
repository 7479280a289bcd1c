"""Rods and bodies that move in a viscous medium.

Problem: rods and a sphere fall, spin and are carried along in a medium; a soft rod bends in a stream.
Exact answer: closed forms of relaxation and terminal motion with the resistances of slender-body theory and of Stokes'
    sphere; the same run turned and mirrored; the energy book.
Measured: velocities against time and step, the book's rest, positions of both integrators.
Tolerance: declared orders within 0.1; the approach left, told with each test; rounding elsewhere.
Cannot see: whether slender-body theory is what a medium does (walls, other parts, Reynolds numbers near 1).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from fem_biobot.config import load_design
from fem_biobot.rod.drag.record import Drag
from fem_biobot.rod.dynamics.integrate import Integrator, Motion, Settings, dynamics
from fem_biobot.rod.model import RodModel
from fem_biobot.rod.records import Body, Gravity, Hold, Rod
from fem_biobot.rod.section import RodMaterial, Section
from fem_biobot.rod.walk import walk
from tests.helpers import rotation, slope, unit
from tests.rods import arc, straight

Array = NDArray[np.float64]

MU, L, R, RHO = 2e-5, 12.0, 0.15, 1.4e-6  # kPa s, mm, mm, kg/mm^3
ALONG = 2.0 * np.pi * MU / np.log(L / R)  # mN s/mm^2
EXPLICIT = Settings(integrator=Integrator.explicit)


def fibre(axis: Any, *loads: Any, young: float = 3e3, n: int = 4) -> RodModel:
    """A straight rod, straight enough under its own drag."""
    rod = Rod(straight(n, L, axis), Section.circle(R), RodMaterial(young=young, poisson=0.3, density=RHO))
    return RodModel([rod], loads=loads)


def test_a_falling_rod_reaches_twice_the_speed_along_its_axis_that_it_has_across() -> None:
    """Terminal velocities ``w ln(L/r) / (4 pi mu)`` across and twice that along, with buoyancy; askew, it drifts.

    After 40 relaxation times of the slower motion; a straight rod does not turn.
    Catches: the ratio, the logarithm's argument, drag per node instead of per length, weight without buoyancy.
    """
    g, medium = 9810.0, 1e-6
    weight = (RHO - medium) * np.pi * R**2 * g  # per length
    relaxation = RHO * np.pi * R**2 / ALONG
    found = []
    down = np.array([0.0, 0.0, -1.0])
    for axis in (unit(0.0, 0.0, 1.0), unit(1.0, 0.3, 0.0), unit(1.0, -0.4, 0.8)):
        model = fibre(axis, Gravity((0.0, 0.0, -g), medium), Drag(MU))
        settings = Settings(dissipation=0.0)
        motion = dynamics(model, 40.0 * relaxation, relaxation / 5.0, settings=settings, sample_every=200)
        wanted = weight * (down + axis * (axis @ down)) / (2.0 * ALONG)
        np.testing.assert_allclose(motion.v[-1, :, :3], np.tile(wanted, (5, 1)), atol=1e-9 * np.abs(wanted).max())
        found.append(-motion.v[-1, 2, 2])
    assert found[0] / found[1] == pytest.approx(2.0, rel=1e-9)


def test_steps_of_thousands_of_relaxation_times_converge() -> None:
    """A soft fibre thrown into a thick stream: without the drag's tangent an iteration multiplies the error by 3000.

    Catches: a tangent without drag, by the velocity at the end instead of that at theta.
    """
    model = fibre(
        unit(1.0, 0.3, 0.2), Gravity(), Drag(1e3 * MU, density=1e-6, velocity=(30.0, 20.0, -50.0)), young=30.0
    )
    motion = dynamics(model, 0.5, 1e-2, settings=Settings(dissipation=50.0))
    assert motion.halved == 0
    assert motion.iterations <= 2 * motion.steps


@pytest.mark.parametrize("integrator", list(Integrator))
@pytest.mark.parametrize("law", ["linear", "quadratic"])
def test_the_order_in_time_stays_two(integrator: Integrator, law: str) -> None:
    """A rod that falls across its axis: ``v_t (1 - exp(-t / tau))``, or ``v_t tanh(g t / v_t)`` with the square alone.

    Catches: drag at the beginning of the step (order one), a quadratic part without its factor.
    """
    g = 9810.0
    mass = RHO * np.pi * R**2
    if law == "linear":
        drag, tau = Drag(MU), mass / (2.0 * ALONG)
        exact: Callable[[float], float] = lambda t: g * tau * (1.0 - np.exp(-t / tau))  # noqa: E731
    else:
        drag = Drag(0.0, density=1e-6)
        top = np.sqrt(mass * g / (1e-6 * 1.1 * R))
        tau = top / g
        exact = lambda t: top * np.tanh(t / tau)  # noqa: E731
    duration = 1.5 * tau
    explicit = integrator is Integrator.explicit
    counts = (100, 200, 400) if explicit else (6, 12, 24)
    model = fibre((1.0, 0.0, 0.0), Gravity(), drag, young=3.0 if explicit else 3e3)
    errors = []
    for count in counts:
        settings = Settings(integrator=integrator, dissipation=0.0, tolerance=1e-11)
        motion = dynamics(model, duration, duration / count, settings=settings, sample_every=count)
        errors.append(abs(-motion.v[-1, 2, 2] / exact(duration) - 1.0))
    assert slope([1.0 / c for c in counts], errors) == pytest.approx(2.0, abs=0.1)
    assert errors[-1] <= 2e-3


def test_a_sphere_slows_down_and_stops_turning_as_stokes_says() -> None:
    """``exp(-6 pi mu R t / m)`` for its velocity in a stream and ``exp(-8 pi mu R^3 t / J)`` for its spin.

    Catches: spin left free, the velocity of the medium with the wrong sign.
    """
    radius, mass, J = 0.8, 3e-6, 1e-6
    ball = Body((1.0, 2.0, 3.0), mass, (J, J, J), "ball", 4.0 / 3.0 * np.pi * radius**3)
    stream = np.array([3.0, -1.0, 0.5])
    model = RodModel(bodies=[ball], loads=[Drag(MU, velocity=tuple(stream))])  # type: ignore[arg-type]
    rate, spin = 6.0 * np.pi * MU * radius / mass, 8.0 * np.pi * MU * radius**3 / J
    v = np.array([[1.0, 4.0, -2.0, 3.0, -5.0, 2.0]])
    duration, settings = 1.0 / rate, Settings(dissipation=0.0)
    motion = dynamics(model, duration, duration / 400, start=replace(model.drawn(), v=v), settings=settings)
    t = motion.times[:, None]
    np.testing.assert_allclose(motion.v[:, 0, :3], stream + (v[0, :3] - stream) * np.exp(-rate * t), atol=1e-5)
    np.testing.assert_allclose(motion.v[:, 0, 3:], v[0, 3:] * np.exp(-spin * t), atol=2e-3)


def bent(turn: Array | None = None, n: int = 8) -> tuple[RodModel, Gravity]:
    """A soft curved rod, held at one end, in a stream askew to it; all turned by `turn` (3, 3)."""
    T = np.eye(3) if turn is None else turn
    rod = Rod(
        arc(n, 8.0, 1.1) @ T.T,
        Section.rectangle(0.5, 0.25),
        RodMaterial(young=40.0, poisson=0.4, density=RHO),
        normal=tuple(T @ [0.0, 0.0, 1.0]),
    )
    g, u = T @ [300.0, -200.0, 500.0], T @ [20.0, -30.0, 55.0]
    drag = Drag(5e-6, density=1e-6, velocity=tuple(u))
    gravity = Gravity(tuple(g))
    return RodModel([rod], supports=[Hold(("rod", 0))], loads=[gravity, drag], damping_time=1e-4), gravity


def swung(turn: Array | None = None, step: float = 5e-4, **others: Any) -> Motion:
    """Its motion from rest."""
    return dynamics(bent(turn)[0], 0.06, step, sample_every=round(0.02 / step), **others)


@pytest.fixture(scope="module")
def path() -> Motion:
    """Of the rod as drawn; it bends by more than a fifth of its length."""
    motion = swung()
    assert np.abs(motion.x[-1] - motion.x[0]).max() > 1.6
    return motion


def test_a_turned_and_a_mirrored_rod_bend_alike(path: Motion) -> None:
    """Rod, weight and stream turned together, and mirrored, to the solver's tolerance.

    Catches: world axes in the drag, a preferred handedness.
    """
    T = rotation()
    assert np.abs(swung(T).x @ T - path.x).max() <= 1e-7
    S = np.diag([1.0, -1.0, 1.0])
    assert np.abs(swung(S).x @ S - path.x).max() <= 1e-7


def test_the_energy_book_closes_with_an_entry_for_drag(path: Motion) -> None:
    """What the stream did is 3000 times what the book leaves open, which falls with the square of the step.

    Catches: work of the drag at the velocity of the medium or at that of the end, moments left out of it.
    """
    rests = []
    for motion in (path, swung(step=2.5e-4)):
        rests.append(float(np.abs(motion.energy_error).max()))
    work = path.energy("drag")[-1]
    assert work > 0.3 * path.energy("elastic")[-1]
    assert rests[0] <= 3e-4 * work
    assert rests[1] <= 0.35 * rests[0]


def test_both_integrators_bend_a_rod_alike_and_enter_the_same_work(path: Motion) -> None:
    """Implicit at 0.125 ms and explicit at 4 us, in positions and in the work of the stream.

    Catches: an error in either that its own convergence does not show.
    """
    implicit, explicit = swung(step=1.25e-4), swung(step=4e-6, settings=EXPLICIT)
    assert np.abs(implicit.x - explicit.x).max() <= 1e-4
    assert implicit.energy("drag")[-1] == pytest.approx(explicit.energy("drag")[-1], rel=5e-4)
    assert abs(explicit.energy_error[-1]) <= 1e-5 * explicit.energy("drag")[-1]


def test_a_walk_in_a_thick_medium_is_damped_and_its_book_closes() -> None:
    """The bot in a medium ten thousand times as viscous as water closes less; the drag takes energy from every stroke.

    Catches: a design's viscosity that `walk` does not see, in milli- instead of kilopascals.
    """
    wet = load_design("junction_bot", ["ground.immersion=submerged"])
    thin, thick = (
        walk(wet.with_values({"ground.viscosity": mu}), frequency=2.0, duration=1.0, discard=1) for mu in (1e-6, 1e-2)
    )
    assert thick.stroke_mm < 0.9 * thin.stroke_mm
    for each in (thin, thick):
        assert each.energy_error_1 < 1e-4
        assert (np.diff(each.motion.energy("drag")) <= 0.0).all()
    assert -thick.motion.energy("drag")[-1] > 0.02 * np.abs(np.diff(thick.motion.energy("muscle"))).sum()

"""The driver of the time integrators: what it refuses, how it halves, adapts, stops and goes on."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fem_biobot.errors import ModelError, SolveError
from fem_biobot.rod.dynamics import integrate
from fem_biobot.rod.dynamics.arrays import copied
from fem_biobot.rod.dynamics.integrate import Checkpoint, Integrator, Motion, MotionInterrupted, Settings, dynamics
from fem_biobot.rod.explicit.stability import longest_step
from fem_biobot.rod.ground import ContactPoints, Ground
from fem_biobot.rod.model import RodModel
from fem_biobot.rod.records import Body, Gravity, Hold, Muscle, PointLoad, Rigid, Rod, Spherical, Spring
from fem_biobot.rod.section import RodMaterial, Section

GEL = RodMaterial(young=319.4, poisson=0.45, density=1.12e-6)
WEIGHT = Gravity((0.0, 0.0, -9810.0))
EXPLICIT = Settings(integrator=Integrator.explicit)
GROUND = Ground(0.42, 0.3)


def walker(*, damping_time: float = 1e-4, elements: int = 4) -> RodModel:
    """A small two-footed machine of unequal pillars."""
    points = np.stack(
        [np.linspace(-3.5, 3.5, elements + 1), np.zeros(elements + 1), np.full(elements + 1, 3.4)], axis=1
    )
    beam = Rod(points, Section.rectangle(0.68, 7.0), GEL, "beam", normal=(0.0, 0.0, 1.0))
    bodies, joints, contacts = [], [], []
    for name, x, foot, node in (("short", -5.25, 0.6, 0), ("long", 5.25, 0.0, -1)):
        centre = (x, 0.0, (3.74 + foot) / 2.0)
        bodies.append(Body.box(centre, (3.5, 7.0, 3.74 - foot), 1.12e-6, name))
        joints.append(Rigid(("beam", node), (name, centre)))
        contacts.append(ContactPoints(name, [(x + a, b, foot) for a in (-1.75, 1.75) for b in (-3.5, 3.5)]))
    muscle = Muscle(("short", (-3.5, 0.0, 1.4)), ("long", (3.5, 0.0, 1.4)), 0.88, 10.0, 0.9, 2.7)
    return RodModel([beam], joints, bodies, (), [WEIGHT], [muscle], contacts, damping_time)


def strokes(t: float) -> float:
    """Three strokes a second."""
    return float(np.abs(np.sin(3.0 * np.pi * t)))


def ball(**others: Any) -> RodModel:
    """A ball on a spring."""
    body = Body((0.0, 0.0, 1.0), 2e-3, (1e-3, 1e-3, 1e-3), "ball")
    spring = Spring(("ball", (0.0, 0.0, 1.0)), (0.0, 0.0, 9.0), stiffness=20.0)
    points = ContactPoints("ball", [(0.0, 0.0, 0.0)])
    return RodModel(bodies=[body], members=[spring], contacts=[points], **others)


def same(a: Motion, b: Motion, first: int = 0) -> bool:
    """Whether `b` repeats `a` from a sample on, to the last bit."""
    names = ("times", "x", "Q", "v", "touch", "book", "drive")
    return all(np.array_equal(getattr(a, k)[first:], getattr(b, k)) for k in names)


# ---- refusals


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        ({"duration": 0.0}, "duration"),
        ({"duration": float("nan")}, "duration"),
        ({"duration": True}, "duration"),
        ({"step": -1e-3}, "step"),
        ({"step": float("inf")}, "step"),
        ({"step": 0.2}, "step: found 0.2"),
        ({"sample_every": 0}, "sample_every"),
        ({"sample_every": 2.5}, "sample_every"),
        ({"drive": lambda t: float("nan") if t > 0.05 else 0.0}, "drive: found nan at 0.051"),
        ({"drive": lambda t: -0.2}, "drive: found -0.2"),
    ],
)
def test_wrong_arguments_are_named(arguments: dict[str, Any], word: str) -> None:
    """One line says what was found. Catches: a bad value that runs on, or a traceback from inside."""
    with pytest.raises(ModelError, match=word) as error:
        dynamics(ball(), **{"duration": 0.1, **arguments})
    assert "\n" not in str(error.value)


def test_a_history_that_is_no_number_is_refused() -> None:
    """Catches: a NaN that reaches the steps as a load."""
    load = PointLoad(("ball", (0.0, 0.0, 1.0)), force=(1.0, 0.0, 0.0), history=lambda t: float("inf"))
    with pytest.raises(ModelError, match="history of a load"):
        dynamics(ball(loads=[load]), 0.1)


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        ({"integrator": "midpoint"}, "integrator"),
        ({"dissipation": -1.0}, "dissipation"),
        ({"dissipation": float("nan")}, "dissipation"),
        ({"tolerance": 0.0}, "tolerance"),
        ({"tolerance": 0.1}, "tolerance"),
        ({"parts": 0}, "parts"),
        ({"parts": 2.0}, "parts"),
        ({"largest_error": 0.0}, "largest_error"),
        ({"largest_error": 1e-3, "integrator": "explicit"}, "largest_error"),
    ],
)
def test_wrong_settings_are_named(arguments: dict[str, Any], word: str) -> None:
    """Catches: a setting without effect or with a hidden one."""
    with pytest.raises(ModelError, match=f"settings: {word}"):
        Settings(**arguments)


def test_a_start_that_does_not_fit_is_refused() -> None:
    """In the ground, of another shape, of another model. Catches: a machine thrown out of the ground by its start."""
    model = ball()
    with pytest.raises(ModelError, match=r"lies 0\.5 mm inside the ground"):
        dynamics(model, 0.1, ground=Ground(height=0.5))
    with pytest.raises(ModelError, match="start: x"):
        dynamics(model, 0.1, start=replace(model.drawn(), x=np.zeros((2, 3))))
    with pytest.raises(ModelError, match="start: v"):
        dynamics(model, 0.1, start=replace(model.drawn(), v=np.full((1, 6), np.nan)))
    other = dynamics(model, 0.01).final  # without ground there are no contact points
    with pytest.raises(ModelError, match="checkpoint of another model or ground"):
        dynamics(model, 0.1, start=other, ground=Ground())


def test_explicit_steps_refuse_parts_without_mass() -> None:
    """Catches: a division by no mass."""
    bar = Rod(np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]), Section.circle(0.1), GEL, mass=0.0)
    with pytest.raises(ModelError, match="'rod' has no mass"):
        dynamics(RodModel([bar]), 1e-3, 1e-6, settings=EXPLICIT)


# ---- the limit of explicit steps


def test_explicit_steps_beyond_the_stability_limit_are_refused_with_the_limit() -> None:
    """A ball on a spring: 2 / w. With a dashpot: w^2 (h^2 + 2 h tau) = 4, tau = c / k. Held along it: no limit.

    Catches: a limit without damping, half or double frequency, motions that joints forbid.
    """
    w = np.sqrt(20.0 / 2e-3)
    with pytest.raises(ModelError, match=f"expected at most {2.0 / w:.3g} s"):
        dynamics(ball(), 0.1, 2.02 / w, settings=EXPLICIT)
    dynamics(ball(), 0.1, 1.98 / w, settings=EXPLICIT)
    tau = 4e-3
    place = ("ball", (0.0, 0.0, 1.0))
    damped = RodModel(
        bodies=[Body((0.0, 0.0, 1.0), 2e-3, (1e-3, 1e-3, 1e-3), "ball")],
        members=[Spring(place, (0.0, 0.0, 9.0), 20.0, damping=20.0 * tau)],  # type: ignore[arg-type]
    )
    limit = np.sqrt(tau**2 + 4.0 / w**2) - tau
    with pytest.raises(ModelError, match=f"expected at most {limit:.3g} s"):
        dynamics(damped, 0.1, 1.01 * limit, settings=EXPLICIT)
    held = RodModel(
        bodies=damped.bodies,
        members=damped.members,
        supports=[Hold(place, "z", "")],  # type: ignore[arg-type]
    )
    dynamics(held, 0.1, 1.5 * limit, settings=EXPLICIT)


@pytest.mark.parametrize("tau", [0.0, 3e-5])
def test_the_limit_of_explicit_steps_of_a_rod_is_where_they_begin_to_grow(tau: float) -> None:
    """Just below it a disturbed rod stays bounded for 3000 steps, 2 % above it the same steps leave all numbers.

    Catches: a mass or stiffness left out of the estimate, a bound that is far from sharp.
    """
    points = np.linspace(0.0, 10.0, 16)[:, None] * np.array([1.0, 0.0, 0.0])
    model = RodModel([Rod(points, Section.rectangle(0.7, 2.0), GEL)], damping_time=tau)
    motion = dynamics(model, 1e-6, 1e-6, settings=EXPLICIT)
    limit = longest_step(model.assembly, model.system, motion.final.state, np.zeros(0), 1.0)
    generator = np.random.default_rng(7)
    start = replace(model.drawn(), v=1e-3 * generator.normal(size=(16, 6)))
    kept = dynamics(model, 3000 * 0.98 * limit, 0.98 * limit, start=start, sample_every=100, settings=EXPLICIT)
    assert np.abs(kept.x - kept.x[0]).max() <= 1.0
    with pytest.raises(ModelError, match="explicit steps"):
        dynamics(model, 1.0, 1.02 * limit, start=start, settings=EXPLICIT)


# ---- steps that fail


def test_a_step_that_does_not_converge_is_halved() -> None:
    """A step of 40 ms winds a thrown strip further than an element may turn; halves make it, and the same motion.

    Catches: a step accepted unconverged, halves that do not add up to the step, samples at wrong times.
    """
    points = np.linspace(0.0, 6.0, 4)[:, None] * np.array([1.0, 0.0, 0.0])
    strip = Rod(points, Section.rectangle(0.6, 0.3), GEL)
    model = RodModel([strip], supports=[Hold(("rod", 0))], damping_time=1e-3)
    v = np.zeros((4, 6))
    v[3, 3:] = [0.0, 120.0, 30.0]
    start = replace(model.drawn(), v=v)
    rough = dynamics(model, 0.08, 0.04, start=start)
    assert rough.halved > 0
    assert rough.largest_residual <= 1e-9
    np.testing.assert_allclose(rough.times, [0.0, 0.04, 0.08], rtol=1e-15)
    fine = dynamics(model, 0.08, 1e-3, start=start, sample_every=40)
    assert fine.halved == 0
    assert np.abs(rough.x[-1] - fine.x[-1]).max() <= 0.2


@pytest.mark.parametrize("settings", [Settings(dissipation=0.0), Settings(dissipation=0.0, largest_error=1e-3)])
def test_halved_steps_take_loads_at_their_own_times(settings: Settings) -> None:
    """A force that grows with time gives a free strip half its product with the time, however steps are divided.

    The trapezoidal rule is exact for it. Catches: both halves of a step taken at the first one's time.
    """
    points = np.linspace(0.0, 6.0, 4)[:, None] * np.array([1.0, 0.0, 0.0])
    push = PointLoad(("rod", 1), force=(2e-3, 3e-3, -1e-3), history=lambda t: 10.0 * t)
    model = RodModel([Rod(points, Section.rectangle(0.6, 0.3), GEL)], loads=[push], damping_time=1e-3)
    v = np.zeros((4, 6))
    v[3, 3:] = [0.0, 120.0, 30.0]
    v[0, 3:] = -v[3, 3:]
    motion = dynamics(model, 0.08, 0.04, start=replace(model.drawn(), v=v), settings=settings)
    assert motion.halved > 0
    np.testing.assert_allclose(motion.momentum[-1], 0.5 * 10.0 * 0.08**2 * np.array(push.force), rtol=1e-6)


@pytest.mark.parametrize("integrator", list(Integrator))
def test_a_run_that_diverges_ends_with_what_was_reached(integrator: Integrator) -> None:
    """A moment that grows without bound winds a rod up: the error carries the motion up to its last sample.

    Catches: an endless run, numbers that are none in the result, a loss of what was done.
    """
    points = np.linspace(0.0, 6.0, 5)[:, None] * np.array([1.0, 0.0, 0.0])
    twist = PointLoad(("rod", -1), moment=(0.1, 0.0, 0.0), history=lambda t: np.exp(400.0 * t))
    model = RodModel([Rod(points, Section.circle(0.3), GEL)], (), (), [Hold(("rod", 0))], [twist], damping_time=1e-5)
    settings = Settings(integrator=integrator)
    step = 1e-3 if integrator is Integrator.implicit else 5e-6
    with pytest.raises(SolveError, match="fails: an element turns") as error:
        dynamics(model, 1.0, step, settings=settings, sample_every=2)
    best, reason = error.value.best, error.value.reason
    assert isinstance(best, Motion)
    assert "3 rad" in reason
    assert len(best.times) > 2
    assert best.times[-1] == best.final.time
    assert np.isfinite(best.x).all()
    assert np.array_equal(best.x[-1], best.final.state.x)
    assert best.steps == 2 * (len(best.times) - 1)


# ---- interrupt and go on


@pytest.mark.parametrize(
    "settings", [Settings(), Settings(largest_error=5e-6), EXPLICIT], ids=["implicit", "adaptive", "explicit"]
)
def test_an_interrupted_walk_goes_on_to_the_last_bit(settings: Settings, tmp_path: Path) -> None:
    """Stopped by the user between two samples, saved to a file, read and gone on with: the same numbers.

    Catches: times summed up anew, factors or step sizes kept across samples, a part of the state that is not saved.
    """
    model = walker()
    step = 2e-6 if settings.integrator is Integrator.explicit else 1e-3
    duration, every = 90 * step, 6
    arguments: dict[str, Any] = {"ground": GROUND, "drive": strokes, "sample_every": every, "settings": settings}
    whole = dynamics(model, duration, step, **arguments)

    def stop(time: float) -> None:
        if time > 7.5 * every * step:
            raise KeyboardInterrupt

    with pytest.raises(MotionInterrupted, match="interrupted after") as stopped:
        dynamics(model, duration, step, **arguments, listener=stop)
    part = stopped.value.best
    assert len(part.times) == 9
    np.savez(tmp_path / "kept.npz", **part.final.arrays())
    with np.load(tmp_path / "kept.npz") as kept:
        begin = Checkpoint.from_arrays(kept)
    rest = dynamics(model, duration - begin.time, step, start=begin, **arguments)
    assert same(whole, rest, first=8)
    assert rest.steps == whole.steps - part.steps
    # something happens in the part compared
    assert np.abs(whole.x[-1] - whole.x[8]).max() > (1e-9 if settings.integrator is Integrator.explicit else 1e-3)


def test_an_interrupt_while_a_sample_is_kept_loses_only_that(monkeypatch: pytest.MonkeyPatch) -> None:
    """Stopped between the sample and its checkpoint, the motion ends at the one before, with its own checkpoint.

    Catches: samples and checkpoint of different times.
    """
    kept = []

    def stopping(state: Any) -> Any:
        kept.append(1)
        if len(kept) == 4:
            raise KeyboardInterrupt
        return copied(state)

    monkeypatch.setattr(integrate, "copied", stopping)
    with pytest.raises(MotionInterrupted) as stopped:
        dynamics(walker(), 0.1, ground=GROUND, drive=strokes, sample_every=5)
    best = stopped.value.best
    assert best.times[-1] == best.final.time == pytest.approx(0.01)
    assert np.array_equal(best.x[-1], best.final.state.x)


def test_an_interrupt_in_the_middle_of_a_sample_loses_only_that() -> None:
    """The drive is interrupted within the fourth interval: three intervals are there, whole.

    Catches: a state half-way through a step given out as that of a sample.
    """
    model = walker()

    def interrupted(t: float) -> float:
        if t > 0.0345:
            raise KeyboardInterrupt
        return strokes(t)

    with pytest.raises(MotionInterrupted) as stopped:
        dynamics(model, 1.0, ground=GROUND, drive=interrupted, sample_every=10)
    whole = dynamics(model, 0.03, ground=GROUND, drive=strokes, sample_every=10)
    assert same(whole, stopped.value.best)


def test_going_on_with_another_step_keeps_time_and_book() -> None:
    """Catches: a time counted in steps of the earlier length, an energy book begun anew."""
    model = walker()
    first = dynamics(model, 0.03, 1e-3, ground=GROUND, drive=strokes)
    then = dynamics(model, 0.02, 5e-4, ground=GROUND, drive=strokes, start=first.final)
    assert then.times[0] == first.times[-1]
    assert then.times[-1] == pytest.approx(0.05, rel=1e-14)
    np.testing.assert_array_equal(then.book[0], first.book[-1])


# ---- adaptive steps


def test_adaptive_steps_reach_the_accuracy_asked_for() -> None:
    """A ball on a spring for one period: the position is found to a few errors a step, and tighter costs more.

    Catches: an error that is not looked at, halves thrown away instead of the whole step, steps that stay small.
    """
    w = np.sqrt(20.0 / 2e-3)
    model = ball()
    start = replace(model.drawn(), x=np.array([[0.0, 0.0, 1.5]]))
    period = 2.0 * np.pi / w
    step = period / 8.0
    found: list[tuple[float, int]] = []
    for limit in (1e-3, 1e-5, 1e-7):
        settings = Settings(dissipation=0.0, largest_error=limit)
        motion = dynamics(model, period, step, start=start, settings=settings)
        exact = 1.0 + 0.5 * np.cos(w * motion.times)
        found.append((float(np.abs(motion.x[:, 0, 2] - exact).max()), motion.halved))
    # errors of the steps, a third of the limit each, add up, with those of the velocities up to pi times
    for (error, halved), limit in zip(found, (1e-3, 1e-5, 1e-7), strict=True):
        assert error <= np.pi * (halved + 8) * limit
    assert found[0][0] > 5.0 * found[1][0] > 25.0 * found[2][0]
    assert found[0][1] < found[1][1] < found[2][1]


def test_adaptive_steps_are_long_where_nothing_happens() -> None:
    """A push in the middle of a second of rest is all that steps are divided for.

    Catches: steps that never grow again.
    """
    push = PointLoad(("ball", (0.0, 0.0, 1.0)), force=(0.0, 0.0, 4.0), history=lambda t: float(0.0305 < t < 0.04))
    model = ball(loads=[push])
    quiet = dynamics(model, 0.03, 1e-3, settings=Settings(largest_error=1e-5))
    assert quiet.halved == 0
    pushed = dynamics(model, 0.06, 1e-3, settings=Settings(largest_error=1e-5))
    assert pushed.halved > 0


def test_an_error_that_cannot_be_reached_ends_the_run() -> None:
    """Catches: an endless division of the step."""
    kick: Callable[[float], float] = lambda t: 1e9 * float(t > 0.0101)  # noqa: E731
    model = ball(loads=[PointLoad(("ball", (0.0, 0.0, 1.0)), force=(1.0, 0.0, 0.0), history=kick)])
    with pytest.raises(SolveError, match="largest_error") as error:
        dynamics(model, 0.1, 1e-3, settings=Settings(largest_error=1e-12))
    assert error.value.best.times[-1] == pytest.approx(0.01)


# ---- results


def test_a_motion_tells_momenta_energies_and_places() -> None:
    """Momenta of a moving ball by hand; its samples are states. Catches: spin left out, wrong columns of the book."""
    body = Body((1.0, 2.0, 3.0), 2.0, (4.0, 5.0, 6.0), "ball")
    model = RodModel(bodies=[body])
    v = np.array([[1.0, -2.0, 0.5, 0.1, 0.2, -0.3]])
    motion = dynamics(model, 2e-3, start=replace(model.drawn(), v=v), settings=Settings(dissipation=0.0))
    np.testing.assert_allclose(motion.momentum, np.tile(2.0 * v[0, :3], (3, 1)), rtol=1e-12)
    spin = np.cross([1.0, 2.0, 3.0], 2.0 * v[0, :3]) + np.array([0.4, 1.0, -1.8])
    np.testing.assert_allclose(motion.angular_momentum, np.tile(spin, (3, 1)), rtol=1e-9)
    assert motion.energy("kinetic")[0] == pytest.approx(5.25 + 0.02 + 0.1 + 0.27)
    assert motion.state(2).velocity(("ball", (1.0, 2.0, 4.0))) == pytest.approx([1.2, -2.1, 0.5], rel=1e-3)
    assert motion.centre_of_mass[1] == pytest.approx([1.001, 1.998, 3.0005])


def test_the_inputs_of_a_run_are_left_as_they_were() -> None:
    """Catches: steps made in the arrays of the start or of a checkpoint."""
    model = walker()
    start = model.drawn()
    before = start.x.copy(), start.Q.copy(), start.v.copy()
    first = dynamics(model, 0.01, ground=GROUND, start=start)
    assert all(np.array_equal(a, b) for a, b in zip(before, (start.x, start.Q, start.v), strict=True))
    kept = {k: v.copy() for k, v in first.final.arrays().items()}
    dynamics(model, 0.01, ground=GROUND, start=first.final)
    assert all(np.array_equal(v, first.final.arrays()[k]) for k, v in kept.items())


def test_a_free_joint_of_massless_parts_is_reported_singular() -> None:
    """A part without mass that nothing holds has no motion. Catches: a division by zero that leaves the numbers."""
    bars = [
        Rod(np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]), Section.circle(0.1), GEL, "a"),
        Rod(np.array([[1.0, 0.0, 0.0], [2.0, 0.0, 0.0]]), Section.circle(0.1), GEL, "b", mass=0.0),
    ]
    model = RodModel(bars, [Spherical(("a", -1), ("b", 0))])
    with pytest.raises(SolveError, match="fails"):
        dynamics(model, 0.01)

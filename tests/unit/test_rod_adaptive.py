"""Steps that adapt: changes of contact located within a step, errors of parts, and runs that go on across a change."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from fem_biobot.config import load_design
from fem_biobot.ensembles import Nudge
from fem_biobot.errors import DesignError, SolveError
from fem_biobot.friction.kernels import LIFTED, SLIP, STICK
from fem_biobot.rod.dynamics.adaptive.kernels import AFTER_CHANGE, FINEST, UNSETTLED
from fem_biobot.rod.dynamics.integrate import Motion, Settings, dynamics
from fem_biobot.rod.dynamics.run.kernels import AFTER
from fem_biobot.rod.ensemble import nudged, walk_ensemble
from fem_biobot.rod.ground import Ground
from fem_biobot.rod.model import RodModel
from fem_biobot.rod.records import Gravity, Hold, PointLoad, Rod
from fem_biobot.rod.reduce import reduce
from fem_biobot.rod.rest import stance
from fem_biobot.rod.section import RodMaterial, Section
from fem_biobot.rod.touch import Touch
from fem_biobot.rod.walk import walk
from fem_biobot.verification.contact import MASS, G, block

STATIC, KINETIC = 0.5, 0.3
RISE = 30.0 * G * MASS  # of a force that grows with time [mN/s]
STEP = 3.7e-3
GROUND = Ground(STATIC, KINETIC)
FREE_OF_ERROR = 1.0  # mm, far above the error of any step here: parts are made where contact changes alone


def located(parts: int) -> Settings:
    """Steps divided for nothing but changes of contact, to so many parts."""
    return Settings(dissipation=0.0, largest_error=FREE_OF_ERROR, parts=parts)


def at_end(model: Any, parts: int, ground: Ground = GROUND, **start: Any) -> Motion:
    """Motion up to the step's multiple next to the end."""
    begin = replace(model.drawn(), **start)
    return dynamics(model, 13 * STEP, STEP, ground=ground, start=begin, settings=located(parts))


def pulled(x: float, z: float) -> Any:
    """A block with a force at its centre of mass that grows with time."""
    push = PointLoad(("block", (0.0, 0.0, 2.5)), force=(RISE * x, 0.0, RISE * z), history=lambda t: t)
    return block(push)


# ---- each change of contact, against closed forms


@pytest.mark.parametrize("static", [0.42, 0.47, 0.5, 0.53])
def test_the_time_at_which_static_friction_gives_way_is_located(static: float) -> None:
    """A block under a force that grows breaks loose at ``t = mu_s m g / rate`` and is released at once.

    Its speed later is exact for the scheme but for the time of the release, which is found to a part, wherever in a
    step it lies. Impulses tell the friction in the middle of a step: in the second half of one, 0.5 and 0.53, nothing
    slips yet. Catches: a release that takes the whole step, one that the middle of the step does not show left to the
    next step, changes that are not looked for where the step adapts.
    """
    end, loose = 13 * STEP, static * G * MASS / RISE
    exact = RISE / MASS * (end**2 - loose**2) / 2.0 - KINETIC * G * (end - loose)
    model, errors = pulled(1.0, 0.0), {}
    for parts in (1, 8, 64):
        motion = at_end(model, parts, Ground(static, KINETIC))
        errors[parts] = abs(float(motion.v[-1, 0, 0]) - exact) / ((static - KINETIC) * G)
        assert (motion.touch[motion.times < loose - STEP] == STICK).all()
        assert (motion.touch[-1] == SLIP).all()
    assert errors[1] > STEP / 8
    assert errors[8] < STEP / 8
    assert errors[64] < STEP / 64


@pytest.mark.parametrize("static", [0.42, 0.47, 0.5, 0.53])
def test_steps_of_one_length_release_within_a_part(static: float) -> None:
    """The same with steps divided into four, and into one: within a part, and for one within a step.

    Catches: a foot that gives way in the second half of a step and is held to its end.
    """
    end, loose = 13 * STEP, static * G * MASS / RISE
    exact = RISE / MASS * (end**2 - loose**2) / 2.0 - KINETIC * G * (end - loose)
    for parts in (1, 4, 16):
        settings = Settings(dissipation=0.0, parts=parts)
        motion = dynamics(pulled(1.0, 0.0), end, STEP, ground=Ground(static, KINETIC), settings=settings)
        late = abs(float(motion.v[-1, 0, 0]) - exact) / ((static - KINETIC) * G)
        assert late < STEP / parts


@pytest.mark.parametrize("share", [0.8, 0.84, 0.88, 0.92])
def test_a_release_soon_after_another_change_is_found_as_well(share: float) -> None:
    """A block that slid and stopped breaks loose in the first whole steps after those in parts, within a part of when.

    Catches: friction carried on from the part before as if that had been a whole step.
    """
    loose, end = (5 + share) * STEP, 11 * STEP
    static = RISE * loose / (G * MASS)
    model = pulled(1.0, 0.0)
    start = replace(model.drawn(), v=np.array([[-60.0, 0.0, 0.0, 0.0, 0.0, 0.0]]))
    settings = Settings(dissipation=0.0, parts=16)
    motion = dynamics(model, end, STEP, ground=Ground(static, 0.8 * static), start=start, settings=settings)
    exact = RISE / MASS * (end**2 - loose**2) / 2.0 - 0.8 * static * G * (end - loose)
    assert abs(motion.v[-1, 0, 0] - exact) < 0.2 * static * G * STEP / 16


def test_a_foot_gives_way_where_both_directions_together_do() -> None:
    """Pushed backward with 0.4 of its weight against 0.6, a block is pulled aside against 0.4 with a growing force.

    Loose at ``0.4 m g sqrt(1 - (0.4 / 0.6)^2) / rate``, in the second half of a step. Catches: directions taken one by
    one, coefficients exchanged.
    """
    push = PointLoad(("block", (0.0, 0.0, 2.5)), force=(-0.4 * G * MASS, 0.0, 0.0))
    pull = PointLoad(("block", (0.0, 0.0, 2.5)), force=(0.0, RISE, 0.0), history=lambda t: t)
    ground = Ground(0.4, 0.36, reverse_static_friction=0.6, reverse_kinetic_friction=0.54)
    loose = 0.4 * np.sqrt(1.0 - (0.4 / 0.6) ** 2) * G * MASS / RISE
    step = loose / 3.8
    settings = Settings(dissipation=0.0, largest_error=FREE_OF_ERROR, parts=64)
    motion = dynamics(block(push, pull), 4 * step, step, ground=ground, settings=settings)
    assert motion.slip_share[4] * step == pytest.approx(np.full(4, 4 * step - loose), abs=step / 64)


def test_the_time_at_which_a_slide_ends_is_located() -> None:
    """A thrown block stops after ``v^2 / (2 mu g)``; the part in which it does is of first order.

    Catches: a stop rounded to the step, a block that slips back.
    """
    speed = 97.0
    exact = speed**2 / (2.0 * KINETIC * G)
    errors = {}
    for parts in (1, 8, 64):
        motion = at_end(block(), parts, v=np.array([[speed, 0.0, 0.0, 0.0, 0.0, 0.0]]))
        errors[parts] = abs(float(motion.x[-1, 0, 0]) - exact)
        assert errors[parts] <= 0.5 * KINETIC * G * (STEP / parts) ** 2 + 1e-9
        assert (motion.touch[-1] == STICK).all()
    assert errors[64] < errors[1] / 64.0


def test_the_time_of_a_landing_is_located() -> None:
    """A block that lands in motion loses ``mu v`` of its speed along the ground at once and then slides.

    A landing one part early or late gives its friction that part. Catches: a landing rounded to the step, an impact
    divided for ever.
    """
    height, speed = 1.7, 290.0
    down = float(np.sqrt(2.0 * G * height))
    falls, end = down / G, 13 * STEP
    after = speed - KINETIC * down
    exact = speed * falls + after * (end - falls) - 0.5 * KINETIC * G * (end - falls) ** 2
    ground = Ground(KINETIC, KINETIC, height=-height)
    errors = {}
    for parts in (1, 8, 64):
        motion = at_end(block(), parts, ground, v=np.array([[speed, 0.0, 0.0, 0.0, 0.0, 0.0]]))
        errors[parts] = abs(float(motion.x[-1, 0, 0]) - exact)
        # gaps close within a few parts, so does the impulse
        assert errors[parts] <= 2.0 * KINETIC * down * STEP / parts
        assert motion.x[:, 0, 2].min() >= 2.5 - height - 1e-10
    assert errors[64] < errors[1] / 8.0


def test_the_time_at_which_a_body_leaves_the_ground_is_located() -> None:
    """Lifted by a force that grows it leaves at the time of its weight, ``g / rate``, and rises with the third power.

    A force averaged over the step in which that happens is wrong by the rate and the step's square over eight.
    Catches: a body that leaves with the step, adhesion until its end.
    """
    leaves, end = G * MASS / RISE, 13 * STEP
    since = end - leaves
    exact = RISE * since**3 / (6.0 * MASS)
    errors = {}
    for parts in (1, 64):
        motion = at_end(pulled(0.0, 1.0), parts)
        errors[parts] = abs(float(motion.x[-1, 0, 2]) - 2.5 - exact)
        assert (motion.touch[-1] == LIFTED).all()
    # after it smooth parts of the whole length alone are to blame, exact to the step's square
    assert errors[1] <= RISE / MASS * STEP**2 * since / 4.0
    assert errors[64] < 0.9 * errors[1]


def _strike(settings: Settings, spin: float = 0.02) -> Motion:
    """A block pushed with 0.35 of its weight against 0.4 that comes down on its heel, turning about its toe [rad/s].

    A moment takes the weight off the heel: nothing but the strike changes at it.
    """
    moment = PointLoad(("block", (0.0, 0.0, 2.5)), moment=(0.0, (6.0 + 0.35 * 2.5) * G * MASS, 0.0))
    push = PointLoad(("block", (0.0, 0.0, 2.5)), force=(-0.35 * G * MASS, 0.0, 0.0))
    start, tilt = block(push, moment).drawn(), 0.5e-3 * spin
    turn = np.array([[np.cos(tilt), 0.0, np.sin(tilt)], [0.0, 1.0, 0.0], [-np.sin(tilt), 0.0, np.cos(tilt)]])
    toe = np.array([6.0, 0.0, 0.0])
    x = toe + (start.x - toe) @ turn.T
    omega = np.array([0.0, -spin, 0.0])
    v = np.concatenate([np.cross(omega, x[0] - toe), omega])[None]
    start = replace(start, x=x, Q=start.Q @ turn.T, v=v)
    return dynamics(start.model, 4e-3, 1e-3, ground=Ground(0.4, 0.2), start=start, settings=settings)


def test_a_weak_strike_of_a_heel_releases_the_foot() -> None:
    """A heel that comes down with 0.24 mm/s stops with ``5 / 12`` of its impulse along the ground: beyond 0.4.

    The foot breaks loose at 0.5 ms and slides, since 0.35 is pushed against 0.2; as its heel lifts again it
    turns a little. In a part in which the weight's impulse is far above the strike's it seems to hold.
    Catches: landings located no better than to a coarse part.
    """
    fine = _strike(Settings(largest_error=1e-6))
    assert (fine.touch[1:, 2:] == SLIP).all()
    assert fine.v[-1, 0, 0] == pytest.approx(-0.15 * G * 3.5e-3, rel=0.1)
    for coarse in (Settings(), Settings(largest_error=1e-6, parts=8)):
        assert abs(_strike(coarse).v[-1, 0, 0]) < 1e-6


@pytest.mark.parametrize("friction", [0.0, 0.01])
@pytest.mark.parametrize("below", ["ground", "walls"])
def test_without_friction_stick_and_slip_are_the_same(below: str, friction: float) -> None:
    """Pushed to and fro on slick ground or slick walls a body turns round within whole steps; with friction not.

    Catches: parts made for a stop or a turn that no force knows of, contacts between parts forgotten, changes
    overlooked where there is friction.
    """
    push = {"force": (0.0, 600.0, 0.0), "history": lambda t: np.cos(700.0 * t)}
    model = block(PointLoad(("block", (0.0, 0.0, 2.5)), **push))
    if below == "walls":
        stuff, across = RodMaterial(young=1e6, poisson=0.3, density=1e-6), (1.0, 0.0, 0.0)
        ends = [np.array([(x, -5.0, 0.0), (x, 5.0, 0.0)]) for x in (-2.0, 2.0)]
        walls = [Rod(points, Section.circle(0.5), stuff, name=f"wall {k}") for k, points in enumerate(ends)]
        plank = Rod(np.array([(-2.0, 0.0, 1.0), (2.0, 0.0, 1.0)]), Section.circle(0.5), stuff, name="plank")
        push["force"] = (0.0, 600.0 * 4.0 * np.pi / 4 * 1e-6, 0.0)
        model = RodModel(
            [plank, *walls],
            supports=[Hold((f"wall {k}", end)) for k in (0, 1) for end in (0, 1)],
            loads=[Gravity(), *(PointLoad(("plank", end), **push) for end in (0, 1))],
            touches=[Touch("plank", f"wall {k}", nodes=[k], friction=friction, along=across) for k in (0, 1)],
        )
    ground = Ground(friction) if below == "ground" else None
    motion = dynamics(model, 20e-3, 1e-3, ground=ground, settings=located(64))
    sideways = motion.v[:, 0, 1]
    assert (sideways[1:] * sideways[:-1] < 0.0).sum() >= 3
    assert (motion.divided <= 2) == (friction == 0.0)


# ---- what a state carries from part to part


def test_a_run_goes_on_across_a_change_to_the_last_bit() -> None:
    """Stopped after any step about the release, where parts are short, it repeats the whole run.

    Catches: a length of parts, or a count of those since the change, that a checkpoint does not keep.
    """
    model = pulled(1.0, 0.0)
    settings = Settings(largest_error=1e-6)
    whole = dynamics(model, 13 * STEP, STEP, ground=GROUND, settings=settings)
    seen = []
    for steps in range(3, 10):
        first = dynamics(model, steps * STEP, STEP, ground=GROUND, settings=settings)
        rest = dynamics(model, (13 - steps) * STEP, STEP, ground=GROUND, start=first.final, settings=settings)
        for name in ("x", "v", "touch", "book"):
            assert np.array_equal(getattr(whole, name)[steps:], getattr(rest, name))
        seen.append(int(first.final.state.alert[0]))
    assert max(seen) % UNSETTLED > 0


def test_a_start_is_made_in_short_parts_that_grow() -> None:
    """Nothing is known of a start's accelerations; at rest all steps but the first few are whole.

    Catches: an error told from accelerations that are none, parts that do not grow.
    """
    motion = dynamics(block(), 20e-3, 1e-3, ground=GROUND, settings=Settings(largest_error=1e-7))
    assert 1 <= motion.divided <= 2
    assert motion.halved == 0
    assert motion.final.state.alert[0] == 0
    assert AFTER_CHANGE < FINEST


def test_steps_of_one_length_do_not_take_a_level_for_a_count() -> None:
    """A run with whole steps from where parts were short divides no more steps than after a change.

    Catches: the level of an adaptive run taken for the number of steps still to be divided.
    """
    settings = Settings(largest_error=1e-6)
    short = dynamics(pulled(1.0, 0.0), 5 * STEP, STEP, ground=GROUND, settings=settings)
    assert short.final.state.alert[0] > AFTER
    on = dynamics(pulled(1.0, 0.0), 20 * STEP, STEP, ground=GROUND, start=short.final)
    assert on.divided <= AFTER


def test_parts_that_fail_at_the_shortest_length_end_the_run() -> None:
    """A moment that winds a block up beyond all numbers: what was reached is there, and the step's own length told.

    The time told is the part's. Catches: a failure taken for an error of the parts, an endless run, the time at which
    the whole step begins.
    """
    twist = PointLoad(("block", (0.0, 0.0, 2.5)), moment=(0.0, 1.0, 0.0), history=lambda t: np.exp(9e3 * t))
    with pytest.raises(SolveError, match=f"a step of {1e-3 / 2**FINEST:.3g} s fails") as error:
        dynamics(block(twist), 0.1, 1e-3, ground=None, settings=Settings(largest_error=1e-3))
    reached = error.value.best.times[-1]
    assert reached == error.value.best.final.time < 0.1
    told = float(str(error.value).split("at ")[1].split(" s")[0])
    assert reached + 1e-5 < told < reached + 1e-3
    assert np.isfinite(error.value.best.x).all()


@pytest.mark.parametrize("number", [0, 3])
def test_a_strike_that_rings_on_is_passed(number: int) -> None:
    """Starts from which the junction bot strikes the ground so that its velocities jump on for many short parts.

    Catches: halves without end, which no error however large for one part would stop.
    """
    design = load_design("junction_bot", ["muscle.passive_tension = 0.9 kPa", "muscle.active_tension = 2.7 kPa"])
    model, ground = reduce(design, beam_elements=4), Ground(0.42, 0.3)
    start = nudged(stance(model, ground), Nudge(), np.random.default_rng([20180417, number]))
    motion = dynamics(model, 3e-3, 5e-4, ground=ground, start=start, settings=Settings(largest_error=2e-7))
    assert motion.times[-1] == pytest.approx(3e-3)
    assert motion.halved < 6 * FINEST  # tries, of which a passage to the shortest parts takes one a level
    assert np.abs(motion.energy_error).max() < 1e-6 * np.abs(motion.energy("kinetic")).max()


# ---- from a design


def test_a_design_may_ask_for_an_error() -> None:
    """``numerics.largest_error`` is that of the settings, in a walk and in an ensemble; none by default.

    Catches: a key without effect, or that ensembles forget.
    """
    design = load_design("junction_bot", ["numerics.largest_error = 0.02 um"])
    given = {"duration": 0.012, "beam_elements": 4, "frequency": 100.0}
    asked = walk(design, **given).motion
    told = walk(load_design("junction_bot"), settings=Settings(largest_error=2e-5), **given).motion
    plain = walk(load_design("junction_bot"), **given).motion
    assert np.array_equal(asked.x, told.x)
    assert asked.divided > plain.divided
    usual = walk_ensemble(load_design("junction_bot"), starts=1, **given).walks[0].motion
    for settings in ({}, {"settings": None}):
        together = walk_ensemble(design, starts=1, **settings, **given).walks[0].motion
        assert together.divided > usual.divided
    with pytest.raises(DesignError, match=r"numerics\.largest_error"):
        load_design("junction_bot", ["numerics.largest_error = 0 mm"])

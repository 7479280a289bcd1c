"""C1 to C5 beyond their rows in the table: rigid bodies with corners or round surfaces on a frictional ground.

Problem: that of the cases (`verification.contact`), and landings, bounces and feet that come to rest.
Exact answers: closed forms of uniform or harmonic motion, arithmetic in each test.
Measured: positions, velocities and times of `dynamics` at its default step of 1 ms, and their change with the step.
Tolerance: an event is found within its step, so times within a step and lengths within a step times the speed there;
    uniform acceleration is exact for the scheme without its dissipation, up to its tolerance of 1e-9; rest is exact up
    to rounding.
Cannot see: rods, feet that turn as they slide (then the law itself leaves the corners' shares open).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fem_biobot.friction.kernels import SLIP, STICK
from fem_biobot.rod.dynamics.integrate import Integrator, Motion, Settings, dynamics
from fem_biobot.rod.ground import ContactPoints, Ground
from fem_biobot.rod.model import RodModel
from fem_biobot.rod.records import Body, Gravity, Hold, PointLoad, Spring
from fem_biobot.verification.contact import (
    EXACT,
    MASS,
    RADIUS,
    ROUND,
    G,
    block,
    long_rest,
    moving,
    pushed,
    rolling,
    slide,
)
from fem_biobot.verification.contact_sticking import slide_down, slope


def test_c1_a_block_slides_straight() -> None:
    """Along an oblique direction nothing pushes it aside.

    Catches: a box instead of a circle of friction.
    """
    across = slide(1e-3).x[:, 0, :2] @ np.array([-0.6, 0.8])
    assert np.abs(across).max() <= 1e-9


def test_c1_a_block_at_rest_bears_its_push() -> None:
    """Held by static friction, its corners carry weight and push together, and all of them stick.

    Catches: friction that holds without a force, regularised friction.
    """
    rest = long_rest()
    assert (rest.touch[1:] == STICK).all()
    np.testing.assert_allclose(rest.contact_force[-1].sum(axis=0), [G, -0.27 * G, -0.36 * G], rtol=1e-9)


def test_c2_explicit_steps_know_static_from_kinetic_friction() -> None:
    """The other integrator's push from rest: 1.1541894 J after 10 N, exactly none after 7 N.

    Catches: static friction kept in slip, kinetic friction at rest, slip begun one step late.
    """
    settings = Settings(integrator=Integrator.explicit)
    energy = 0.5e-6 * (0.25 * (1e7 - 0.4 * 9806650.0)) ** 2
    assert pushed(10_000.0, settings).energy("kinetic")[-1] == pytest.approx(energy, rel=1e-7)
    assert pushed(7000.0, settings).energy("kinetic")[-1] <= 1e-20


@pytest.mark.parametrize("name", list(ROUND))
def test_c3_a_round_body_keeps_its_height(name: str) -> None:
    """Its axis stays a radius above the ground, while it slides and while it rolls.

    Catches: contact at the axis, penetration as it begins to roll.
    """
    found = rolling(*ROUND[name])
    assert found.rolls_from < 0.2
    assert np.abs(found.motion.x[:, 0, 2] - RADIUS).max() <= 1e-9 * RADIUS
    # from its first sample that sticks on, it never slips again
    assert 0.0 <= found.began - found.rolls_from <= 1e-3


def test_c5_another_slope_starts_at_its_angle_of_friction() -> None:
    """A steep one: just below tan(angle) = 1.2 it stays for 100 s; just above it slides, all corners.

    Catches: an angle taken for its tangent.
    """
    below, above = slope(1.2 * (1.0 - 1e-7), 1.2), slope(1.2 * (1.0 + 1e-7), 1.2)
    assert np.abs(below.x - below.x[0]).max() < 1e-9
    along = above.x[-1, 0, :2] @ np.array([0.6, 0.8])
    assert along == pytest.approx(slide_down(1.2 * (1.0 + 1e-7), 1.2), rel=1e-8)
    assert (above.touch[-1] == SLIP).all()


@pytest.mark.parametrize("above", [False, True])
def test_c5_a_slope_may_be_given_by_the_ground(above: bool) -> None:
    """The same with a tilted plane at a height under vertical weight, its forward direction across the slope.

    Catches: ground axes, height or forward taken in the world's frame.
    """
    static = 0.45
    angle = np.arctan(static * (1.0 + (1e-6 if above else -1e-6)))
    normal = np.array([np.sin(angle), 0.0, np.cos(angle)])
    down = np.array([np.cos(angle), 0.0, -np.sin(angle)])
    height = 7.0
    corners = [height * normal + a * down + b * np.array([0.0, 1.0, 0.0]) for a in (-3.0, 3.0) for b in (-2.0, 2.0)]
    body = Body(tuple((height + 1.5) * normal), MASS, (30.0, 40.0, 50.0), "block")
    model = RodModel(bodies=[body], loads=[Gravity((0.0, 0.0, -G))], contacts=[ContactPoints("block", corners)])
    ground = Ground(static, 0.2, height=height, normal=tuple(normal), forward=(0.0, 1.0, 0.0))
    motion = dynamics(model, 0.4, ground=ground, settings=EXACT)
    moved = motion.x[-1, 0] - motion.x[0, 0]
    expected = 0.5 * G * (np.sin(angle) - 0.2 * np.cos(angle)) * 0.4**2 if above else 0.0
    np.testing.assert_allclose(moved, expected * down, rtol=0.0, atol=1e-8 * max(expected, 1.0))


def test_reverse_friction_holds_against_slip_backwards_alone() -> None:
    """A push of 0.4 of the weight moves the block forward past 0.3 and not backward against 0.6.

    Catches: forward and reverse exchanged, the sideways coefficient used for both.
    """

    def pushed(x: float, y: float) -> Motion:
        push = PointLoad(("block", (0.0, 0.0, 0.0)), force=(0.4 * G * x, 0.4 * G * y, 0.0))
        ground = Ground(0.3, reverse_static_friction=0.6, forward=(0.0, 1.0, 0.0))
        return dynamics(block(push), 0.2, ground=ground, settings=EXACT)

    forward, back = pushed(0.0, 1.0), pushed(0.0, -1.0)
    assert forward.x[-1, 0, 1] == pytest.approx(0.5 * 0.1 * G * 0.2**2, rel=1e-8)
    assert np.abs(back.x - back.x[0]).max() < 1e-9


def test_corners_of_a_foot_that_slid_to_rest_carry_no_friction_of_their_own() -> None:
    """After a slide nothing pushes the block, so each corner's friction is zero, not only their sum.

    Catches: friction impulses of the slide that stay in the corners, in equilibrium with each other.
    """
    model = block()
    start = replace(model.drawn(), v=np.array([[200.0, 90.0, 0.0, 0.0, 0.0, 25.0]]))
    motion = dynamics(model, 0.3, ground=Ground(0.5), start=start)
    assert (motion.touch[-1] == STICK).all()
    assert np.abs(motion.contact_force[-1, :, 1:]).max() <= 1e-9 * G
    assert motion.contact_force[-1, :, 0].sum() == pytest.approx(G, rel=1e-9)


@pytest.mark.parametrize("integrator", list(Integrator))
@pytest.mark.parametrize("drop", [20.0, 20.17, 20.35, 20.5])
def test_a_dropped_block_neither_penetrates_nor_bounces(integrator: Integrator, drop: float) -> None:
    """Wherever in a step it lands, it is never below the ground nor on its way up, and its gap closes like 1/3^k.

    Catches: a velocity that closes a gap already passed (it throws the block up again), penetration in the impact step,
    energy made or lost by anything but the normal impulse.
    """
    exact = Settings(integrator=integrator, dissipation=0.0)
    motion = dynamics(block(), 0.2, ground=Ground(0.3, height=-drop), settings=exact)
    height = motion.x[:, 0, 2] - 2.5 + drop
    assert height.min() >= -1e-10
    assert motion.v[:, 0, 2].max() <= 1e-9
    # it lands within two steps and a gap of at most the speed times the step is left then
    for k in (0, 4, 8):
        late = height[motion.times > np.sqrt(2.0 * drop / G) + (2 + k) * 1e-3]
        assert late.max() <= 3.0**-k * 1e-3 * np.sqrt(2.0 * drop * G)
    normal, weight = motion.energy("normal"), motion.energy("weight")
    assert normal[-1] == pytest.approx(weight[-1] - weight[0], rel=1e-9)
    assert np.abs(motion.energy_error).max() <= 1e-9 * abs(normal[-1])


def test_a_held_part_stays_where_it_is() -> None:
    """A held block does not fall, nor does one that the start would throw.

    Catches: gravity on held nodes, a start's velocity kept by them.
    """
    body = Body.box((0.0, 0.0, 2.5), (12.0, 9.0, 5.0), MASS / 540.0, "block")
    hold = Hold(("block", (0.0, 0.0, 2.5)))
    held = RodModel(bodies=[body], loads=[Gravity((0.0, 0.0, -G))], supports=[hold])
    motion = dynamics(held, 0.05, start=moving(held, 100.0, 0.0, 0.0))
    assert np.abs(motion.x - held.built.x).max() == 0.0


def _comes_to_rest(step: float, parts: int) -> tuple[float, float]:
    """Where and when a block on a spring with friction stops, from its last slip."""
    spring = Spring(("block", (-6.0, 0.0, 2.5)), (-106.0, 0.0, 2.5), 1600.0 * MASS)
    start = block(members=(spring,)).drawn()
    start = replace(start, x=start.x + np.array([20.0, 0.0, 0.0]))
    settings = Settings(parts=parts, dissipation=0.0)
    motion = dynamics(start.model, 0.45, step, ground=Ground(0.3), start=start, settings=settings)
    slips = np.flatnonzero((motion.touch == SLIP).any(axis=1))[-1]
    return float(motion.x[-1, 0, 0]), float(motion.times[slips])


def test_steps_in_which_contact_changes_are_divided() -> None:
    """Free vibration with dry friction loses ``2 mu g / w^2`` each half swing (Rayleigh 1877) and stops after five.

    Turns of the slip rounded to whole steps cost several times the accuracy.

    Catches: a division that keeps the step's own length, one that is made after the step was taken.
    """
    d = 0.3 * G / 1600.0
    exact = -(20.0 - 10.0 * d)
    assert abs(exact) < d  # it stays there
    errors = {parts: abs(_comes_to_rest(3.7e-3, parts)[0] - exact) for parts in (1, 4, 16)}
    assert errors[4] < 0.5 * errors[1]
    assert errors[16] < 0.5 * errors[4]
    position, time = _comes_to_rest(1e-3, 4)
    assert position == pytest.approx(exact, abs=2e-3 * d)
    assert time == pytest.approx(5.0 * np.pi / 40.0, abs=1e-3)

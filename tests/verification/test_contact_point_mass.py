"""C1, C2, C4, C5: one mass on a plane with static and kinetic friction.

Problem: a sliding block stops; a push from rest; stick-slip on a belt; a slope near its angle of friction; an
oscillator
    that stops at the turn where static friction holds it.
Exact answers: closed forms of piecewise uniform or harmonic motion (VERIFICATION C1, C2, C4, C5), shown in each test.
Measured: distance, time, energy, period, range, rest, with steps of the trapezoidal rule and impulses at their ends.
Tolerance: an event is found within its step, so times within two steps and lengths within two steps times the speed
there;
    uniform motion between events and rest are exact up to rounding.
Cannot see: coupling of points, rotation, anything but one mass. Units here are kg, m, s: the solver has no scale.
"""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from fem_biobot.friction.kernels import SLIP, STICK, settle, solve_friction
from fem_biobot.friction.scratch import scratch

Array = NDArray[np.float64]

TOLERANCE = 1e-12


class Mass:
    """A point of mass 1 pressed on a plane; position and velocity along the tangents, spring to the origin along t1."""

    def __init__(self, friction: tuple[float, float], spring: float = 0.0, belt: float = 0.0) -> None:
        self.static, self.kinetic = np.full((1, 4), friction[0]), np.full((1, 4), friction[1])
        self.spring, self.belt = spring, belt
        self.x, self.v = np.zeros(3), np.zeros(3)  # normal, tangent 1, tangent 2
        self.state, self.slip = np.array([STICK]), np.zeros((1, 2))
        self.p, self.w = np.zeros((1, 3)), np.zeros((1, 3))
        self.buffers = scratch(1)

    def step(self, h: float, force: Array) -> None:
        """Trapezoidal rule for spring and position, impulse of the end of the step."""
        ground = np.array([0.0, self.belt, 0.0])
        k = np.array([0.0, self.spring, 0.0])
        M = 1.0 + 0.25 * k * h * h
        free = ((1.0 - 0.25 * k * h * h) * self.v + h * (force - k * self.x)) / M
        b = (free - ground)[None].copy()
        b[0, 0] += self.x[0] / h
        state = self.state.copy()
        residual, _ = solve_friction(
            np.diag(1.0 / M), b, self.static, self.kinetic, state, self.slip, self.p, self.w,
            self.buffers, TOLERANCE, 200,
        )  # fmt: skip
        assert residual <= TOLERANCE
        settle(b, self.w, state, self.slip, TOLERANCE)
        self.state = state
        v = free + self.p[0] / M
        self.x = self.x + 0.5 * h * (self.v + v)
        self.v = v


@pytest.mark.parametrize("h", [1e-2, 1e-3])
def test_c1_a_sliding_block_stops_and_stays(h: float) -> None:
    """From 5 m/s with friction 0.5 under 9.81: 2.548420 m, 1.019368 s; then no motion in 100 s.

    Catches: kinetic friction off by a factor, creep at rest, a bounce at the stop.
    """
    mass = Mass((0.5, 0.5))
    mass.v[1] = 5.0
    mass.state[0] = SLIP
    mass.slip[0, 0] = 5.0
    g = np.array([-9.81, 0.0, 0.0])
    steps = 0
    while mass.state[0] == SLIP and steps * h < 2.0:
        mass.step(h, g)
        steps += 1
    assert abs(steps * h - 5.0 / (0.5 * 9.81)) <= 2.0 * h
    # within the step in which it stops the speed is at most mu g h
    assert abs(mass.x[1] - 25.0 / (2.0 * 0.5 * 9.81)) <= 0.5 * 9.81 * h * h
    place = mass.x.copy()
    for _ in range(10_000):
        mass.step(h, g)
    # 1e-12 m in 100 s, that is 1e-14 m/s
    assert np.abs(mass.x - place).max() <= 1e-14 * 10_000 * h


def test_c2_a_push_from_rest() -> None:
    """10 N for 0.25 s against 0.8 and 0.4 of a weight of 9.80665 N: kinetic energy 1.1541894 J; 7 N: exactly none.

    Catches: static friction kept in slip, kinetic friction at rest, slip begun one step late.
    """
    for force, energy in ((10.0, 0.5 * ((10.0 - 0.4 * 9.80665) * 0.25) ** 2), (7.0, 0.0)):
        mass = Mass((0.8, 0.4))
        for _ in range(250):
            mass.step(1e-3, np.array([-9.80665, force, 0.0]))
        # 250 sums, each rounded relative to the velocity of one step
        assert abs(0.5 * mass.v[1] ** 2 - energy) <= 1e-12
    assert energy == 0.0
    assert mass.v[1] == pytest.approx(0.0, abs=1e-17)


def _belt(h: float) -> tuple[float, float, float]:
    """Period, smallest and largest position over some periods on the belt."""
    mass = Mass((0.5, 0.3), spring=1.0, belt=3.0)
    mass.v[1] = 3.0
    begins: list[float] = []
    xs: list[float] = []
    for k in range(round(30.0 / h)):
        before = mass.state[0]
        mass.step(h, np.array([-10.0, 0.0, 0.0]))
        if before == STICK and mass.state[0] == SLIP:
            begins.append(k * h)
        if begins:
            xs.append(mass.x[1])
    return (begins[-1] - begins[0]) / (len(begins) - 1), min(xs), max(xs)


def test_c4_stick_slip_on_a_belt() -> None:
    """Mass 1, spring 1, weight 10, friction 0.5 and 0.3, belt 3: period 6.4405134334, x from -0.6055 to 6.6055.

    Slip begins at x = 5 and is harmonic about 3 with radius sqrt(2^2 + 3^2) until the mass has the belt's speed again.
    Catches: one friction for both, stick that ends on kinetic friction, slip that does not end.
    """
    radius = np.sqrt(13.0)
    slip = 2.0 * np.pi - 2.0 * np.arctan2(2.0, 3.0)
    assert slip + 4.0 / 3.0 == pytest.approx(6.4405134334, abs=1e-10)
    errors = []
    for h in (8e-3, 2e-3):
        period, low, high = _belt(h)
        errors.append(abs(period - 6.4405134334))
        # begin and end of slip are found within a step each, and the steps of the belt are 3 h
        assert errors[-1] <= 2.0 * h
        assert abs(low - (3.0 - radius)) <= 2.0 * 3.0 * h
        assert abs(high - (3.0 + radius)) <= 2.0 * 3.0 * h
    assert errors[-1] <= 1e-3 * 6.44


@pytest.mark.parametrize("static", [0.35, 0.8, 1.3])
def test_c5_a_block_on_a_slope_starts_at_its_angle_of_friction(static: float) -> None:
    """Just below tan(angle) = mu_s it stays put for ever; just above it slides with g (sin - mu_k cos).

    Catches: the kinetic bound at rest, a threshold on velocity that hides a slow start, creep.
    """
    g, h, steps = 9.81, 1e-3, 2000
    for tangent, moves in ((static * (1.0 - 1e-9), False), (static * (1.0 + 1e-9), True)):
        angle = np.arctan(tangent)
        force = g * np.array([-np.cos(angle), 0.6 * np.sin(angle), 0.8 * np.sin(angle)])
        mass = Mass((static, 0.6 * static))
        for _ in range(steps):
            mass.step(h, force)
        along = 0.6 * mass.x[1] + 0.8 * mass.x[2]
        expected = 0.5 * g * (np.sin(angle) - 0.6 * static * np.cos(angle)) * (h * steps) ** 2 if moves else 0.0
        # uniform acceleration is exact for this rule; rest is rounding of one step's velocity
        assert abs(along - expected) <= 1e-12 * max(1.0, abs(expected))
        assert (mass.state[0] == SLIP) == moves


def test_an_oscillator_stops_at_the_turn_where_static_friction_holds_it() -> None:
    """Released at 10 with bounds 5 and 3 N and spring 1: half a turn about 3 ends at -4, where 4 N are held for ever.

    Catches: a slip that turns back within a step without meeting static friction (it would end at -2).
    """
    h = 2e-3
    mass = Mass((0.5, 0.3), spring=1.0)
    mass.x[1] = 10.0
    for _ in range(round(8.0 / h)):
        mass.step(h, np.array([-10.0, 0.0, 0.0]))
    assert mass.state[0] == STICK
    # the speed within a step of the turn is at most the acceleration there times the step
    assert abs(mass.x[1] + 4.0) <= 7.0 * h * h

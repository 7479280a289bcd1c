"""C1 to C5: rigid bodies with corners or round surfaces on a frictional ground, through the dynamics of assemblies."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from fem_biobot import (
    Body,
    ContactPoints,
    Gravity,
    Ground,
    Motion,
    PointLoad,
    RodModel,
    RodState,
    dynamics,
)
from fem_biobot.friction.kernels import STICK
from fem_biobot.rod.dynamics.integrate import Settings
from fem_biobot.verification.blocks import unit
from fem_biobot.verification.records import Case, Claim, Curve, Finding, Graph, worst

Array = NDArray[np.float64]

MASS = 1.0  # kg
G = 9810.0  # mm/s^2
STEP = 1e-3  # s, the default
EXACT = Settings(dissipation=0.0)
_COULOMB = "Coulomb, uniform acceleration"


def block(*loads: PointLoad, gravity: tuple[float, float, float] = (0.0, 0.0, -G), members: tuple = ()) -> RodModel:
    """A block of 1 kg, 12 by 9 by 5 mm, on its four lower corners."""
    body = Body.box((0.0, 0.0, 2.5), (12.0, 9.0, 5.0), MASS / (12.0 * 9.0 * 5.0), "block")
    corners = [(x, y, 0.0) for x in (-6.0, 6.0) for y in (-4.5, 4.5)]
    return RodModel(
        bodies=[body], loads=[Gravity(gravity), *loads], members=members, contacts=[ContactPoints("block", corners)]
    )


def moving(model: RodModel, *v: float) -> RodState:
    """The model as drawn with its only body at a velocity, (3,) [mm/s]."""
    return replace(model.drawn(), v=np.array([[*v, 0.0, 0.0, 0.0]]))


# --- C1 ---------------------------------------------------------------------------------------------------------------

SPEED, FRICTION = 5000.0, 0.5
STOP_TIME = SPEED / (FRICTION * G)
STOP_DISTANCE = SPEED**2 / (2.0 * FRICTION * G)


@cache
def slide(step: float, x: float = 0.8, y: float = 0.6) -> Motion:
    """The block sliding from 5 m/s along a direction until after it has stopped."""
    model = block()
    return dynamics(model, 1.1, step, ground=Ground(FRICTION), start=moving(model, *(SPEED * unit(x, y)), 0.0))


def stop(motion: Motion, x: float = 0.8, y: float = 0.6) -> tuple[float, float]:
    """Time [s] and distance [mm] in which a slide along a direction ended."""
    rests = np.flatnonzero((motion.touch == STICK).all(axis=1) & (motion.times > 0.5))
    return float(motion.times[rests[0]]), float(motion.x[-1, 0, :2] @ unit(x, y))


def stop_error(step: float) -> float:
    """Distance by which a slide in steps may be off [mm].

    Within the step in which it stops the speed is at most mu g step; theta above 1/2 weighs the speeds at the ends.
    """
    return 0.5 * FRICTION * G * step**2 + (Settings().theta(step) - 0.5) * step * SPEED


@cache
def long_rest() -> Motion:
    """The block held by friction against nine tenths of what it bears, for 100 s."""
    push = PointLoad(("block", (0.0, 0.0, 0.5)), force=(0.45 * G * 0.6, 0.45 * G * 0.8, 0.0))
    return dynamics(block(push), 100.0, 5e-3, ground=Ground(FRICTION), sample_every=1000)


def sliding_block() -> Finding:
    """C1: a sliding block stops and stays.

    Problem: a block of four corners at 5 m/s along an oblique direction, friction 0.5; at rest under a push of nine
        tenths of static friction.
    Measured: time and distance of the stop at steps of 1 ms and 0.25 ms; motion at rest over 100 s.
    Tolerance: one step for the time; `stop_error` for the distance; 1e-9 mm at rest.
    Cannot see: feet that turn as they slide.
    Catches: friction doubled over four corners, a box instead of a circle of friction, a bounce, creep.
    """
    values: list[float] = []
    for step in (STEP, STEP / 4.0):
        values += stop(slide(step))
    rest = long_rest()
    motion = slide(STEP)
    t = np.linspace(0.0, STOP_TIME, 61)
    along = motion.x[::50, 0, :2] @ unit(0.8, 0.6)
    curves = (
        Curve("v t - mu g t^2 / 2", t, 1e-3 * (SPEED * t - 0.5 * FRICTION * G * t * t), known=True),
        Curve("block", motion.times[::50], 1e-3 * along),
    )
    return Finding.of([*values, np.abs(rest.x - rest.x[1]).max()], Graph("time [s]", "distance [m]", curves))


C1 = Case(
    "C1",
    "sliding block",
    (
        *(
            claim
            for step in (STEP, STEP / 4.0)
            for claim in (
                Claim(f"time of the stop, step {1e3 * step:g} ms", STOP_TIME, step, "s", f"{_COULOMB}: v / (mu g)"),
                Claim(
                    f"distance of the stop, step {1e3 * step:g} ms",
                    STOP_DISTANCE,
                    stop_error(step),
                    "mm",
                    f"{_COULOMB}: v^2 / (2 mu g)",
                ),
            )
        ),
        Claim("motion in 100 s at rest under a push", 0.0, 1e-9, "mm", "Coulomb: true stick"),
    ),
    sliding_block,
)

# --- C2 ---------------------------------------------------------------------------------------------------------------


def pushed(force: float, settings: Settings | None = None) -> Motion:
    """The block pushed from rest for 0.25 s by a force [mN], friction 0.8 at rest and 0.4 in motion."""
    push = PointLoad(("block", (0.0, 0.0, 0.0)), force=(0.0, force, 0.0))
    model = block(push, gravity=(0.0, 0.0, -9806.65))
    return dynamics(model, 0.25, ground=Ground(0.8, 0.4), settings=settings)


def push_from_rest() -> Finding:
    """C2: a push from rest, above and below static friction.

    Problem: 1 kg, g = 9.80665 m/s^2, friction 0.8 at rest and 0.4 in motion, 10 N or 7 N for 0.25 s.
    Measured: kinetic energy at the end.
    Tolerance: 1e-7, half of the last printed digit; below static friction rounding of the velocity, squared.
    Cannot see: a push that is not constant.
    Catches: static friction kept in slip, kinetic friction at rest, slip begun one step late.
    """
    strong, weak = pushed(10_000.0), pushed(7000.0)
    return Finding.of([1e-6 * strong.energy("kinetic")[-1], 1e-6 * weak.energy("kinetic")[-1]])


C2 = Case(
    "C2",
    "push from rest",
    (
        Claim("kinetic energy after 10 N", 1.1541894, 1e-7, "J", f"{_COULOMB}: ((F - mu_k m g) t)^2 / 2 m"),
        Claim("kinetic energy after 7 N", 0.0, 1e-26, "J", "Coulomb: below mu_s m g nothing moves"),
    ),
    push_from_rest,
)

# --- C3 ---------------------------------------------------------------------------------------------------------------

RADIUS, ROLLING_SPEED, ROLLING_FRICTION = 3.0, 400.0, 0.3
# J = I m r^2 / 2: a hoop (2), a solid cylinder (1), a core heavier than that, and a ball touching at a point
ROUND = {"solid cylinder": (1.0, True), "cylinder with a heavy core": (0.3, True), "solid ball": (0.8, False)}


@dataclass(frozen=True, eq=False)
class Rolling:
    """A round body thrown without spin: its factor I and its motion."""

    factor: float
    motion: Motion

    @property
    def rolls_from(self) -> float:
        """Time at which slip ends, ``V I / (2 + I) / (mu g)`` [s]."""
        return ROLLING_SPEED * self.factor / (2.0 + self.factor) / (ROLLING_FRICTION * G)

    @property
    def began(self) -> float:
        """First sample that sticks [s]."""
        sticks = (self.motion.touch[1:] == STICK).all(axis=1)
        return float(self.motion.times[np.flatnonzero(sticks)[0] + 1])

    @property
    def after(self) -> Array:
        """Velocities after that, (k, 6)."""
        return self.motion.v[self.motion.times > self.rolls_from + STEP, 0]


@cache
def rolling(factor: float, cylinder: bool) -> Rolling:
    """A round body that touches along its lower generator, or a ball that touches at its lowest point."""
    J = 0.5 * factor * MASS * RADIUS**2
    body = Body((0.0, 0.0, RADIUS), MASS, (J, J, J), "wheel")
    ends = [(0.0, -4.0, RADIUS), (0.0, 4.0, RADIUS)] if cylinder else [(0.0, 0.0, RADIUS)]
    contacts = [ContactPoints("wheel", ends, RADIUS, (0.0, 1.0, 0.0) if cylinder else None)]
    model = RodModel(bodies=[body], loads=[Gravity((0.0, 0.0, -G))], contacts=contacts)
    start = moving(model, ROLLING_SPEED, 0.0, 0.0)
    return Rolling(factor, dynamics(model, 0.5, ground=Ground(ROLLING_FRICTION), start=start))


def rolling_and_sliding() -> Finding:
    """C3: a round body slides, then rolls.

    Problem: V = 0.4 m/s without spin, friction 0.3, J = I m r^2 / 2, for cylinders and a ball.
    Measured: translational energy after the slip, its worst sample until 0.5 s; the time at which slip ends; rolling.
    Tolerance: 1e-8 of energy and velocity: in the step in which slip ends impulse and time are found together; a step
        for the time.
    Cannot see: rolling resistance, which is none here.
    Catches: contact at the axis without moment, a wrong arm or sign of the moment, friction that goes on in rolling.
    """
    values: list[float] = []
    curves: list[Curve] = []
    for name, (factor, cylinder) in ROUND.items():
        found = rolling(factor, cylinder)
        energy = 0.5e-6 * MASS * found.after[:, 0] ** 2
        slipping = found.after[:, 4] * RADIUS / found.after[:, 0]
        values += [worst(energy, _rolling_energy(factor)), found.began, worst(slipping, 1.0)]
        t = np.array([0.0, found.rolls_from, 0.2])
        v = np.array([ROLLING_SPEED, *[ROLLING_SPEED / (1.0 + 0.5 * factor)] * 2])
        every = found.motion.times <= 0.2
        curves += [
            Curve(f"{name}, closed form", t, v, known=True),
            Curve(name, found.motion.times[every][::10], found.motion.v[every, 0, 0][::10]),
        ]
    return Finding.of(values, Graph("time [s]", "velocity [mm/s]", tuple(curves)))


def _rolling_energy(factor: float) -> float:
    """``1/2 m V^2 / (1 + I/2)^2`` [J]."""
    return 0.5e-6 * MASS * ROLLING_SPEED**2 / (1.0 + 0.5 * factor) ** 2


C3 = Case(
    "C3",
    "rolling and sliding",
    tuple(
        claim
        for name, (factor, _) in ROUND.items()
        for claim in (
            Claim(
                f"translational energy, {name}",
                _rolling_energy(factor),
                1e-8 * _rolling_energy(factor),
                "J",
                "Coulomb: m V^2 / 2 / (1 + I/2)^2",
            ),
            Claim(
                f"end of slip, {name}",
                ROLLING_SPEED * factor / (2.0 + factor) / (ROLLING_FRICTION * G),
                STEP,
                "s",
                "Coulomb: V I / (2 + I) / (mu g)",
            ),
            Claim(f"turning times radius over velocity, {name}", 1.0, 1e-8, "1", "rolling without slip"),
        )
    ),
    rolling_and_sliding,
)

CASES = (C1, C2, C3)

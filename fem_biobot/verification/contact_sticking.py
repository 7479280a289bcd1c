"""C4 and C5: stick-slip on a belt, and a block on a slope."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from fem_biobot import Ground, Motion, Spring, dynamics
from fem_biobot.verification.contact import EXACT, STEP, G, block, moving
from fem_biobot.verification.records import Case, Claim, Curve, Finding, Graph

Array = NDArray[np.float64]

# --- C4 ---------------------------------------------------------------------------------------------------------------

BELT = 3000.0  # mm/s
RANGE = 1000.0 * np.sqrt(13.0)
PERIOD = 6.4405134334


@cache
def belt(step: float) -> Motion:
    """The block of 1 kg on a spring of 1 N/m, pressed by 10 N on a belt, friction 0.5 at rest and 0.3 in motion."""
    spring = Spring(("block", (0.0, 0.0, 2.5)), (-20_000.0, 0.0, 2.5), stiffness=1.0)
    model = block(gravity=(0.0, 0.0, -10_000.0), members=(spring,))
    ground = Ground(0.5, 0.3, velocity=(BELT, 0.0, 0.0))
    return dynamics(model, 17.0, step, ground=ground, start=moving(model, BELT, 0.0, 0.0))


def belt_cycle(motion: Motion) -> tuple[float, float, float]:
    """Period [s], smallest and largest position [mm], from the first passage of 1 m on."""
    x, times = motion.x[:, 0, 0], motion.times
    rises = np.flatnonzero((x[:-1] < 1000.0) & (x[1:] >= 1000.0))
    passages = times[rises] + np.diff(times)[rises] * (1000.0 - x[rises]) / (x[rises + 1] - x[rises])
    late = times > passages[0]
    return (passages[-1] - passages[0]) / (len(passages) - 1), float(x[late].min()), float(x[late].max())


def belt_error(step: float) -> float:
    """Largest of the errors of the period, over it, and of the two ends of the range, in metres."""
    period, low, high = belt_cycle(belt(step))
    return max(abs(period / PERIOD - 1.0), abs(low - 3000.0 + RANGE) / 1e3, abs(high - 3000.0 - RANGE) / 1e3)


def stick_slip_on_a_belt() -> Finding:
    """C4: stick-slip on a belt.

    Problem: m = 1 kg, k = 1 N/m, N = 10 N, friction 0.5 and 0.3, belt at 3 m/s. Slip begins at 5 m and is harmonic
        about 3 m with radius sqrt(2^2 + 3^2) m until the mass has the belt's speed again.
    Measured: period, ends of the range, and how much smaller errors are at a quarter of the step.
    Tolerance: a change of contact is found within a quarter of its step of 1 ms, in which the belt moves 0.75 mm: 1 mm,
        and 1 ms for the two changes of a period. They are first order: a quarter of the step leaves a quarter of the
        error, give or take where in its step each lies. (At longer steps the slip between them, of second order, has
        the larger error.)
    Cannot see: friction that depends on speed.
    Catches: one friction for both, stick that ends on kinetic friction, slip that does not end, a ground at rest.
    """
    period, low, high = belt_cycle(belt(STEP))
    shown = belt(STEP)
    early = shown.times <= 2.0 * PERIOD
    known_times = np.linspace(5.0 / 3.0, 5.0 / 3.0 + PERIOD - 4.0 / 3.0, 121)
    phase = known_times - known_times[0] + np.arctan2(2.0, 3.0)
    curves = (
        Curve("harmonic slip", known_times, 3.0 + 1e-3 * RANGE * np.sin(phase), known=True),
        Curve("block", shown.times[early][::200], 1e-3 * shown.x[early, 0, 0][::200]),
    )
    ratio = belt_error(0.25 * STEP) / belt_error(STEP)
    return Finding.of([period, 1e-3 * low, 1e-3 * high, ratio], Graph("time [s]", "position [m]", curves))


C4 = Case(
    "C4",
    "stick-slip on a belt",
    (
        Claim("period", PERIOD, STEP, "s", "2 pi - 2 atan(2/3) + 4/3"),
        Claim("smallest position", -0.6055512755, 1e-3, "m", "3 - sqrt(13)"),
        Claim("largest position", 6.6055512755, 1e-3, "m", "3 + sqrt(13)"),
        Claim("error at a quarter of the step over that", 0.25, 0.15, "1", "first order: 1/4"),
    ),
    stick_slip_on_a_belt,
)

# --- C5 ---------------------------------------------------------------------------------------------------------------

STATIC = 0.35
KINETIC = 0.6 * STATIC
# just below and just above the angle of friction
NEAR = 1e-7


@cache
def slope(tangent: float, static: float = STATIC) -> Motion:
    """The block on a slope of a tangent, down an oblique direction: for 100 s, above its angle of friction 0.5 s."""
    angle = np.arctan(tangent)
    model = block(gravity=(0.6 * G * np.sin(angle), 0.8 * G * np.sin(angle), -G * np.cos(angle)))
    ground = Ground(static, 0.6 * static)
    if tangent < static:
        return dynamics(model, 100.0, 1e-2, ground=ground, sample_every=1000)
    return dynamics(model, 0.5, ground=ground, settings=EXACT)


def slide_down(tangent: float, static: float = STATIC, time: float = 0.5) -> float:
    """``g (sin - mu_k cos) t^2 / 2`` [mm]."""
    angle = np.arctan(tangent)
    return float(0.5 * G * (np.sin(angle) - 0.6 * static * np.cos(angle)) * time**2)


def block_on_a_slope() -> Finding:
    """C5: a block on a slope starts at its angle of friction.

    Problem: friction 0.35 at rest and 0.21 in motion; a slope whose tangent is 1e-7 of it below and above 0.35.
    Measured: motion in 100 s below; distance in 0.5 s above.
    Tolerance: 1e-9 mm; 1e-8 of the distance, since uniform acceleration is exact for a scheme without dissipation.
    Cannot see: a slope that changes.
    Catches: the kinetic bound at rest, a threshold on velocity that hides a slow start, creep.
    """
    below, above = slope(STATIC * (1.0 - NEAR)), slope(STATIC * (1.0 + NEAR))
    down = np.array([0.6, 0.8])
    t = np.linspace(0.0, 0.5, 61)
    curves = (
        Curve("g (sin - mu_k cos) t^2 / 2", t, [slide_down(STATIC * (1.0 + NEAR), time=v) for v in t], known=True),
        Curve("above the angle of friction", above.times[::25], above.x[::25, 0, :2] @ down),
        Curve("below it: at rest", [0.0, 0.5], [0.0, float((below.x[1, 0, :2] - below.x[0, 0, :2]) @ down)]),
    )
    return Finding.of(
        [np.abs(below.x - below.x[0]).max(), above.x[-1, 0, :2] @ down], Graph("time [s]", "distance [mm]", curves)
    )


C5 = Case(
    "C5",
    "slope",
    (
        Claim("motion in 100 s just below the angle of friction", 0.0, 1e-9, "mm", "Coulomb: tan(angle) < mu_s"),
        Claim(
            "distance in 0.5 s just above it",
            slide_down(STATIC * (1.0 + NEAR)),
            1e-8 * slide_down(STATIC * (1.0 + NEAR)),
            "mm",
            "Coulomb: g (sin - mu_k cos) t^2 / 2",
        ),
    ),
    block_on_a_slope,
)

CASES = (C4, C5)

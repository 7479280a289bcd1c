"""S13 and C7: solids in motion, free and on a frictional ground, through the solid's dynamics."""

from __future__ import annotations

from functools import cache
from itertools import pairwise

import numpy as np

from fem_biobot import (
    ActiveStress,
    Fix,
    Ground,
    NeoHooke,
    SolidModel,
    SolidMotion,
    SolidState,
    Step,
    Traction,
    solid_dynamics,
)
from fem_biobot.solid.dynamics.integrate import rigid_velocity
from fem_biobot.solid.dynamics.settings import DynamicsSettings, Scheme
from fem_biobot.solid.modes import modes
from fem_biobot.verification.blocks import box_mesh, on_three_corners
from fem_biobot.verification.records import Case, Claim, Finding, order

G = 9810.0  # mm/s^2
DENSITY = {"muscle": 1.1e-6}
EULER, MIDDLE, SOFT = Scheme.backward_euler, Scheme.energy_momentum, Scheme.soft_landing

# --- S13 --------------------------------------------------------------------------------------------------------------

SOFT_SIZE = (1.0, 0.8, 0.6)
ORDERS = {EULER: (1.0, (100, 200, 400)), MIDDLE: (2.0, (20, 40, 80)), SOFT: (2.0, (20, 40, 80))}


@cache
def soft_block(element: str = "P2") -> SolidModel:
    """A block of 0.5 kPa with muscle fibres across it."""
    tension = ActiveStress(0.05, np.array([0.6, 0.8, 0.0]))
    return SolidModel(
        box_mesh(1 if element == "P2" else 2, SOFT_SIZE), {"muscle": NeoHooke(0.5, 0.3)}, {"muscle": tension},
        supports=on_three_corners(SOFT_SIZE), element=element,
    )  # fmt: skip


def tumbling(settings: DynamicsSettings, drive: float = 0.0, damping_time: float = 0.0) -> SolidMotion:
    """The block in free flight, turning by more than half a turn; its muscle's factor rises with a rate [1/s]."""
    model = soft_block()
    velocity = rigid_velocity(model, (1.0, 2.0, -3.0), (40.0, 25.0, -60.0), (0.1, 0.3, 0.2))
    return solid_dynamics(
        model, 0.06, 2e-3, densities=DENSITY, free=True, velocity=velocity, settings=settings,
        drive=lambda t: drive * t, damping_time=damping_time,
    )  # fmt: skip


@cache
def swinging() -> float:
    """Time of one swing of a cantilever let go from its first mode, over the period of that mode [1]."""
    model = SolidModel(
        box_mesh((1, 1, 4), (1.0, 0.8, 6.0), shift=0.0), {"muscle": NeoHooke(100.0, 0.3)}, supports=[Fix("z0")]
    )
    rest = SolidState(model, Step(0.0, 0.0), np.zeros_like(model.system.space.points))
    first = modes(rest, DENSITY, 1)
    shape = first.shapes[0] / np.abs(first.shapes[0]).max()
    period = 1.0 / first.frequencies[0]
    found = solid_dynamics(
        model, 1.5 * period, period / 60.0, densities=DENSITY, start=SolidState(model, Step(0.0, 0.0), 1e-3 * shape),
        settings=DynamicsSettings(MIDDLE, tolerance=1e-9),
    )  # fmt: skip
    tip, t = np.einsum("sin,in->s", found.u, shape), found.times
    crossing = [
        t[k] - tip[k] * (t[k + 1] - t[k]) / (tip[k + 1] - tip[k]) for k in np.flatnonzero(tip[1:] * tip[:-1] < 0.0)
    ]
    return float((crossing[2] - crossing[0]) / period)


@cache
def observed(scheme: Scheme) -> float:
    """Order with which the end of a damped, driven motion settles as the step is halved."""
    counts = ORDERS[scheme][1]

    def end(n: int) -> np.ndarray:
        found = solid_dynamics(
            soft_block("P1"), 0.02, 0.02 / n, densities=DENSITY, gravity=(0.0, 50.0, -G), damping_time=3e-4,
            sample_every=n, drive=lambda t: np.sin(150.0 * t) ** 2, settings=DynamicsSettings(scheme, tolerance=1e-10),
        )  # fmt: skip
        return found.u[-1]

    ends = [end(n) for n in (*counts, 2 * counts[-1])]
    return order([1.0 / n for n in counts], [float(np.linalg.norm(a - b)) for a, b in pairwise(ends)])


def solid_in_motion() -> Finding:
    """S13: what a solid keeps in free flight, how fast it swings, and the order of the schemes.

    Problem: a soft block that tumbles; a cantilever let go; a block held on three corners, driven and damped.
    Measured: largest departure of angular momentum and energy from their first values, over these; a swing's time;
        slope of the differences between runs of ever shorter steps.
    Tolerance: what is kept, up to the tolerance of the steps (1e-11 of the forces) summed over 30 steps; the swing up
        to a step of a 60th of it, order two; orders within 0.15, which tells them apart.
    Cannot see: contact.
    Catches: forces at the end of the step in a scheme of the middle, lumped mass, drive at the wrong instant.
    """
    flight = tumbling(DynamicsSettings(MIDDLE, tolerance=1e-11))
    spin = flight.angular_momentum
    energy = flight.energy("kinetic") + flight.energy("strain")
    kept = (
        float(np.abs(spin - spin[0]).max() / np.linalg.norm(spin[0])),
        float(np.abs(energy - energy[0]).max() / energy[0]),
    )
    return Finding.of([*kept, swinging(), *(observed(scheme) for scheme in ORDERS)])


S13 = Case(
    "S13",
    "solid in motion",
    (
        Claim("angular momentum of a tumbling block, departure", 0.0, 1e-7, "1", "conservation, energy_momentum"),
        Claim("energy of a tumbling block, departure", 0.0, 1e-8, "1", "conservation, energy_momentum"),
        Claim("swing of a cantilever over its first mode's period", 1.0, 2e-3, "1", "eigenvalue of tangent and mass"),
        *(Claim(f"order of {scheme}", known, 0.15, "1", "declared") for scheme, (known, _) in ORDERS.items()),
    ),
    solid_in_motion,
)

# --- C7 ---------------------------------------------------------------------------------------------------------------

SIZE = (1.0, 0.8, 0.5)
ANGLE, SLIDING = float(np.radians(30.0)), 0.3
PRESSURE, HEIGHT = 7.0, 0.3


@cache
def block(element: str = "P2", young: float = 50.0) -> SolidModel:
    """A deformable block of a millimetre."""
    return SolidModel(
        box_mesh((2, 1, 1), SIZE), {"muscle": NeoHooke(young, 0.3)}, supports=on_three_corners(SIZE), element=element
    )


@cache
def on_slope(
    angle: float, friction: float, duration: float, step: float, element: str = "P2", scheme: Scheme = EULER
) -> SolidMotion:
    """The block put on a slope."""
    return solid_dynamics(
        block(element), duration, step, densities=DENSITY, gravity=(G * np.sin(angle), 0.0, -G * np.cos(angle)),
        free=True, ground=Ground(friction, friction), feet=["z0"], damping_time=1e-3, settings=DynamicsSettings(scheme),
    )  # fmt: skip


def acceleration(found: SolidMotion) -> float:
    """Mean acceleration down the slope in the second half of a motion [mm/s^2]."""
    v, middle = found.momentum[:, 0] / found.body.total_mass, len(found.times) // 2
    return float((v[-1] - v[middle]) / (found.times[-1] - found.times[middle]))


@cache
def pressed() -> SolidMotion:
    """A block under an even push on its top, on a ground without friction, come to rest."""
    model = SolidModel(
        box_mesh((3, 2, 2), SIZE), {"muscle": NeoHooke(50.0, 0.3)}, supports=on_three_corners(SIZE),
        loads=[Traction("z1", (0.0, 0.0, -PRESSURE))],
    )  # fmt: skip
    return solid_dynamics(
        model, 0.4, 0.01, densities=DENSITY, free=True, ground=Ground(0.0), feet=["z0"], damping_time=0.01,
        settings=DynamicsSettings(tolerance=1e-10),
    )  # fmt: skip


def unevenness(found: SolidMotion) -> float:
    """Largest departure of the last pressure at the sides of the facets from the push [kPa]."""
    assert found.feet is not None
    sides = found.feet.area > 0.0
    return float(np.abs(found.contact_force[-1, sides, 0] / found.feet.area[sides] - PRESSURE).max())


@cache
def falling(scheme: Scheme = EULER) -> SolidMotion:
    """A block turned so that a corner comes first, let fall."""
    model = block("P2", 20.0)
    X = model.system.space.points
    c, d = np.cos(0.5), np.sin(0.5)
    about_y = np.array([[c, 0.0, d], [0.0, 1.0, 0.0], [-d, 0.0, c]])
    x = about_y @ np.array([[1.0, 0.0, 0.0], [0.0, c, -d], [0.0, d, c]]) @ X
    x[2] += HEIGHT - x[2].min()
    return solid_dynamics(
        model, 0.06, 5e-4, densities=DENSITY, gravity=(0.0, 0.0, -G), free=True, ground=Ground(0.5, 0.4), feet=["z0"],
        damping_time=1e-3, start=SolidState(model, Step(0.0, 0.0), x - X), settings=DynamicsSettings(scheme),
    )  # fmt: skip


def lowest(found: SolidMotion) -> np.ndarray:
    """Height of the lowest contact point at the samples, (s,) [mm]."""
    assert found.feet is not None
    return (found.body.system.space.points[2] + found.u[:, 2])[:, found.feet.nodes].min(axis=1)


def solid_on_ground() -> Finding:
    """C7: a deformable block slides, rests, is pressed and falls.

    Problem: the block on slopes of 30 degrees (friction 0.3) and of nine tenths of its friction 0.5; under 7 kPa on its
        top; dropped by 0.3 mm onto a corner.
    Measured: acceleration; motion from 1 to 10 s at rest; pressures at the sides of quadratic facets; the lowest
        contact point, and what the book of energies leaves unexplained over the energy of the fall.
    Tolerance: 0.5 % of the acceleration; 1e-9 mm; the tolerance of the steps (1e-10 of the forces) with a factor of 10.
    Cannot see: friction that weakens from a rim inward.
    Catches: regularised friction, penalties that sink, forces lumped against the shape functions.
    """
    rest = on_slope(float(np.arctan(0.45)), 0.5, 10.0, 0.02)
    late = rest.u[rest.times >= 1.0]
    fall = falling()
    given = fall.body.total_mass * G * HEIGHT
    return Finding.of(
        [
            acceleration(on_slope(ANGLE, SLIDING, 0.04, 1e-3)),
            acceleration(on_slope(ANGLE, SLIDING, 0.04, 1e-3, scheme=SOFT)),
            float(np.abs(late - late[-1]).max()),
            unevenness(pressed()),
            max(-float(lowest(fall).min()), 0.0),
            float(np.abs(fall.energy_error).max() / given),
        ]
    )


_RATE = G * (np.sin(ANGLE) - SLIDING * np.cos(ANGLE))
C7 = Case(
    "C7",
    "deformable block on a ground",
    (
        *(
            Claim(
                f"acceleration on a slope of 30 degrees, {scheme}",
                _RATE,
                5e-3 * _RATE,
                "mm/s^2",
                "g (sin a - mu cos a)",
            )
            for scheme in (EULER, SOFT)
        ),
        Claim("motion in 9 s below the slope of its friction", 0.0, 1e-9, "mm", "Coulomb: true stick"),
        Claim("unevenness of its pressure under 7 kPa", 0.0, 7e-8, "kPa", "contact patch test"),
        Claim("depth of its contact points in a fall on a corner", 0.0, 1e-9, "mm", "unilateral contact"),
        Claim("energy left unexplained over that of the fall", 0.0, 1e-6, "1", "conservation"),
    ),
    solid_on_ground,
)

CASES = (S13, C7)

"""S14 and S15: solids whose motion resists itself: muscle that feels its velocity, and a body in a medium."""

from __future__ import annotations

from functools import cache

import numpy as np

from fem_biobot import (
    ActiveStress,
    Body,
    Fix,
    ForceVelocity,
    Foundation,
    Hold,
    Muscle,
    MuscleCurve,
    NeoHooke,
    PointLoad,
    RodModel,
    SolidModel,
    SolidMotion,
    Step,
    SurfaceDrag,
    Symmetry,
    Traction,
    dynamics,
    solid_dynamics,
)
from fem_biobot.solid.dynamics.settings import DynamicsSettings, Scheme
from fem_biobot.verification.blocks import box_mesh, on_three_corners
from fem_biobot.verification.records import Case, Claim, Curve, Finding, Graph

SIZE = (1.0, 0.8, 0.5)
SECTION = SIZE[1] * SIZE[2]

# --- S14 --------------------------------------------------------------------------------------------------------------

PASSIVE, ACTIVE, YOUNG = 1.5, 6.0, 9.0
FASTEST, K, ECCENTRIC = 3.0, 0.2, 1.6
RATES = (-2.0, -0.6, 1.5)  # of a strip moved by its end [1/s]
# lifted or let down, of the stimulated force, by the solid and by the rods: apart, so that a picture shows both
LOADS, OTHERS = (0.1, 0.35, 0.8, 1.25), (0.2, 0.55, 0.9, 1.4)
_C = (ECCENTRIC - 1.0) * K / (1.0 + K)


def hill(rate: float) -> float:
    """Share of the force at a rate of stretch, of A. V. Hill (1938) in shortening."""
    y = rate / FASTEST
    return max(1.0 + y, 0.0) / (1.0 - y / K) if y < 0.0 else 1.0 + (ECCENTRIC - 1.0) * y / (y + _C)


def rate_under(load: float) -> float:
    """Rate at which a share of the force is lifted, or let down."""
    return FASTEST * (-(1.0 - load) / (1.0 + load / K) if load < 1.0 else _C * (load - 1.0) / (ECCENTRIC - load))


def _strip(young: float, supports: tuple[Fix, ...], loads: tuple[Traction, ...] = ()) -> SolidModel:
    """A block of muscle along x that keeps its section, held at its left face."""
    fibres = ActiveStress(
        PASSIVE + ACTIVE, np.array([1.0, 0.0, 0.0]), standing=PASSIVE,
        force_velocity=ForceVelocity(FASTEST, K, ECCENTRIC),
    )  # fmt: skip
    held = [Symmetry("x0"), Symmetry("y0"), Symmetry("z0"), *supports]
    return SolidModel(box_mesh(1, SIZE), {"muscle": NeoHooke(young, 0.0)}, {"muscle": fibres}, held, list(loads), "P1")


@cache
def shares_of_the_force() -> tuple[float, ...]:
    """Stimulated force of a strip moved at constant rates, over the isometric: from the reaction, less all else."""
    found = []
    for rate in RATES:
        model = _strip(YOUNG, (Fix("x1", "x", 0.1 * rate * SIZE[0]),))
        motion = solid_dynamics(
            model, 0.1, 0.0125, densities={"muscle": 1e-12}, drive=lambda t: Step(10.0 * t, 1.0, time=t),
            settings=DynamicsSettings(Scheme.soft_landing, tolerance=1e-12),
            velocity=np.array([[rate], [0.0], [0.0]]) * model.system.space.points,
        )  # fmt: skip
        s = 1.0 + 0.1 * rate
        nominal = -motion.state(-1).reaction("x0")[0] / SECTION
        found.append((nominal - PASSIVE - 0.5 * YOUNG * (s - 1.0 / s)) / ACTIVE)
    return tuple(found)


@cache
def rates_of_the_solid() -> tuple[float, ...]:
    """Rates of a strip of soft tissue under constant loads, in its last step [1/s]."""
    found = []
    for load in LOADS:
        model = _strip(1e-4 * ACTIVE, (), (Traction("x1", (PASSIVE + load * ACTIVE, 0.0, 0.0)),))
        motion = solid_dynamics(model, 0.04, 4e-3, densities={"muscle": 1e-12}, drive=lambda t: Step(1.0, 1.0, time=t))
        far = model.mesh.landmarks["corner_100"]
        found.append(float(np.diff(motion.u[-2:, 0, far])[0]) / 4e-3 / SIZE[0])
    return tuple(found)


@cache
def rates_of_the_rods() -> tuple[float, ...]:
    """The same of a muscle member between a held and a free ball, once that moves evenly."""
    post, ball = ("post", (0.0, 0.0, 0.0)), ("ball", (SIZE[0], 0.0, 0.0))
    curve = MuscleCurve.hill(FASTEST, K, ECCENTRIC)
    found = []
    for load in OTHERS:
        pull = SECTION * (PASSIVE + load * ACTIVE)
        model = RodModel(
            bodies=[Body(p, 1e-3, (1e-3,) * 3, n) for n, p in (post, ball)], supports=[Hold(post)],
            loads=[PointLoad(ball, force=(pull, 0.0, 0.0))],
            members=[Muscle(post, ball, SECTION, 0.0, PASSIVE, ACTIVE, force_velocity=curve)],
        )  # fmt: skip
        motion = dynamics(model, 0.06, 5e-4, drive=lambda t: 1.0)
        found.append(float(motion.v[-1, model.atlas.node_of["ball", 0], 0]) / SIZE[0])
    return tuple(found)


def muscle_by_velocity() -> Finding:
    """S14: the stimulated force of solid and rods over the rate of the fibre's stretch.

    Problem: a strip moved at constant rates; a strip, and a muscle member, that lift a constant load or let it down.
    Measured: the reaction less standing tension and tissue, over the isometric force; rates of stretch.
    Tolerance: of the force, the steps' (1e-12) through the reaction; of the rates, the strip's own stiffness (a
        ten-thousandth of its tension, times the curve's slope), and the table of 1025 points of the rods.
    Cannot see: whether engineered tissue obeys Hill's curve.
    Catches: the standing tension slowed, rates relative to the length reached, the curvature's inverse.
    """
    forces, solid, rods = shares_of_the_force(), rates_of_the_solid(), rates_of_the_rods()
    rates = np.linspace(-FASTEST, 0.8 * FASTEST, 121)
    graph = Graph(
        "rate of the fibre's stretch [1/s]", "force over the isometric [1]",
        (
            Curve("Hill 1938", rates, [hill(float(r)) for r in rates], known=True),
            Curve("strip moved", RATES, forces),
            Curve("strip under a load", solid, LOADS),
            Curve("member under a load", rods, OTHERS),
        ),
    )  # fmt: skip
    return Finding.of([*forces, *solid, *rods], graph)


S14 = Case(
    "S14",
    "muscle that feels its velocity",
    (
        *(
            Claim(f"force over the isometric at {rate:g} /s, solid", hill(rate), 1e-10, "1", "Hill 1938")
            for rate in RATES
        ),
        *(
            Claim(f"rate under {load:g} of the force, {model}", rate_under(load), tolerance, "1/s", "Hill 1938")
            for model, loads, tolerance in (("solid", LOADS, 2e-4), ("rods", OTHERS, 1e-6))
            for load in loads
        ),
    ),
    muscle_by_velocity,
)

# --- S15 --------------------------------------------------------------------------------------------------------------

G, DENSITY, MEDIUM = 9810.0, 1.2e-6, 1.0e-6
LINEAR, QUADRATIC = 2e-6, 3e-7  # kPa s/mm, kg/mm^3
VOLUME = SIZE[0] * SECTION
MASS = DENSITY * VOLUME
SURFACE = 2.0 * (SIZE[0] * SIZE[1] + SIZE[1] * SIZE[2] + SIZE[0] * SIZE[2])
WEIGHT = (DENSITY - MEDIUM) * VOLUME * G
TOP = 2.0 * WEIGHT / (SURFACE * (LINEAR + float(np.sqrt(LINEAR**2 + 4.0 * QUADRATIC * WEIGHT / SURFACE))))


@cache
def sunk() -> SolidMotion:
    """A block that sinks until it falls no faster."""
    model = SolidModel(box_mesh(1, SIZE), {"muscle": NeoHooke(2e3, 0.3)}, supports=on_three_corners(SIZE))
    tau = MASS * TOP / WEIGHT
    return solid_dynamics(
        model, 40.0 * tau, 2.0 * tau, densities={"muscle": DENSITY}, gravity=(0.0, 0.0, -G), medium_density=MEDIUM,
        free=True, drag=SurfaceDrag(LINEAR, QUADRATIC), damping_time=1e-4, settings=DynamicsSettings(tolerance=1e-11),
    )  # fmt: skip


@cache
def fading(share: float = 0.02) -> tuple[float, float]:
    """Rate at which the inverse amplitude of a swinging block grows by quadratic drag, over theirs; work not explained.

    The envelope of weak damping is ``1 / A = 1 / A_0 + 4 b S w t / (3 pi m)``; `share` is ``b S A_0 / m``.
    """
    stiffness, begin = 0.02, 0.05
    w = float(np.sqrt(stiffness * SIZE[0] * SIZE[1] / MASS))
    supports = [Fix("z0", "xy"), Foundation("z0", stiffness, 0.0)]
    model = SolidModel(box_mesh(1, SIZE), {"muscle": NeoHooke(2e3, 0.3)}, supports=supports, element="P1")
    period = 2.0 * np.pi / w
    motion = solid_dynamics(
        model, 5.0 * period, period / 100.0, densities={"muscle": DENSITY}, velocity=(0.0, 0.0, begin * w),
        drag=SurfaceDrag(0.0, share / begin * MASS / SURFACE),
        settings=DynamicsSettings(Scheme.energy_momentum, tolerance=1e-11),
    )  # fmt: skip
    z, t = motion.centre_of_mass[:, 2] - motion.centre_of_mass[0, 2], motion.times
    tops = []
    for i in range(1, len(z) - 1):
        if abs(z[i - 1]) < abs(z[i]) >= abs(z[i + 1]):  # the top of the parabola through three samples
            bend, rise = z[i - 1] - 2.0 * z[i] + z[i + 1], 0.5 * (z[i + 1] - z[i - 1])
            tops.append((t[i] - rise / bend * (t[1] - t[0]), 1.0 / abs(z[i] - 0.5 * rise**2 / bend)))
    times, inverse = np.array(tops).T
    rate = float(np.polyfit(times, inverse, 1)[0])
    lost = abs(float(motion.energy("drag")[-1]))
    return rate / (4.0 * share / begin * w / (3.0 * np.pi)), float(np.abs(motion.energy_error).max()) / lost


def solid_in_a_medium() -> Finding:
    """S15: drag of a medium on a solid's surface.

    Problem: a block that sinks, and one that swings on springs, with linear and quadratic drag on its whole surface.
    Measured: the speed after forty relaxation times by steps of two, and the work of drag in the last step over that of
        the weight; the fall of the amplitude over five swings; what the book of energies leaves unexplained.
    Tolerance: the steps' (1e-11) for what is steady; the next order of the envelope and a hundred steps in a swing.
    Cannot see: whether a medium drags like that.
    Catches: facets inside the body, half of the square, drag at another instant than the step's, work booked elsewhere.
    """
    motion = sunk()
    speed = -float(motion.momentum[-1, 2]) / motion.body.total_mass
    fall = motion.centre_of_mass[-2, 2] - motion.centre_of_mass[-1, 2]
    return Finding.of([speed, -np.diff(motion.energy("drag"))[-1] / (WEIGHT * fall), *fading()])


S15 = Case(
    "S15",
    "solid in a medium",
    (
        Claim("terminal speed of a sinking block", TOP, 1e-8 * TOP, "mm/s", "weight = S (a v + b v^2)"),
        Claim("work of drag over that of the weight", 1.0, 1e-6, "1", "conservation"),
        Claim("fall of a swing's amplitude over the envelope's", 1.0, 5e-3, "1", "1/A - 1/A_0 = 4 b S w t / (3 pi m)"),
        Claim("energy left unexplained over that lost by drag", 0.0, 1e-6, "1", "conservation"),
    ),
    solid_in_a_medium,
)

CASES = (S14, S15)

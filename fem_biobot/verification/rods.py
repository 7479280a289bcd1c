"""R1 to R5: cantilever rods in equilibrium at large deflection."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from fem_biobot import DistributedLoad, Hold, PointLoad, Rod, RodMaterial, RodModel, RodState, Section, statics
from fem_biobot.verification.records import (
    Case,
    Claim,
    Curve,
    Finding,
    Graph,
    extrapolated,
    observed_order,
    order,
    worst,
)
from fem_biobot.verification.rod_parts import arc, rod_of, stiff, straight

Array = NDArray[np.float64]

CLAMP = Hold(("rod", 0))
TIP = ("rod", -1)
_HALVED = [4.0, 2.0, 1.0]

# --- R1 ---------------------------------------------------------------------------------------------------------------

ROLL_LENGTH, ROLL_BENDING = 13.0, 2.3


def rolled(share: float, n: int) -> RodState:
    """A cantilever under a share of the moment that rolls it into a circle; its section could deform otherwise too."""
    L, EI = ROLL_LENGTH, ROLL_BENDING
    rod = rod_of(straight(n, L), (40.0, 50.0, 70.0, 5.1, EI, 1.7), normal=(0.0, 1.0, 0.0))
    moment = PointLoad(TIP, moment=(0.0, 0.0, 2.0 * np.pi * share * EI / L))
    return statics(RodModel([rod], supports=[CLAMP], loads=[moment]), tolerance=1e-13).last


def circle(share: float, angle: Array) -> Array:
    """Points of the rolled rod at angles of its tangent, (k, 3) [mm]."""
    radius = ROLL_LENGTH / (2.0 * np.pi * share)
    return radius * np.stack([np.sin(angle), 1.0 - np.cos(angle), 0.0 * angle], axis=1)


def roll_up() -> Finding:
    """R1: an end moment rolls a cantilever into a circle.

    Problem: a straight rod of seven elements, clamped, under the end moment 2 pi E I / L or half of it.
    Measured: displacement of the tip; the node farthest from the circle.
    Tolerance: 1e-11 L: the element is exact at constant strain, residuals are 1e-13 of the moment over L^2 / E I.
    Cannot see: variable strain.
    Catches: the chord for the arc, E I of the other axis, a moment that is halved.
    """
    values: list[float] = []
    curves: list[Curve] = []
    apart = []
    for share in (1.0, 0.5):
        state = rolled(share, 7)
        values += list(state.displacement(TIP)[:2] / ROLL_LENGTH)
        points = state.points("rod")
        angle = 2.0 * np.pi * share * np.linspace(0.0, 1.0, len(points))
        apart.append(float(np.abs(points - circle(share, angle)).max()))
        fine = circle(share, np.linspace(0.0, angle[-1], 181))
        curves += [
            Curve(f"circle, {share:g} of the moment", fine[:, 0], fine[:, 1], known=True),
            Curve(f"rod, {share:g} of the moment", points[:, 0], points[:, 1]),
        ]
    graph = Graph("x [mm]", "y [mm]", tuple(curves), equal=True)
    return Finding.of([*values, worst(apart, 0.0) / ROLL_LENGTH], graph)


R1 = Case(
    "R1",
    "roll-up by an end moment",
    (
        Claim("tip displacement x / L, whole circle", -1.0, 1e-11, "1", "M = 2 pi E I / L: a circle"),
        Claim("tip displacement y / L, whole circle", 0.0, 1e-11, "1", "M = 2 pi E I / L: a circle"),
        Claim("tip displacement x / L, half of it", -1.0, 1e-11, "1", "M = pi E I / L: half a circle"),
        Claim("tip displacement y / L, half of it", 2.0 / np.pi, 1e-11, "1", "M = pi E I / L: half a circle"),
        Claim("node farthest from the circle / L", 0.0, 1e-11, "1", "constant curvature"),
    ),
    roll_up,
)

# --- R2, R3 -----------------------------------------------------------------------------------------------------------

# P L^2 / E I: w / L, u / L
ELASTICA = {
    1.0: (0.301721, 0.056433),
    2.0: (0.493457, 0.160642),
    5.0: (0.713792, 0.387628),
    10.0: (0.810609, 0.554996),
}
# q L^3 / E I: x / L, y / L as printed; the same of the differential equation, to ten digits
DEAD_LOAD = {5.0: (0.8467, 0.4959), 15.0: (0.5296, 0.7860), 25.0: (0.3862, 0.8559)}
DEAD_LOAD_EXACT = {
    5.0: (0.8466571800, 0.4959050446),
    15.0: (0.5295658917, 0.7860428917),
    25.0: (0.3861597509, 0.8559002110),
}
# of the order: a load along the rod, integrated as parabolas at its ends, follows its order on finer meshes alone
_MESHES = {"tip": (20, 40, 80), "all along": (80, 160, 320)}


@cache
def bent(n: int, load: str, size: float) -> RodState:
    """A cantilever of unit length and bending stiffness under a dead `load` across it, all but inextensible.

    The load is ``"tip"`` or ``"all along"``, per drawn length. Stiffnesses of 1e8 E I / L^2 leave P / EA, below 1e-7.
    """
    force = (0.0, -size, 0.0)
    loads = [PointLoad(TIP, force=force) if load == "tip" else DistributedLoad("rod", force=force)]
    return statics(RodModel([rod_of(straight(n), stiff())], supports=[CLAMP], loads=loads)).last


def _limit(load: str, size: float) -> tuple[Array, float]:
    """Tip displacement of 80 elements, and the order at which three meshes approach their limit."""
    tips = [bent(n, load, size).displacement(TIP) for n in _MESHES[load]]
    return bent(80, load, size).displacement(TIP), observed_order(*tips)


def _shapes(load: str, tips: dict[float, tuple[float, float]]) -> Graph:
    """Bent rods, and the known places of their tips by the size of the load."""
    curves = []
    for size in tips:
        points = bent(_MESHES[load][0], load, size).points("rod")
        curves.append(Curve(f"rod at {size:g}", points[:, 0], points[:, 1]))
    known = np.array([[x, -y] for x, y in tips.values()])
    curves.append(Curve("known tips", known[:, 0], known[:, 1], known=True, joined=False))
    return Graph("x / L [1]", "y / L [1]", tuple(curves), equal=True)


def tip_force_elastica() -> Finding:
    """R2: a dead tip force bends the elastica.

    Problem: cantilever, inextensible and unshearable in the limit, dead force across its tip.
    Measured: tip displacement of 80 elements; the order from 20, 40 and 80.
    Tolerance: half of the last printed digit and P / EA, 1e-7; a tenth of an order.
    Cannot see: stretch, shear, three dimensions.
    Catches: a force that turns along, a membrane that locks, a load applied twice.
    """
    limits, rates = zip(*(_limit("tip", P) for P in ELASTICA), strict=True)
    values = [component for limit in limits for component in (-limit[1], -limit[0])]
    tips = {P: (1.0 - u, w) for P, (w, u) in ELASTICA.items()}
    return Finding.of([*values, worst(rates, 4.0)], _shapes("tip", tips))


R2 = Case(
    "R2",
    "elastica under a tip force",
    (
        *(
            Claim(f"{name}, P L^2 / E I = {P:g}", value, 6e-7, "1", "elastica, elliptic integrals")
            for P, pair in ELASTICA.items()
            for name, value in zip(("w / L", "u / L"), pair, strict=True)
        ),
        Claim("order in the element length, farthest from 4", 4.0, 0.1, "1", "declared"),
    ),
    tip_force_elastica,
)


def distributed_dead_load() -> Finding:
    """R3: a dead load along the rod.

    Problem: cantilever, inextensible and unshearable in the limit, dead load per drawn length.
    Measured: tip of 80 elements, against the printed digits and against those of the differential equation; the order
        from 80, 160 and 320: at the ends, where a parabola is integrated, the next order is as large on coarse meshes.
    Tolerance: half of the last printed digit; 1e-6 against the differential equation, q / EA included; a tenth of an
        order.
    Cannot see: stretch, shear, three dimensions.
    Catches: half an element's load lost at an end, load per present length.
    """
    limits, rates = zip(*(_limit("all along", q) for q in DEAD_LOAD), strict=True)
    tips = [(1.0 + limit[0], -limit[1]) for limit in limits]
    apart = [float(np.abs(np.subtract(tip, DEAD_LOAD_EXACT[q])).max()) for q, tip in zip(DEAD_LOAD, tips, strict=True)]
    return Finding.of([*np.ravel(tips), worst(apart, 0.0), worst(rates, 4.0)], _shapes("all along", DEAD_LOAD_EXACT))


R3 = Case(
    "R3",
    "elastica under a dead load along it",
    (
        *(
            Claim(f"{name}, q L^3 / E I = {q:g}", value, 5.1e-5, "1", "published, as quoted")
            for q, pair in DEAD_LOAD.items()
            for name, value in zip(("x / L", "y / L"), pair, strict=True)
        ),
        Claim("tip farthest from the differential equation's", 0.0, 1e-6, "1", "E I theta'' = -q (L - s) cos(theta)"),
        Claim("order in the element length, farthest from 4", 4.0, 0.1, "1", "declared"),
    ),
    distributed_dead_load,
)

# --- R4 ---------------------------------------------------------------------------------------------------------------

RADIUS, BEND_YOUNG, BEND_FORCE = 100.0, 1e7, 600.0
# of the square section of side 1 with nu = 0 and J = 1/6: GA1, GA2, EA, EI1, EI2, GJ
BEND_STIFFNESS = tuple(BEND_YOUNG / k for k in (2.0, 2.0, 1.0, 12.0, 12.0, 12.0))
QUOTED = np.array([-23.5, -13.4, 53.4])
# of the rod's differential equation
BEND_EXACT = np.array([-23.5602395450, -13.6045213473, 53.4748587918])


@cache
def bend_state(n: int) -> RodState:
    """An eighth of a circle, clamped, under a dead force out of its plane."""
    rod = rod_of(arc(n, RADIUS, np.pi / 4), BEND_STIFFNESS)
    load = PointLoad(TIP, force=(0.0, 0.0, BEND_FORCE))
    return statics(RodModel([rod], supports=[CLAMP], loads=[load])).last


def bend_of_45_degrees() -> Finding:
    """R4: the 45-degree bend.

    Problem: arc of radius 100 and 45 degrees, section 1 x 1, E = 1e7, nu = 0, J = 1/6, shear factor 1, dead tip force
        of 600 out of its plane.
    Measured: tip displacement with eight elements against the quoted one; extrapolated from 16 and 32 elements at
        order 2 against the solution of the rod's differential equation; the order from 16 to 64.
    Tolerance: 1 % of the quoted length; 1e-6 of it for what the extrapolation leaves, of order 4; 0.05 of an order:
        bent and twisted at once, elements are of second order.
    Cannot see: sections that warp.
    Catches: curvature of the drawing lost or counted as strain, torsion and bending exchanged.
    """
    tips = {n: bend_state(n).displacement(TIP) for n in (8, 16, 32, 64)}
    limit = extrapolated(tips[16], tips[32])
    rate = order(_HALVED, [float(np.linalg.norm(tips[n] - BEND_EXACT)) for n in (16, 32, 64)])
    size = float(np.linalg.norm(QUOTED))
    points = bend_state(8).points("rod")
    tip = arc(1, RADIUS, np.pi / 4)[-1] + QUOTED
    curves = (
        Curve("rod, eight elements", points[:, 1], points[:, 2]),
        Curve("rod, drawn", arc(8, RADIUS, np.pi / 4)[:, 1], np.zeros(9)),
        Curve("tip, Bathe and Bolourchi", tip[1:2], tip[2:], known=True, joined=False),
    )
    values = [float(np.linalg.norm(tips[8] - QUOTED)) / size, *limit, rate]
    return Finding.of(values, Graph("y [mm]", "z [mm]", curves, equal=True))


R4 = Case(
    "R4",
    "45-degree bend",
    (
        Claim("error of the tip over its displacement, 8 elements", 0.0, 0.01, "1", "Bathe and Bolourchi 1979"),
        *(
            Claim(f"tip displacement along {name}", float(value), 6e-5, "mm", "Simo 1985, differential equation")
            for name, value in zip("xyz", BEND_EXACT, strict=True)
        ),
        Claim("order in the element length", 2.0, 0.05, "1", "declared"),
    ),
    bend_of_45_degrees,
)

# --- R5 ---------------------------------------------------------------------------------------------------------------

THICK_FORCE = 15.0


@cache
def thick_tip(n: int, factor: float, force: float, elements: str = "corrected") -> float:
    """Tip deflection of a short round cantilever of shear factor `factor` [mm], of `elements` (`Discretisation`)."""
    section = Section.circle(0.25, shear_factor=factor)
    material = RodMaterial(young=1e6, density=1e-6, shear_modulus=1e4)
    rod = Rod(straight(n, 3.0), section, material, discretisation=elements)
    load = PointLoad(TIP, force=(0.0, -force, 0.0))
    return -float(statics(RodModel([rod], supports=[CLAMP], loads=[load])).last.displacement(TIP)[1])


def timoshenko_cantilever() -> Finding:
    """R5: a short thick cantilever.

    Problem: E = 1e6, G = 1e4, round section of radius 0.25, length 3, tip force 15 and a thousandth of it.
    Measured: tip of 20 elements; at small load of three, scaled back.
    Tolerance: half of the last printed digit; at small load the square of the slope, 2e-5^2, matters less.
    Cannot see: distributed load, other sections.
    Catches: the shear factor on the wrong side, G for E, shear left out, a linearised rod.
    """
    values = [1e3 * thick_tip(3, factor, 1e-3 * THICK_FORCE) for factor in (4 / 3, 27 / 28)]
    return Finding.of([*values, thick_tip(20, 4 / 3, THICK_FORCE)])


R5 = Case(
    "R5",
    "Timoshenko cantilever",
    (
        Claim("tip, linear limit, shear factor 4/3", 0.0611918925, 1e-10, "mm", "F L^3 / 3 E I + F L / k G A"),
        Claim("tip, linear limit, shear factor 27/28", 0.0677702968, 1e-10, "mm", "F L^3 / 3 E I + F L / k G A"),
        Claim("tip at full load, shear factor 4/3", 0.0611734, 6e-8, "mm", "Simo 1985, differential equation"),
    ),
    timoshenko_cantilever,
)

CASES = (R1, R2, R3, R4, R5)

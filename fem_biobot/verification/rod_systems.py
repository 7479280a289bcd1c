"""R6 to R8: frequencies, free flight and helical buckling of rods."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from fem_biobot import (
    Hold,
    Motion,
    Rod,
    RodMaterial,
    RodModel,
    RodState,
    Section,
    dynamics,
    modes,
    reaction,
    statics,
)
from fem_biobot.rod.dynamics.integrate import Integrator, Settings
from fem_biobot.verification.blocks import rotation, unit
from fem_biobot.verification.records import Case, Claim, Curve, Finding, Graph, extrapolated, order, worst
from fem_biobot.verification.rod_parts import rod_of, straight

Array = NDArray[np.float64]

_HALVED = [4.0, 2.0, 1.0]

# --- R6 ---------------------------------------------------------------------------------------------------------------

# of cos cosh = -1 (clamped-free) and of cos cosh = 1 (free)
CLAMPED_FREE = (1.8751040687, 4.6940911330, 7.8547574382, 10.9955407349)
FREE = (4.7300407449, 7.8532046241, 10.9956078380, 14.1371654913)
_ELEMENTS = (30, 60, 120)


def frequency_roots(n: int, clamped: bool, elements: str = "corrected") -> Array:
    """``(w^2 m / E I)^(1/4) L`` of the first four bending modes in one plane, the other being far stiffer, (4,)."""
    EI, m, L = 2.0, 3e-6, 7.0
    stiffness = (1e6, 1e6, 1e6, 1e4 * EI, EI, 1e4)
    rod = rod_of(straight(n, L), stiffness, mass_per_length=m, normal=(0.0, 1.0, 0.0), discretisation=elements)
    rigid = 0 if clamped else 6
    found = modes(RodModel([rod], supports=[Hold(("rod", 0))] if clamped else []), count=4 + rigid)
    return (found.squares[rigid:] * m / EI) ** 0.25 * L


def bending_frequencies() -> Finding:
    """R6: frequencies of slender rods, clamped at one end and free.

    Problem: a rod that bends in one plane, of 60 elements; the same of 30, 60 and 120 plain ones.
    Measured: four roots; the order of each of plain elements, the farthest from 2.
    Tolerance: 2e-5 of the root: rotary inertia and the other stiffnesses are below 1e-5, as is the error of fourth
        order; a tenth of an order.
    Cannot see: damping, motion of finite size.
    Catches: whole instead of half masses at the ends, the wrong plane, squares taken for frequencies.
    """
    values: list[float] = []
    rates: list[float] = []
    curves: list[Curve] = []
    number = np.arange(1, 5)
    for words, clamped, exact in (("clamped-free", True, CLAMPED_FREE), ("free", False, FREE)):
        found = frequency_roots(_ELEMENTS[1], clamped)
        plain = [frequency_roots(n, clamped, "plain") for n in _ELEMENTS]
        values += list(found)
        rates += [order(_HALVED, [abs(f[mode] - exact[mode]) for f in plain]) for mode in range(4)]
        curves.append(Curve(f"{words}, roots", number, exact, known=True, joined=False))
        curves.append(Curve(f"{words}, rod", number, found))
    graph = Graph("mode [1]", "(w^2 m / E I)^(1/4) L [1]", tuple(curves))
    return Finding.of([*values, worst(rates, 2.0)], graph)


R6 = Case(
    "R6",
    "frequencies of a slender rod",
    (
        *(
            Claim(f"root {k}, {words}", root, 2e-5 * root, "1", source)
            for words, roots, source in (
                ("clamped-free", CLAMPED_FREE, "Euler-Bernoulli: cos cosh = -1"),
                ("free", FREE, "Euler-Bernoulli: cos cosh = 1"),
            )
            for k, root in enumerate(roots, start=1)
        ),
        Claim("order of plain elements, farthest from 2", 2.0, 0.1, "1", "declared"),
    ),
    bending_frequencies,
)

# --- R7 ---------------------------------------------------------------------------------------------------------------

EXPLICIT = Settings(integrator=Integrator.explicit)
CONSERVING = Settings(dissipation=0.0, tolerance=1e-11)


def gel_strip(n: int = 8) -> Rod:
    """12 mm of a gel strip, 1.5 by 0.8 mm, in a generic direction."""
    points = np.linspace(0.0, 12.0, n + 1)[:, None] * unit(1.0, -2.0, 0.5)
    return Rod(points, Section.rectangle(1.5, 0.8), RodMaterial(young=300.0, poisson=0.45, density=1.1e-6))


def thrown(model: RodModel) -> RodState:
    """As drawn, moving as a rigid body, with some stretching and bending."""
    state = model.drawn()
    spin, away = np.array([9.0, -5.0, 14.0]), state.x - state.centre_of_mass
    v = np.concatenate([np.cross(spin, away) + np.array([40.0, 25.0, -60.0]), np.tile(spin, (len(away), 1))], axis=1)
    along = np.linspace(-1.0, 1.0, len(away))[:, None]
    v[:, :3] += along**2 * rotation()[0] * 30.0 + 4.0 * away
    return replace(state, v=v)


def drift(motion: Motion) -> tuple[float, float, float]:
    """Largest relative change of momentum, angular momentum and energy."""
    p, L, E = motion.momentum, motion.angular_momentum, motion.book[:, :2].sum(axis=1)
    return (
        float(np.abs(p - p[0]).max() / np.linalg.norm(p[0])),
        float(np.abs(L - L[0]).max() / np.linalg.norm(L[0])),
        float(np.abs(E - E[0]).max() / E[0]),
    )


@cache
def flight(duration: float, step: float, settings: Settings, every: int = 8) -> Motion:
    """The strip thrown, without ground or load."""
    model = RodModel([gel_strip()])
    return dynamics(model, duration, step, start=thrown(model), sample_every=every, settings=settings)


def free_flight() -> Finding:
    """R7: a free rod tumbles and swings.

    Problem: a straight strip of gel, thrown with a spin about a generic axis and set swinging, without any load.
    Measured: largest change of linear and angular momentum over 0.2 s of explicit steps and over 0.08 s of implicit
        ones without dissipation; the order in the step of the energy's error, once steps resolve waves along it.
    Tolerance: rounding of a sum over the steps (1e-16 a step) for explicit ones; for implicit ones the tolerance of
        their impulses, which are at most twice the momentum; 0.2 of an order.
    Cannot see: forces that are wrong but derive from an energy of their own.
    Catches: rotational update in the body frame, forces at the end of the step, a scheme that drifts.
    """
    long = flight(0.2, 1e-5, EXPLICIT, 100)
    explicit = [drift(flight(0.02, h, EXPLICIT))[2] for h in (2e-5, 1e-5)]
    implicit = {h: flight(0.08, h, CONSERVING, 1) for h in (2e-4, 1e-4, 2.5e-5)}
    energies = [drift(implicit[h])[2] for h in (1e-4, 2.5e-5)]
    values = [
        *drift(long)[:2],
        float(np.log2(explicit[0] / explicit[1])),
        *drift(implicit[2e-4])[:2],
        float(np.log2(energies[0] / energies[1])) / 2.0,
    ]
    curves = [Curve("no change", [0.0, 0.08], [0.0, 0.0], known=True)]
    for h, motion in implicit.items():
        total = motion.book[:, :2].sum(axis=1)
        curves.append(Curve(f"implicit, {1e3 * h:g} ms", motion.times, 1e6 * (total / total[0] - 1.0)))
    return Finding.of(values, Graph("time [s]", "change of the energy [1e-6]", tuple(curves)))


R7 = Case(
    "R7",
    "free flight of a swinging rod",
    (
        Claim("change of momentum, 20000 explicit steps", 0.0, 2e-12, "1", "Newton"),
        Claim("change of angular momentum, 20000 explicit steps", 0.0, 2e-12, "1", "Euler"),
        Claim("order in the step of the energy, explicit", 2.0, 0.15, "1", "declared (Stoermer-Verlet)"),
        Claim("change of momentum, 400 implicit steps", 0.0, 8e-9, "1", "Newton"),
        Claim("change of angular momentum, 400 implicit steps", 0.0, 8e-9, "1", "Euler"),
        Claim("order in the step of the energy, implicit", 2.0, 0.2, "1", "declared"),
    ),
    free_flight,
)

# --- R8 ---------------------------------------------------------------------------------------------------------------

HELIX_LENGTH, HELIX_BENDING, HELIX_TWIST, SLACK, TURNS = 100.0, 1.345, 0.789, 3.0, 27.0
HELIX_MOMENT, HELIX_TENSION = 98.541496171190744, 2900.993205792131
_HELIX_MESHES = (100, 200, 400)


def localised_angle(s: Array) -> Array:
    """Angle of the tangent to the axis in the localised solution, s from -1/2 to 1/2 [rad]."""
    t = 1.0 - HELIX_MOMENT**2 / (4.0 * HELIX_TENSION)
    return np.arccos(1.0 - 2.0 * t / np.cosh(s * np.sqrt(HELIX_TENSION * t)) ** 2)


@cache
def helix(n: int) -> RodState:
    """Equilibrium near the localised solution, ends held at a distance and turned by all turns."""
    M, ratio = HELIX_MOMENT, HELIX_BENDING / HELIX_TWIST

    def along(s: float, y: Array) -> Array:
        theta = localised_angle(np.array(s))
        turn = M / (1.0 + np.cos(theta))
        tangent = [np.sin(theta) * np.cos(y[3]), np.sin(theta) * np.sin(y[3]), np.cos(theta)]
        # twist M / C all along
        return np.array([*tangent, turn, M * ratio - turn * np.cos(theta)])

    s = np.linspace(-0.5, 0.5, n + 1)
    x, y, z, psi, phi = solve_ivp(along, (-0.5, 0.5), np.zeros(5), t_eval=s, rtol=1e-9, atol=1e-11).y
    theta = localised_angle(s)
    theta[[0, -1]] = 0.0
    R = Rotation.from_euler("ZYZ", np.stack([psi, theta, phi], axis=1)).as_matrix()
    R[-1] = Rotation.from_rotvec([0.0, 0.0, 2 * np.pi * TURNS]).as_matrix()
    points = HELIX_LENGTH * np.stack([x, y, z], axis=1)
    points[0], points[-1] = 0.0, [0.0, 0.0, HELIX_LENGTH - SLACK]
    stiffness = (1e7, 1e7, 1e7, HELIX_BENDING, HELIX_BENDING, HELIX_TWIST)
    rod = rod_of(straight(n, HELIX_LENGTH, (0.0, 0.0, 1.0)), stiffness, normal=(1.0, 0.0, 0.0))
    model = RodModel([rod], supports=[Hold(("rod", 0)), Hold(("rod", -1))])
    # rows are the directors; drawn, they are the axes
    begin = RodState(model, points, np.ascontiguousarray(np.swapaxes(R, 1, 2)))
    return statics(model, start=begin).last


def helical_buckling() -> Finding:
    """R8: a twisted rod with slack buckles into a localised helix.

    Problem: L = 100, B = 1.345, C = 0.789, ends held 3 closer and turned by 27 turns; 100, 200 and 400 elements.
    Measured: moment and tension at the end, M L / B and T L^2 / B, extrapolated at order 2; the order; the envelope of
        the tangent's angle, extrapolated, over its largest value.
    Tolerance: 5e-4 of moment and tension, and 2e-3 of the envelope: what order 4 leaves at 40 elements a wave; in the
        tail the angle is tiny and its arccosine loses half the digits. 0.15 of an order.
    Cannot see: whether the helix would touch itself.
    Catches: twist that does not travel through large turns, bending and twist exchanged, elements that lose turns.
    """
    ends, angles = [], []
    for n in _HELIX_MESHES:
        state = helix(n)
        end = reaction(state, ("rod", -1))
        ends.append(np.array([end[5] * HELIX_LENGTH, end[2] * HELIX_LENGTH**2]) / HELIX_BENDING)
        angles.append(np.arccos(np.clip(state.directors("rod")[:, 2, 2], -1.0, 1.0))[:: n // _HELIX_MESHES[0]])
    exact = np.array([HELIX_MOMENT, HELIX_TENSION])
    rate = order(_HALVED, [float(np.linalg.norm(end / exact - 1.0)) for end in ends])
    s = np.linspace(-0.5, 0.5, _HELIX_MESHES[0] + 1)
    known, envelope = localised_angle(s), extrapolated(angles[1], angles[2])
    apart = np.abs(envelope - known).max() / known.max()
    fine = np.linspace(-0.5, 0.5, 401)
    curves = (
        Curve("Gazzola et al.", fine, localised_angle(fine), known=True),
        Curve(f"rod, {_HELIX_MESHES[-1]} elements", s, angles[-1]),
    )
    return Finding.of(
        [*extrapolated(ends[1], ends[2]), rate, apart], Graph("arc length / L [1]", "angle to the axis [rad]", curves)
    )


_GAZZOLA = "Gazzola et al. 2018"
R8 = Case(
    "R8",
    "helical buckling",
    (
        Claim("end moment M L / B", HELIX_MOMENT, 5e-4 * HELIX_MOMENT, "1", _GAZZOLA),
        Claim("end tension T L^2 / B", HELIX_TENSION, 5e-4 * HELIX_TENSION, "1", _GAZZOLA),
        Claim("order in the element length", 2.0, 0.15, "1", "declared"),
        Claim("envelope of the tangent's angle, distance over its peak", 0.0, 2e-3, "1", _GAZZOLA),
    ),
    helical_buckling,
)

CASES = (R6, R7, R8)

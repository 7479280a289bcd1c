"""S9 and S10: the machine as a solid, however it is held; its muscle in series with its beam."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from fem_biobot import (
    BodyMesh,
    Design,
    Fix,
    NeoHooke,
    SolidModel,
    SolidState,
    load_design,
    solve,
    tension_step,
)
from fem_biobot.solid.newton import NewtonSettings
from fem_biobot.verification.beam import EccentricStrip
from fem_biobot.verification.blocks import committed_bot, measured
from fem_biobot.verification.records import Case, Claim, Curve, Finding, Graph

Array = NDArray[np.float64]

# --- S9 ---------------------------------------------------------------------------------------------------------------

# six rigid motions held at other places than a design's own, one of them along an oblique axis only
OTHER_SUPPORTS = (
    Fix("foot_short_centre", "xyz"),
    Fix("foot_long_centre", "yz"),
    Fix("span_long", "y", axes=((1.0, 0.0, 0.0), (0.0, 0.8, 0.6), (0.0, -0.6, 0.8))),
)
COMPARED = {
    "tip_closing_mm": "tip closing",
    "sagitta_mm": "sagitta",
    "muscle_force_mN": "muscle force",
    "fibre_stretch_1": "fibre stretch",
    "strain_energy_uJ": "strain energy",
}


@cache
def held_in_two_ways() -> tuple[Design, tuple[SolidState, SolidState]]:
    """The junction bot at 4 kPa under its own supports and under others."""
    design, mesh = committed_bot()
    own = SolidModel.from_design(design, mesh)
    tight = NewtonSettings(tolerance=1e-12)
    first, other = (
        solve(model, [tension_step(design, 4.0)], settings=tight).last
        for model in (own, SolidModel(mesh, own.materials, own.active, OTHER_SUPPORTS))
    )
    return design, (first, other)


def support_force(state: SolidState, force: float) -> float:
    """Largest component of any support's reaction over a force [1]."""
    supports = [support for support in state.model.supports if isinstance(support, Fix)]
    return max(float(np.abs(state.reaction(support.where)).max()) for support in supports) / force


def support_independence() -> Finding:
    """S9: a machine in equilibrium with itself does not feel how it is held.

    Problem: the junction bot at 4 kPa, held against its six rigid motions at three vertices, chosen in two ways.
    Measured: closing, sagitta, force, stretch and energy under one over those under the other; the largest reaction of
        either, over the muscle's force.
    Tolerance: 1e-8, and 1e-9 of the force: a hundred times what the residual of 1e-12 leaves.
    Cannot see: whether the shape is right.
    Catches: a closing along the global x, a sagitta from u_z, a support that holds more than six motions.
    """
    design, states = held_in_two_ways()
    one, other = (measured(state, design) for state in states)
    reactions = [support_force(state, one["muscle_force_mN"]) for state in states]
    return Finding.of([*(other[key] / one[key] for key in COMPARED), max(reactions)])


S9 = Case(
    "S9",
    "the junction bot under two supports",
    (
        *(Claim(f"{words} over that under others", 1.0, 1e-8, "1", "statics") for words in COMPARED.values()),
        Claim("largest reaction over the muscle's force", 0.0, 1e-9, "1", "statics: no load, no reaction"),
    ),
    support_independence,
)

# --- S10 --------------------------------------------------------------------------------------------------------------

SMALL_TENSION = 1e-2
# the pillars' modulus over the beam's
RIGID = 1e4
POISSON = 0.45
PLATE = 1.0 / (1.0 - POISSON**2)
# the stiff pillars lift the rounding of stresses to 1e-8 of the tension
_ENOUGH = NewtonSettings(tolerance=1e-6)


@dataclass(frozen=True)
class Pulled:
    """A solved machine, its measures and its beam."""

    design: Design
    state: SolidState
    values: dict[str, float]
    beam: EccentricStrip

    @property
    def force(self) -> float:
        """Through the muscle [mN]."""
        return self.values["muscle_force_mN"]

    def moved(self, x: float, z: float) -> Array:
        """Displacement at mid-width, (3,) [mm]."""
        return self.state.at((x, 0.0, z))

    def end_rotation(self, side: float) -> float:
        """Turn of the span's end at -x (-1) or +x (+1) toward the muscle, from the beam's lower face to its axis."""
        half, axis, depth = self.design.span / 2.0, self.design.beam_axis_height, self.beam.t / 2.0
        top, bottom = (self.moved(side * half, z)[0] for z in (axis, axis - depth))
        return float(side * (top - bottom) / depth)

    @property
    def closure(self) -> float:
        """Approach of the pillars at the muscle's height [mm]."""
        half, height = self.design.span / 2.0, self.design.value("muscle.junction_height")
        return float(self.moved(-half, height)[0] - self.moved(half, height)[0])

    @property
    def plate_factor(self) -> float:
        """Curvature of a beam of the same section over that of the machine, at mid-span and mid-width."""
        z, a = self.design.beam_axis_height, self.design.span / 8.0
        w = [self.moved(x, z)[2] for x in (-a, 0.0, a)]
        return float(self.beam.curvature(self.force) / ((2.0 * w[1] - w[0] - w[2]) / a**2))


@cache
def pulled(width: float, poisson: float, young_muscle: float, poisson_muscle: float, rigid: float = RIGID) -> Pulled:
    """The preset with all lengths along y scaled to a beam `width`, on its committed mesh scaled alike.

    The pillars' modulus is `rigid` times the beam's.
    """
    _, mesh = committed_bot()
    wider = width / 7.0
    design = load_design(
        "junction_bot",
        [
            f"skeleton.beam_width={width} mm",
            f"skeleton.pillar_width={width} mm",
            f"muscle.junction_width={2.2 * wider} mm",
            f"skeleton.material.poisson={poisson}",
            f"muscle.material.young={young_muscle} kPa",
            f"muscle.material.poisson={poisson_muscle}",
        ],
    )
    X = mesh.points * np.array([[1.0], [wider], [1.0]])
    mesh = BodyMesh(X, mesh.cells, mesh.regions, mesh.surfaces, mesh.landmarks)
    base = SolidModel.from_design(design, mesh)
    gel = mesh.regions["skeleton"]
    outside = np.abs(X[0, mesh.cells[:, gel]].mean(axis=0)) > design.span / 2.0
    parts = {"skeleton": gel[~outside], "pillars": gel[outside], "muscle": mesh.regions["muscle"]}
    E = design.value("skeleton.material.young")
    model = SolidModel(
        BodyMesh(X, mesh.cells, parts, mesh.surfaces, mesh.landmarks),
        {**base.materials, "pillars": NeoHooke(rigid * E, poisson)},
        base.active,
        base.supports,
    )
    state = solve(model, [tension_step(design, SMALL_TENSION)], settings=_ENOUGH).last
    beam = EccentricStrip(E, width, design.value("skeleton.beam_thickness"), design.span, design.moment_arm)
    return Pulled(design, state, measured(state, design), beam)


def beam_alone() -> Pulled:
    """Without Poisson's effect, with a soft muscle: a beam in series with a strip."""
    return pulled(7.0, 0.0, 1.0, 0.0)


def strip_in_series_with_a_beam() -> Finding:
    """S10: a contracting strip bends the beam above it as a force at its height does.

    Problem: the junction bot with pillars made rigid (10^4 times the modulus) and a soft muscle, at a tension that
        turns the beam's ends by about a thousandth.
    Measured: end rotations, closure at the muscle, mid-span rise, tip closing and force of the over the
        closed forms at the muscle's force; the plate factor as curvature at mid-span, away from the clamped ends.
    Tolerance: 0.1 % at nu = 0 (the strip bends with the beam, the ends turn by 10^-3); 1 % for plate factors on this
        coarse mesh; the strip's own force 0.7 %, because its ends inside the rings, a seventh of its length, give way
        less.
    Cannot see: large turns, the flexibility of real pillars, stress at corners.
    Catches: moment arm to another plane, sagitta from the sole, half a span lost, plane strain put into the law, a
        lateral support that holds the anticlastic bow.
    """
    machine = beam_alone()
    F, beam, found = machine.force, machine.beam, machine.values
    strip = beam.strip_force(SMALL_TENSION, machine.design.junction_section, 1.0)
    narrow, preset, wide = (pulled(width, POISSON, 0.1, 0.3).plate_factor for width in (1.0, 7.0, 56.0))
    values = [
        *(machine.end_rotation(side) / beam.end_rotation(F) for side in (-1.0, 1.0)),
        machine.closure / beam.closure(F),
        found["sagitta_mm"] / beam.rise(F),
        found["tip_closing_mm"] / beam.tip_closing(F, (2.8, 3.4)),
        found["eq3_force_mN"] / F,
        F / strip,
        narrow,
        wide,
        preset,
    ]
    widths = [1.0, 7.0, 56.0]
    curves = (
        Curve("beam", widths, [1.0, 1.0, 1.0], known=True),
        Curve("plate, 1 / (1 - nu^2)", widths, [PLATE] * 3, known=True),
        Curve("solid", widths, [narrow, preset, wide]),
    )
    return Finding.of(values, Graph("beam width [mm]", "plate factor [1]", curves, logarithmic="x"))


_BEAM = "Euler-Bernoulli"
S10 = Case(
    "S10",
    "strip in series with a beam, small strain",
    (
        Claim("rotation of the short end over the beam's", 1.0, 1e-3, "1", f"{_BEAM}: F h L / (2 E I)"),
        Claim("rotation of the long end over the beam's", 1.0, 1e-3, "1", f"{_BEAM}: F h L / (2 E I)"),
        Claim("closure at the muscle over the beam's", 1.0, 1e-3, "1", f"{_BEAM}: F h^2 L / (E I) + F L / (E A)"),
        Claim("mid-span rise over the beam's", 1.0, 1e-3, "1", f"{_BEAM}: F h L^2 / (8 E I)"),
        Claim("tip closing over the beam's", 1.0, 1e-3, "1", f"{_BEAM}: F h L (h1 + h2) / (2 E I) + F L / (E A)"),
        Claim("force by Eq. 3 over the true one", 1.0, 1e-3, "1", "Pagan-Diaz et al. 2018, Eq. 3"),
        Claim("force of the strip over the series'", 1.0, 7e-3, "1", f"{_BEAM}: T A / (1 + E A c / L)"),
        Claim("plate factor, beam of 1 mm", 1.0, 0.01, "1", "beam: 1"),
        Claim("plate factor, beam of 56 mm", PLATE, 0.01 * PLATE, "1", "plate: 1 / (1 - nu^2)"),
        Claim("plate factor, the preset's beam of 7 mm", PLATE, None, "1", "at most a plate's: 1 / (1 - nu^2)"),
    ),
    strip_in_series_with_a_beam,
)

CASES = (S9, S10)

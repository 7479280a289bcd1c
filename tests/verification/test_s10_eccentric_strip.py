"""S10: a contracting strip in series with a beam, at small strain.

Problem: the junction bot with pillars made rigid (a modulus 10^4 times higher) and a soft muscle, at a
    tension that turns the beam's ends by about a thousandth.
Exact answer: end rotation F h L/(2EI), closure F h^2 L/(EI) + F L/(EA), mid-span rise F h L^2/(8EI), strip force
    T A/(1 + E A c/L) (tests/oracles/beam.py); with Poisson's ratio between a beam's EI and a plate's EI/(1 - nu^2).
Measured: muscle_force, tip_closing and sagitta of the measures, displacements through `at`, mid-span curvature.
Tolerance: 0.1 % at nu = 0 (the strip bends with the beam, the ends turn by 10^-3); the plate factor is measured as
    curvature at mid-span, away from the clamped ends, to 1 % on this coarse mesh.
Cannot see: large turns, the flexibility of real pillars, stress at corners.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from fem_biobot.config import load_design
from fem_biobot.design import Design
from fem_biobot.material import NeoHooke
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.solid.from_design import model_from_design, tension_step
from fem_biobot.solid.measures import measures
from fem_biobot.solid.model import SolidModel, SolidState, solve
from fem_biobot.solid.newton import NewtonSettings
from tests.helpers import committed_bot
from tests.oracles.beam import EccentricStrip

TENSION = 1e-2
RIGID = 1e4
# the pillars' stiffness lifts the rounding of stresses to 1e-8 of the tension
ENOUGH = NewtonSettings(tolerance=1e-6)


@dataclass(frozen=True)
class Pulled:
    """A solved machine, its measures and its beam."""

    design: Design
    state: SolidState
    values: dict
    beam: EccentricStrip

    @property
    def force(self) -> float:
        return self.values["muscle_force_mN"]

    def moved(self, x: float, z: float) -> np.ndarray:
        """Displacement at mid-width."""
        return self.state.at((x, 0.0, z))

    @property
    def plate_factor(self) -> float:
        """Curvature of a beam of the same section over that of the machine, at mid-span and mid-width."""
        z, a = self.design.beam_axis_height, self.design.span / 8.0
        w = [self.moved(x, z)[2] for x in (-a, 0.0, a)]
        return self.beam.curvature(self.force) / ((2.0 * w[1] - w[0] - w[2]) / a**2)


def _pulled(width: float, poisson: float, young_muscle: float, poisson_muscle: float, rigid: float = RIGID) -> Pulled:
    """The preset with all lengths along y scaled to a beam `width`, on its committed mesh scaled alike."""
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
    base = model_from_design(design, mesh)
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
    state = solve(model, [tension_step(design, TENSION)], settings=ENOUGH).last
    beam = EccentricStrip(E, width, design.value("skeleton.beam_thickness"), design.span, design.moment_arm)
    return Pulled(design, state, measures(state, design), beam)


def test_without_poissons_effect_the_machine_is_a_beam_in_series_with_a_strip() -> None:
    """At nu = 0 rotation, closure, rise, tip closing and the strip's own force are those of the closed forms.

    Catches: moment arm to another plane, sagitta from the sole, half a span lost, a muscle force that counts one side.
    """
    machine = _pulled(7.0, 0.0, 1.0, 0.0)
    F, beam = machine.force, machine.beam
    half, z_beam = machine.design.span / 2.0, machine.design.beam_axis_height
    lower, z_muscle = 0.34, machine.design.value("muscle.junction_height")
    for side in (-1.0, 1.0):
        top, bottom = (machine.moved(side * half, z)[0] for z in (z_beam, z_beam - lower))
        assert side * (top - bottom) / lower == pytest.approx(beam.end_rotation(F), rel=1e-3)
    closure = machine.moved(-half, z_muscle)[0] - machine.moved(half, z_muscle)[0]
    assert closure == pytest.approx(beam.closure(F), rel=1e-3)
    assert machine.values["sagitta_mm"] == pytest.approx(beam.rise(F), rel=1e-3)
    assert machine.values["tip_closing_mm"] == pytest.approx(beam.tip_closing(F, (2.8, 3.4)), rel=1e-3)
    assert machine.values["eq3_force_mN"] == pytest.approx(F, rel=1e-3)
    assert machine.plate_factor == pytest.approx(1.0, abs=1e-3)
    # the strip gives way by 6 %; its ends inside the rings, a seventh of its length, give way less
    assert F == pytest.approx(beam.strip_force(TENSION, machine.design.junction_section, 1.0), rel=0.007)


def test_the_plate_factor_goes_from_a_beams_to_a_plates_with_the_width() -> None:
    """1 for a narrow beam, 1/(1 - nu^2) for a wide one, between the two for the preset's, rising with the width.

    Catches: plane strain or plane stress moduli put into the law, a lateral support that holds the anticlastic bow.
    """
    nu = 0.45
    plate = 1.0 / (1.0 - nu**2)
    narrow, preset, wide = (_pulled(width, nu, 0.1, 0.3).plate_factor for width in (1.0, 7.0, 56.0))
    assert narrow == pytest.approx(1.0, abs=0.01)
    assert wide == pytest.approx(plate, rel=0.01)
    assert 1.05 < preset < plate
    assert narrow < preset < wide


def test_the_real_machine_bends_between_beam_and_plate() -> None:
    """The preset itself, pillars of gel and muscle at its own modulus, bends with a factor between 1 and 1/(1 - nu^2).

    Catches: moduli swapped between muscle and gel; a muscle force in other units.
    """
    factor = _pulled(7.0, 0.45, 10.0, 0.47, rigid=1.0).plate_factor
    assert 1.05 < factor < 1.0 / (1.0 - 0.45**2)

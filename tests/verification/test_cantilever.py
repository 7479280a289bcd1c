"""Cantilever at small load against Timoshenko's beam.

Problem: the cantilever preset, clamped at one end, a small force spread over the other.
Exact answer: F L^3/(3EI) + F L/(k G A) with k = 5/6, exact for the mean deflection at nu = 0 but for the clamp.
Measured: tip deflection, mean over the tip face, on two committed meshes.
Tolerance: 0.2 % on the coarse mesh and 0.1 % on the finer; at nu = 0.45 between beam and plate.
Cannot see: finite turns, tension.
"""

from __future__ import annotations

import pytest

from fem_biobot.config import load_design
from fem_biobot.mesh.committed import committed_mesh
from fem_biobot.solid.from_design import model_from_design
from fem_biobot.solid.measures import measures
from fem_biobot.solid.model import solve

FORCE, LENGTH, YOUNG, WIDTH, THICKNESS = 1e-3, 14.0, 319.4, 7.0, 0.68


def _over_timoshenko(poisson: float, size: float) -> float:
    """Deflection over that of the beam."""
    design = load_design("cantilever", [f"skeleton.material.poisson={poisson}", f"load.tip_force={FORCE} mN"])
    model = model_from_design(design, committed_mesh(design, size))
    bending = FORCE * LENGTH**3 / (3.0 * YOUNG * WIDTH * THICKNESS**3 / 12.0)
    shear = FORCE * LENGTH / (5.0 / 6.0 * YOUNG / (2.0 * (1.0 + poisson)) * WIDTH * THICKNESS)
    return measures(solve(model).last, design)["tip_deflection_mm"] / (bending + shear)


def test_without_poissons_effect_the_tip_sinks_as_timoshenko_says() -> None:
    """At nu = 0 the error is below 0.2 %, from below, and falls with the mesh.

    Catches: linear elements, a force lumped at a corner, E or I off by a percent.
    """
    coarse, fine = (_over_timoshenko(0.0, size) for size in (1.4, 0.7))
    assert coarse == pytest.approx(1.0, abs=2e-3)
    assert fine == pytest.approx(1.0, abs=1e-3)
    assert coarse < fine < 1.0


def test_with_poissons_effect_it_is_between_beam_and_plate() -> None:
    """At nu = 0.45 the clamp and the width stiffen it, by less than 1/(1 - nu^2).

    Catches: plane-strain moduli in the law; an incompressible part that locks.
    """
    assert 1.0 - 0.45**2 < _over_timoshenko(0.45, 0.7) < 1.0

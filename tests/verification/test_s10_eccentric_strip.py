"""S10 beyond its rows in the table: a contracting strip in series with a beam, at small strain.

Problem: the junction bot with pillars made rigid (a modulus 10^4 times higher) and a soft muscle, at a
    tension that turns the beam's ends by about a thousandth.
Exact answer: end rotation F h L/(2EI), closure F h^2 L/(EI) + F L/(EA), mid-span rise F h L^2/(8EI), strip force
    T A/(1 + E A c/L) (verification/beam.py); with Poisson's ratio between a beam's EI and a plate's EI/(1 - nu^2).
Measured: muscle_force, tip_closing and sagitta of the measures, displacements through `at`, mid-span curvature.
Tolerance: 0.1 % at nu = 0 (the strip bends with the beam, the ends turn by 10^-3); the plate factor is measured as
    curvature at mid-span, away from the clamped ends, to 1 % on this coarse mesh.
Cannot see: large turns, the flexibility of real pillars, stress at corners.
"""

from __future__ import annotations

from fem_biobot.verification.solid_machine import PLATE, POISSON, pulled


def test_the_plate_factor_rises_with_the_width() -> None:
    """From a beam's to a plate's (rows of the table), the preset's between the two.

    Catches: plane strain or plane stress moduli put into the law, a lateral support that holds the anticlastic bow.
    """
    narrow, preset, wide = (pulled(width, POISSON, 0.1, 0.3).plate_factor for width in (1.0, 7.0, 56.0))
    assert 1.05 < preset < PLATE
    assert narrow < preset < wide


def test_the_real_machine_bends_between_beam_and_plate() -> None:
    """The preset itself, pillars of gel and muscle at its own modulus, bends with a factor between 1 and 1/(1 - nu^2).

    Catches: moduli swapped between muscle and gel; a muscle force in other units.
    """
    assert 1.05 < pulled(7.0, POISSON, 10.0, 0.47, rigid=1.0).plate_factor < PLATE

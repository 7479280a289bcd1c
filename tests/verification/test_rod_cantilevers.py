"""R1 to R5 beyond their rows in the table: cantilevers at large deflection.

Problem: those of the cases (`verification.rods`), on other meshes.
Exact answer and its source: the circle; Timoshenko's formula.
What is measured: the whole line, reactions, the known error of the element.
Tolerance and why: rounding for constant strain; else the element's error.
What it cannot see: joints, bodies, members; the path to these states.
"""

from __future__ import annotations

import numpy as np
import pytest

from fem_biobot.rod.statics import reaction
from fem_biobot.verification.rods import ROLL_BENDING, ROLL_LENGTH, bend_state, circle, rolled, thick_tip


@pytest.mark.parametrize("share", [1.0, 0.5])
def test_r1_a_finer_rod_lies_on_its_circle_too(share: float) -> None:
    """Every node of 24 elements lies on the circle, to rounding, and the clamp bears the moment.

    Catches: the chord for the arc, a reaction with the wrong sign.
    """
    state = rolled(share, 24)
    curvature = 2.0 * np.pi * share / ROLL_LENGTH
    points = circle(share, curvature * np.linspace(0.0, ROLL_LENGTH, 25))
    # residuals of 1e-13 of the moment over the softest stiffness, L^2 / EI
    np.testing.assert_allclose(state.points("rod"), points, rtol=0.0, atol=1e-11 * ROLL_LENGTH)
    moment = reaction(state, ("rod", 0))[3:]
    np.testing.assert_allclose(moment, [0.0, 0.0, -curvature * ROLL_BENDING], rtol=0.0, atol=1e-10)


def test_r4_the_bends_clamp_bears_the_force() -> None:
    """The reaction is the force's opposite, whatever the mesh.

    Catches: a dead force that turns along with the tip.
    """
    force = reaction(bend_state(8), ("rod", 0))[:3]
    np.testing.assert_allclose(force, [0.0, 0.0, -600.0], rtol=0.0, atol=1e-6)


@pytest.mark.parametrize(("elements", "short"), [("corrected", 0.0), ("plain", 1.0 / (4.0 * 6**2))])
def test_r5_the_tip_is_exact_and_short_of_what_plain_elements_do_not_bend(elements: str, short: float) -> None:
    """Six corrected elements have the whole deflection; in that of plain ones bending is short by 1 / (4 n^2).

    Catches: residual bending left out, with the other plane's E I, or in plain elements; shear without its factor.
    """
    bending, shear = 15.0 * 3.0**3 / (3.0 * 1e6 * np.pi * 0.25**4 / 4.0), 15.0 * 3.0 / (4.0 / 3.0 * 1e4 * np.pi / 16.0)
    expected = bending * (1.0 - short) + shear
    assert 1e3 * thick_tip(6, 4.0 / 3.0, 15e-3, elements) == pytest.approx(expected, rel=1e-8)

"""S2: a cube that pulls alike in all directions.

Problem: unit cube, E = 1, nu = 0.3, sigma = [mu (b - I) + lmbda ln J I] / J, constant second Piola tension 0.5 in every
    direction, no load.
Exact answer: one stretch, 0.8575651716, of mu (s - 1/s) + 3 lmbda ln(s)/s + T0 s = 0 (FEBio test suite, case ma20).
Measured: F^T F at every quadrature point, for tension along and wholly across an oblique fibre.
Tolerance: 5e-11, the printed digits.
Cannot see: anything that distinguishes directions, except that nothing may.
"""

from __future__ import annotations

import numpy as np
import pytest

from fem_biobot.material import ActiveStress, NeoHooke
from fem_biobot.solid.model import SolidModel, solve
from tests.helpers import TIGHT, box_mesh, on_three_corners, unit

PRINTED = 0.8575651716


def test_tension_in_all_directions_contracts_the_cube_to_the_printed_stretch() -> None:
    """Fibres of any direction with the whole tension across them too contract the cube by 0.8575651716.

    Catches: a transverse share of the trace instead of each direction, a factor of two between H and its complement.
    """
    muscle = ActiveStress(0.5, unit(0.3, -0.5, 0.8), "second_piola", transverse=1.0)
    model = SolidModel(box_mesh(2), {"muscle": NeoHooke(1.0, 0.3)}, {"muscle": muscle}, on_three_corners())
    state = solve(model, [0.5, 1.0], settings=TIGHT).last
    C = np.einsum("im...,ik...->mk...", state.F, state.F)
    expected = PRINTED**2 * np.eye(3)[:, :, None, None]
    np.testing.assert_allclose(C, np.broadcast_to(expected, C.shape), rtol=0.0, atol=5e-11)


@pytest.mark.parametrize("convention", ["nominal", "kirchhoff", "cauchy"])
def test_other_conventions_contract_it_by_their_own_equation(convention: str) -> None:
    """With p(s) = 1, 1/s or s^2 for s the residual mu (s - 1/s) + 3 lmbda ln(s)/s + T0 p(s) vanishes.

    Catches: the tension across in another convention than that along.
    """
    law = NeoHooke(1.0, 0.3)
    muscle = ActiveStress(0.3, unit(0.3, -0.5, 0.8), convention, transverse=1.0)
    model = SolidModel(box_mesh(2), {"muscle": law}, {"muscle": muscle}, on_three_corners())
    state = solve(model, [0.5, 1.0]).last
    s = float(np.mean(state.stretch))
    np.testing.assert_allclose(state.stretch, s, rtol=0.0, atol=1e-8)
    p = {"nominal": 1.0, "kirchhoff": 1.0 / s, "cauchy": s * s}[convention]
    residual = law.mu * (s - 1.0 / s) + 3.0 * law.lmbda * np.log(s) / s + 0.3 * p
    assert residual == pytest.approx(0.0, abs=1e-8)

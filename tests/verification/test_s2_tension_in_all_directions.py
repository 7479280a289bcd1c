"""S2 in other conventions: a cube that pulls alike in all directions.

Problem: unit cube, E = 1, nu = 0.3, sigma = [mu (b - I) + lmbda ln J I] / J, constant tension in every direction, no
    load; in second Piola tension it is a row of the table.
Exact answer: one stretch, of mu (s - 1/s) + 3 lmbda ln(s)/s + T0 p(s) = 0.
Measured: the fibre stretch at every quadrature point.
Tolerance: 1e-8, the default tolerance of the solve.
Cannot see: anything that distinguishes directions, except that nothing may.
"""

from __future__ import annotations

import numpy as np
import pytest

from fem_biobot.material import ActiveStress, NeoHooke
from fem_biobot.solid.model import SolidModel, solve
from tests.helpers import box_mesh, on_three_corners, unit


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

"""S1: free contraction of a block of muscle along an oblique fibre.

Problem: unit cube on a distorted mesh, compressible neo-Hooke, nominal tension T along an oblique fibre, no load.
Exact answer: two stretches from two scalar equations of the law (tests/oracles/free_muscle.py), whose limit at
    nu -> 1/2 is the table of shared values mu (s - s^-2) + T = 0.
Measured: F^T F at every quadrature point; fibre stretch; lengths of the cube's edges through `at`.
Tolerance: 1e-9, the residual is solved to 1e-13 of the force scale and the block's softest stiffness is near mu.
Cannot see: discretisation (the answer is homogeneous), forces through a section (there are none).
"""

from __future__ import annotations

import numpy as np
import pytest

from fem_biobot.material import ActiveStress, NeoHooke
from fem_biobot.solid.model import SolidModel, solve
from tests.helpers import TIGHT, box_mesh, on_three_corners, unit
from tests.oracles.free_muscle import free_stretches

FIBRE = unit(0.48, 0.64, -0.6)
# mu (s - s^-2) + T = 0
INCOMPRESSIBLE = {0.1: 0.967753113, 0.5: 0.858094330, 1.0: 0.754877666, 2.0: 0.618033989}


def test_the_scalar_equations_reach_the_incompressible_table() -> None:
    """The oracle's stretch tends to the tabled incompressible one with an error proportional to 1 - 2 nu.

    Catches: a wrong scalar equation (sign of T, t for t^2).
    """
    for tension, expected in INCOMPRESSIBLE.items():
        near, nearer = (free_stretches(tension, 0.5 - gap)[0] - expected for gap in (2e-4, 1e-4))
        assert abs(nearer) < 1e-4
        assert near / nearer == pytest.approx(2.0, abs=0.002)


@pytest.mark.parametrize("poisson", [0.3, 0.47])
def test_free_muscle_contracts_by_the_scalar_equations(poisson: float) -> None:
    """Every point of the block has the two stretches of the scalar equations at T/mu = 0.1, 0.5, 1 and 2.

    Catches: tension along a0 of another frame, second Piola for nominal tension, a tension not scaled by the step.
    """
    law = NeoHooke(9.3, poisson)
    tensions = list(INCOMPRESSIBLE)
    model = SolidModel(box_mesh(2), {"muscle": law}, {"muscle": ActiveStress(law.mu, FIBRE)}, on_three_corners())
    solution = solve(model, tensions, settings=TIGHT)
    for tension, state in zip(tensions, solution.states, strict=True):
        s, t = free_stretches(tension, poisson)
        C = np.einsum("im...,ik...->mk...", state.F, state.F)
        expected = t**2 * np.eye(3) + (s**2 - t**2) * np.outer(FIBRE, FIBRE)
        np.testing.assert_allclose(C, np.broadcast_to(expected[:, :, None, None], C.shape), rtol=0.0, atol=1e-9)
        np.testing.assert_allclose(state.stretch, s, rtol=0.0, atol=1e-9)
        edge = np.array([0.0, 0.0, 1.0]) + state.at((0.2, 0.3, 1.0)) - state.at((0.2, 0.3, 0.0))
        assert np.linalg.norm(edge) == pytest.approx(np.sqrt(expected[2, 2]), abs=1e-9)


def test_the_way_to_a_tension_does_not_matter() -> None:
    """One step to T/mu = 2, or four, end in the same stretch, and both in that of the scalar equations.

    Catches: an intermediate state left rough, tension accumulated instead of set.
    """
    law = NeoHooke(9.3, 0.47)
    model = SolidModel(box_mesh(2), {"muscle": law}, {"muscle": ActiveStress(2.0 * law.mu, FIBRE)}, on_three_corners())
    s, _ = free_stretches(2.0, 0.47)
    for steps in ([1.0], [0.1, 0.4, 0.6, 1.0]):
        np.testing.assert_allclose(solve(model, steps, settings=TIGHT).stretch, s, rtol=0.0, atol=1e-9)

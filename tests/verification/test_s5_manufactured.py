"""S5 beyond its rows in the table: manufactured solution at finite strain.

Problem: cube of contracting neo-Hooke under the body force, end traction and boundary displacement of a chosen field
    with displacement gradients up to 0.6.
Exact answer: the chosen field; its body force by hand-written derivatives (verification/manufactured.py).
Measured: L2 norms of the errors of displacement and gradient on smoothly bent meshes, also by scikit-fem's quadrature.
Tolerance: slopes p + 1 and p within 0.15; finest errors bounded, a slope can be right around a wrong limit.
Cannot see: interfaces, near incompressibility, corners.
"""

from __future__ import annotations

import numpy as np
import pytest

from fem_biobot.material import NeoHooke
from fem_biobot.verification.solid_fields import COMPRESSIBLE, convergence, field_errors, manufactured_state
from tests.helpers import generator, slope
from tests.oracles.forms import FormOracle


def test_the_body_force_balances_the_stress() -> None:
    """The oracle's body force is minus the divergence of its stress, by fourth-order differences.

    Catches: a term lost from the hand-written divergence.
    """
    X = generator(3).uniform(0.1, 0.9, (3, 12))
    h = 1e-3
    divergence = np.zeros_like(X)
    for k in range(3):
        step = h * np.eye(3)[:, [k]]
        near = COMPRESSIBLE.stress(X + step)[:, k] - COMPRESSIBLE.stress(X - step)[:, k]
        far = COMPRESSIBLE.stress(X + 2 * step)[:, k] - COMPRESSIBLE.stress(X - 2 * step)[:, k]
        divergence += (8.0 * near - far) / (12.0 * h)
    f = COMPRESSIBLE.body_force(X)
    np.testing.assert_allclose(-divergence, f, rtol=0.0, atol=1e-9 * np.abs(f).max())


@pytest.mark.parametrize("element", ["P2", "P1"])
def test_errors_are_what_scikit_fem_measures(element: str) -> None:
    """The errors in the table are those of scikit-fem's own interpolation and a rule of degree 8, to 1e-3.

    Catches: errors measured where the elements are best (their own four points), values of another basis.
    """
    law = NeoHooke(COMPRESSIBLE.young, COMPRESSIBLE.poisson)
    state = manufactured_state(4, element, law, COMPRESSIBLE)
    mesh, found = state.model.mesh, field_errors(state, COMPRESSIBLE)
    oracle = FormOracle(mesh.points, mesh.cells, state.X, linear=element == "P1", degree=8)
    length, gradient = oracle.distance(state.u.T, COMPRESSIBLE.displacement, COMPRESSIBLE.gradient)
    assert found.displacement == pytest.approx(length, rel=1e-3)
    assert found.gradient == pytest.approx(gradient, rel=1e-3)
    if element == "P2":
        # at its own points the gradient is better than anywhere else
        own = state.F - np.eye(3)[:, :, None, None] - COMPRESSIBLE.gradient(state.model.system.space.quadrature_points)
        assert np.sqrt(np.sum(own**2 * state.model.system.space.dV)) < 0.95 * found.gradient


@pytest.mark.slow
@pytest.mark.parametrize(
    ("element", "cells", "degree", "bounds"),
    [
        ("P2", (3, 4, 6, 8, 10), None, (1.6e-5, 1.4e-3)),
        ("P2", (3, 4, 6, 8, 10), 5, (1.6e-5, 1.4e-3)),
        ("P1", (6, 9, 14), None, (7.0e-4, 0.035)),
    ],
)
def test_rates_hold_on_finer_meshes_and_with_more_points(
    element: str, cells: tuple[int, ...], degree: int | None, bounds: tuple[float, float]
) -> None:
    """P2 up to ten cells a side, with the default rule and with the one of degree 5; P1 up to fourteen.

    Catches: a rate that only holds before the quadrature's error shows.
    """
    found = convergence(element, cells, degree)
    h, rate = [1.0 / n for n in cells], {"P1": 1, "P2": 2}[element]
    assert slope(h, [e.displacement for e in found]) == pytest.approx(rate + 1, abs=0.15)
    assert slope(h, [e.gradient for e in found]) == pytest.approx(rate, abs=0.15)
    assert found[-1].displacement < bounds[0]
    assert found[-1].gradient < bounds[1]

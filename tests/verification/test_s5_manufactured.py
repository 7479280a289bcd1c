"""S5: manufactured solution at finite strain.

Problem: cube of contracting neo-Hooke under the body force, end traction and boundary displacement of a chosen field
    with displacement gradients up to 0.6.
Exact answer: the chosen field; its body force by hand-written derivatives (tests/oracles/manufactured.py).
Measured: L2 norms of the errors of displacement and gradient, by quadrature of degree 8, on smoothly bent meshes.
Tolerance: slopes p + 1 and p within 0.15; finest errors bounded, a slope can be right around a wrong limit.
Cannot see: interfaces, near incompressibility, corners.
"""

from __future__ import annotations

import numpy as np
import pytest

from fem_biobot.material import ActiveStress, NeoHooke
from fem_biobot.solid.model import SolidModel, solve
from fem_biobot.solid.records import BodyForce, Traction
from tests.helpers import FACES, box_mesh, generator, hold_everywhere, slope, unit
from tests.oracles.forms import FormOracle
from tests.oracles.manufactured import Manufactured

EXACT = Manufactured(10.0, 0.36, 4.0, unit(0.6, 0.3, -0.7))


def _bend(X: np.ndarray) -> np.ndarray:
    """Smooth map of the unit cube onto itself that keeps its faces; meshes of all sizes are alike in shape."""
    bump = np.prod(np.sin(np.pi * X), axis=0)
    return X + bump * np.array([[0.10], [-0.07], [0.06]])


def _errors(n: int, element: str, degree: int | None = None, pulled: str | None = "z1") -> tuple[float, float]:
    mesh = box_mesh(n, bend=_bend)
    model = SolidModel(
        mesh,
        {"muscle": NeoHooke(EXACT.young, EXACT.poisson)},
        {"muscle": ActiveStress(EXACT.tension, EXACT.a0)},
        hold_everywhere(EXACT.displacement, [face for face in FACES if face != pulled]),
        [BodyForce(EXACT.body_force), *([Traction(pulled, lambda X: EXACT.stress(X)[:, 2])] if pulled else [])],
        element=element,
        quadrature_degree=degree,
    )
    u = solve(model).last.u.T
    nodes = model.system.space.points
    oracle = FormOracle(mesh.points, mesh.cells, nodes, linear=element == "P1", degree=8)
    return oracle.distance(u, EXACT.displacement, EXACT.gradient)


def _assert_rates(sizes: list[int], element: str, bounds: tuple[float, float], degree: int | None = None) -> None:
    # where held and pulled faces meet, the dual problem is singular at Poisson's ratio 0.36 and takes a tenth off the
    # L2 rate of linear elements, of any code; so those are held all around
    errors = np.array([_errors(n, element, degree, "z1" if element == "P2" else None) for n in sizes])
    h = [1.0 / n for n in sizes]
    order = {"P1": 1, "P2": 2}[element]
    assert slope(h, errors[:, 0]) == pytest.approx(order + 1, abs=0.15)
    assert slope(h, errors[:, 1]) == pytest.approx(order, abs=0.15)
    assert errors[-1, 0] < bounds[0]
    assert errors[-1, 1] < bounds[1]


def test_the_body_force_balances_the_stress() -> None:
    """The oracle's body force is minus the divergence of its stress, by fourth-order differences.

    Catches: a term lost from the hand-written divergence.
    """
    X = generator(3).uniform(0.1, 0.9, (3, 12))
    h = 1e-3
    divergence = np.zeros_like(X)
    for k in range(3):
        step = h * np.eye(3)[:, [k]]
        near = EXACT.stress(X + step)[:, k] - EXACT.stress(X - step)[:, k]
        far = EXACT.stress(X + 2 * step)[:, k] - EXACT.stress(X - 2 * step)[:, k]
        divergence += (8.0 * near - far) / (12.0 * h)
    f = EXACT.body_force(X)
    np.testing.assert_allclose(-divergence, f, rtol=0.0, atol=1e-9 * np.abs(f).max())


def test_quadratic_elements_converge_with_three_and_two() -> None:
    """P2: L2 error falls with h^3, gradient error with h^2.

    Catches: midpoint nodes off their edges, a body force integrated with a rule too low, a small-strain term.
    """
    _assert_rates([3, 4, 6], "P2", (7.0e-5, 3.6e-3))


def test_linear_elements_converge_with_two_and_one() -> None:
    """P1: L2 error falls with h^2, gradient error with h.

    Catches: linear elements on quadratic weights, a body force of the wrong basis.
    """
    _assert_rates([4, 6, 9], "P1", (1.7e-3, 0.055))


@pytest.mark.slow
def test_rates_hold_on_finer_meshes_and_with_more_points() -> None:
    """P2 up to ten cells a side, with the default rule and with the one of degree 5; P1 up to fourteen.

    Catches: a rate that only holds before the quadrature's error shows.
    """
    for degree in (None, 5):
        _assert_rates([3, 4, 6, 8, 10], "P2", (1.6e-5, 1.4e-3), degree)
    _assert_rates([6, 9, 14], "P1", (7.0e-4, 0.035))

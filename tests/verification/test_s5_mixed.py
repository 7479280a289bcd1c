"""S5 with the mixed element: manufactured solution at finite strain, incompressible and nearly so.

Problem: cube of contracting neo-Hooke whose volume stays, or changes by a pressure over a bulk modulus of 1e4 mu;
    body force, end traction and boundary displacement of a chosen displacement and a chosen pressure.
Exact answer: those fields; body force by complex steps of hand-written gradients (verification/manufactured.py).
Measured: L2 norms of the errors of displacement, its gradient and the pressure, on smoothly bent meshes.
Tolerance: slopes 3, 2 and 2 (Taylor-Hood) within 0.15 (pressure: no slower than 2, by 0.15); finest errors bounded.
Cannot see: interfaces (the pressure's jump is a test of its own), corners.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
import skfem

from fem_biobot.verification.manufactured import ManufacturedMixed
from fem_biobot.verification.solid_fields import FIBRE, INCOMPRESSIBLE, manufactured_state
from tests.helpers import generator, slope
from tests.mixed import Split, rest
from tests.oracles.forms import FormOracle

MU, TENSION = INCOMPRESSIBLE.mu, INCOMPRESSIBLE.tension


def _exact(bulk: float) -> ManufacturedMixed:
    return ManufacturedMixed(MU, bulk, TENSION, FIBRE)


@cache
def _errors(n: int, bulk: float) -> tuple[float, float, float]:
    """Errors of displacement, gradient and pressure."""
    exact = _exact(bulk)
    state = manufactured_state(n, "P2-P1", Split(rest(MU), bulk), exact)
    mesh = state.model.mesh
    oracle = FormOracle(mesh.points, mesh.cells, state.X, degree=6)
    basis = skfem.Basis(skfem.MeshTet(mesh.points, mesh.cells), skfem.ElementTetP1(), intorder=6)
    assert state.pressure is not None
    assert len(state.pressure) == basis.N == mesh.n_vertices
    error = np.asarray(basis.interpolate(state.pressure)) - exact.pressure(np.asarray(basis.global_coordinates()))
    in_pressure = float(np.sqrt(np.sum(error**2 * basis.dx)))
    return *oracle.distance(state.u.T, exact.displacement, exact.gradient), in_pressure


def _assert_rates(sizes: list[int], bulk: float, bounds: tuple[float, float, float]) -> None:
    errors = np.array([_errors(n, bulk) for n in sizes])
    h = [1.0 / n for n in sizes]
    assert slope(h, errors[:, 0]) == pytest.approx(3.0, abs=0.15)
    assert slope(h, errors[:, 1]) == pytest.approx(2.0, abs=0.15)
    assert slope(h, errors[:, 2]) > 2.0 - 0.15
    for found, bound in zip(errors[-1], bounds, strict=True):
        assert found < bound


@pytest.mark.parametrize("bulk", [np.inf, 1e4 * MU, 2.0 * MU])
def test_the_body_force_balances_the_stress(bulk: float) -> None:
    """The oracle's body force is minus the divergence of its stress, by fourth-order differences; J is as said.

    Catches: a term lost from Piola's identity, a gradient that is not the displacement's.
    """
    exact = _exact(bulk)
    X = generator(3).uniform(0.1, 0.9, (3, 12))
    h = 1e-3
    divergence = np.zeros_like(X)
    for k in range(3):
        step = h * np.eye(3)[:, [k]]
        near = exact.stress(X + step)[:, k] - exact.stress(X - step)[:, k]
        far = exact.stress(X + 2 * step)[:, k] - exact.stress(X - 2 * step)[:, k]
        divergence += (8.0 * near - far) / (12.0 * h)
    f = exact.body_force(X)
    np.testing.assert_allclose(-divergence, f, rtol=0.0, atol=1e-9 * np.abs(f).max())
    F = exact.gradient(X) + np.eye(3)[:, :, None]
    np.testing.assert_allclose(exact._analytic_gradient(X), F, rtol=0.0, atol=1e-14)
    J = np.linalg.det(np.moveaxis(F, -1, 0))
    np.testing.assert_allclose(J, np.exp(exact.pressure(X) / bulk), rtol=0.0, atol=1e-13)
    assert np.abs(exact.gradient(X)).max() > 0.3


@pytest.mark.parametrize("bulk", [np.inf, 1e4 * MU], ids=["incompressible", "nearly"])
def test_taylor_hood_converges_with_three_two_and_two(bulk: float) -> None:
    """Displacement h^3, gradient h^2, pressure h^2 at least, whatever the bulk modulus.

    Catches: locking (rates of 2 and 1 at the larger modulus), a pressure interpolated on the wrong vertices.
    """
    _assert_rates([3, 4, 6], bulk, (9.0e-5, 4.2e-3, 7.0e-3))


def test_errors_do_not_grow_with_the_bulk_modulus() -> None:
    """Incompressible or 1e4 times stiffer in volume than in shear, the errors are the same within a hundredth.

    Catches: a stabilisation or a quadrature that acts like a penalty.
    """
    one, other = np.array(_errors(4, np.inf)), np.array(_errors(4, 1e4 * MU))
    np.testing.assert_allclose(one, other, rtol=0.01)


@pytest.mark.slow
@pytest.mark.parametrize("bulk", [np.inf, 1e4 * MU, 2.0 * MU])
def test_rates_hold_on_finer_meshes(bulk: float) -> None:
    """Up to ten cells a side.

    Catches: a rate that only holds before the quadrature's error shows.
    """
    _assert_rates([4, 6, 8, 10], bulk, (3.2e-5, 2.4e-3, 2.3e-3))

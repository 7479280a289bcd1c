"""Two levels of quadratic and linear tetrahedra: transfer, symmetry, iterations that stay bounded, whole solutions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import sparse

from fem_biobot.errors import ModelError
from fem_biobot.material import ActiveStress, NeoHooke
from fem_biobot.solid.linear import NotPositiveDefiniteError, conjugate_gradients
from fem_biobot.solid.model import SolidModel, linear_solver, solve
from fem_biobot.solid.multigrid import kernels
from fem_biobot.solid.multigrid.solver import TwoLevelSolver
from fem_biobot.solid.multigrid.two_level import TwoLevel
from fem_biobot.solid.newton import NewtonSettings
from fem_biobot.solid.records import Fix, Symmetry
from tests.helpers import box_mesh, generator, on_three_corners, unit

ITERATIVE = NewtonSettings(linear="iterative")


def _model(n: int, poisson: float = 0.4) -> SolidModel:
    """A muscle on three corners."""
    law, muscle = NeoHooke(10.0, poisson), ActiveStress(4.0, unit(0.3, 0.8, -0.5))
    return SolidModel(box_mesh(n), {"muscle": law}, {"muscle": muscle}, on_three_corners())


def _turned() -> SolidModel:
    """A box turned out of the axes, held along its own faces: nodes with axes of their own."""
    mesh = box_mesh(2)
    c, s = np.cos(0.4), np.sin(0.4)
    R = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]) @ np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    mesh = replace(mesh, points=R @ mesh.points)
    return SolidModel(mesh, {"muscle": NeoHooke(10.0, 0.4)}, supports=[Symmetry("x0"), Symmetry("y0"), Fix("z0")])


def _levels(model: SolidModel) -> tuple[TwoLevel, np.ndarray]:
    """Preconditioner and upper triangle of the tangent at a generic homogeneous strain."""
    system = model.system
    u = 0.05 * system.space.points.T @ generator(3).normal(size=(3, 3))
    points = system.points(system.deformation_gradient(u), 1.0)
    data = system.tangent(points.F, points.S, points.D)
    system.block(data)
    held = system.held
    levels = TwoLevel(system.pattern, system.space.nodes, held.turned, held.axes, held.dofs)
    return levels, data


def _full(data: np.ndarray, p: object) -> np.ndarray:
    upper = sparse.csr_matrix((data, p.columns, p.starts), shape=(p.n_dofs,) * 2).toarray()  # type: ignore[attr-defined]
    return upper + np.triu(upper, 1).T


@pytest.mark.parametrize("make", [lambda: _model(2), _turned], ids=["corners", "turned"])
def test_coarse_matrix_is_that_of_the_transfer(make: object) -> None:
    """``P^T A P`` with the transfer's own columns, at every vertex that is not held.

    Catches: a block added to the wrong half, transposed, or twice; turns left out; held unknowns that leak.
    """
    levels, data = _levels(make())  # type: ignore[operator]
    levels.renew(data)
    n, m = levels.fine.n_dofs, levels.coarse.n_dofs
    P = np.zeros((n, m))
    for j in range(m):
        e, x = np.zeros(m), np.zeros(n)
        e[j] = 1.0
        kernels.prolong(levels.parents, levels.turned, levels.axes, levels.blocked, e, x)
        P[:, j] = x
    free = levels.blocked[:m] == 0
    expected = P.T @ _full(data, levels.fine) @ P
    found = _full(levels._coarse_data, levels.coarse)
    scale = np.abs(expected).max()
    np.testing.assert_allclose(found[np.ix_(free, free)], expected[np.ix_(free, free)], atol=1e-13 * scale)
    assert np.abs(found[np.ix_(free, ~free)]).max() == 0.0


def test_linear_displacements_pass_unchanged() -> None:
    """A displacement that is linear in space is interpolated exactly, also between nodes with axes of their own.

    Catches: ends of an edge exchanged for those of another, a turn by the wrong node's axes.
    """
    model = _turned()
    levels, _ = _levels(model)
    X = model.system.space.points
    G = generator(4).normal(size=(3, 3))
    u = model.system.to_local((G @ X).T.copy()).ravel()
    x = np.zeros(levels.fine.n_dofs)
    kernels.prolong(
        levels.parents, levels.turned, levels.axes, np.zeros_like(levels.blocked), u[: levels.coarse.n_dofs], x
    )
    np.testing.assert_allclose(x, u, atol=1e-13)


@pytest.mark.parametrize("make", [lambda: _model(2), _turned], ids=["corners", "turned"])
def test_preconditioner_is_symmetric_and_positive(make: object) -> None:
    """What conjugate gradients need.

    Catches: smoothing before that is not the transpose of that after, restriction that is not the transpose.
    """
    levels, data = _levels(make())  # type: ignore[operator]
    levels.renew(data)
    u, v = generator(6).normal(size=(2, levels.fine.n_dofs))
    u[levels.blocked == 1] = v[levels.blocked == 1] = 0.0
    one, other = levels.solve(u) @ v, levels.solve(v) @ u
    size = abs(levels.solve(u) @ u)
    assert abs(one - other) <= 1e-12 * size
    assert levels.solve(u) @ u > 0.0


def test_iterations_do_not_grow_with_the_mesh() -> None:
    """To 1e-8 from 2 to 6 cells a side, forty times the unknowns.

    Catches: a coarse level that does not reach the smooth part (iterations double with the mesh).
    """
    used = []
    for n in (2, 4, 6):
        levels, data = _levels(_model(n))
        levels.renew(data)
        b = generator(5).normal(size=levels.fine.n_dofs)
        b[levels.blocked == 1] = 0.0
        _, count, reached = conjugate_gradients(levels.fine, data, b, levels.solve, tolerance=1e-8, max_iterations=100)
        assert reached
        used.append(count)
    assert used[-1] <= 1.3 * used[0] + 3, used
    assert used[-1] <= 40, used


def test_both_ways_find_the_same_equilibrium() -> None:
    """A contracted muscle by factorisation and by two levels.

    Catches: a preconditioner kept beyond its matrix, a tolerance that does not reach the residual's.
    """
    model = _model(3)
    direct, iterative = solve(model, [0.5, 1.0]), solve(model, [0.5, 1.0], settings=ITERATIVE)
    assert "two levels" in iterative.linear_solver
    assert "two levels" not in direct.linear_solver
    scale = np.abs(direct.states[-1].u).max()
    np.testing.assert_allclose(iterative.states[-1].u, direct.states[-1].u, atol=1e-7 * scale)
    assert iterative.states[-1].residual <= 1e-9


def test_no_stiffness_is_found_out() -> None:
    """A matrix with a direction of negative stiffness is refused.

    Catches: an iteration that goes on through negative curvature.
    """
    model = _model(2)
    levels, data = _levels(model)
    solver = TwoLevelSolver(levels)
    solver.refuse_unstable(data)
    data = data.copy()
    data[levels.fine.starts[30]] *= -1.0
    with pytest.raises(NotPositiveDefiniteError):
        solver.refuse_unstable(data)


def test_way_is_chosen_by_size_and_can_be_set() -> None:
    """Small models are factored; a word that is none is refused.

    Catches: a setting without effect.
    """
    model = _model(2)
    assert "two levels" not in linear_solver(model).name
    assert "two levels" in linear_solver(model, ITERATIVE).name
    with pytest.raises(ModelError, match="linear: found 'both', expected one of"):
        NewtonSettings(linear="both")


def test_two_levels_are_for_quadratic_displacements() -> None:
    """Linear tetrahedra have no coarser level here: refused, not ignored.

    Catches: a fallback in silence.
    """
    model = SolidModel(box_mesh(2), {"muscle": NeoHooke(10.0, 0.3)}, supports=on_three_corners(), element="P1")
    with pytest.raises(ModelError, match="linear: found 'iterative' with element P1, expected element P2"):
        linear_solver(model, ITERATIVE)

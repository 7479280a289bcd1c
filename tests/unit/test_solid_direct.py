"""The solver that factors: half the digits where they are enough, and stability without another factorisation."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import sparse

from fem_biobot.material import ActiveStress, NeoHooke
from fem_biobot.solid import solvers
from fem_biobot.solid.direct import LinearSolver
from fem_biobot.solid.linear import NotPositiveDefiniteError, Pardiso, SuperLU, factorisation, pardiso_missing
from fem_biobot.solid.model import SolidModel, linear_solver, solve
from fem_biobot.solid.newton import NewtonSettings
from tests.helpers import TIGHT, box_mesh, generator, on_three_corners, unit

MODEL = SolidModel(
    box_mesh(2),
    {"muscle": NeoHooke(10.0, 0.4)},
    {"muscle": ActiveStress(4.0, unit(0.3, 0.8, -0.5))},
    on_three_corners(),
)
PATTERN = MODEL.system.pattern

needs_pardiso = pytest.mark.skipif(pardiso_missing() is not None, reason=f"PARDISO: {pardiso_missing()}")


def _stiffness() -> np.ndarray:
    """Upper triangle of a positive definite tangent."""
    system = MODEL.system
    points = system.points(system.deformation_gradient(np.zeros((system.space.n_nodes, 3))), 0.0)
    data = system.tangent(points.F, points.S, points.D)
    system.block(data)
    return data


def _full(data: np.ndarray) -> np.ndarray:
    upper = sparse.csr_matrix((data, PATTERN.columns, PATTERN.starts)).toarray()
    return upper + np.triu(upper, 1).T


def _less(data: np.ndarray, share: float) -> np.ndarray:
    """`data` less that share of its smallest eigenvalue on the diagonal."""
    smallest = np.linalg.eigvalsh(_full(data))[0]
    out = data.copy()
    out[PATTERN.starts[:-1]] -= share * smallest
    return out


@needs_pardiso
def test_a_single_factor_has_half_the_digits() -> None:
    """A right-hand side of any size is solved to single precision, no better and no worse.

    Catches: values handed over in the wrong precision, a small right-hand side flushed to zero.
    """
    factor = Pardiso(PATTERN, single=True)
    factor.factor(_stiffness())
    b = 1e-60 * generator(6).normal(size=PATTERN.n_dofs)
    x = factor.solve(b)
    assert x.dtype == np.float64
    rest = np.linalg.norm(_full(_stiffness()) @ x - b) / np.linalg.norm(b)
    assert 1e-8 < rest < 1e-4
    assert not np.any(factor.solve(np.zeros_like(b)))
    assert "single" in factor.name
    assert "single" not in Pardiso(PATTERN).name


def test_the_answer_has_all_digits_whatever_the_factor() -> None:
    """Solved to 1e-10 with a single factor, at once and with that of a near matrix.

    Catches: the single factor's own answer handed on.
    """
    solver = LinearSolver(PATTERN, NewtonSettings(), single=True)
    b = generator(6).normal(size=PATTERN.n_dofs)
    for data in (_stiffness(), _less(_stiffness(), 0.1)):
        x = solver.solve(data, b, 1e-10)
        assert np.linalg.norm(_full(data) @ x - b) < 2e-10 * np.linalg.norm(b)
    assert solver.counts.factorisations == 1
    assert solver.counts.cg > 0


@needs_pardiso
def test_what_a_single_factor_cannot_is_done_in_double() -> None:
    """A matrix nearer to singular than single precision can tell is solved, and is found stable, in double precision.

    Catches: a rounded refusal taken for an instability, a hundred iterations with a useless factor.
    """
    data = _less(_stiffness(), 1.0 - 1e-8)
    b = generator(6).normal(size=PATTERN.n_dofs)
    for ask in ("solve", "stability"):
        solver = LinearSolver(PATTERN, NewtonSettings(), single=True)
        assert solver.single
        if ask == "solve":
            x = solver.solve(data, b, 1e-10)
            # rounding of a product with the solution, which is some 1e9 times the right-hand side
            rounding = np.finfo(float).eps * np.linalg.norm(_full(data)) * np.linalg.norm(x)
            assert np.linalg.norm(_full(data) @ x - b) < 10.0 * rounding
        else:
            solver.refuse_unstable(data)
        assert not solver.single
        assert "single" not in solver.name


@pytest.mark.parametrize("single", [False, True])
def test_stability_is_told_with_the_factor_at_hand(single: bool) -> None:
    """With the factor of a near matrix a barely stable one passes without another, a barely unstable one is refused.

    Catches: the check left out, a factorisation for every state, pivots of the old matrix looked at.
    """
    solver = LinearSolver(PATTERN, NewtonSettings(max_cg=30), single=single)
    solver.factor(_stiffness())
    solver.refuse_unstable(_less(_stiffness(), 0.999))
    assert solver.counts.factorisations == 1
    with pytest.raises(NotPositiveDefiniteError):
        solver.refuse_unstable(_less(_stiffness(), 1.001))


def test_a_factor_too_far_away_is_not_tried_at_all() -> None:
    """Where the last solve shows that the digits wanted take too many iterations, the matrix is factored.

    Catches: iterations spent on a factor that is bound to be given up.
    """
    solver = LinearSolver(PATTERN, NewtonSettings(max_cg=6))
    b = generator(6).normal(size=PATTERN.n_dofs)
    solver.solve(_stiffness(), b, 1e-10)
    far = _stiffness()
    far[PATTERN.starts[:-1]] *= 1.0 + 0.05 * generator(4).uniform(size=PATTERN.n_dofs)
    solver.solve(far, b, 0.5)
    used, made = solver.counts.cg, solver.counts.factorisations
    assert used > 0
    assert made == 1
    solver.solve(far, b, 1e-12)
    assert (solver.counts.cg, solver.counts.factorisations) == (used, made + 1)


def test_large_models_are_factored_in_single_precision(monkeypatch: pytest.MonkeyPatch) -> None:
    """From `FEW` unknowns on; the states are those of double precision, and the solution names the precision.

    Catches: single precision everywhere or nowhere, states that depend on it.
    """
    double = solve(MODEL, [0.5, 1.0], settings=TIGHT)
    monkeypatch.setattr(solvers, "FEW", MODEL.n_dofs - 1)
    assert linear_solver(MODEL).counts.factorisations == 0
    single = solve(MODEL, [0.5, 1.0], settings=TIGHT)
    for one, other in zip(single.states, double.states, strict=True):
        np.testing.assert_allclose(one.u, other.u, rtol=0.0, atol=1e-10)
    named = factorisation(PATTERN, single=True)
    assert single.linear_solver == named.name
    assert isinstance(named, SuperLU) or single.linear_solver != double.linear_solver

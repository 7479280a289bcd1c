"""Linear algebra of the solid: both factorisations, their refusals, conjugate gradients, and how little is factored."""

from __future__ import annotations

import os
import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import sparse

from fem_biobot.material import ActiveStress, NeoHooke
from fem_biobot.solid import linear, products
from fem_biobot.solid.direct import LinearSolver
from fem_biobot.solid.linear import (
    NotPositiveDefiniteError,
    Pardiso,
    SuperLU,
    conjugate_gradients,
    factorisation,
    pardiso_missing,
)
from fem_biobot.solid.mixed.kernels import symmetric_product
from fem_biobot.solid.model import SolidModel, linear_solver, solve
from fem_biobot.solid.newton import NewtonSettings
from fem_biobot.solid.pattern import Pattern, pattern
from fem_biobot.solid.products import write_node_product
from fem_biobot.solid.sharing import run_parts
from fem_biobot.solid.vectors.kernels import add_node_rows
from tests.helpers import TIGHT, box_mesh, generator, on_three_corners, unchanged, unit

MODEL = SolidModel(
    box_mesh(2),
    {"muscle": NeoHooke(10.0, 0.4)},
    {"muscle": ActiveStress(4.0, unit(0.3, 0.8, -0.5))},
    on_three_corners(),
)
PATTERN = MODEL.system.pattern

needs_pardiso = pytest.mark.skipif(pardiso_missing() is not None, reason=f"PARDISO: {pardiso_missing()}")
every_kind = pytest.mark.parametrize("kind", [pytest.param(Pardiso, marks=needs_pardiso), SuperLU])


def _stiffness() -> np.ndarray:
    """Upper triangle of a positive definite tangent."""
    system = MODEL.system
    points = system.points(system.deformation_gradient(np.zeros((system.space.n_nodes, 3))), 0.0)
    data = system.tangent(points.F, points.S, points.D)
    system.block(data)
    return data


def _full(data: np.ndarray, p: Pattern = PATTERN) -> np.ndarray:
    upper = sparse.csr_matrix((data, p.columns, p.starts), shape=(p.n_dofs, p.n_dofs)).toarray()
    return upper + np.triu(upper, 1).T


def _indefinite() -> np.ndarray:
    """The same with one direction of negative stiffness."""
    data = _stiffness()
    data[PATTERN.starts[7]] *= -1.0
    assert np.linalg.eigvalsh(_full(data))[0] < 0.0
    return data


@every_kind
def test_the_factor_solves_and_can_be_renewed(kind: type) -> None:
    """Both factorisations solve the symmetric system, and again after new values on the same pattern.

    Catches: the upper triangle taken for the full matrix, an old factor kept.
    """
    factor = kind(PATTERN)
    b = generator(6).normal(size=PATTERN.n_dofs)
    for scale in (1.0, 3.0):
        data = _stiffness()
        data[PATTERN.starts[:-1]] *= scale
        factor.factor(data)
        with unchanged(b, data):
            x = factor.solve(b)
        expected = np.linalg.solve(_full(data), b)
        np.testing.assert_allclose(x, expected, rtol=0.0, atol=1e-10 * np.abs(expected).max())


@pytest.mark.parametrize(("compiled", "threads"), [(True, 1), (True, 3), (False, 1)])
def test_the_products_are_those_of_the_whole_matrix(
    compiled: bool, threads: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By blocks and by rows, with entries in double and in single precision, compiled, shared, and as plain Python.

    Catches: a block taken for its transpose, the last block or the node's own left out, sums in single precision, a
    thread's rows done twice or not at all.
    """
    shared = []
    monkeypatch.setattr(products, "usable_threads", lambda: threads)
    monkeypatch.setattr(products, "_FEWEST", 100)
    monkeypatch.setattr(products, "run_parts", lambda work, parts: shared.append(len(parts)) or run_parts(work, parts))
    if not compiled:
        monkeypatch.setattr(products, "add_node_rows", getattr(add_node_rows, "py_func", add_node_rows))
    data, x = _stiffness(), generator(3).normal(size=PATTERN.n_dofs)
    data += generator(5).normal(size=data.shape)  # no block of it is symmetric
    single = data.astype(np.float32)
    for product, values in ((write_node_product, data), (write_node_product, single), (symmetric_product, data)):
        y = np.full_like(x, np.nan)
        write = product if compiled else getattr(product, "py_func", product)
        write(PATTERN.starts, PATTERN.columns, values, x, y)
        np.testing.assert_allclose(y, _full(values.astype(float)) @ x, rtol=0.0, atol=1e-12 * np.abs(y).max())
    assert shared == ([threads, threads] if threads > 1 else [])


@needs_pardiso
def test_cholesky_refuses_an_indefinite_matrix_and_then_goes_on() -> None:
    """A direction of negative stiffness is refused, and the next good matrix is factored as before.

    Catches: an indefinite factorisation used, the error taken for a lack of memory.
    """
    factor = Pardiso(PATTERN)
    with pytest.raises(NotPositiveDefiniteError):
        factor.factor(_indefinite())
    data, b = _stiffness(), np.ones(PATTERN.n_dofs)
    factor.factor(data)
    np.testing.assert_allclose(_full(data) @ factor.solve(b), b, rtol=0.0, atol=1e-9)


@needs_pardiso
def test_the_pattern_is_analysed_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """One analysis serves all factorisations of an object.

    Catches: an analysis with every factorisation, which costs as much as the factorisation.
    """
    phases = []
    run = Pardiso._run
    monkeypatch.setattr(Pardiso, "_run", lambda self, phase, *rest: phases.append(phase) or run(self, phase, *rest))
    factor = Pardiso(PATTERN)
    for _ in range(3):
        factor.factor(_stiffness())
        factor.solve(np.ones(PATTERN.n_dofs))
    assert phases == [11, 22, 33, 22, 33, 22, 33]


@needs_pardiso
@pytest.mark.parametrize(("phase", "word"), [(11, "analysis"), (22, "factorisation"), (33, "solution")])
def test_other_failures_of_pardiso_are_told(monkeypatch: pytest.MonkeyPatch, phase: int, word: str) -> None:
    """An error code of any phase ends in an error that names the phase and the code.

    Catches: a code ignored, and a solution of nonsense.
    """
    run = Pardiso._run
    monkeypatch.setattr(Pardiso, "_run", lambda self, p, *rest: -2 if p == phase else run(self, p, *rest))
    factor = Pardiso(PATTERN)

    def solve_once() -> None:
        factor.factor(_stiffness())
        factor.solve(np.ones(PATTERN.n_dofs))

    with pytest.raises(MemoryError, match=f"{word} failed with code -2"):
        solve_once()


def test_superlu_refuses_a_singular_matrix() -> None:
    """A matrix with an empty row is refused as not positive definite, not by a RuntimeError.

    Catches: SuperLU's own error let through.
    """
    data = _stiffness()
    rows = np.repeat(np.arange(PATTERN.n_dofs), np.diff(PATTERN.starts))
    data[(rows == 9) | (PATTERN.columns == 9)] = 0.0
    with pytest.raises(NotPositiveDefiniteError):
        SuperLU(PATTERN).factor(data)


def test_conjugate_gradients_refuse_an_indefinite_matrix() -> None:
    """A direction of negative curvature is told, also with an exact factor of another matrix.

    Catches: the sign of the curvature not looked at.
    """
    factor = SuperLU(PATTERN)
    factor.factor(_stiffness())
    b = generator(6).normal(size=PATTERN.n_dofs)
    with pytest.raises(NotPositiveDefiniteError):
        conjugate_gradients(PATTERN, _indefinite(), b, factor.solve, tolerance=1e-12, max_iterations=200)


def test_conjugate_gradients_reach_the_tolerance_or_say_that_they_do_not() -> None:
    """With the factor of a near matrix they converge in a few iterations; cut short they say so.

    Catches: the preconditioner left out, the flag always true, an absolute tolerance.
    """
    factor = SuperLU(PATTERN)
    factor.factor(_stiffness())
    data = _stiffness()
    data[PATTERN.starts[:-1]] *= 1.0 + 1e-3 * generator(4).uniform(size=PATTERN.n_dofs)
    b = 1e-9 * generator(6).normal(size=PATTERN.n_dofs)
    with unchanged(data, b):
        x, used, reached = conjugate_gradients(PATTERN, data, b, factor.solve, tolerance=1e-10, max_iterations=40)
    assert reached
    assert used < 15
    assert np.linalg.norm(_full(data) @ x - b) < 2e-10 * np.linalg.norm(b)
    x, used, reached = conjugate_gradients(PATTERN, data, b, factor.solve, tolerance=1e-10, max_iterations=2)
    assert used == 2
    assert not reached


def test_the_variable_asks_for_superlu_and_the_answer_is_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    """FEM_BIOBOT_FACTORISATION=superlu chooses SuperLU, which the solution names, and gives the same states.

    Catches: the variable ignored, the fallback silent, a factor of half the matrix.
    """
    usual = solve(MODEL, [0.5, 1.0], settings=TIGHT)
    monkeypatch.setenv("FEM_BIOBOT_FACTORISATION", "SuperLU")
    assert "asks for SuperLU" in (pardiso_missing() or "")
    other = solve(MODEL, [0.5, 1.0], settings=TIGHT)
    assert other.linear_solver == SuperLU.name
    np.testing.assert_allclose(other.last.u, usual.last.u, rtol=0.0, atol=1e-10)
    assert abs(other.factorisations - usual.factorisations) <= 1


def test_a_missing_library_is_named_and_superlu_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where MKL cannot be loaded the reason is kept for the report and SuperLU takes over.

    Catches: an import error that ends the run.
    """

    def missing() -> None:
        raise ImportError("no libmkl_rt.so")

    monkeypatch.delenv("FEM_BIOBOT_FACTORISATION", raising=False)
    monkeypatch.setattr(linear, "_mkl_pardiso", missing)
    assert pardiso_missing() == "no libmkl_rt.so"
    assert isinstance(factorisation(PATTERN), SuperLU)


def test_the_library_is_looked_for_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """A second solve does not search the disk for MKL again.

    Catches: pypardiso's search through the whole environment, half a second, at every solve.
    """
    pypardiso = pytest.importorskip("pypardiso.pardiso_wrapper")
    solve(MODEL, [0.1])
    made = []
    build = pypardiso.PyPardisoSolver.__init__
    monkeypatch.setattr(
        pypardiso.PyPardisoSolver, "__init__", lambda self, *a, **k: made.append(1) or build(self, *a, **k)
    )
    solve(MODEL, [0.1])
    assert not made


def test_a_solver_may_serve_several_calls() -> None:
    """A shared solver keeps its analysis; each solution counts its own work only.

    Catches: counts that go on from the call before.
    """
    shared = linear_solver(MODEL)
    first = solve(MODEL, [0.5], solver=shared)
    second = solve(MODEL, [0.5], solver=shared)
    assert first.factorisations == second.factorisations == shared.counts.factorisations // 2 > 0
    np.testing.assert_array_equal(first.last.u, second.last.u)


class _Counting:
    """A factorisation that counts, on SuperLU."""

    name = "counting"
    single = False

    def __init__(self) -> None:
        self.inner, self.factored, self.negative_pivots = SuperLU(PATTERN), 0, 0

    def factor(self, data: np.ndarray) -> None:
        self.factored += 1
        self.inner.factor(data)
        self.negative_pivots = self.inner.negative_pivots

    def solve(self, b: np.ndarray) -> np.ndarray:
        return self.inner.solve(b)


def test_a_near_tangent_is_not_factored_again_and_a_far_one_is() -> None:
    """Within a step the first factor preconditions; after `renew`, or when it no longer helps, a new one is made.

    Catches: a factorisation an iteration; an old factor kept at any price, also against negative curvature.
    """
    counting = _Counting()
    solver = LinearSolver(PATTERN, NewtonSettings(), _factor=counting)
    data, b = _stiffness(), np.ones(PATTERN.n_dofs)

    def solved(values: np.ndarray) -> np.ndarray:
        x = solver.solve(values, b, 1e-10)
        np.testing.assert_allclose(_full(values) @ x, b, rtol=0.0, atol=1e-7)
        return x

    solved(data)
    near = data.copy()
    near[PATTERN.starts[:-1]] *= 1.001
    solved(near)
    assert counting.factored == 1
    far = data.copy()
    far[PATTERN.starts[:-1]] *= 1.0 + 50.0 * generator(4).uniform(size=PATTERN.n_dofs)
    solved(far)
    assert counting.factored == 2
    with pytest.raises(NotPositiveDefiniteError):
        solver.solve(_indefinite(), b, 1e-10)
    assert counting.factored == 3
    solver.renew()
    solved(data)
    assert counting.factored == 4 == solver.counts.factorisations + 1  # refused ones do not count
    assert solver.counts.cg > 0


def test_a_pattern_too_large_for_its_indices_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """More entries than 32-bit indices hold are refused, not wrapped around.

    Catches: int32 overflow in the row starts.
    """

    class Narrow:
        """numpy whose int32 ends at 1000."""

        def __getattr__(self, name: str) -> object:
            return getattr(np, name)

        def iinfo(self, _: object) -> SimpleNamespace:
            return SimpleNamespace(max=1000)

    monkeypatch.setattr("fem_biobot.solid.pattern.np", Narrow())
    with pytest.raises(MemoryError, match="32-bit"):
        pattern(MODEL.system.space.nodes, MODEL.system.space.n_nodes)


_BLOCKTIME = """
import ctypes
import numpy as np
from scipy.sparse import identity
from fem_biobot.solid.linear import pardiso_missing
assert pardiso_missing() is None
from pypardiso import spsolve
spsolve(identity(4, format="csr"), np.ones(4))  # MKL loads its threads at the first call
with open("/proc/self/maps") as maps:
    library = next(line.split()[-1] for line in maps if "libiomp5" in line)
print(ctypes.CDLL(library).kmp_get_blocktime())
"""


@needs_pardiso
@pytest.mark.skipif(sys.platform != "linux", reason="needs /proc")
@pytest.mark.parametrize(("asked", "found"), [(None, 1), ("150", 150)])
def test_idle_threads_of_the_factorisation_leave_their_processor(asked: str | None, found: int) -> None:
    """MKL's threads wait for 1 ms, and not 200, before they sleep, unless the user says how long.

    Catches: the variable set after MKL was loaded, which reads it once, or written over the user's.
    """
    kept = {key: value for key, value in os.environ.items() if key != "KMP_BLOCKTIME"}
    env = kept if asked is None else {**kept, "KMP_BLOCKTIME": asked}
    done = subprocess.run([sys.executable, "-c", _BLOCKTIME], env=env, capture_output=True, text=True, check=True)
    assert int(done.stdout) == found

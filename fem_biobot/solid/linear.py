"""Linear algebra of the solid: symmetric factorisation with its analysis kept, and conjugate gradients on top of it.

PARDISO (Intel MKL, loaded through pypardiso) factors the upper triangle as it is assembled, after one analysis per
pattern; its refusal of a matrix that is not positive definite is handed on as `NotPositiveDefiniteError`. The matrix of
the mixed form is a saddle point's: there it factors with symmetric pivots and counts the negative ones. Elsewhere
SuperLU factors the full matrix with pivots on the diagonal, whose signs say the same (Sylvester's law of inertia).

What was measured for the saddle point at 65 000 unknowns, one factorisation of the displacement form being 1: symmetric
indefinite factorisation 1.3 (two threads) or 1.6 (one); at 155 000 unknowns 1.9. Minimal residuals, preconditioned by
the positive definite factor of the body at a Poisson's ratio of 0.45 and the pressures' mass matrix, need 28 iterations
to 1e-3 and 74 to 1e-8, 2 and 5 beside that factor. Whole tension path of the machine, incompressible: 20
factorisations and 36 Newton iterations.
"""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Callable
from functools import cache
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import LinearOperator, eigs, splu

from fem_biobot.solid.mixed.kernels import symmetric_product
from fem_biobot.solid.pattern import Pattern
from fem_biobot.solid.products import write_node_product
from fem_biobot.solid.unsymmetric.kernels import add_skew_product, add_to
from fem_biobot.solid.vectors.kernels import add_scaled, advance, inner_product

Array = NDArray[np.float64]

# that threads of MKL go on asking for work once theirs is done
_IDLE_MS = "1"


class NotPositiveDefiniteError(Exception):
    """The matrix has a direction of no or negative stiffness; the caller halves its step or reports instability."""


class Solver(Protocol):
    """What solves for forces on the displacements."""

    def solve(self, b: Array) -> Array:
        """Answer to one right side (dofs,) or several (k, dofs); a new array."""
        ...


class Factorisation(Solver, Protocol):
    """A factorisation that can be renewed for new values on the same pattern.

    `negative_pivots` of the latest matrix are as many as its negative eigenvalues.
    """

    name: str
    negative_pivots: int
    single: bool

    def factor(self, data: Array) -> None:
        """Factor the matrix with these upper-triangle values; may raise `NotPositiveDefiniteError`."""
        ...

    def solve(self, b: Array) -> Array:
        """Solve with the latest factor for one right side (dofs,) or several (k, dofs); returns a new array."""
        ...


class Pardiso:
    """Factorisation by MKL's PARDISO, one analysis for the life of the object.

    Cholesky's for displacements alone, in single precision if wished; with pressures ``L D L^T`` with pivots of one or
    two rows; without symmetry ``L U``.
    """

    def __init__(self, pattern: Pattern, symmetric: bool = True, single: bool = False) -> None:
        self._call = _mkl_pardiso()
        self._kind = 11 if not symmetric else -2 if pattern.n_pressures else 2
        kind = {11: "unsymmetric", -2: "symmetric indefinite", 2: "symmetric positive definite"}[self._kind]
        self.name = f"PARDISO (MKL), {kind}" + (", single precision" if single else "")
        self.single = single
        self.negative_pivots = 0
        self._whole = None if symmetric else Whole(pattern)
        self._starts, self._columns = (self._whole or pattern).starts, (self._whole or pattern).columns
        self._pattern = pattern
        self._pt = np.zeros(64, dtype=np.int64)
        iparm = np.zeros(64, dtype=np.int32)
        iparm[0] = 1  # no defaults: every entry below is chosen
        iparm[1] = 2  # nested dissection by METIS
        iparm[9] = 8  # pivot perturbation 1e-8 (unused for a definite matrix)
        iparm[17] = -1  # report the fill
        iparm[20] = 1  # pivots of one or two rows (Bunch and Kaufman) where indefinite
        iparm[23] = 1  # two-level factorisation, scales on few threads
        iparm[27] = int(single)
        iparm[34] = 1  # zero-based indices
        self._iparm = iparm
        self._analysed = False
        self._data: Array | NDArray[np.float32] | None = None

    def _run(self, phase: int, data: Any, b: Any = None, x: Any = None) -> int:
        int32 = ctypes.c_int32
        error = int32(0)
        dummy = ctypes.c_double(0.0)

        def at(array: np.ndarray | None) -> Any:
            return ctypes.byref(dummy) if array is None else array.ctypes.data_as(ctypes.c_void_p)

        n = self._pattern.n_dofs
        self._call(
            self._pt.ctypes.data_as(ctypes.POINTER(ctypes.c_int64)),
            ctypes.byref(int32(1)), ctypes.byref(int32(1)), ctypes.byref(int32(self._kind)), ctypes.byref(int32(phase)),
            ctypes.byref(int32(n)),
            at(data),
            self._starts.ctypes.data_as(ctypes.POINTER(int32)),
            self._columns.ctypes.data_as(ctypes.POINTER(int32)),
            ctypes.byref(int32(0)), ctypes.byref(int32(1 if b is None else b.size // n)),
            self._iparm.ctypes.data_as(ctypes.POINTER(int32)),
            ctypes.byref(int32(0)),
            at(b), at(x), ctypes.byref(error),
        )  # fmt: skip
        return error.value

    def factor(self, data: Array) -> None:
        """Factor; the first call also analyses the pattern."""
        if self._whole is not None:
            data = self._whole.entries(data)
        values = data.astype(np.float32) if self.single else data
        if not self._analysed:
            error = self._run(11, values)
            if error:
                raise MemoryError(f"PARDISO: analysis failed with code {error}")
            self._analysed = True
        error = self._run(22, values)
        if error == -4:
            raise NotPositiveDefiniteError
        if error:
            raise MemoryError(f"PARDISO: factorisation failed with code {error}")
        self._data = values
        self.negative_pivots = int(self._iparm[22])

    def solve(self, b: Array) -> Array:
        """Solve with the latest factor."""
        if not self.single:
            return self._solved(np.ascontiguousarray(b))
        # neither the right-hand side nor the solution may leave the range of small numbers
        size = float(np.max(np.abs(b))) or 1.0
        return size * self._solved((b / size).astype(np.float32)).astype(float)

    def _solved(self, b: Any) -> Any:
        x = np.empty_like(b)
        error = self._run(33, self._data, b, x)
        if error:
            raise MemoryError(f"PARDISO: solution failed with code {error}")
        return x

    def __del__(self) -> None:
        # at the interpreter's end the memory goes with the process, and modules may be gone
        if getattr(self, "_analysed", False) and not sys.is_finalizing():
            self._run(-1, None)


class SuperLU:
    """LU factorisation by SciPy's SuperLU, for machines without MKL; symmetric ordering, diagonal pivots."""

    name = "SuperLU (SciPy)"
    single = False

    def __init__(self, pattern: Pattern, symmetric: bool = True) -> None:
        self._pattern = pattern
        self._whole = None if symmetric else Whole(pattern)
        self._lu: Any = None
        self.negative_pivots = 0

    def factor(self, data: Array) -> None:
        """Factor the full matrix; raises `NotPositiveDefiniteError` where a matrix of displacements alone is not."""
        p = self._pattern
        if self._whole is not None:
            w = self._whole
            full = sparse.csr_matrix((w.entries(data), w.columns, w.starts), shape=(p.n_dofs, p.n_dofs)).tocsc()
            try:
                self._lu = splu(full, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.1)
            except RuntimeError:
                raise NotPositiveDefiniteError from None
            return
        upper = sparse.csr_matrix((data, p.columns, p.starts), shape=(p.n_dofs, p.n_dofs))
        full = (upper + sparse.triu(upper, 1).T).tocsc()
        try:
            self._lu = splu(full, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
        except RuntimeError:
            raise NotPositiveDefiniteError from None
        # a pivot off the diagonal replaces one that vanishes: no stable equilibrium either
        if not np.array_equal(self._lu.perm_r, self._lu.perm_c):
            raise NotPositiveDefiniteError
        self.negative_pivots = int(np.sum(self._lu.U.diagonal() < 0.0))
        if self.negative_pivots and not p.n_pressures:
            raise NotPositiveDefiniteError

    def solve(self, b: Array) -> Array:
        """Solve with the latest factor."""
        return self._lu.solve(b) if b.ndim == 1 else np.ascontiguousarray(self._lu.solve(np.ascontiguousarray(b.T)).T)


@cache
def _mkl_pardiso() -> Callable[..., None]:
    """MKL's `pardiso` entry as pypardiso finds and types it; ImportError where it is not installed."""
    # 0.2 s by default, in which they keep a processor from the threads that share elements
    os.environ.setdefault("KMP_BLOCKTIME", _IDLE_MS)
    from pypardiso.pardiso_wrapper import PyPardisoSolver

    return PyPardisoSolver()._mkl_pardiso


def pardiso_missing() -> str | None:
    """Why PARDISO cannot be used here, or None if it can."""
    if os.environ.get("FEM_BIOBOT_FACTORISATION", "").lower() == "superlu":
        return "FEM_BIOBOT_FACTORISATION asks for SuperLU"
    try:
        _mkl_pardiso()
    except (ImportError, OSError, AttributeError) as error:
        return str(error) or type(error).__name__
    return None


def factorisation(pattern: Pattern, symmetric: bool = True, *, single: bool = False) -> Factorisation:
    """The best factorisation that this machine has; in single precision if wished and the library can."""
    return SuperLU(pattern, symmetric) if pardiso_missing() else Pardiso(pattern, symmetric, single)


class Whole:
    """Both triangles of a matrix that is kept as the upper triangles of its symmetric and of its skew part."""

    def __init__(self, pattern: Pattern) -> None:
        shape = (pattern.n_dofs, pattern.n_dofs)
        number = np.arange(1, len(pattern.columns) + 1)  # of each entry; none is zero, so that none is dropped
        upper = sparse.csr_matrix((number, pattern.columns, pattern.starts), shape=shape)
        whole = (upper - sparse.triu(upper, 1).T).tocsr()
        whole.sort_indices()
        self.starts, self.columns = whole.indptr.astype(np.int32), whole.indices.astype(np.int32)
        self._place = np.abs(whole.data) - 1
        self._sign = np.sign(whole.data).astype(float)

    def entries(self, data: Array) -> Array:
        """Entries of both triangles, from (2, entries) of the upper ones."""
        even, odd = data
        return even[self._place] + self._sign * odd[self._place]


def has_negative_eigenvalue(factor: Factorisation, pattern: Pattern) -> bool:
    """Whether one of the real eigenvalues nearest to zero is negative, by Arnoldi's iteration with the inverse.

    Pressures, where there are some, are constraints.
    """
    n = pattern.n_dofs - pattern.n_pressures

    def inverse(x: Array) -> Array:
        whole = np.zeros(pattern.n_dofs)
        whole[:n] = x
        return factor.solve(whole)[:n]

    operator: Any = LinearOperator((n, n), matvec=inverse, dtype=float)  # type: ignore[call-arg]
    found: Any = eigs(operator, k=4, which="LM", return_eigenvectors=False, v0=np.ones(n))
    real = np.abs(found.imag) < 1e-6 * np.abs(found)
    return bool(np.any(found.real[real] < 0.0))


def product(pattern: Pattern, data: Array, x: Array) -> Array:
    """Matrix times vector, (dofs,); `data` as the upper triangle, or (2, entries) without symmetry."""
    y = np.empty(pattern.n_dofs)
    _write_product(pattern, data if data.ndim == 1 else data[0], x, y)
    if data.ndim == 2:
        add_skew_product(pattern.starts, pattern.columns, data[1], x, y)
    return y


def _write_product(pattern: Pattern, data: Array, x: Array, y: Array) -> None:
    write = symmetric_product if pattern.n_pressures else write_node_product
    write(pattern.starts, pattern.columns, data, x, y)


def euclidean_norm(x: Array) -> float:
    """Euclidean norm of all components; compiled, for BLAS would wake threads against those of the factorisation."""
    flat = np.ascontiguousarray(x).ravel()
    return float(np.sqrt(inner_product(flat, flat)))


def conjugate_gradients(
    pattern: Pattern,
    data: Array,
    b: Array,
    precondition: Callable[[Array], Array],
    *,
    tolerance: float,
    max_iterations: int,
) -> tuple[Array, int, bool]:
    """Preconditioned conjugate gradients from zero.

    Parameters
    ----------
    pattern, data
        Upper triangle of the symmetric matrix.
    b
        Right-hand side, (dofs,).
    precondition
        Approximate inverse, symmetric positive definite.
    tolerance
        Reduction of the residual norm at which to stop.
    max_iterations
        Limit.

    Returns
    -------
    tuple
        Solution, iterations used, and whether the tolerance was reached.

    Raises
    ------
    NotPositiveDefiniteError
        On a direction of negative curvature.
    """
    # vector operations are compiled too: BLAS would wake threads of its own against those of the factorisation
    x = np.zeros_like(b)
    r = b.copy()
    Ap = np.empty_like(b)
    goal = tolerance**2 * inner_product(b, b)
    z = precondition(r)
    p = z.copy()
    rz = inner_product(r, z)
    for iteration in range(1, max_iterations + 1):
        _write_product(pattern, data, p, Ap)
        curvature = inner_product(p, Ap)
        if not curvature > 0.0:
            raise NotPositiveDefiniteError
        if advance(rz / curvature, p, Ap, x, r) <= goal:
            return x, iteration, True
        z = precondition(r)
        rz, before = inner_product(r, z), rz
        add_scaled(z, rz / before, p)
    return x, max_iterations, False


def minimal_residuals(
    pattern: Pattern,
    data: Array,
    b: Array,
    precondition: Callable[[Array], Array],
    *,
    tolerance: float,
    max_iterations: int,
) -> tuple[Array, int, bool]:
    """Generalised minimal residuals (Saad and Schultz 1986) from zero, preconditioned on the right.

    For the symmetric indefinite matrix of the mixed form, whose preconditioner, the factor of a near matrix, is
    indefinite too, and for matrices without symmetry. Keeps two vectors an iteration, so it is for few. Parameters and
    results as those of `conjugate_gradients`.
    """
    size = euclidean_norm(b)
    if size == 0.0:
        return np.zeros_like(b), 0, True
    basis, directions = [b / size], []
    H = np.zeros((max_iterations + 1, max_iterations))
    target = np.zeros(max_iterations + 1)
    target[0] = size
    weights = np.zeros(0)
    reached = False
    for k in range(max_iterations):
        directions.append(precondition(basis[k]))
        w = product(pattern, data, directions[k])
        for i in range(k + 1):
            H[i, k] = inner_product(basis[i], w)
            add_to(w, -H[i, k], basis[i])
        H[k + 1, k] = euclidean_norm(w)
        weights, *_ = np.linalg.lstsq(H[: k + 2, : k + 1], target[: k + 2], rcond=None)
        rest = float(np.linalg.norm(target[: k + 2] - H[: k + 2, : k + 1] @ weights))
        reached = rest <= tolerance * size
        if reached or H[k + 1, k] <= np.finfo(float).eps * size:
            break
        basis.append(w / H[k + 1, k])
    x = np.zeros_like(b)
    for weight, direction in zip(weights, directions, strict=True):
        add_to(x, float(weight), direction)
    return x, len(directions), reached

"""Preconditioner of the tangent on quadratic tetrahedra: smoothing there, a factorisation on the linear ones.

Displacements that are linear between the vertices are an eighth of all; on them the matrix is factored. What they do
not see, a polynomial in the block-diagonally scaled matrix takes away. The factor grows much more slowly than that of
the whole matrix, and the number of conjugate-gradient iterations hardly grows with the mesh.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fem_biobot.solid.linear import Factorisation, NotPositiveDefiniteError, factorisation
from fem_biobot.solid.multigrid import kernels
from fem_biobot.solid.pattern import Pattern, pattern
from fem_biobot.solid.products import write_node_product
from fem_biobot.solid.vectors.kernels import inner_product

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

# ends of the tetrahedron's edges in the order of their nodes
_EDGES = ((0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3))
_DEGREE = 3  # of the smoothing polynomial, before and after the coarse level
_BAND = 20.0  # largest eigenvalue over the smallest that the polynomial damps; the coarse level takes the rest
_POWER_STEPS = 12  # for the largest eigenvalue, of which a tenth more is assumed


class TwoLevel:
    """An approximate inverse of a positive definite tangent, symmetric and positive definite itself.

    Parameters
    ----------
    fine
        Pattern of the tangent on quadratic tetrahedra.
    nodes
        Nodes of each element, (10, e), vertices first and numbered first.
    turned, axes, held
        Nodes' own axes as in `solid.held.Held`, and the unknowns held.

    Notes
    -----
    A p-multigrid of two levels with a Galerkin coarse matrix: Ronquist and Patera (1987). The smoother is Chebyshev's
    polynomial in ``D^-1 A`` (Adams et al. 2003), ``D`` the nodes' own blocks. Near incompressibility the linear
    tetrahedra lock and iterations grow: about 25 to 1e-8 at a Poisson's ratio of 0.45, three times as many at 0.49.
    """

    name = "conjugate gradients preconditioned by two levels (P2, factorised P1)"

    def __init__(self, fine: Pattern, nodes: Ints, turned: Ints, axes: Array, held: Ints) -> None:
        n = fine.n_dofs // 3
        n_vertices = int(nodes[:4].max()) + 1
        self.fine, self.turned, self.axes = fine, turned, np.ascontiguousarray(axes)
        self.parents = np.repeat(np.arange(n, dtype=np.int64)[:, None], 2, axis=1)
        for k, (a, b) in enumerate(_EDGES):
            self.parents[nodes[4 + k], 0], self.parents[nodes[4 + k], 1] = nodes[a], nodes[b]
        self.blocked = np.zeros(3 * n, dtype=np.int64)
        self.blocked[held] = 1
        self.coarse = pattern(nodes[:4], n_vertices)
        self._data = np.zeros(0, dtype=np.float32)
        self._coarse_data = np.zeros(len(self.coarse.columns))
        self._factor: Factorisation = factorisation(self.coarse)
        self._inverse = np.zeros((n, 3, 3))
        self._largest_vector = np.random.default_rng(1).normal(size=3 * n)
        self._largest = 0.0

    def renew(self, data: Array) -> None:
        """Prepare for the matrix with these upper-triangle values; may raise `NotPositiveDefiniteError`."""
        # half the digits are enough for what only preconditions, and half the memory is read at every product
        self._data = data.astype(np.float32)
        c = self.coarse
        kernels.coarsen(
            self.fine.starts, self.fine.columns, data, self.blocked, self.parents, self.turned, self.axes, c.starts,
            c.columns, self._coarse_data,
        )  # fmt: skip
        self._factor.factor(self._coarse_data)
        if self._factor.negative_pivots or not kernels.invert_diagonal(self.fine.starts, data, self._inverse):
            raise NotPositiveDefiniteError
        self._estimate_largest()

    def _estimate_largest(self) -> None:
        """Largest eigenvalue of ``D^-1 A`` by power iteration from the last vector, with a margin."""
        x, zero = self._largest_vector, np.zeros_like(self._largest_vector)
        growth = 1.0
        for _ in range(_POWER_STEPS):
            r = self._product(x)
            y = np.zeros_like(x)
            kernels.smoothing_step(self._inverse, 0.0, 1.0, r, zero, y)
            growth = float(np.sqrt(inner_product(y, y) / inner_product(x, x)))
            x = y / np.sqrt(inner_product(y, y))
        self._largest_vector, self._largest = x, 1.1 * growth

    def _product(self, x: Array) -> Array:
        y = np.empty_like(x)
        write_node_product(self.fine.starts, self.fine.columns, self._data, x, y)
        return y

    def _smooth(self, x: Array, r: Array) -> None:
        """Improve `x` in place; `r` is its residual and is used up."""
        middle = 0.5 * self._largest * (1.0 + 1.0 / _BAND)
        half = 0.5 * self._largest * (1.0 - 1.0 / _BAND)
        ratio = middle / half
        rho = 1.0 / ratio
        d = np.zeros_like(x)
        kernels.smoothing_step(self._inverse, 0.0, 1.0 / middle, r, d, x)
        for _ in range(_DEGREE - 1):
            r -= self._product(d)
            following = 1.0 / (2.0 * ratio - rho)
            kernels.smoothing_step(self._inverse, following * rho, 2.0 * following / half, r, d, x)
            rho = following

    def solve(self, b: Array) -> Array:
        """Apply the approximate inverse: smooth, correct on the vertices, smooth; returns a new array."""
        x = np.zeros_like(b)
        self._smooth(x, b.copy())
        coarse = np.empty(self.coarse.n_dofs)
        kernels.restrict(self.parents, self.turned, self.axes, self.blocked, b - self._product(x), coarse)
        correction = self._factor.solve(coarse)
        kernels.prolong(self.parents, self.turned, self.axes, self.blocked, correction, x)
        self._smooth(x, b - self._product(x))
        return x

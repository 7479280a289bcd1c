"""Linear systems of large displacement models, solved by conjugate gradients without factoring the whole matrix."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from fem_biobot.solid.linear import NotPositiveDefiniteError, conjugate_gradients
from fem_biobot.solid.multigrid.two_level import TwoLevel
from fem_biobot.solid.newton import Counts

Array = NDArray[np.float64]

# iterations of one system; the two levels need a few dozen, and a hundred or two near incompressibility
_MOST_ITERATIONS = 400
# iterations more than with a new preconditioner, after which the old one is given up
_WORSE = 8
# reduction of the residual in the search for a direction without stiffness
_STABLE = 1e-6


@dataclass
class TwoLevelSolver:
    """Solves successive tangents by conjugate gradients preconditioned by `TwoLevel`.

    The preconditioner is made at the first tangent of a step and kept for the next ones. `counts.factorisations` are
    those of the linear tetrahedra.

    Notes
    -----
    Stability is not decided by pivots here: `refuse_unstable` looks for a direction of negative stiffness in the Krylov
    space of a generic vector, which finds one unless it is nearly orthogonal to that space.
    """

    levels: TwoLevel
    counts: Counts = field(default_factory=Counts)
    _usable: bool = False
    _fewest: int = 0

    @property
    def name(self) -> str:
        """How systems are solved."""
        return self.levels.name

    def renew(self) -> None:
        """Have the preconditioner made anew for the next tangent."""
        self._usable = False

    def _renew(self, data: Array) -> None:
        self._usable = False
        self.levels.renew(data)
        self.counts.factorisations += 1
        self._usable, self._fewest = True, 0

    def refuse_unstable(self, data: Array) -> None:
        """Raise `NotPositiveDefiniteError` where a direction without stiffness is found."""
        self._renew(data)
        b = np.random.default_rng(2).normal(size=self.levels.fine.n_dofs)
        b[self.levels.blocked == 1] = 0.0
        self._iterate(data, b, _STABLE)

    def solve(self, data: Array, b: Array, tolerance: float) -> Array:
        """Solve with the tangent's upper triangle; raises `NotPositiveDefiniteError`."""
        fresh = not self._usable
        if fresh:
            self._renew(data)
        try:
            x, used = self._iterate(data, b, tolerance)
        except NotPositiveDefiniteError:
            if fresh:
                raise
            # the old preconditioner may mislead: let a new one decide
            self._renew(data)
            return self._iterate(data, b, tolerance)[0]
        self._fewest = used if fresh else self._fewest
        if used > self._fewest + _WORSE:
            self.renew()
        return x

    def _iterate(self, data: Array, b: Array, tolerance: float) -> tuple[Array, int]:
        x, used, reached = conjugate_gradients(
            self.levels.fine, data, b, self.levels.solve, tolerance=tolerance, max_iterations=_MOST_ITERATIONS
        )
        self.counts.cg += used
        if not reached:
            raise NotPositiveDefiniteError
        return x, used

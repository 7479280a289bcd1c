"""Solver of a step's linear systems that factors, as seldom as pays and in half the digits where that is enough.

A factor in single precision costs two thirds of one in double precision and half its memory. It preconditions
conjugate gradients on the matrix in double precision, which gain about three digits an iteration with it; nothing of
the answer is single. Whether an equilibrium is stable is not left to rounded pivots either: see `krylov.refuse`.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from fem_biobot.solid.linear import (
    Factorisation,
    NotPositiveDefiniteError,
    conjugate_gradients,
    factorisation,
    has_negative_eigenvalue,
    minimal_residuals,
)
from fem_biobot.solid.newton import Counts, NewtonSettings
from fem_biobot.solid.pattern import Ints, Pattern

Array = NDArray[np.float64]

# compliance beside that of the pressures, in shear moduli, with which the matrix of the mixed form is factored: the
# factor then solves it to about this, and rounding, which grows as its inverse, stays far below
_STEADY = 1e-6
# reduction of the residual of a generic vector at which a matrix passes for positive definite
STABLE = 1e-8
# a first correction more accurate than this does not make Newton's next residual smaller
_FRESH = 1e-4


@dataclass
class LinearSolver:
    """Solves successive tangents with as few factorisations as pay.

    The first tangent of a step, at the predictor, is factored; its factor preconditions conjugate gradients on the
    later tangents of the step, which differ little from it, and on the one whose stability is asked for.

    With pressures the matrix is that of a saddle point: symmetric, with as many negative eigenvalues as pressures where
    the equilibrium is stable. Then a matrix is factored that differs from it by very little compliance, so that no
    pivot vanishes however incompressible the body is, and minimal residuals take the place of conjugate gradients.

    Parameters
    ----------
    steadying
        Places in the matrix and what is added there before it is factored; with pressures only.
    symmetric
        Whether the matrices are; an unsymmetric one is factored as ``L U``, which says nothing of stability.
    single
        Factor in single precision; for positive definite matrices only. A matrix that is refused in single precision,
        or that its factor does not solve, is factored in double precision, and so are those after it.

    Notes
    -----
    A matrix ``K`` of `n` rows passes for positive definite where conjugate gradients, preconditioned by a positive
    definite ``M``, reduce the residual of a normally distributed vector by `STABLE` without meeting negative curvature.
    Their residual is ``p(K M^-1) b`` with a polynomial that is 1 at zero and, as long as all Ritz values are positive,
    at least 1 left of it: what `b` has in a direction of no or negative stiffness is still in the residual. So it was
    less than ``STABLE sqrt(n)`` standard deviations, which has a probability below ``0.8 STABLE sqrt(n)``: 4e-6 at
    250 000 unknowns. With a factor of a near matrix this takes a third of the time of another factorisation.
    """

    pattern: Pattern
    settings: NewtonSettings
    counts: Counts = field(default_factory=Counts)
    steadying: tuple[Ints, Array] | None = None
    symmetric: bool = True
    single: bool = False
    _factor: Factorisation | None = None
    _usable: bool = False
    _even: LinearSolver | None = None
    # digits that an iteration with the present factor gained last
    _digits: float = np.inf

    @property
    def name(self) -> str:
        """Which factorisation is used."""
        return self._renewable().name

    @property
    def definite(self) -> bool:
        """Whether the matrix of a stable equilibrium is positive definite."""
        return self.symmetric and not self.pattern.n_pressures

    def _renewable(self) -> Factorisation:
        if self._factor is None:
            self._factor = factorisation(self.pattern, self.symmetric, single=self.single and self.definite)
        return self._factor

    def renew(self) -> None:
        """Have the next tangent factored."""
        self._usable = False

    def factor(self, data: Array) -> None:
        """Factor a tangent; raises `NotPositiveDefiniteError` where the equilibrium it belongs to is not stable."""
        self._usable = False
        factor = self._renewable()
        if self.steadying is not None:
            places, values = self.steadying
            data = data.copy()
            (data if self.symmetric else data[0])[places] += _STEADY * values
        try:
            factor.factor(data)
        except NotPositiveDefiniteError:
            if not factor.single:
                raise
            self._factor_exactly(data)
            return
        self.counts.factorisations += 1
        if self.symmetric and factor.negative_pivots != self.pattern.n_pressures:
            raise NotPositiveDefiniteError
        self._usable, self._digits = True, np.inf

    def _factor_exactly(self, data: Array) -> None:
        """Factor in double precision from now on."""
        self.single, self._factor = False, None
        self.factor(data)

    def refuse_unstable(self, data: Array) -> None:
        """Raise `NotPositiveDefiniteError` for the tangent of an equilibrium that is not stable.

        Without symmetry a positive definite symmetric part is enough; where it is not, no eigenvalue near zero may be
        negative (divergence; flutter is an affair of dynamics).
        """
        if self.definite:
            self._refuse_indefinite(data)
            return
        if self.symmetric:
            self.factor(data)
            return
        if self._even is None:
            self._even = LinearSolver(self.pattern, self.settings, self.counts, self.steadying)
        try:
            self._even.factor(data[0])
        except NotPositiveDefiniteError:
            self.factor(data)
            if has_negative_eigenvalue(self._renewable(), self.pattern):
                raise

    def _refuse_indefinite(self, data: Array) -> None:
        b = np.random.default_rng(2).normal(size=self.pattern.n_dofs)
        if self._usable and self._try(data, b, STABLE)[1]:
            return
        self.factor(data)
        # the pivots of a rounded matrix say less than those of the matrix
        if self._renewable().single and not self._try(data, b, STABLE)[1]:
            self._factor_exactly(data)

    def solve(self, data: Array, b: Array, tolerance: float) -> Array:
        """Solve with the tangent's upper triangle; raises `NotPositiveDefiniteError`."""
        if self._usable:
            x, reached = self._try(data, b, tolerance)
            if reached:
                return x
        self.factor(data)
        if self._renewable().single:
            x, reached = self._try(data, b, min(tolerance, _FRESH))
            if reached:
                return x
            self._factor_exactly(data)
        if self.pattern.n_pressures:
            return self._iterate(data, b, tolerance)[0]
        return self._renewable().solve(b)

    def _try(self, data: Array, b: Array, tolerance: float) -> tuple[Array, bool]:
        """Iterate with the factor of another matrix, unless it is bound to take too long or misleads."""
        if -np.log10(tolerance) > self._digits * self.settings.max_cg:
            return b, False
        before = self.counts.cg
        try:
            x, reached = self._iterate(data, b, tolerance)
        except NotPositiveDefiniteError:
            # let a new factor decide
            return b, False
        if reached and self.counts.cg > before:
            self._digits = -np.log10(tolerance) / (self.counts.cg - before)
        return x, reached

    def _iterate(self, data: Array, b: Array, tolerance: float) -> tuple[Array, bool]:
        method = conjugate_gradients if self.definite else minimal_residuals
        x, used, reached = method(
            self.pattern,
            data,
            b,
            self._renewable().solve,
            tolerance=tolerance,
            max_iterations=self.settings.max_cg,
        )
        self.counts.cg += used
        return x, reached

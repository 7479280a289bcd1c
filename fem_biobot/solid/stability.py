"""Where and how a body loses its stability: linearised buckling about an equilibrium, towards another step.

Along the way to a step the tangent changes; to first order ``K + s K'`` with the parameter s, 0 at the equilibrium and
1 at the step. The smallest positive s at which it is singular is where the body buckles, its null vector how.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse.linalg import ArpackError, LinearOperator, eigs

from fem_biobot.errors import ModelError
from fem_biobot.solid.direct import LinearSolver
from fem_biobot.solid.linear import NotPositiveDefiniteError, product
from fem_biobot.solid.newton import Equilibrium, StepSolver, newton_matrix
from fem_biobot.solid.records import Step
from fem_biobot.solid.space import Array
from fem_biobot.solid.system import InvertedError, System

# step of the difference quotient of the tangent, as a share of the way
_DIFFERENCE = 1e-4
# critical points farther than this, in ways to the step that failed, are not why it failed
_NEAR_CRITICAL = 2.0


@dataclass(frozen=True, eq=False)
class Buckling:
    """Loss of stability near an equilibrium.

    Attributes
    ----------
    step
        Load and tension factors at which the tangent becomes singular, to first order from the equilibrium.
    way
        Where that is on the way from the equilibrium, at 0, to the step looked towards, at 1.
    mode
        Displacement of the nodes in the direction in which nothing resists, (3, n), its largest component 1 [1].
    """

    step: Step
    way: float
    mode: Array


def critical(system: System, solver: StepSolver, state: Equilibrium, toward: Step) -> Buckling | None:
    """Loss of stability on the straight way of factors from a stable equilibrium, or none in that direction.

    Raises
    ------
    ModelError
        The equilibrium itself is not stable, or `toward` is where it is.
    """
    here = state.step
    if here == toward:
        raise ModelError("buckling: found the equilibrium's own step to look towards, expected another one")
    K = newton_matrix(system, state)
    try:
        solver.refuse_unstable(K)
    except NotPositiveDefiniteError:
        raise ModelError("buckling: found an equilibrium that is not stable, expected a stable one") from None
    rate = _matrix_rate(system, solver, state, toward, K)

    def ratio(x: Array) -> Array:
        return solver.solve(K, product(system.pattern, rate, x), 1e-10)

    n = system.n_dofs
    operator: Any = LinearOperator((n, n), matvec=ratio, dtype=float)  # type: ignore[call-arg]
    start = ratio(np.random.default_rng(1729).normal(size=n))
    if not np.any(start):
        return None
    try:
        found: Any = eigs(operator, k=2, which="SR", v0=start, tol=1e-8, maxiter=300)  # type: ignore[arg-type]
    except ArpackError:
        return None
    k = int(np.argmin(found[0].real))
    value = found[0][k]
    if not value.real < 0.0 or abs(value.imag) > 1e-6 * abs(value):
        return None
    way = -1.0 / float(value.real)
    mode = system.parts(np.ascontiguousarray(found[1][:, k].real))[0].T
    mode = mode / mode.flat[np.argmax(np.abs(mode))]
    return Buckling(here.between(toward, way), way, mode)


def lost_stability(system: System, solver: StepSolver, last: Equilibrium, unstable_at: Step | None) -> Buckling | None:
    """Buckling between the last state of a path and the step that failed, if that is why it failed."""
    if unstable_at is None or not isinstance(solver, LinearSolver):
        return None
    try:
        found = critical(system, solver, last, unstable_at)
    except ModelError:
        return None
    return found if found is not None and found.way <= _NEAR_CRITICAL else None


def _matrix_rate(system: System, solver: StepSolver, state: Equilibrium, toward: Step, K: Array) -> Array:
    """Change of the matrix on the way to a step per way, along the tangent of the path of equilibria."""
    here, held, h = state.step, system.held, _DIFFERENCE
    near = here.between(toward, h)
    F = state.points.F
    points = system.points(F, near, state.p)
    force, _ = system.internal_force(points)
    b = -system.residual(points, force, system.external_force(state.u, near))
    # what is left of the state's own residual is no part of the change
    b += system.residual(state.points, state.force, system.external_force(state.u, here))
    lift = np.zeros(system.n_dofs)
    lift[held.dofs] = held.at(near) - held.at(here)
    if np.any(lift):
        b -= product(system.pattern, newton_matrix(system, state, blocked=False), lift)
    b[held.dofs] = (K if system.symmetric else K[0])[system.diagonal] * lift[held.dofs]
    change, change_p = system.parts(solver.solve(K, b, 1e-12))
    u, p = state.u + change, state.p + change_p
    try:
        moved = system.points(system.deformation_gradient(u), near, p)
    except InvertedError:
        raise ModelError("buckling: found an inverted element next to the equilibrium, expected none") from None
    there = Equilibrium(near, u, p, moved, state.force, 0.0, 0)
    rate = (newton_matrix(system, there, blocked=False) - newton_matrix(system, state, blocked=False)) / h
    rate[..., system.blocked] = 0.0
    return rate

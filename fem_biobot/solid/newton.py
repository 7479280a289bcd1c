"""One load step: Newton's method whose geometric stiffness uses carried stresses, and the solver of its linear systems.

Plain Newton zigzags on thin soft parts: each linear step turns the strip and leaves a spurious quadratic membrane
stress in the next tangent. Here the geometric part of the tangent uses the second Piola stress extrapolated linearly
from the last iterate, while the residual stays exact (the mixed integration point method of Magisano, Leonetti and
Garcea 2017, in its displacement form). The limit is the same, so convergence is still quadratic.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from fem_biobot.material.kernels import extrapolated_stress
from fem_biobot.material.law import Array
from fem_biobot.solid.linear import Factorisation, NotPositiveDefiniteError, conjugate_gradients, factorisation
from fem_biobot.solid.pattern import Pattern
from fem_biobot.solid.records import Step
from fem_biobot.solid.system import InvertedError, Points, System


@dataclass(frozen=True)
class NewtonSettings:
    """Limits of the iteration.

    Attributes
    ----------
    tolerance
        Residual norm at convergence, relative to the norm of the summed sizes of all element forces (and of the loads).
    max_iterations
        Newton iterations in a step before it is given up (and halved).
    max_cg
        Conjugate-gradient iterations with an older factor before the tangent is factored anew; a factorisation costs
        about twenty of them.
    check_stability
        Factor the tangent of every state once it has converged: an equilibrium from which the body would snap away is
        no answer. Conjugate gradients alone do not see a direction in which nothing pushes.
    """

    tolerance: float = 1e-9
    max_iterations: int = 12
    max_cg: int = 12
    check_stability: bool = True


# relative residual of a trial below which the factor of the step before still serves
_NEAR = 1e-4


# the residual cannot fall below this many times what rounding leaves of the stresses
_ROUNDING = 4.0


class StepFailedError(Exception):
    """The step did not converge; says why in the words of the solve's message."""


@dataclass
class Counts:
    """Work done so far."""

    newton: int = 0
    factorisations: int = 0
    cg: int = 0

    def copy(self) -> Counts:
        """The counts as they stand."""
        return replace(self)

    def since(self, before: Counts) -> Counts:
        """What was added since."""
        return Counts(self.newton - before.newton, self.factorisations - before.factorisations, self.cg - before.cg)


@dataclass
class LinearSolver:
    """Solves successive tangents with as few factorisations as pay.

    The first tangent of a step, at the predictor, is factored; its factor preconditions conjugate gradients on the
    later tangents of the step, which differ little from it.
    """

    pattern: Pattern
    settings: NewtonSettings
    counts: Counts = field(default_factory=Counts)
    _factor: Factorisation | None = None
    _usable: bool = False

    @property
    def name(self) -> str:
        """Which factorisation is used."""
        return self._renewable().name

    def _renewable(self) -> Factorisation:
        if self._factor is None:
            self._factor = factorisation(self.pattern)
        return self._factor

    def renew(self) -> None:
        """Have the next tangent factored."""
        self._usable = False

    def factor(self, data: Array) -> None:
        """Factor a tangent; raises `NotPositiveDefiniteError`."""
        self._usable = False
        self._renewable().factor(data)
        self.counts.factorisations += 1
        self._usable = True

    def solve(self, data: Array, b: Array, tolerance: float) -> Array:
        """Solve with the tangent's upper triangle; raises `NotPositiveDefiniteError`."""
        factor = self._renewable()
        if self._usable:
            try:
                x, used, reached = conjugate_gradients(
                    self.pattern, data, b, factor.solve, tolerance=tolerance, max_iterations=self.settings.max_cg
                )
            except NotPositiveDefiniteError:
                # the old factor may mislead: let the new one decide
                reached, used, x = False, 0, b
            self.counts.cg += used
            if reached:
                return x
        self.factor(data)
        return factor.solve(b)


@dataclass(frozen=True)
class Equilibrium:
    """A converged state of the discrete equations."""

    step: Step
    u: Array
    points: Points
    force: Array
    residual: float
    newton_iterations: int


Observer = Callable[[str, dict[str, float]], None]


def newton(
    system: System,
    solver: LinearSolver,
    step: Step,
    u: Array,
    S_carried: Array | None,
    scale: float,
    settings: NewtonSettings,
    observe: Observer,
) -> tuple[Equilibrium, float]:
    """Equilibrium at `step` from the trial displacement `u`, (n, 3) [mm].

    Parameters
    ----------
    S_carried
        Stress for the first geometric stiffness, (6, e, q) [kPa]; None takes the stress of the trial state.
    scale
        Largest force scale met so far on the path [mN]; the scale met here is returned with the state.

    Raises
    ------
    StepFailedError
        No convergence, an inverted element, or a tangent that is not positive definite.
    """
    held = system.held
    f_ext = step.load * system.dead_load
    u = u.copy()
    points = _points(system, u, step)
    S_geo = points.S if S_carried is None else S_carried
    lift = step.load * held.values - system.to_local(u).ravel()[held.dofs]
    lifting = bool(np.any(np.abs(lift) > 0.0))
    last = norm = np.inf
    first = None
    for iteration in range(settings.max_iterations + 1):
        force, magnitude = system.internal_force(points)
        r = system.to_local(force - f_ext).ravel()
        scale = max(scale, float(np.linalg.norm(magnitude)), float(np.linalg.norm(f_ext)))
        free = r.copy()
        free[held.dofs] = 0.0
        norm = float(np.linalg.norm(free))
        observe("iteration", {"iteration": iteration, "residual": norm / scale if scale else 0.0})
        if not np.isfinite(norm):
            raise StepFailedError("the residual is not a number")
        if norm <= max(settings.tolerance * scale, _ROUNDING * system.rounding_force) and not lifting:
            return Equilibrium(step, u, points, force, norm / scale if scale else 0.0, iteration), scale
        if iteration == settings.max_iterations:
            break
        # a trial close to equilibrium has a tangent close to the one factored last
        if lifting or (first is None and norm > _NEAR * scale):
            solver.renew()
        if lifting:
            pass  # the residual tells nothing yet: what is prescribed has not moved
        elif first is None:
            first = norm
        elif norm > 1e4 * max(first, settings.tolerance * scale):
            raise StepFailedError(f"the residual grows (to {norm / scale:.2g} of the force scale)")
        data = system.tangent(points.F, S_geo, points.D)
        b = -free
        if lifting:
            full = np.zeros(system.n_dofs)
            full[held.dofs] = lift
            b -= system.product(data, full).ravel()
        system.block(data)
        if lifting:
            b[held.dofs] = data[system.diagonal] * lift
        forcing = 1e-8
        if not lifting:
            # solve no further than Newton's own error of this iteration deserves
            expected = 0.1 * (norm / last) ** 2 if 0.0 < last < np.inf else 1e-3
            forcing = min(1e-2, max(0.1 * settings.tolerance * scale / norm, expected))
        solver.counts.newton += 1
        try:
            delta = solver.solve(data, b, forcing)
        except NotPositiveDefiniteError:
            raise StepFailedError(
                "the tangent is not positive definite (loss of stability, or a trial too far)"
            ) from None
        last = np.inf if lifting else norm
        lifting = False
        change = system.to_global(delta.reshape(-1, 3))
        F_next = system.deformation_gradient(u + change)
        S_geo = np.empty_like(points.S)
        extrapolated_stress(points.F, F_next, points.S, points.D, S_geo)
        u += change
        points = _points(system, u, step, F_next)
    raise StepFailedError(
        f"no convergence in {settings.max_iterations} iterations (residual {norm / scale:.2g} of the force scale)"
    )


def refuse_unstable(system: System, solver: LinearSolver, state: Equilibrium) -> None:
    """Refuse a converged state whose tangent is not positive definite; raises `StepFailedError`."""
    data = system.tangent(state.points.F, state.points.S, state.points.D)
    system.block(data)
    try:
        solver.factor(data)
    except NotPositiveDefiniteError:
        raise StepFailedError("the equilibrium found is not stable (its tangent is not positive definite)") from None


def _points(system: System, u: Array, step: Step, F: Array | None = None) -> Points:
    try:
        return system.points(system.deformation_gradient(u) if F is None else F, step.tension)
    except InvertedError as error:
        raise StepFailedError(str(error)) from None

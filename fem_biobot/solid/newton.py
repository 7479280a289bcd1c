"""One load step: Newton's method whose geometric stiffness uses carried stresses, and the solver of its linear systems.

Plain Newton zigzags on thin soft parts: each linear step turns the strip and leaves a spurious quadratic membrane
stress in the next tangent. Here the geometric part of the tangent uses the second Piola stress extrapolated linearly
from the last iterate, while the residual stays exact (the mixed integration point method of Magisano, Leonetti and
Garcea 2017, in its displacement form). The limit is the same, so convergence is still quadratic. The pressure of the
mixed form is an unknown like the displacement; its change is carried into the stress in the same way.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple, Protocol

import numpy as np

from fem_biobot.errors import ModelError
from fem_biobot.material.law import Array, OutsideLawError
from fem_biobot.solid.interface.state import Touch
from fem_biobot.solid.linear import NotPositiveDefiniteError, euclidean_norm
from fem_biobot.solid.records import Step
from fem_biobot.solid.step_failed import Iterate, StepFailedError, Why
from fem_biobot.solid.system import InvertedError, Points, System


@dataclass(frozen=True)
class NewtonSettings:
    """Limits of the iteration.

    Attributes
    ----------
    tolerance
        Residual norm at convergence, relative to the norm of the summed sizes of all element forces (and of the loads),
        the largest met on the path. Where those of the state itself are far smaller, it is solved further as long as
        that helps.
    max_iterations
        Newton iterations in a step before it is given up (and halved).
    max_cg
        Conjugate-gradient iterations with an older factor before the tangent is factored anew; a factorisation costs
        about twenty of them.
    check_stability
        Factor the tangent of every state once it has converged: an equilibrium from which the body would snap away is
        no answer. Conjugate gradients alone do not see a direction in which nothing pushes.
    linear
        How linear systems are solved: ``direct`` factors the matrix; ``iterative``, for quadratic tetrahedra without
        pressures, factors that of the linear ones alone (`solid.multigrid`); ``auto`` takes the latter where the model
        has more unknowns than `MANY`, whose factor would need much memory.
    """

    tolerance: float = 1e-9
    max_iterations: int = 12
    max_cg: int = 12
    check_stability: bool = True
    linear: str = "auto"

    def __post_init__(self) -> None:
        if self.linear not in _WAYS:
            raise ModelError(f"linear: found {self.linear!r}, expected one of: {', '.join(_WAYS)}")


_WAYS = ("auto", "direct", "iterative")
# unknowns from which systems are solved iteratively: the factor of so many takes about 6 GiB
MANY = 300_000


# iterations in which the residual may rise however far: the first turns slender parts along their tangents, which
# stretches them, and the stress carried along takes that back in the next ones
_MAY_RISE = 2
# relative residual of a trial below which the factor of the step before still serves
_NEAR = 1e-4


# the residual cannot fall below this many times what rounding leaves of the stresses
_ROUNDING = 4.0
# times the tolerance, of the state's own forces, that a state is taken with; above it is solved further
_OF_ITS_OWN = 4.0


class StepSolver(Protocol):
    """What a step needs of whoever solves its linear systems; both ways tell where an equilibrium is not stable."""

    counts: Counts

    @property
    def name(self) -> str:
        """How systems are solved."""
        ...

    def renew(self) -> None:
        """Have the next tangent prepared anew."""
        ...

    def refuse_unstable(self, data: Array) -> None:
        """Raise `NotPositiveDefiniteError` for the tangent of an equilibrium that is not stable."""
        ...

    def solve(self, data: Array, b: Array, tolerance: float) -> Array:
        """Solve with the tangent's upper triangle; raises `NotPositiveDefiniteError`."""
        ...


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


@dataclass(frozen=True)
class Equilibrium:
    """A converged state of the discrete equations; `touch` is that of a sliding contact."""

    step: Step
    u: Array
    p: Array
    points: Points
    force: Array
    residual: float
    newton_iterations: int
    touch: Touch | None = None


class Trial(NamedTuple):
    """Where an iteration begins.

    Attributes
    ----------
    u
        Displacement, (n, 3) [mm].
    S
        Stress for the first geometric stiffness, (6, e, q) [kPa]; None takes the stress of the trial itself.
    p
        Pressures of the mixed form, (m,) [kPa]; zero by default.
    """

    u: Array
    S: Array | None = None
    p: Array | None = None


Observer = Callable[[str, dict[str, float]], None]


def newton(
    system: System,
    solver: StepSolver,
    step: Step,
    trial: Trial,
    scale: float,
    settings: NewtonSettings,
    observe: Observer,
) -> tuple[Equilibrium, float]:
    """Equilibrium at `step` from a trial.

    Parameters
    ----------
    scale
        Largest force scale met so far on the path [mN]; the scale met here is returned with the state.

    Raises
    ------
    StepFailedError
        No convergence, an inverted element, or a tangent that is not positive definite.
    """
    held = system.held
    u = trial.u.copy()
    p = np.zeros(system.n_pressures) if trial.p is None else trial.p.copy()
    points = _points(system, u, p, step, 0, None)
    S_geo = points.S if trial.S is None else trial.S
    lift = held.at(step) - system.to_local(u).ravel()[held.dofs]
    lifting = bool(np.any(np.abs(lift) > 0.0))
    last = norm = np.inf
    first = best = None
    free = np.zeros(system.n_dofs)

    def failed(text: str, why: Why) -> StepFailedError:
        return StepFailedError(text, why, element=system.loudest(free), iteration=iteration, best=best)

    most = settings.max_iterations
    for iteration in range(most + 1):
        force, magnitude = system.internal_force(points)
        f_ext = system.external_force(u, step)
        free = system.residual(points, force, f_ext)
        own = max(euclidean_norm(magnitude), euclidean_norm(f_ext))
        scale = max(scale, own)
        free[held.dofs] = 0.0
        norm = euclidean_norm(free)
        observe("iteration", {"iteration": iteration, "residual": norm / scale if scale else 0.0})
        if not np.isfinite(norm):
            raise failed("the residual is not a number", Why.no_number)
        if not lifting and scale and (best is None or norm < best.residual * scale):
            best = Iterate(u.copy(), p.copy(), norm / scale)
        least = _ROUNDING * system.rounding_force
        if norm <= max(settings.tolerance * scale, least) and not lifting:
            # a trial of a thin part may have had forces far above those of the state, which alone say how good it is;
            # but those of a body that contracts freely vanish, so that there is no more than trying
            helped = norm < 0.5 * last
            if norm <= max(_OF_ITS_OWN * settings.tolerance * own, least) or not helped or iteration == most:
                return Equilibrium(step, u, p, points, force, norm / scale if scale else 0.0, iteration), scale
        if iteration == most:
            break
        # a trial close to equilibrium has a tangent close to the one factored last
        if lifting or (first is None and norm > _NEAR * scale):
            solver.renew()
        if lifting:
            pass  # the residual tells nothing yet: what is prescribed has not moved
        elif first is None:
            first = norm
        elif iteration > _MAY_RISE and norm > max(last, 1e4 * max(first, settings.tolerance * scale)):
            raise failed(f"the residual grows (to {norm / scale:.2g} of the force scale)", Why.diverged)
        data = system.matrix(points, S_geo, u, step)
        b = -free
        if lifting:
            full = np.zeros(system.n_dofs)
            full[held.dofs] = lift
            b -= system.product(data, full)
        system.block(data)
        if lifting:
            b[held.dofs] = (data if system.symmetric else data[0])[system.diagonal] * lift
        forcing = 1e-8
        if not lifting:
            # solve no further than Newton's own error of this iteration deserves
            expected = 0.1 * (norm / last) ** 2 if 0.0 < last < np.inf else 1e-3
            # own forces set how far once the path's are met
            wanted = own if norm <= settings.tolerance * scale else scale
            forcing = min(1e-2, max(0.1 * settings.tolerance * wanted / norm, expected))
        solver.counts.newton += 1
        try:
            delta = solver.solve(data, b, forcing)
        except NotPositiveDefiniteError:
            text = "the tangent is not positive definite (loss of stability, or a trial too far)"
            raise failed(text, Why.indefinite) from None
        last = np.inf if lifting else norm
        lifting = False
        change, change_p = system.parts(delta)
        u += change
        p += change_p
        F_next = system.deformation_gradient(u)
        S_geo = system.carry(points, F_next, change_p)
        points = _points(system, u, p, step, iteration + 1, best, F_next)
    raise failed(
        f"no convergence in {settings.max_iterations} iterations (residual {norm / scale:.2g} of the force scale)",
        Why.iterations,
    )


def refuse_unstable(system: System, solver: StepSolver, state: Equilibrium) -> None:
    """Refuse a converged state whose tangent is not positive definite; raises `StepFailedError`."""
    try:
        solver.refuse_unstable(newton_matrix(system, state))
    except NotPositiveDefiniteError:
        text = "the equilibrium found is not stable (its tangent is not positive definite)"
        best = Iterate(state.u, state.p, state.residual)
        raise StepFailedError(text, Why.unstable, best=best) from None


def newton_matrix(system: System, state: Equilibrium, *, blocked: bool = True) -> Array:
    """The tangent at an equilibrium; `blocked` replaces what is held by a scaled identity."""
    points = state.points
    if not len(points.D):  # a state read back keeps no moduli
        points = system.points(points.F, state.step, state.p)
    data = system.matrix(points, points.S, state.u, state.step)
    if blocked:
        system.block(data)
    return data


def _points(
    system: System, u: Array, p: Array, step: Step, iteration: int, best: Iterate | None, F: Array | None = None
) -> Points:
    try:
        return system.points(system.deformation_gradient(u) if F is None else F, step, p)
    except InvertedError as error:
        text = f"an element is inverted (det F = {error.J:.3g})"
        raise StepFailedError(text, Why.inverted, element=error.element, iteration=iteration, best=best) from None
    except OutsideLawError as error:
        text = str(error)
        raise StepFailedError(text, Why.outside_law, element=error.element, iteration=iteration, best=best) from None

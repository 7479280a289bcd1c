"""Newton's iteration for the equilibrium of an assembly, and a damped descent for where it finds no way.

Plain Newton zigzags on slender rods: a linear step turns an element and leaves a spurious quadratic stretch, whose
huge force fills the next geometric stiffness. Here the geometric part uses the resultants extrapolated linearly from
the last iterate, while the residual stays exact (the mixed integration point iteration of Magisano, Leonetti and Garcea
2017, carried to rods). The limit is the same, so convergence stays quadratic.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import diags_array

from fem_biobot.rod.balance import (
    Conditions,
    Forces,
    Point,
    StepFailedError,
    out_of_balance,
    strain_change,
    tangent,
)
from fem_biobot.rod.model import RodModel
from fem_biobot.rod.sparse import Factors, Pattern, SingularError, negative_motions, pattern

Array = NDArray[np.float64]
Listener = Callable[[str, dict[str, float]], None]

# largest turn of an element's end against the other, and of a node, in one iteration [rad]
_TURN_WITHIN = 1.0
_TURN = 2.0
# gaps of joints at convergence, of the model's extent
_GAP = 1e-11
_DESCENTS = 600


@dataclass
class Counts:
    """Work done so far."""

    iterations: int = 0
    factorisations: int = 0


@dataclass(frozen=True)
class Problem:
    """A model with the pattern of its unknowns, and how far to iterate."""

    model: RodModel
    pattern: Pattern
    tolerance: float
    max_iterations: int
    listener: Listener
    counts: Counts

    def factors(self, given: Conditions, at: Point, forces: Forces, s: Array, damping: Array | None = None) -> Factors:
        """Factorised tangent with the geometric part of the resultants `s`."""
        matrix = self.pattern.matrix(*tangent(self.model, given, at, s, forces.tension, forces.lengths))
        if damping is not None:
            matrix = (matrix + diags_array(damping)).tocsc()
            matrix.sort_indices()
        self.counts.factorisations += 1
        return Factors(matrix, self.pattern.joint)

    def residual(self, given: Conditions, forces: Forces) -> tuple[float, float]:
        """Largest force out of balance [mN] and largest gap of a joint, of the extent [1]."""
        nodes, _ = self.pattern.scatter(self.pattern.gather(forces.force, np.zeros_like(forces.value)))
        force = np.abs(nodes / np.array([1.0, 1.0, 1.0, *[given.extent] * 3])).max(initial=0.0)
        _, gaps = self.pattern.scatter(self.pattern.gather(np.zeros_like(forces.force), forces.value))
        return float(force), float(np.abs(gaps / np.array([*[given.extent] * 3, 1.0, 1.0, 1.0])).max(initial=0.0))


def newton(
    problem: Problem, given: Conditions, at: Point, lift: Array | None = None, *, guessed: bool = False
) -> tuple[Point, Forces, float]:
    """Equilibrium from a trial point.

    Parameters
    ----------
    problem, given, at
        What to solve, what acts, where to begin.
    lift
        Motion still to be made by held nodes, (n, 6); it goes into the first linear step with its effect on the others.
    guessed
        The trial point comes from no equilibrium.

    Returns
    -------
    Point, Forces, float
        The equilibrium, its forces, and the residual over the largest force.

    Raises
    ------
    StepFailedError
        No convergence, an element wound up, or a singular tangent.
    """
    model = problem.model
    forces = out_of_balance(model, given, at)
    s_geo = forces.s.copy()
    if guessed:
        # the stretch of a guess says nothing of the answer's forces
        s_geo[:, :3] = 0.0
    first = last = norm = np.inf
    scale = 1.0
    tiny = False
    for iteration in range(problem.max_iterations + 1):
        norm, gap = problem.residual(given, forces)
        scale = max(forces.scale, 1e-300)
        problem.listener("iteration", {"iteration": iteration, "residual": norm / scale})
        done = norm <= max(problem.tolerance * scale, forces.floor) and gap <= _GAP
        # rounding that the estimate of the floor misses shows as a residual that stands still under tiny steps
        stuck = tiny and norm <= 1e-6 * scale and norm >= 0.3 * last and gap <= 1e-9
        if (done or stuck) and lift is None:
            return at, forces, norm / scale
        if iteration == problem.max_iterations:
            break
        if iteration == 1:
            first = norm
        elif iteration > 3 and norm > 1e6 * max(first, problem.tolerance * scale):
            raise StepFailedError(f"the residual grows (to {norm / scale:.2g} of the largest force)")
        try:
            factors = problem.factors(given, at, forces, s_geo)
            b = problem.pattern.gather(forces.force, -forces.value)
            if lift is not None:
                b -= _pushed(problem, given, at, forces, lift)
            step, change = problem.pattern.scatter(factors.solve(b))
        except SingularError:
            raise StepFailedError("the tangent is singular") from None
        problem.counts.iterations += 1
        if lift is not None:
            step += lift
        part = _shortened(model, step)
        if lift is not None and part < 1.0:
            raise StepFailedError("supports move too far in one step")
        lift = None
        step, change = part * step, -part * change
        tiny = bool(np.abs(step[:, :3]).max() <= 1e-9 * given.extent and np.abs(step[:, 3:]).max() <= 1e-9)
        s_geo = forces.s + given.assembly.elements.stiffness * strain_change(given, at, step)
        at = at.moved(step, change)
        forces = out_of_balance(model, given, at)
        last = norm
    raise StepFailedError(
        f"no convergence in {problem.max_iterations} iterations (residual {norm / scale:.2g} of the largest force)"
    )


def descend(problem: Problem, given: Conditions, at: Point) -> Point:
    """Go down from a point far from equilibrium, by implicit steps of a damped motion, until Newton may take over.

    The way of a snap-through, and of what hangs before any load has stretched it. The damping falls with the residual.

    Raises
    ------
    StepFailedError
        No equilibrium came near.
    """
    model = problem.model
    forces = out_of_balance(model, given, at)
    s_geo = forces.s
    n = model.n_nodes
    norm, _ = problem.residual(given, forces)
    stiffness = max(norm, forces.floor) / given.extent / n
    weight = np.tile([1.0, 1.0, 1.0, *[given.extent**2 / n] * 3], (n, 1)) * stiffness
    shape = problem.pattern.gather(weight, np.zeros_like(forces.value))
    factor = 1.0
    for _ in range(_DESCENTS):
        scale = max(forces.scale, 1e-300)
        if norm <= 1e-5 * scale and (factor < 1e-2 or norm <= max(1e-9 * scale, forces.floor)):
            return at
        try:
            factors = problem.factors(given, at, forces, s_geo, factor * shape)
            b = problem.pattern.gather(forces.force, -forces.value)
            step, change = problem.pattern.scatter(factors.solve(b))
            part = _shortened(model, step)
            trial = at.moved(part * step, -part * change)
            after = out_of_balance(model, given, trial)
        except (SingularError, StepFailedError):
            factor *= 8.0
            s_geo = forces.s
            if factor > 1e12:
                break
            continue
        problem.counts.iterations += 1
        problem.listener("descent", {"residual": norm / scale})
        s_geo = forces.s + given.assembly.elements.stiffness * strain_change(given, at, part * step)
        new, _ = problem.residual(given, after)
        factor *= float(np.clip(new / max(norm, 1e-300), 0.3, 2.0)) if part == 1.0 else 1.5
        at, forces, norm = trial, after, new
    raise StepFailedError("no equilibrium was found by going down, either")


def settled(problem: Problem, given: Conditions, at: Point) -> bool:
    """Whether an equilibrium is stable: the symmetric part of its tangent is positive on what joints allow.

    With loads that follow, this sees loss of stiffness, no flutter.
    """
    forces = out_of_balance(problem.model, given, at)
    matrix = problem.pattern.matrix(*tangent(problem.model, given, at, forces.s, forces.tension, forces.lengths))
    matrix = (0.5 * (matrix + matrix.T)).tocsc()
    matrix.sort_indices()
    problem.counts.factorisations += 1
    try:
        return negative_motions(matrix, problem.pattern.joint) == 0
    except SingularError:
        return False


def _pushed(problem: Problem, given: Conditions, at: Point, forces: Forces, lift: Array) -> Array:
    """What a motion of held nodes (n, 6) adds to the linear equations of the others."""
    free = given.everywhere_free()
    whole = pattern(free.assembly, problem.model.system)
    matrix = whole.matrix(*tangent(problem.model, free, at, forces.s, forces.tension, forces.lengths))
    return problem.pattern.gather(*whole.scatter(matrix @ whole.gather(lift, np.zeros_like(forces.value))))


def _shortened(model: RodModel, step: Array) -> float:
    """Share of a step that turns nothing by more than an iteration may."""
    pairs = model.assembly.elements.nodes
    within = np.linalg.norm(step[pairs[:, 1], 3:] - step[pairs[:, 0], 3:], axis=1).max(initial=0.0)
    turn = np.linalg.norm(step[:, 3:], axis=1).max()
    return min(1.0, _TURN_WITHIN / max(within, 1e-300), _TURN / max(turn, 1e-300))

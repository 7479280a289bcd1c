"""A path of load steps: predictor, subdivision of long steps, halving of steps that fail, and the outcome.

The predictor extrapolates up to four last states in the path's parameter, displacement, pressure AND the point
stresses: extrapolating the displacement alone leaves a strip full of spurious membrane stress and is worse than none.
With equal steps the fourth state saves one Newton iteration in three; a fifth was tried and saves none.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Protocol

import numpy as np

from fem_biobot.solid.linear import euclidean_norm
from fem_biobot.solid.newton import (
    Counts,
    Equilibrium,
    NewtonSettings,
    Observer,
    StepSolver,
    Trial,
    newton,
    refuse_unstable,
)
from fem_biobot.solid.records import Step
from fem_biobot.solid.space import Array
from fem_biobot.solid.step_failed import StepFailedError
from fem_biobot.solid.system import InvertedError, System

# a way is halved as often as this, and as many tries of one step may fail
_HALVINGS, _FAILURES = 8, 16
# longest rise of the active tension in one step, as a share of three times the tissue's shear modulus: about the
# contraction that a linear step still brings near enough, whatever the mesh
_LONGEST_RISE = 0.36
# the same where parts slide on each other: slip in a step is taken to be straight
_LONGEST_SLIDING_RISE = 0.1
# largest prescribed rotation in one step [rad]: what is held moves along chords in the first iteration
_LONGEST_TURN = 0.3
# states met only on the way need not be exact
_ON_THE_WAY = 1e-5
# a predictor may reach this many times the last interval before it loses an order
_REACH = 2.0


class Finder(Protocol):
    """Solves steps in place of `newton`, where parts slide on each other; see `solid.interface.equilibrium`."""

    def find(
        self,
        counts: Counts,
        step: Step,
        trial: Trial,
        last: Equilibrium,
        scale: float,
        settings: NewtonSettings,
        observe: Observer,
    ) -> tuple[Equilibrium, float]: ...


class PathFailedError(Exception):
    """No equilibrium at a step even after halving it.

    Carries the last state reached, the step asked for, the shorter one that failed, and how it failed.
    """

    def __init__(self, failure: StepFailedError, last: Equilibrium, wanted: Step, failed_at: Step) -> None:
        super().__init__(str(failure))
        self.failure, self.last, self.wanted, self.failed_at = failure, last, wanted, failed_at


def equilibria(
    system: System,
    solver: StepSolver,
    steps: list[Step],
    settings: NewtonSettings,
    observe: Observer,
    start: list[Equilibrium] | None = None,
    trial: Trial | None = None,
    finder: Finder | None = None,
) -> Iterator[tuple[Equilibrium, Counts]]:
    """Yield the equilibrium of every step asked for, with the work it took (intermediate steps included).

    Parameters
    ----------
    start
        States to go on from, latest last; by default the undeformed body without load.
    trial
        Where the first step begins; that step is neither subdivided nor halved.
    finder
        Solves the steps where parts slide on each other; stability is not asked for then.
    """
    history = list(start) if start else [_rest(system, steps[0].time if steps else 0.0)]
    scale = 0.0
    rough = replace(settings, tolerance=max(settings.tolerance, _ON_THE_WAY))
    for target in steps:
        before = solver.counts.copy()
        goals = [target] if trial else _subdivided(system, history[-1].step, target, sliding=finder is not None)
        halved = [0] * len(goals)  # how often the way to each goal was halved
        failures = 0
        while goals:
            goal = goals[-1]
            try:
                begin = trial or predict(system, history, goal)
                if finder is not None:  # what follows hangs on every state met on the way
                    state, scale = finder.find(solver.counts, goal, begin, history[-1], scale, settings, observe)
                else:
                    exact = settings if len(goals) == 1 else rough
                    state, scale = newton(system, solver, goal, begin, scale, exact, observe)
                    if settings.check_stability:
                        refuse_unstable(system, solver, state)
            except StepFailedError as failure:
                failures += 1
                halved[-1] += 1
                reached = history[-1].step
                if halved[-1] > _HALVINGS or failures > _FAILURES or reached == goal or trial:
                    raise PathFailedError(failure, history[-1], target, goal) from None
                observe("halved", {"load": goal.load, "tension": goal.tension})
                goals.append(reached.between(goal, 0.5))
                halved.append(halved[-1])
                continue
            goals.pop()
            halved.pop()
            # moduli are most of a state and serve no predictor
            history = [*history[-3:], replace(state, points=state.points._replace(D=state.points.D[:0].copy()))]
            trial = None
        yield history[-1], solver.counts.since(before)


def _subdivided(system: System, here: Step, target: Step, *, sliding: bool) -> list[Step]:
    """The target preceded by as many equal steps (latest first) as rising tension and turning surfaces ask for."""
    longest = _LONGEST_SLIDING_RISE if sliding else _LONGEST_RISE
    rises = [c.rise_between(here, target) / longest for c in system.contractions]
    turns = [
        abs((target.load_on(name) - here.load_on(name)) * angle) / _LONGEST_TURN
        for name, angle in system.held.prescribed.rotations
    ]
    n = max(1, int(np.ceil(max([*rises, *turns], default=0.0) - 1e-9)))
    return [target if k == n else here.between(target, k / n) for k in range(n, 0, -1)]


def _rest(system: System, time: float) -> Equilibrium:
    """The undeformed body without load or tension, as the first point of a path."""
    u = np.zeros((system.space.n_nodes, 3))
    points = system.points(system.deformation_gradient(u), 0.0)
    return Equilibrium(Step(0.0, 0.0, time=time), u, np.zeros(system.n_pressures), points, np.zeros_like(u), 0.0, 0)


def _named(steps: list[Step]) -> tuple[list[str], list[str]]:
    """Names of loads and of muscles that any of the steps drives on its own."""
    loads = dict.fromkeys(name for step in steps for name in step.loads)
    return list(loads), list(dict.fromkeys(name for step in steps for name in step.tensions))


def _factors(step: Step, named: tuple[list[str], list[str]]) -> Array:
    """A step as a point on the path: common factors, those of these names, and the time."""
    loads, tensions = named
    own = [*(step.load_on(name) for name in loads), *(step.tension_in(name) for name in tensions)]
    return np.array([step.load, step.tension, *own, step.time])


def weights(steps: Sequence[Step], goal: Step) -> list[tuple[int, float]]:
    """Which of some states of a path, oldest first, serve a polynomial at `goal`, latest first, and their weights.

    The latest alone, with weight 1, where no other lies on a line with it and the goal at a useful distance.
    """
    latest = len(steps) - 1
    named = _named([*steps, goal])
    here = _factors(steps[-1], named)
    way = _factors(goal, named) - here
    length = float(np.linalg.norm(way))
    if length == 0.0 or latest == 0:
        return [(latest, 1.0)]
    # parameter: 0 at the last state, 1 at the goal
    places = []
    for number, step in enumerate(steps):
        offset = _factors(step, named) - here
        along = float(offset @ way) / length**2
        if np.linalg.norm(offset - along * way) > 1e-9 * max(length, float(np.linalg.norm(offset))):
            places.clear()
            continue
        places.append((along, number))
    # each order needs an interval comparable with the step; a repeated or reversed parameter carries nothing
    chosen = [(0.0, latest)]
    for along, number in reversed(places[:-1]):
        nearest = min(abs(along - other) for other, _ in chosen)
        if nearest * _REACH < 1.0 and len(chosen) > 1:
            break
        if nearest * 2.0 * _REACH < 1.0:
            break
        chosen.append((along, number))
    if len(chosen) < 2:
        return [(latest, 1.0)]
    s = np.array([along for along, _ in chosen])
    found = [float(np.prod([(1.0 - s[j]) / (s[i] - s[j]) for j in range(len(s)) if j != i])) for i in range(len(s))]
    return [(number, w) for (_, number), w in zip(chosen, found, strict=True)]


def predict(system: System, history: Sequence[Equilibrium], goal: Step) -> Trial:
    """Trial displacement, pressure and carried stress at `goal` from up to four collinear states."""
    last = history[-1]
    chosen = weights([state.step for state in history], goal)
    if len(chosen) < 2:
        return Trial(last.u, None, last.p)
    u, S, p = np.zeros_like(last.u), np.zeros_like(last.points.S), np.zeros_like(last.p)
    for number, w in chosen:
        state = history[number]
        u += w * state.u
        S += w * state.points.S
        p += w * state.p
    try:
        system.points(system.deformation_gradient(u), 0.0, passive=False, moduli=False)
    except InvertedError:
        return Trial(last.u, None, last.p)
    return Trial(u, S, p)


def residual(system: System, trial: Trial, step: Step) -> float:
    """Norm of the forces that a trial leaves unbalanced at a step [mN]; raises `InvertedError`, `OutsideLawError`."""
    p = np.zeros(system.n_pressures) if trial.p is None else trial.p
    points = system.points(system.deformation_gradient(trial.u), step, p, moduli=False)
    force, _ = system.internal_force(points)
    free = system.residual(points, force, system.external_force(trial.u, step))
    free[system.held.dofs] = 0.0
    return euclidean_norm(free)

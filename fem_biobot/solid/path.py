"""A path of load steps: predictor, subdivision of long steps, halving of steps that fail, and the outcome.

The predictor extrapolates up to four last states in the path's parameter, displacement, pressure AND the point
stresses: extrapolating the displacement alone leaves a strip full of spurious membrane stress and is worse than none.
With equal steps the fourth state saves one Newton iteration in three; a fifth was tried and saves none.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from fem_biobot.solid.newton import (
    Counts,
    Equilibrium,
    NewtonSettings,
    Observer,
    StepFailedError,
    StepSolver,
    Trial,
    newton,
    refuse_unstable,
)
from fem_biobot.solid.records import Step
from fem_biobot.solid.system import InvertedError, System

_HALVINGS = 8
# longest rise of the active tension in one step, as a share of three times the tissue's shear modulus: about the
# contraction that a linear step still brings near enough, whatever the mesh
_LONGEST_RISE = 0.36
# states met only on the way need not be exact
_ON_THE_WAY = 1e-5
# a predictor may reach this many times the last interval before it loses an order
_REACH = 2.0


class PathFailedError(Exception):
    """No equilibrium at a step even after halving it.

    Carries the last state reached, the step asked for, and the shorter one that failed if stability may be why.
    """

    def __init__(self, reason: str, last: Equilibrium, wanted: Step, unstable_at: Step | None) -> None:
        super().__init__(reason)
        self.last, self.wanted, self.unstable_at = last, wanted, unstable_at


def equilibria(
    system: System,
    solver: StepSolver,
    steps: list[Step],
    settings: NewtonSettings,
    observe: Observer,
    start: list[Equilibrium] | None = None,
    trial: Trial | None = None,
) -> Iterator[tuple[Equilibrium, Counts]]:
    """Yield the equilibrium of every step asked for, with the work it took (intermediate steps included).

    Parameters
    ----------
    start
        States to go on from, latest last; by default the undeformed body without load.
    trial
        Where the first step begins; that step is neither subdivided nor halved.
    """
    history = list(start) if start else [_rest(system)]
    scale = 0.0
    rough = replace(settings, tolerance=max(settings.tolerance, _ON_THE_WAY))
    for target in steps:
        before = solver.counts.copy()
        goals = [target] if trial else _subdivided(system, history[-1].step, target)
        halvings = 0
        while goals:
            goal = goals[-1]
            try:
                begin = trial or _predict(system, history, goal)
                exact = settings if len(goals) == 1 else rough
                state, scale = newton(system, solver, goal, begin, scale, exact, observe)
                if settings.check_stability:
                    refuse_unstable(system, solver, state)
            except StepFailedError as failure:
                halvings += 1
                reached = history[-1].step
                if halvings > _HALVINGS or reached == goal or trial:
                    unstable_at = goal if failure.unstable and reached != goal else None
                    raise PathFailedError(str(failure), history[-1], target, unstable_at) from None
                observe("halved", {"load": goal.load, "tension": goal.tension})
                goals.append(Step(0.5 * (reached.load + goal.load), 0.5 * (reached.tension + goal.tension)))
                continue
            goals.pop()
            # moduli are most of a state and serve no predictor
            history = [*history[-3:], replace(state, points=state.points._replace(D=state.points.D[:0].copy()))]
            trial = None
        yield history[-1], solver.counts.since(before)


def _subdivided(system: System, here: Step, target: Step) -> list[Step]:
    """The target preceded by as many equal steps (latest first) as the rise of the active tension asks for."""
    rise = abs(target.tension - here.tension) * max((c.rise for c in system.contractions), default=0.0)
    n = max(1, int(np.ceil(rise / _LONGEST_RISE - 1e-9)))
    ways = [k / n for k in range(n, 0, -1)]
    return [
        target
        if s == 1.0
        else Step(here.load + s * (target.load - here.load), here.tension + s * (target.tension - here.tension))
        for s in ways
    ]


def _rest(system: System) -> Equilibrium:
    """The undeformed body without load or tension, as the first point of a path."""
    u = np.zeros((system.space.n_nodes, 3))
    points = system.points(system.deformation_gradient(u), 0.0)
    return Equilibrium(Step(0.0, 0.0), u, np.zeros(system.n_pressures), points, np.zeros_like(u), 0.0, 0)


def _predict(system: System, history: list[Equilibrium], goal: Step) -> Trial:
    """Trial displacement, pressure and carried stress at `goal` from up to four collinear states."""
    last = history[-1]
    here = np.array([last.step.load, last.step.tension])
    way = np.array([goal.load, goal.tension]) - here
    length = float(np.linalg.norm(way))
    if length == 0.0 or len(history) < 2:
        return Trial(last.u, None, last.p)
    # parameter: 0 at the last state, 1 at the goal
    places = []
    for state in history:
        offset = np.array([state.step.load, state.step.tension]) - here
        along = float(offset @ way) / length**2
        if np.linalg.norm(offset - along * way) > 1e-9 * max(length, float(np.linalg.norm(offset))):
            places.clear()
            continue
        places.append((along, state))
    # each order needs an interval comparable with the step; a repeated or reversed parameter carries nothing
    chosen = [(0.0, last)]
    for along, state in reversed(places[:-1]):
        nearest = min(abs(along - other) for other, _ in chosen)
        if nearest * _REACH < 1.0 and len(chosen) > 1:
            break
        if nearest * 2.0 * _REACH < 1.0:
            break
        chosen.append((along, state))
    if len(chosen) < 2:
        return Trial(last.u, None, last.p)
    s = np.array([along for along, _ in chosen])
    weights = [float(np.prod([(1.0 - s[j]) / (s[i] - s[j]) for j in range(len(s)) if j != i])) for i in range(len(s))]
    u, S, p = np.zeros_like(last.u), np.zeros_like(last.points.S), np.zeros_like(last.p)
    for w, (_, state) in zip(weights, chosen, strict=True):
        u += w * state.u
        S += w * state.points.S
        p += w * state.p
    try:
        system.points(system.deformation_gradient(u), 0.0, passive=False, moduli=False)
    except InvertedError:
        return Trial(last.u, None, last.p)
    return Trial(u, S, p)

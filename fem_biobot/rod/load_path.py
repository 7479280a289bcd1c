"""A path of equilibria: load steps halved where they fail, supports moved, stability looked at."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from fem_biobot.errors import ModelError
from fem_biobot.rod.balance import Conditions, Point, StepFailedError, conditions, out_of_balance, tangent, turned
from fem_biobot.rod.free import free_motions
from fem_biobot.rod.model import RodModel, RodState
from fem_biobot.rod.newton import Counts, Listener, Problem, descend, newton, settled
from fem_biobot.rod.rotation.kernels import rotation_between
from fem_biobot.rod.sparse import Factors, SingularError, pattern

Array = NDArray[np.float64]

_HALVINGS = 10
# halvings spent on staying stable; beyond, an unstable equilibrium is accepted and says so
_CAUTION = 5
# iterations allowed where a step cannot be halved, over the usual number
_PATIENCE = 4
# a support turns by no more in one step [rad], and moves by no more of the model's extent
_LONGEST_TURN = 0.7
_LONGEST_MOVE = 0.1
# tolerance on the way to what was asked for
_ROUGH = 1e-6


@dataclass(frozen=True)
class Settings:
    """What does not change along a path; see `statics`."""

    drive: float
    time: float
    tolerance: float
    max_iterations: int
    listener: Listener
    held_node: int | None


@dataclass
class LoadPath:
    """Where a path has come to, and how to go on."""

    model: RodModel
    settings: Settings
    at: Point
    load: float = 0.0
    tension: float = 0.0
    halvings: int = 0
    descents: int = 0
    counts: Counts = field(default_factory=Counts)
    hint: str = ""
    stable: bool | None = True
    slack: bool = False
    _problem: Problem | None = None

    @property
    def problem(self) -> Problem:
        """What Newton needs."""
        if self._problem is None:
            s = self.settings
            made = pattern(self.given(0.0, 0.0).assembly, self.model.system)
            self._problem = Problem(self.model, made, s.tolerance, s.max_iterations, s.listener, self.counts)
        return self._problem

    def given(self, load: float, tension: float) -> Conditions:
        """What acts at these factors."""
        found = conditions(self.model, load, tension, self.settings.drive, self.settings.time)
        if self.settings.held_node is None:
            return found
        held = found.assembly.inertia.held.copy()
        held[self.settings.held_node] = 1
        inertia = found.assembly.inertia._replace(held=held)
        return replace(found, assembly=found.assembly._replace(inertia=inertia))

    def refuse_free_motion(self, load: float, tension: float) -> None:
        """Refuse supports that leave the model free; a free turn that loads drive (a pendulum) may come to rest."""
        given = self.given(load, tension)
        self.at = replace(self.at, multiplier=first_multipliers(self.problem, given, self.at))
        free, self.slack = free_motions(self.model, given, self.at, self.problem.pattern)
        bad = [m.name for m in free if not (m.turns and m.pushed)]
        if bad:
            raise ModelError(
                f"supports: nothing holds {', '.join(bad)}, expected supports, joints or stiffness against every motion"
                + ('; free="hold" lets a whole model float' if not self.model.supports else "")
            )
        if free:
            self.hint = f" (nothing but the loads resists {', '.join(m.name for m in free)})"

    def go(self, load: float, tension: float) -> RodState:
        """Equilibrium at the factors; raises `StepFailedError`."""
        begin = (self.load, self.tension)
        goals = [(load, tension)]
        n = self._pieces(begin[0], load)
        goals += [_between(begin, (load, tension), k / n) for k in range(n - 1, 0, -1)]
        halved = strayed = 0
        residual = 0.0
        if self.slack and self._lift(load) is None:
            # nothing but loads gives stiffness: a linear step from here leads anywhere, going down does not
            residual = self._fall((load, tension), "nothing resists the loads")
            goals = []
        self.slack = False
        while goals:
            goal = goals[-1]
            here, at = (self.load, self.tension), self.at
            try:
                residual = self._step(goal, self.settings.tolerance if len(goals) == 1 else _ROUGH)
                stable = settled(self.problem, self.given(*goal), self.at)
                if self.stable and not stable and here != goal and strayed < _CAUTION:
                    # Newton may have left the stable branch for another; a shorter step tells
                    strayed += 1
                    (self.load, self.tension), self.at = here, at
                    goals.append(_between(here, goal, 0.5))
                    continue
                self.stable = stable
            except StepFailedError as failure:
                halved += 1
                self.halvings += 1
                self.settings.listener("halved", {"load": goal[0], "tension": goal[1]})
                if halved > _HALVINGS or here == goal or "singular" in str(failure):
                    residual = self._fall(goals[0], str(failure))
                    break
                goals.append(_between(here, goal, 0.5))
                continue
            goals.pop()
        n, joints = len(self.at.x), len(self.at.multiplier)
        return RodState(
            self.model,
            self.at.x.copy(),
            self.at.Q.copy(),
            np.zeros((n, 6)),
            self.settings.drive,
            self.settings.time,
            self.at.multiplier.copy().reshape(joints, 6),
            load,
            tension,
            self.stable,
            residual,
        )

    def _step(self, goal: tuple[float, float], tolerance: float) -> float:
        given = self.given(*goal)
        lift = self._lift(goal[0])
        problem = replace(self.problem, tolerance=tolerance)
        guessed = goal == (self.load, self.tension)
        if guessed:
            problem = replace(problem, max_iterations=_PATIENCE * problem.max_iterations)
        self.at, _, residual = newton(problem, given, self.at, lift, guessed=guessed)
        self.load, self.tension = goal
        return residual

    def _fall(self, goal: tuple[float, float], why: str) -> float:
        """Go down to the equilibrium at a goal that no path of equilibria reaches."""
        if self._lift(goal[0]) is not None:
            raise StepFailedError(why)
        given = self.given(*goal)
        try:
            near = descend(self.problem, given, self.at)
            patient = replace(self.problem, max_iterations=_PATIENCE * self.problem.max_iterations)
            self.at, _, residual = newton(patient, given, near)
        except StepFailedError:
            raise StepFailedError(why) from None
        self.descents += 1
        self.load, self.tension = goal
        self.stable = settled(self.problem, given, self.at)
        return residual

    def _pieces(self, begin: float, end: float) -> int:
        """Steps that moving supports ask for."""
        moved = self.model.built.moved
        turn = max((float(np.linalg.norm(m.hold.turn)) for m in moved), default=0.0)
        move = max((float(np.linalg.norm(m.hold.displacement)) for m in moved), default=0.0)
        share = max(turn / _LONGEST_TURN, move / (_LONGEST_MOVE * self.given(0.0, 0.0).extent))
        return max(1, int(np.ceil(share * abs(end - begin) - 1e-9)))

    def _lift(self, load: float) -> Array | None:
        """How held nodes must still move, (n, 6); None where they are in place."""
        lift = np.zeros((len(self.at.x), 6))
        for m in self.model.built.moved:
            if m.constraint >= 0:
                continue
            Q = turned(np.eye(3), load * np.array(m.hold.turn))
            target = m.place + load * np.array(m.hold.displacement) - Q.T @ m.offset
            lift[m.node, :3] = target - self.at.x[m.node]
            rotation = np.zeros((1, 3))
            rotation_between(self.at.Q[m.node : m.node + 1].copy(), Q[None].copy(), rotation)
            lift[m.node, 3:] = rotation[0]
        return lift if np.abs(lift).max() > 1e-14 * np.abs(self.at.x).max() else None


def first_multipliers(problem: Problem, given: Conditions, at: Point) -> Array:
    """Multipliers of the joints that balance the loads at a point best, (j, 6), in the sense of least squares."""
    if not len(at.multiplier) or np.any(at.multiplier):
        return at.multiplier
    forces = out_of_balance(problem.model, given, at)
    blocks, geometric = tangent(problem.model, given, at, forces.s, forces.tension, forces.lengths)
    n = len(at.x)
    nodes = np.zeros((len(blocks), 6, 6))
    nodes[problem.model.system.plan.diagonal[:n]] = np.diag([1.0, 1.0, 1.0, *[given.extent**2] * 3])
    for places in problem.model.system.joint:
        for place in places[places >= 0]:
            nodes[place] = blocks[place]
    matrix = problem.pattern.matrix(nodes, np.zeros_like(geometric))
    try:
        solution = Factors(matrix, problem.pattern.joint).solve(
            problem.pattern.gather(forces.force, np.zeros_like(forces.value))
        )
    except SingularError:
        return at.multiplier
    return -problem.pattern.scatter(solution)[1]


def _between(a: tuple[float, float], b: tuple[float, float], share: float) -> tuple[float, float]:
    return a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])

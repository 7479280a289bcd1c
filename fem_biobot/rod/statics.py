"""Static equilibrium of an assembly of rods along a path of loads and muscle tension.

solution = statics(RodModel([Rod(points, section, material)], supports=[Hold(("rod", 0))], loads=[...]), [0.5, 1.0])
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fem_biobot.errors import ModelError, SolveError
from fem_biobot.rod.balance import Point, StepFailedError, of_state, out_of_balance
from fem_biobot.rod.load_path import LoadPath, Settings
from fem_biobot.rod.model import RodModel, RodState, refuse_touches
from fem_biobot.rod.newton import Listener
from fem_biobot.rod.parts.kernels import constraint
from fem_biobot.rod.records import Place

Array = NDArray[np.float64]

# resultant of the loads on a floating model, of the largest force
_RESULTANT = 1e-7


@dataclass(frozen=True)
class RodStep:
    """A state asked for: factors on the loads (gravity and moved supports with them) and on the muscles' tension."""

    load: float = 1.0
    tension: float = 1.0

    def __post_init__(self) -> None:
        for what, factor in (("load", self.load), ("tension", self.tension)):
            number = isinstance(factor, int | float | np.floating | np.integer) and not isinstance(factor, bool)
            if not number or not np.isfinite(factor):
                raise ModelError(f"step: {what}: found {factor!r}, expected a finite factor")
        if self.tension < 0.0:
            raise ModelError(f"step: tension: found {self.tension:g}, expected at least 0 (muscle pulls)")


@dataclass(frozen=True, eq=False)
class RodSolution:
    """The states asked for, in order, and what they took.

    Attributes
    ----------
    states
        Equilibria; each says whether it is stable.
    steps
        What each was asked for.
    iterations, factorisations
        Linear solutions of the iteration, and factorised tangents, stability included.
    halvings
        Steps that had to be halved.
    descents
        Steps that were reached by going down from a lost equilibrium (a snap-through, or a start without stiffness).
    """

    states: tuple[RodState, ...]
    steps: tuple[RodStep, ...]
    iterations: int
    factorisations: int
    halvings: int = 0
    descents: int = 0

    @property
    def last(self) -> RodState:
        """The state of the last step."""
        return self.states[-1]

    @property
    def stable(self) -> bool:
        """Whether every state is stable."""
        return all(bool(s.stable) for s in self.states)


def statics(
    model: RodModel,
    steps: Iterable[float | RodStep] = (1.0,),
    *,
    drive: float = 1.0,
    time: float = 0.0,
    start: RodState | None = None,
    free: str = "refuse",
    tolerance: float = 1e-11,
    max_iterations: int = 16,
    listener: Listener | None = None,
) -> RodSolution:
    """Static equilibria along a path of load steps.

    Parameters
    ----------
    model
        What stands in equilibrium. Parts may be without mass.
    steps
        States asked for: `RodStep` records, or numbers that scale loads and tension alike. Steps that do not converge
        are halved on the way.
    drive
        Of the muscles, between 0 and 1: their tension at factor 1 is ``passive + drive * active``.
    time
        At which loads with a history are taken [s].
    start
        A state from which to begin: held parts stay where it has them; a guess of one's own need not be in equilibrium.
        By default the model as drawn.
    free
        ``"hold"`` holds the first node of a model without supports, so that it may float; its loads must be in
        equilibrium among themselves. ``"refuse"``: a model must be supported.
    tolerance
        Largest force out of balance at convergence over the largest force that acts (loads, resultants, tensions;
        moments over the model's extent); rounding of a stiff rod may end above it.
    max_iterations
        In one step, before it is halved.
    listener
        Called with ``"iteration"`` (iteration, residual), ``"descent"`` (residual) and ``"halved"`` (load, tension).

    Returns
    -------
    RodSolution
        States with their multipliers. An equilibrium that is not stable is returned, and says so (`RodState.stable`):
        on the straight branch of a column beyond its buckling load, for example, from which only a perturbation leads
        away; steps are halved a few times before, to stay on a stable branch. A snap-through lands on the other side
        of the jump.

    Raises
    ------
    ModelError
        A model that supports leave free to move, with the motion's name, or with touches; a step that is no number.
    SolveError
        Where a step finds no equilibrium however small it is made; its `best` is the solution up to there.

    Notes
    -----
    Newton's method with the exact tangent, resultants of the geometric part extrapolated; sparse LU of the nodes with
    the joints' multipliers. Order in element length: `Discretisation`; exact for states of constant strain.
    """
    wanted = [s if isinstance(s, RodStep) else RodStep(s, s) for s in steps]
    if not np.isfinite(drive):
        raise ModelError(f"drive: found {drive!r}, expected a finite number")
    if free not in ("refuse", "hold"):
        raise ModelError(f"free: found {free!r}, expected 'refuse' or 'hold'")
    if free == "hold" and model.supports:
        raise ModelError(f"free: found 'hold' with {len(model.supports)} supports, expected a model without any")
    refuse_touches("statics", model)
    if start is not None and start.model is not model:
        raise ModelError("start: found a state of another model, expected one of this model")
    settings = Settings(
        drive, time, tolerance, max_iterations, listener or (lambda kind, values: None), 0 if free == "hold" else None
    )
    path = _path(model, settings, start)
    if wanted:
        path.refuse_free_motion(wanted[0].load, wanted[0].tension)
    states: list[RodState] = []

    def solution() -> RodSolution:
        c = path.counts
        return RodSolution(
            tuple(states), tuple(wanted[: len(states)]), c.iterations, c.factorisations, path.halvings, path.descents
        )

    for step in wanted:
        try:
            states.append(path.go(step.load, step.tension))
        except StepFailedError as failure:
            raise SolveError(
                f"no equilibrium between load x{path.load:.6g}, tension x{path.tension:.6g} (reached) and "
                f"load x{step.load:.6g}, tension x{step.tension:.6g} (asked): {failure}{path.hint}",
                solution(),
                reason=str(failure),
                reached=RodStep(path.load, path.tension),
                wanted=step,
            ) from None
        if free == "hold":
            _refuse_resultant(path, step)
    return solution()


def reaction(state: RodState, place: Place) -> Array:
    """Force [mN] and moment about a place [uJ], spatial, that supports exert on the part there, (6,).

    Of a partial support, its multipliers; of a held node, what keeps everything else on it in balance.
    """
    given, at = of_state(state)
    node, offset = state.model.atlas.locate(place)
    free = given.everywhere_free()
    A, C = free.assembly, given.assembly.constraints
    total = np.zeros(6)
    if state.model.assembly.inertia.held[node]:
        total -= out_of_balance(state.model, free, at).force[node]
        total[3:] -= np.cross(state.Q[node].T @ offset, total[:3])
        return total
    value, rows = np.zeros(6), np.zeros((6, 12))
    for j in np.flatnonzero((C.nodes[:, 0] == node) & (C.nodes[:, 1] < 0)):
        constraint(A.constraints, j, at.x, at.Q, value, rows)
        total += at.multiplier[j] @ rows[:, :6]
    total[3:] -= np.cross(state.Q[node].T @ offset, total[:3])
    return total


def _path(model: RodModel, settings: Settings, start: RodState | None) -> LoadPath:
    if start is None:
        n, joints = model.n_nodes, len(model.assembly.constraints.rows)
        at = Point(model.built.x.copy(), np.tile(np.eye(3), (n, 1, 1)), np.zeros((joints, 6)))
        return LoadPath(model, settings, at)
    _, at = of_state(start)
    at = Point(at.x.copy(), at.Q.copy(), at.multiplier.copy())
    return LoadPath(model, settings, at, start.load, start.tension, stable=start.stable)


def _refuse_resultant(path: LoadPath, step: RodStep) -> None:
    """A floating model is held by nothing: what its first node had to bear must be nothing."""
    given = path.given(step.load, step.tension)
    forces = out_of_balance(path.model, given.everywhere_free(), path.at)
    borne = np.abs(forces.force[0] / np.array([1.0, 1.0, 1.0, *[given.extent] * 3])).max()
    if borne > max(_RESULTANT * forces.scale, 100.0 * forces.floor):
        raise ModelError(
            f"free: the loads have a resultant of {borne:.3g} mN (moments over the extent), expected loads in "
            "equilibrium among themselves, or supports"
        )

"""A solid model and its solution: a mesh with laws, active tension, supports and loads; states returned, never stored.

model = SolidModel(mesh, materials={"skeleton": NeoHooke(319.4, 0.45)}, supports=[Fix("clamp")], loads=[...])
solution = solve(model, steps=[0.5, 1.0])
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from fem_biobot.errors import ModelError, SolveError
from fem_biobot.material.active import ActiveStress
from fem_biobot.material.law import Array, Law
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.solid.assembly import assemble_system, with_laws
from fem_biobot.solid.failure import advice, concerned, told
from fem_biobot.solid.interface.equilibrium import Slide
from fem_biobot.solid.interface.record import Sliding
from fem_biobot.solid.newton import Counts, Equilibrium, NewtonSettings, StepSolver, Trial
from fem_biobot.solid.path import PathFailedError, equilibria
from fem_biobot.solid.records import Load, Step, Support, as_step
from fem_biobot.solid.solvers import direct_solver, linear_solver
from fem_biobot.solid.space import Element, LockingWarning
from fem_biobot.solid.stability import Buckling, critical, lost_stability
from fem_biobot.solid.state import SolidState
from fem_biobot.solid.step_failed import Iterate
from fem_biobot.solid.system import System

__all__ = ["SolidModel", "SolidSolution", "SolidState", "StateObserver", "buckling", "solve"]

if TYPE_CHECKING:
    from fem_biobot.design import Design


@dataclass(frozen=True)
class SolidModel:
    """A body in quasi-static equilibrium at finite strain.

    Parameters
    ----------
    mesh
        Checked mesh.
    materials
        Passive law of every region.
    active
        Active tension of some regions, at tension factor 1.
    supports, loads
        See `solid.records`.
    element
        See `Element`.
    quadrature_degree
        See `solid.space.space`.
    sliding
        Contact of two surfaces of parts that are not bonded, for the quasi-static path (`solve`).

    Raises
    ------
    ModelError
        Where a part names something that the mesh does not have, the supports leave a rigid motion free, or a law asks
        for another element.

    Warns
    -----
    LockingWarning
        Where a region's Poisson's ratio is above what the element bears; `system.notes` has the same texts.
    """

    mesh: BodyMesh
    materials: Mapping[str, Law]
    active: Mapping[str, ActiveStress] = field(default_factory=dict)
    supports: Sequence[Support] = ()
    loads: Sequence[Load] = ()
    element: Element | str = Element.P2
    quadrature_degree: int | None = None
    sliding: Sliding | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "supports", tuple(self.supports))
        object.__setattr__(self, "loads", tuple(self.loads))
        object.__setattr__(self, "materials", dict(self.materials))
        object.__setattr__(self, "active", dict(self.active))
        for note in self.system.notes:  # refuses now what does not fit
            warnings.warn(note, LockingWarning, stacklevel=3)

    @classmethod
    def from_design(cls, design: Design, mesh: BodyMesh) -> SolidModel:
        """The model of a design: laws, fibres, tension at full drive, and neutral supports."""
        from fem_biobot.solid.from_design import model_from_design

        return model_from_design(design, mesh)

    @cached_property
    def slide(self) -> Slide | None:
        """What solves the steps where parts slide on each other; None where all is bonded."""
        return None if self.sliding is None else Slide(self.system, self.mesh, self.sliding)

    @cached_property
    def system(self) -> System:
        """The discrete equations, made once."""
        return assemble_system(
            self.mesh, self.materials, self.active, self.supports, self.loads, self.element, self.quadrature_degree
        )

    def with_materials(self, materials: Mapping[str, Law]) -> SolidModel:
        """The same model with other passive laws; the discrete space and its sparsity are shared, not made again."""
        if set(materials) != set(self.materials):
            raise ModelError(f"materials: found {', '.join(materials)}, expected {', '.join(self.materials)}")
        if self.sliding is not None:
            raise ModelError("materials: found others for parts that slide on each other, expected a new model")
        changed = copy(self)
        object.__setattr__(changed, "materials", dict(materials))
        ordered = {name: materials[name] for name in self.materials}
        changed.__dict__["system"] = with_laws(self.system, self.mesh, ordered, self.active)
        return changed

    @property
    def n_dofs(self) -> int:
        """Unknowns: displacements, held ones included, and pressures."""
        return self.system.n_dofs


@dataclass(frozen=True)
class SolidSolution:
    """All states asked for, in order, and what the solve took.

    `stretch`, `energy`, `reaction`, `reaction_moment` and `at` speak of the last state.
    """

    states: tuple[SolidState, ...]
    factorisations: int
    newton_iterations: int
    cg_iterations: int
    linear_solver: str
    halvings: int = 0

    @property
    def last(self) -> SolidState:
        """The state of the last step."""
        return self.states[-1]

    @property
    def stretch(self) -> Array:
        """Fibre stretch of the last state, (e, q) [1]."""
        return self.last.stretch

    @property
    def energy(self) -> float:
        """Passive strain energy of the last state [uJ]."""
        return self.last.energy

    def reaction(self, where: str | tuple[float, float, float]) -> Array:
        """Reaction of the last state, (3,) [mN]."""
        return self.last.reaction(where)

    def reaction_moment(
        self, where: str | tuple[float, float, float], about: Sequence[float] = (0.0, 0.0, 0.0)
    ) -> Array:
        """Moment of the last state's reaction about a fixed point [mm], (3,) [uJ]."""
        return self.last.reaction_moment(where, about)

    def at(self, point: Sequence[float]) -> Array:
        """Displacement of the last state at a reference position, (3,) [mm]."""
        return self.last.at(point)


StateObserver = Callable[[str, dict[str, float]], None]


def solve(
    model: SolidModel,
    steps: Iterable[float | Mapping[str, float] | Step] = (1.0,),
    *,
    settings: NewtonSettings | None = None,
    start: Sequence[SolidState] = (),
    trial: tuple[Array, Array | None] | tuple[Array, Array | None, Array | None] | None = None,
    observe: StateObserver | None = None,
    on_state: Callable[[SolidState], None] | None = None,
    solver: StepSolver | None = None,
) -> SolidSolution:
    """Equilibria along a path of load steps.

    Parameters
    ----------
    steps
        States asked for: `Step` records, which may drive muscles and loads each on its own; numbers, which scale loads
        and tension alike; or mappings from regions to tension factors, under full load. Steps that do not converge
        are halved on the way.
    settings
        Tolerance and limits.
    start
        States of the same model to go on from, latest last (up to four serve the predictor); by default the
        undeformed body.
    trial
        Displacement (3, n) [mm] and, if known, point stress (6, e, q) [kPa] from which the first step begins, without
        predictor or subdivision; for paths in a parameter of one's own. With the pressures (m,) [kPa] in the mixed
        form.
    observe
        Called with ``"iteration"`` (iteration, residual) and ``"halved"`` (load, tension).
    on_state
        Called with each state as soon as it has converged.
    solver
        From `linear_solver` of a model on the same mesh with the same supports, to keep its analysis over several
        calls; by default a new one.

    Raises
    ------
    ModelError
        Where a step names a muscle or a load that the model does not have, or supports contradict each other there.
    SolveError
        Where a step finds no equilibrium however small it is made; its `best` is the solution up to there, and its
        `buckling` the critical factors and the mode where the body loses its stability, its `why` one of
        `solid.newton.Why`, its `element` where that happened, its `iterate` the best try of the step that failed.
    """
    system = model.system
    settings = settings or NewtonSettings()
    wanted = [checked_step(system, as_step(s)) for s in steps]
    solver = solver or linear_solver(model, settings)
    before = solver.counts.copy()
    states: list[SolidState] = []
    halvings = 0

    def watch(kind: str, values: dict[str, float]) -> None:
        nonlocal halvings
        halvings += kind == "halved"
        if observe:
            observe(kind, values)

    def finished() -> SolidSolution:
        c = solver.counts.since(before)
        name = solver.name if model.slide is None else model.slide.name
        return SolidSolution(tuple(states), c.factorisations, c.newton, c.cg, name, halvings)

    history = [equilibrium_of(s) for s in start]
    first = None if trial is None else Trial(np.ascontiguousarray(trial[0].T), *trial[1:])
    try:
        for state, work in equilibria(system, solver, wanted, settings, watch, history, first, model.slide):
            states.append(_state(model, state, work))
            if on_state:
                on_state(states[-1])
    except PathFailedError as failure:
        element = concerned(system, failure)
        at = failure.failed_at if failure.failure.unstable and failure.failed_at != failure.last.step else None
        # stability of bodies that contact alone holds is not asked for
        lost = None if model.sliding is not None else lost_stability(system, solver, failure.last, at)
        best = failure.failure.best
        raise SolveError(
            advice(failure, model.mesh, element, lost),
            finished(),
            reason=told(failure, model.mesh, element),
            why=failure.failure.why,
            element=element,
            reached=failure.last.step,
            failed_at=failure.failed_at,
            wanted=failure.wanted,
            buckling=lost,
            iterate=best and _iterate(model, failure.failed_at, best),
        ) from None
    return finished()


def buckling(state: SolidState, toward: float | Mapping[str, float] | Step) -> Buckling | None:
    """Where a body loses its stability on the way from an equilibrium to a step, to first order.

    Parameters
    ----------
    state
        A stable equilibrium.
    toward
        The step in whose direction loads and tension change; it need not be reached.

    Returns
    -------
    Buckling or None
        Critical factors and buckling mode; None where nothing buckles in that direction.

    Notes
    -----
    Linear eigenvalue problem of the tangent and of its change along the path of equilibria; exact where the tangent
    changes linearly, as for a slender column, and the better the nearer the equilibrium is to the critical point.
    """
    model = state.model
    if model.sliding is not None:
        raise ModelError("buckling: found parts that slide on each other, expected all parts bonded")
    there = checked_step(model.system, as_step(toward))
    return critical(model.system, direct_solver(model), equilibrium_of(state), there)


def checked_step(system: System, step: Step) -> Step:
    """The step, refused where it names what the model does not have."""
    muscles = [c.region for c in system.contractions]
    for what, given, known in (("loads", step.loads, system.load_names), ("tensions", step.tensions, muscles)):
        for name in given:
            if name not in known:
                expected = f"one of {', '.join(known)}" if known else "none (the model has nothing of that kind)"
                raise ModelError(f"step, {what}: found {name!r}, expected {expected}")
    system.held.at(step)  # refuses supports that contradict each other there
    return step


def _state(model: SolidModel, found: Equilibrium, work: Counts) -> SolidState:
    return SolidState(
        model,
        found.step,
        np.ascontiguousarray(found.u.T),
        found.residual,
        work.newton,
        work.factorisations,
        work.cg,
        found.p if model.system.mixed else None,
        touch=found.touch,
    )


def _iterate(model: SolidModel, step: Step, found: Iterate) -> SolidState:
    pressure = found.p if model.system.mixed else None
    return SolidState(model, step, np.ascontiguousarray(found.u.T), found.residual, pressure=pressure)


def equilibrium_of(state: SolidState) -> Equilibrium:
    """A state as the solvers have it."""
    system = state.model.system
    p = np.zeros(system.n_pressures) if state.pressure is None else state.pressure
    return Equilibrium(
        state.step,
        np.ascontiguousarray(state.u.T),
        p,
        state.points,
        state.internal_force.T,
        state.residual,
        0,
        state.touch,
    )

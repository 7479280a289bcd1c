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
from fem_biobot.solid.held import place_nodes
from fem_biobot.solid.newton import Counts, Equilibrium, NewtonSettings, StepSolver, Trial
from fem_biobot.solid.path import PathFailedError, equilibria
from fem_biobot.solid.records import Load, Step, Support, as_step
from fem_biobot.solid.solvers import direct_solver, linear_solver
from fem_biobot.solid.space import Element, Ints, LockingWarning
from fem_biobot.solid.stability import Buckling, critical, lost_stability
from fem_biobot.solid.system import Points, System

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
    def system(self) -> System:
        """The discrete equations, made once."""
        return assemble_system(
            self.mesh, self.materials, self.active, self.supports, self.loads, self.element, self.quadrature_degree
        )

    def with_materials(self, materials: Mapping[str, Law]) -> SolidModel:
        """The same model with other passive laws; the discrete space and its sparsity are shared, not made again."""
        if set(materials) != set(self.materials):
            raise ModelError(f"materials: found {', '.join(materials)}, expected {', '.join(self.materials)}")
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
class SolidState:
    """One equilibrium.

    Attributes
    ----------
    model
        What it is a state of.
    step
        Load and tension factors.
    u
        Displacement of the nodes, vertices first, (3, n) [mm].
    pressure
        Pressures of the mixed form, positive in tension, (m,) [kPa], zero if left out; see `pressure_points`.
    residual
        Norm of the residual over the force scale [1].
    newton_iterations, factorisations, cg_iterations
        Work from the state before to this one, halved steps included.
    """

    model: SolidModel
    step: Step
    u: Array
    residual: float = 0.0
    newton_iterations: int = 0
    factorisations: int = 0
    cg_iterations: int = 0
    pressure: Array | None = None

    @property
    def X(self) -> Array:
        """Reference positions of the nodes, vertices first, (3, n) [mm]."""
        return self.model.system.space.points

    @property
    def cells(self) -> Ints:
        """Nodes of each element in VTK's order for quadratic tetrahedra, (10, e)."""
        return self.model.system.space.nodes

    @property
    def pressure_points(self) -> Array:
        """Reference positions of the pressures, region by region, (3, m) [mm]; none but in the mixed form."""
        mixed = self.model.system.mixed
        return self.X[:, mixed.field.vertex] if mixed else np.zeros((3, 0))

    @cached_property
    def F(self) -> Array:
        """Deformation gradient at the quadrature points, (3, 3, e, q) [1]."""
        return self.model.system.deformation_gradient(np.ascontiguousarray(self.u.T))

    @cached_property
    def points(self) -> Points:
        """Stress and energy of passive laws and active tension together, at the quadrature points (no moduli)."""
        return self.model.system.points(self.F, self.step.tension, self.pressure, moduli=False)

    @cached_property
    def internal_force(self) -> Array:
        """Internal force at the nodes, (3, n) [mN]."""
        return self.model.system.internal_force(self.points)[0].T

    @cached_property
    def stretch(self) -> Array:
        """Fibre stretch at the quadrature points, (e, q) [1]; not a number where a region has no fibres."""
        out = np.full(self.model.system.space.dV.shape, np.nan)
        for c in self.model.system.contractions:
            a = np.einsum("ik...,k...->i...", self.F[:, :, c.elements], c.a0[:, c.elements])
            out[c.elements] = np.sqrt(np.einsum("i...,i...->...", a, a))
        return out

    @cached_property
    def energy(self) -> float:
        """Passive strain energy of the whole body [uJ]; the muscle's work is a separate number."""
        passive = self.model.system.points(self.F, 0.0, self.pressure, moduli=False)
        return float(np.sum(passive.psi * self.model.system.space.dV))

    def reaction(self, where: str | tuple[float, float, float]) -> Array:
        """Force that the support at a named surface, landmark or vertex exerts on the body, (3,) [mN]."""
        model = self.model
        nodes = place_nodes(model.mesh, model.system.space, where)
        f_ext = model.system.external_force(np.ascontiguousarray(self.u.T), self.step.load).T
        return (self.internal_force - f_ext)[:, nodes].sum(axis=1)

    def at(self, point: Sequence[float]) -> Array:
        """Displacement at a reference position, (3,) [mm]; refuses a position outside the body."""
        return self.u[:, :] @ interpolation(self.model.system, np.asarray(point, dtype=float))


def interpolation(system: System, X: Array) -> Array:
    """Weights of all nodes whose sum gives the field at reference position `X`, (n,)."""
    space = system.space
    corners = space.points[:, space.nodes[:4]]  # (3, 4, e)
    local = np.einsum("ijk,jk->ik", space.to_reference, X[:, None] - corners[:, 0])
    barycentric = np.concatenate([1.0 - local.sum(axis=0, keepdims=True), local])
    worst = barycentric.min(axis=0)
    element = int(np.argmax(worst))
    if worst[element] < -1e-6:
        raise ModelError(f"point {tuple(np.round(X, 6))} mm: found outside the body, expected a position inside")
    weights = np.zeros(space.n_nodes)
    xi = local[:, element].reshape(3, 1)
    shape = space.shape
    for b, node in enumerate(space.nodes[:, element]):
        weights[node] += float(np.ravel(shape.lbasis(xi, b)[0])[0])
    return weights


@dataclass(frozen=True)
class SolidSolution:
    """All states asked for, in order, and what the solve took.

    `stretch`, `energy`, `reaction` and `at` speak of the last state.
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

    def at(self, point: Sequence[float]) -> Array:
        """Displacement of the last state at a reference position, (3,) [mm]."""
        return self.last.at(point)


StateObserver = Callable[[str, dict[str, float]], None]


def solve(
    model: SolidModel,
    steps: Iterable[float | Step] = (1.0,),
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
        States asked for: `Step` records, or numbers that scale loads and tension alike. Steps that do not converge are
        halved on the way.
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
    SolveError
        Where a step finds no equilibrium however small it is made; its `best` is the solution up to there, and its
        `buckling` the critical factors and the mode where the body loses its stability.
    """
    system = model.system
    settings = settings or NewtonSettings()
    wanted = [as_step(s) for s in steps]
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
        return SolidSolution(tuple(states), c.factorisations, c.newton, c.cg, solver.name, halvings)

    history = [_equilibrium(system, s) for s in start]
    first = None if trial is None else Trial(np.ascontiguousarray(trial[0].T), *trial[1:])
    try:
        for state, work in equilibria(system, solver, wanted, settings, watch, history, first):
            states.append(_state(model, state, work))
            if on_state:
                on_state(states[-1])
    except PathFailedError as failure:
        done, lost = finished(), lost_stability(system, solver, failure.last, failure.unstable_at)
        raise SolveError(
            _advice(failure, lost),
            done,
            reason=str(failure),
            reached=failure.last.step,
            wanted=failure.wanted,
            buckling=lost,
        ) from None
    return finished()


def buckling(state: SolidState, toward: float | Step) -> Buckling | None:
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
    return critical(model.system, direct_solver(model), _equilibrium(model.system, state), as_step(toward))


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
    )


def _equilibrium(system: System, state: SolidState) -> Equilibrium:
    p = np.zeros(system.n_pressures) if state.pressure is None else state.pressure
    return Equilibrium(
        state.step, np.ascontiguousarray(state.u.T), p, state.points, state.internal_force.T, state.residual, 0
    )


def _advice(failure: PathFailedError, lost: Buckling | None) -> str:
    r, w = failure.last.step, failure.wanted
    (load, wanted_load), (tension, wanted_tension) = _apart(r.load, w.load), _apart(r.tension, w.tension)
    return (
        f"no equilibrium between load x{load}, tension x{tension} (reached) and load x{wanted_load}, "
        f"tension x{wanted_tension} (asked): {failure}; {_told(lost)}try a lower tension or load, a finer mesh, or a "
        "stiffer design"
    )


def _told(lost: Buckling | None) -> str:
    return "" if lost is None else f"it buckles at load x{lost.step.load:.4g}, tension x{lost.step.tension:.4g}; "


def _apart(first: float, second: float) -> tuple[str, str]:
    """Two numbers with as many digits, at least four, as tell them apart if they differ."""
    texts = [(f"{first:.{digits}g}", f"{second:.{digits}g}") for digits in range(4, 18)]
    return next(((a, b) for a, b in texts if a != b or first == second), texts[-1])

"""States and natural motions of the solid, as the cross-check observes them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fem_biobot.design import Design
from fem_biobot.errors import SolveError
from fem_biobot.link.modes import Motions
from fem_biobot.link.observed import Array, Observed, Points, drawn_points, observed, parts_of_energy, rotation
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.muscle.fibres import in_junction
from fem_biobot.solid.from_design import densities, model_from_design, tension_step
from fem_biobot.solid.measures import Measurer
from fem_biobot.solid.model import SolidModel, SolidSolution, SolidState, solve
from fem_biobot.solid.modes import modes
from fem_biobot.solid.state import interpolation
from fem_biobot.study.reporter import Reporter

_RIGID = 6


@dataclass(frozen=True)
class SolidSide:
    """The solid of a design on one mesh; a model of it that is at hand, or a new one."""

    design: Design
    mesh: BodyMesh
    given: SolidModel | None = None

    @cached_property
    def model(self) -> SolidModel:
        """What is solved."""
        return SolidModel.from_design(self.design, self.mesh) if self.given is None else self.given

    @cached_property
    def _measurer(self) -> Measurer:
        return Measurer(self.design, self.model)

    def _weights(self, positions: Array) -> Array:
        """Interpolation at positions (p, 3), (n, p)."""
        return np.array([interpolation(self.model.system, X) for X in positions]).T

    @cached_property
    def _marks(self) -> Points:
        """Interpolation weights in place of positions, (p, n)."""
        drawn = drawn_points(self.design)
        return Points(*(self._weights(p).T for p in (drawn.lower, drawn.upper, drawn.tops, drawn.soles)))

    def points(self, state: SolidState) -> Points:
        """Positions of the observed points in a state."""
        x = (self.model.system.space.points + state.u).T
        return Points(*(w @ x for w in (self._marks.lower, self._marks.upper, self._marks.tops, self._marks.soles)))

    def states(self, tensions: Sequence[float], reporter: Reporter) -> tuple[list[Observed], list[SolidState]]:
        """Equilibria at tensions that rise [kPa]; fewer if the body finds none further on."""
        found: list[SolidState] = []

        def keep(state: SolidState) -> None:
            found.append(state)
            reporter.advance(f"solid at {tensions[len(found) - 1]:.3g} kPa")

        try:
            solve(self.model, [tension_step(self.design, T) for T in tensions], on_state=keep)
        except SolveError as failure:
            if not (isinstance(failure.best, SolidSolution) and found):
                raise
            reporter.note(f"solid: nothing above {tensions[len(found) - 1]:.3g} kPa: {failure}")
        return [self.observe(s, T) for s, T in zip(found, tensions, strict=False)], found

    def observe(self, state: SolidState, tension: float) -> Observed:
        """What is compared, in a state at a nominal tension [kPa]."""
        measure = self._measurer
        return observed(
            self.design,
            tension,
            self.points(state),
            muscle_force_mN=measure.muscle_force(state),
            tip_closing_mm=measure.tip_closing(state),
            sagitta_mm=measure.sagitta(state),
            fibre_stretch_1=measure.fibre_stretch(state),
            **parts_of_energy(*passive_energy(state)),
        )

    def squeezed(self, tensions: Sequence[float], reporter: Reporter) -> list[tuple[float, float]]:
        """Passive energy of skeleton and muscle where the rings around the pillars alone pull, at each tension [uJ].

        Rings squeeze their pillars and themselves whether the machine bends or not, and store energy in that which
        rods, whose rings are rigid, have no part for. Nothing in a machine whose muscle is one ring that slides.
        """
        if self.design.value("muscle.layout") != "junction":
            return [(0.0, 0.0)] * len(tensions)
        return [passive_energy(state) for state in self.rings_alone(tensions, reporter)]

    def rings_alone(self, tensions: Sequence[float], reporter: Reporter) -> Sequence[SolidState]:
        """States at tensions [kPa] of the rings around the pillars, the junction between them without any."""
        centres = self.mesh.points[:, self.mesh.cells[:, self.mesh.regions["muscle"]]].mean(axis=1)
        alone = model_from_design(self.design, self.mesh, np.where(in_junction(self.design, centres), 0.0, 1.0))
        reporter.stage("rings of the solid alone", len(tensions))
        ahead = iter(tensions)

        def tell(_: SolidState) -> None:
            reporter.advance(f"rings at {next(ahead):.3g} kPa")

        return solve(alone, [tension_step(self.design, T) for T in tensions], on_state=tell).states

    def motions(self, state: SolidState, at: Array, count: int) -> Motions:
        """Slowest free motions about a state, seen at reference positions (p, 3) [mm]."""
        found = modes(state, densities(self.design), count + _RIGID, free=True)
        flexible = found.frequencies > 0.0
        seen = np.einsum("cin,np->cpi", found.shapes[flexible], self._weights(at))
        return Motions(found.frequencies[flexible], seen @ rotation(-self.points(state).tilt).T)


def passive_energy(state: SolidState) -> tuple[float, float]:
    """Of skeleton and of muscle [uJ], without what their tension could do."""
    system, regions = state.model.system, state.model.mesh.regions
    passive = system.points(state.F, 0.0, state.pressure, moduli=False)
    each = np.sum(passive.psi * system.space.dV, axis=1)
    skeleton, muscle = (float(each[regions[name]].sum()) if name in regions else 0.0 for name in ("skeleton", "muscle"))
    return skeleton, muscle

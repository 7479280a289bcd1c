"""States and natural motions of the rods, as the cross-check observes them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fem_biobot.design import Design
from fem_biobot.errors import ModelError, SolveError
from fem_biobot.link.modes import Motions
from fem_biobot.link.observed import Array, Observed, Points, drawn_points, observed, parts_of_energy, rotation
from fem_biobot.rod.anatomy import anatomy
from fem_biobot.rod.model import RodModel, RodState
from fem_biobot.rod.modes import modes
from fem_biobot.rod.records import Gravity, Muscle, Place
from fem_biobot.rod.statics import RodSolution, RodStep, statics
from fem_biobot.study.reporter import Reporter

PILLARS = ("pillar_short", "pillar_long")
_RIGID = 6


@dataclass(frozen=True)
class RodSide:
    """The rods of a design, afloat and without weight, as the solid is."""

    design: Design
    given: RodModel

    @cached_property
    def model(self) -> RodModel:
        """What is solved."""
        m = self.given
        if not any(isinstance(load, Gravity) for load in m.loads):
            return m
        loads = [load for load in m.loads if not isinstance(load, Gravity)]
        parts = (m.rods, m.joints, m.bodies, m.supports, loads, m.members, m.contacts)
        return RodModel(*parts, landmarks=m.landmarks)

    def points(self, state: RodState) -> Points:
        """Positions of the observed points in a state; sections stay plane."""
        drawn = drawn_points(self.design)
        rod = self.model.rods[0].name
        nodes, frames = state.points(rod), state.directors(rod)
        if len(nodes) != len(drawn.upper):
            raise ModelError(
                f"rods: found a beam of {len(nodes) - 1} elements, expected the {len(drawn.upper) - 1} between the "
                "sections that are observed (beam_elements)"
            )
        rest = self.model.drawn()
        # offset of the points in the frame of their section as drawn
        own = np.einsum("sij,sj->si", rest.directors(rod), drawn.upper - rest.points(rod))
        up = np.einsum("sij,si->sj", frames, own)
        tops, soles = (
            np.array([state.at(_on(name, p)) for name, p in zip(PILLARS, q, strict=True)])
            for q in (drawn.tops, drawn.soles)
        )
        return Points(nodes - up, nodes + up, tops, soles)

    def states(self, tensions: Sequence[float], reporter: Reporter) -> tuple[list[Observed], list[RodState]]:
        """Equilibria at tensions that rise [kPa]; fewer if the assembly finds none further on."""
        amplitude = self.design.drive.amplitude
        unit = self.design.tension(amplitude)
        steps = [RodStep(1.0, T / unit) for T in tensions]
        try:
            found = list(statics(self.model, steps, drive=amplitude, free="hold").states)
        except SolveError as failure:
            if not (isinstance(failure.best, RodSolution) and failure.best.states):
                raise
            found = list(failure.best.states)
            reporter.note(f"rods: nothing above {tensions[len(found) - 1]:.3g} kPa: {failure}")
        reporter.advance(f"rods to {tensions[len(found) - 1]:.3g} kPa")
        return [self._observe(s, T) for s, T in zip(found, tensions, strict=False)], found

    def _observe(self, state: RodState, tension: float) -> Observed:
        points = self.points(state)
        chord = points.axis[-1] - points.axis[0]
        chord /= np.linalg.norm(chord)
        drawn = drawn_points(self.design)
        arm = points.axis[len(points.axis) // 2] - points.axis[0]
        apart, apart0 = points.soles[1] - points.soles[0], drawn.soles[1] - drawn.soles[0]
        return observed(
            self.design,
            tension,
            points,
            muscle_force_mN=sum(force for force, _ in self._muscles(state)),
            tip_closing_mm=float(apart0[0] - apart @ chord),
            sagitta_mm=float(np.linalg.norm(arm - (arm @ chord) * chord)),
            fibre_stretch_1=self._muscles(state)[0][1],
            **parts_of_energy(beam := self.beam_energy(state), state.energy - beam),
        )

    def beam_energy(self, state: RodState) -> float:
        """Elastic energy of the beam [uJ]."""
        return float(energies(state, self.model.rods[0].name).sum())

    def _muscles(self, state: RodState) -> list[tuple[float, float]]:
        """Tensile force [mN] and stretch [1] in the middle of each muscle, of its members and of a rod along them."""
        found = []
        for chain in anatomy(self.model).chains:
            member = self.model.members[chain[len(chain) // 2]]
            assert isinstance(member, Muscle)
            drawn = np.linalg.norm(self.model.atlas.parse(member.b)[1] - self.model.atlas.parse(member.a)[1])
            force = state.muscle_force(member.name)
            if isinstance(member.a[1], int) and member.a[0] in {rod.name for rod in self.model.rods}:
                force += float(state.resultants(member.a[0])[0][member.a[1], 2])
            found.append((force, state.muscle_length(member.name) / float(drawn)))
        return found

    def motions(self, state: RodState, at: Array, count: int) -> Motions:
        """Slowest free motions about a state, seen at drawn positions (p, 3) [mm] of pillars or of the beam's nodes."""
        found = modes(self.model, state, count + _RIGID)
        flexible = found.frequencies > 0.0
        spots = [self.model.atlas.locate(self._place(X)) for X in at]
        seen = []
        for shape in found.shapes[flexible]:
            arms = [state.Q[node].T @ offset for node, offset in spots]
            seen.append([shape[n, :3] + np.cross(shape[n, 3:], arm) for (n, _), arm in zip(spots, arms, strict=True)])
        return Motions(found.frequencies[flexible], np.array(seen) @ rotation(-self.points(state).tilt).T)

    def _place(self, X: Array) -> Place:
        """What carries a drawn position: the beam's node there, or the pillar on that side."""
        drawn = self.model.drawn().points(self.model.rods[0].name)
        apart = np.linalg.norm(drawn - X, axis=1)
        if apart.min() < 1e-9:
            return self.model.rods[0].name, int(apart.argmin())
        return _on(PILLARS[int(X[0] > 0.0)], X)


def _on(body: str, X: Array) -> Place:
    x, y, z = (float(c) for c in X)
    return body, (x, y, z)


def energies(state: RodState, rod: str) -> Array:
    """Elastic energy of a rod by its shear across, stretch, bending across and twist, (6,) [uJ]; linear."""
    eps, kappa = state.strain(rod)
    force, couple = state.resultants(rod)
    drawn = next(each for each in state.model.rods if each.name == rod).points
    size = np.linalg.norm(np.diff(drawn, axis=0), axis=1)
    return 0.5 * size @ np.hstack([force * eps, couple * kappa])

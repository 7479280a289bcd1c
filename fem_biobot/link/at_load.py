"""Rods whose parts have the constants that loads on those parts show where the machine bears them.

Gel, tissue and corners are not linear, rods are. So each stretch of beam and junction is taken about the bending and
the shortening that it has: moment and force of its own curve there, and what they change by. The curves come from
loads on skeleton and muscle alone (`link.sections`, `link.strip`); the state about which they are taken is the rods'
own, found by iteration, and knows nothing of the machine's solid.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from fem_biobot.design import Design
from fem_biobot.errors import SolveError
from fem_biobot.link.alone import Pull
from fem_biobot.link.firm import made_firm
from fem_biobot.link.masses import with_masses
from fem_biobot.link.observed import Array, Observed, parts_of_energy
from fem_biobot.link.rod_side import PILLARS, RodSide, energies
from fem_biobot.link.sections import MeshSections, sections_from_mesh, with_sections
from fem_biobot.link.strip import STRIP, StripSections, pulled, stretches_of, strip_from_mesh, with_strip
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.rod.model import RodModel, RodState
from fem_biobot.study.reporter import Reporter, Silent

_MOST = 20
# change of a stretch, and of a beam's turn from element to element [rad], at which a state is taken as found
_SETTLED = 1e-6


def parts_of(
    design: Design,
    mesh: BodyMesh,
    reduced: RodModel,
    seen: Sequence[Observed],
    reporter: Reporter,
) -> LoadedRods:
    """Constants of skeleton and junction by loads on each alone.

    Loads are as large as rods bear them: the skeleton's those of rods in closed form, the junction's those of rods
    whose parts are measured by unit loads.

    Parameters
    ----------
    design, mesh
        A bot of two pillars, and its mesh.
    reduced
        From `reduce`, with as many elements in the beam as there are stretches.
    seen
        What was observed of `reduced`, by rising tension.
    reporter
        Told of a stage and each part, and noted where the junction is not measured up to the last tension, or not well.
    """
    junction = design.value("muscle.layout") == "junction"
    reporter.stage("parts of the mesh under loads", 5 if junction else 2)
    sections = sections_from_mesh(design, mesh, [each.numbers["muscle_force_mN"] for each in seen])
    reporter.advance("skeleton")
    strip = None
    if junction:
        strip = strip_from_mesh(design, mesh)
        reporter.advance("junction by unit loads")
        # rods in closed form come together by a seventh more; those of unit loads are near what the machine will bear
        rods = LoadedRods(design, reduced, sections, strip, mesh)
        pulls = rods.pulls([each.tension for each in seen])
        if len(pulls) < len(seen):
            reporter.note(
                f"junction: rods by unit loads find no state above {pulls[-1].tension:.3g} kPa; from there to "
                f"{seen[-1].tension:.3g} kPa its constants are those of its last pull: compare smaller tensions"
            )
        strip = pulled(design, mesh, strip, pulls)
        reporter.advance("junction under pulls")
        strip = made_firm(design, reduced, strip, pulls, reporter)
        reporter.advance("junction's bending under pulls")
    found = LoadedRods(design, reduced, sections, strip, mesh)
    reporter.advance("masses")
    return found


class Bearing(NamedTuple):
    """Curvature of each stretch of beam [1/mm], stretch of each of the junction [1], approach of its bonds [mm]."""

    curvature: Array
    stretch: Array | None
    approach: float


@dataclass(frozen=True)
class LoadedRods:
    """Rods of a design with constants of their parts at load.

    Attributes
    ----------
    design
        A bot of two pillars.
    reduced
        From `reduce`, with as many elements in the beam as there are stretches.
    sections
        Of the beam, with pulls at large.
    strip
        Of the junction, with pulls at large; None for a muscle that is none.
    mesh
        Of both, for the masses.
    """

    design: Design
    reduced: RodModel
    sections: MeshSections
    strip: StripSections | None
    mesh: BodyMesh

    def side(self, bearing: Bearing | None = None) -> RodSide:
        """Rods about what their parts bear; without it by unit loads."""
        model = with_sections(self.reduced, self.sections, curvature=bearing.curvature if bearing else None)
        if self.strip is not None:
            stretch = bearing.stretch if bearing else None
            firmness, height = self.strip.clamped(bearing.approach) if bearing else (1.0, 0.0)
            model = with_strip(model, self.design, self.strip, stretch=stretch, firmness=firmness, height=height)
        return RodSide(self.design, with_masses(model, self.design, self.mesh))

    def pulls(self, tensions: Sequence[float]) -> list[Pull]:
        """How rods by unit loads move the bonds of their junction, at tensions that rise [kPa]; fewer if some fail."""
        side = self.side()
        seen, states = side.states(tensions, Silent())
        turns = [float(np.deg2rad(each.numbers["pillar_rotation_deg"])) for each in seen]
        approach = [self.bearing(side, state).approach for state in states]
        return [Pull(each.tension, *by) for each, *by in zip(seen, approach, turns, strict=True)]

    def states(self, tensions: Sequence[float], reporter: Reporter) -> tuple[list[Observed], list[RodState]]:
        """Equilibria at tensions that rise [kPa], each of a model of its own; fewer if there are none further on."""
        observed: list[Observed] = []
        states: list[RodState] = []
        bearing: Bearing | None = None
        for k in range(len(tensions)):
            try:
                side, seen, state = self._settled(tensions[: k + 1], bearing)
            except SolveError as failure:
                if not states:
                    raise
                reporter.note(f"rods at load: nothing above {tensions[k - 1]:.3g} kPa: {failure}")
                break
            bearing = self.bearing(side, state)
            stored = parts_of_energy(*self._stored(side, state, bearing))
            observed.append(replace(seen, numbers={**seen.numbers, **stored}))
            states.append(state)
        reporter.advance(f"rods at load to {tensions[len(states) - 1]:.3g} kPa")
        return observed, states

    def about(self, tensions: Sequence[float]) -> RodSide:
        """Rods about what their parts bear at the last of tensions that rise [kPa]: one model, which can walk.

        Raises
        ------
        SolveError
            No state there.
        """
        return self._settled(tensions, None)[0]

    def _settled(self, tensions: Sequence[float], bearing: Bearing | None) -> tuple[RodSide, Observed, RodState]:
        """Side and state at the last of the tensions about which its constants are."""
        size = np.diff(self.reduced.rods[0].points[:, 0])
        for _ in range(_MOST):
            side = self.side(bearing)
            observed, states = side.states(tensions, Silent())
            if len(states) < len(tensions):
                raise SolveError(f"found no state at {tensions[-1]:.3g} kPa", None)
            before, bearing = bearing, self.bearing(side, states[-1])
            changed = [] if before is None else [np.abs(bearing.curvature - before.curvature) * size]
            if before is not None and before.stretch is not None and bearing.stretch is not None:
                changed += [np.abs(bearing.stretch - before.stretch)]
            if changed and max(float(c.max()) for c in changed) < _SETTLED:
                return side, observed[-1], states[-1]
        raise SolveError(f"constants at load: found no end within {_MOST} rounds at {tensions[-1]:.3g} kPa", None)

    def _stored(self, side: RodSide, state: RodState, bearing: Bearing) -> tuple[float, float]:
        """Energy of beam and of muscle [uJ], each along its own curve, which rods about a load are not."""
        beam = side.model.rods[0]
        size = np.diff(beam.points[:, 0])
        linear = energies(state, beam.name)
        of_beam = float(linear.sum() - linear[3] + self.sections.bending_energy(bearing.curvature) @ size)
        if self.strip is None:
            return of_beam, state.energy - side.beam_energy(state)
        return of_beam, self.strip.stored(bearing.approach)

    def bearing(self, side: RodSide, state: RodState) -> Bearing:
        """What the parts bear in a state."""
        beam = side.model.rods[0]
        natural = 0.0 if beam.natural_curvature is None else np.asarray(beam.natural_curvature)[:, 0]
        curvature = state.strain(beam.name)[1][:, 0] + natural
        if self.strip is None:
            return Bearing(curvature, None, 0.0)
        half, z = self.design.span / 2, self.design.value("muscle.junction_height")
        ends = [state.at((name, (x, 0.0, z))) for name, x in zip(PILLARS, (-half, half), strict=True)]
        approach = self.design.span - float(np.linalg.norm(ends[1] - ends[0]))
        return Bearing(curvature, stretches_of(self.strip, state.points(STRIP)), approach)

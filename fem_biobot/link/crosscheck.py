"""Cross-check of a design: solid and rods at the same tensions, nothing fitted, beside what was expected beforehand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from itertools import pairwise
from typing import Any

import numpy as np

from fem_biobot.design import Design
from fem_biobot.errors import DesignError, ModelError
from fem_biobot.link.at_load import LoadedRods, parts_of
from fem_biobot.link.expected import Expectation, Interval, expect
from fem_biobot.link.modes import Pair, paired, seen_positions
from fem_biobot.link.observed import Array, Observed, beyond, stations
from fem_biobot.link.rod_side import RodSide
from fem_biobot.link.sections import MeshSections, with_sections
from fem_biobot.link.shapes import Both, level_both, rod_outline, solid_outline
from fem_biobot.link.solid_side import SolidSide
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.mesh.committed import mesh_for
from fem_biobot.mesh.own_shape import refuse_own_pillars
from fem_biobot.rod.reduce import PlateFactor, reduce
from fem_biobot.solid.model import SolidState
from fem_biobot.study.reporter import Keeping, Reporter, Silent

# shares of the passive tension at which both are solved, besides that and full drive
SHARES = (0.05, 0.25, 0.5, 0.75)
QUANTITIES = (
    "muscle_force_mN",
    "tip_closing_mm",
    "sagitta_mm",
    "pillar_rotation_deg",
    "curvature_1_per_mm",
    "strain_energy_uJ",
    "fibre_stretch_1",
)
MODES = 3
_BEAM_ELEMENTS = 16  # as the stations
# no difference may be expected to be larger than this
LARGEST_EXPECTED = 0.3


class Stiffness(StrEnum):
    """Where the rods' constants come from; each takes more from the mesh than the one before.

    closed_form
        Section and modulus of the beam, a muscle between two points, as `reduce` has them.
    mesh_beam
        Beam by unit loads on the skeleton, see `link.sections`.
    mesh
        Junction too, a clamped rod by unit loads on the muscle, see `link.strip`, and masses, see `link.masses`.
    mesh_at_load
        The same parts by loads as large as the machine's, see `link.at_load`, the junction's ends turned (`link.firm`)
        and the beam's torsion where it is bent (`link.twist`).
    """

    closed_form = "closed_form"
    mesh_beam = "mesh_beam"
    mesh = "mesh"
    mesh_at_load = "mesh_at_load"


@dataclass(frozen=True)
class Row:
    """One quantity at one tension in both models.

    Attributes
    ----------
    tension
        [kPa]
    quantity
        With its unit as suffix.
    stiffness
        Of the rods.
    solid, rods
        Values.
    expected
        Least and most of ``solid / rods - 1`` [1], stated beforehand; None where nothing was.
    """

    tension: float
    quantity: str
    stiffness: Stiffness
    solid: float
    rods: float
    expected: Interval | None

    @property
    def difference(self) -> float:
        """``solid / rods - 1`` [1]; of the fibre stretch, of its distance from 1."""
        base = 1.0 if self.quantity == "fibre_stretch_1" else 0.0
        return (self.solid - base) / (self.rods - base) - 1.0 if self.rods != base else float("nan")

    @property
    def within(self) -> bool | None:
        """Whether the difference lies where it was expected; None where nothing was."""
        if self.expected is None:
            return None
        return self.expected[0] <= self.difference <= self.expected[1]


@dataclass(frozen=True)
class CrossCheck:
    """Solid and rods of one design.

    Attributes
    ----------
    design
        Of both.
    expectation
        Differences stated beforehand, for rods in closed form.
    solid
        States of the solid, by rising tension.
    rods
        States of the rods with each stiffness, at the same tensions.
    sections
        Stiffnesses from the mesh beside the closed forms.
    modes
        Motions about the passive state, for each stiffness.
    mesh
        Elements and unknowns of the solid.
    outlines
        Name of a state to the solid's surface and the rods' lines from the side, for pictures.
    notes
        What was used instead of what.
    levelled
        States of the solid and of the rods in closed form at the tensions that both reached.
    modes_at
        Tension of the state that `modes` are about [kPa].
    """

    design: Design
    expectation: Expectation
    solid: tuple[Observed, ...]
    rods: dict[Stiffness, tuple[Observed, ...]]
    sections: MeshSections
    modes: dict[Stiffness, tuple[Pair, ...]]
    mesh: dict[str, int]
    outlines: dict[str, tuple[Array, list[Array]]] = field(default_factory=dict)
    notes: tuple[str, ...] = field(default=())
    levelled: Both = ()
    modes_at: float = 0.0

    def rows(self, stiffness: Stiffness = Stiffness.closed_form) -> list[Row]:
        """Every quantity at every tension that both models reached, then the stroke."""
        stated = stiffness is Stiffness.closed_form
        both = list(zip(self.solid, self.rods[stiffness], strict=False))
        found = []
        for a, b in both:
            expected = self.expectation.at(a.tension) if stated else {}
            found += [
                Row(a.tension, name, stiffness, a.numbers[name], b.numbers[name], expected.get(name))
                for name in QUANTITIES
            ]
        passive, peak = (self.design.tension(drive) for drive in (0.0, self.design.drive.amplitude))
        ends = [pair for pair in both if pair[0].tension in (passive, peak)]
        if len(ends) == 2:
            (solid0, rods0), (solid1, rods1) = ends
            name = "tip_closing_mm"
            solid, rods = (b.numbers[name] - a.numbers[name] for a, b in ((solid0, solid1), (rods0, rods1)))
            expected = self.expectation.stroke(passive, peak) if stated else None
            found.append(Row(solid1.tension, "stroke_mm", stiffness, solid, rods, expected))
        return found


def tensions_of(design: Design) -> list[float]:
    """Nominal tensions at which a design is cross-checked, rising [kPa]."""
    passive, peak = design.tension(0.0), design.tension(design.drive.amplitude)
    if not peak > 0.0:
        raise DesignError(f"muscle: found no tension (peak {peak:g} kPa), expected one to cross-check with")
    standing = passive if passive > 0.0 else peak
    wanted = [*(share * standing for share in SHARES), standing]
    return [*wanted, peak] if peak > wanted[-1] else wanted


def crosscheck(
    design: Design,
    mesh: BodyMesh | None = None,
    *,
    tensions: Sequence[float] | None = None,
    solved: Sequence[SolidState] = (),
    parts_mesh: BodyMesh | None = None,
    plate_factor: PlateFactor | str = PlateFactor.none,
    reporter: Reporter | None = None,
) -> CrossCheck:
    """Solve a design as a solid and as rods at the same tensions, and set them side by side.

    Parameters
    ----------
    design
        A bot of two pillars with a junction, tissue as moulded.
    mesh
        Of the solid; by default the design's own.
    tensions
        Nominal, rising [kPa]; by default shares of the passive tension, the passive and the peak one.
    solved
        States of the solid on `mesh` at those tensions, where they are at hand.
    parts_mesh
        On which the parts are loaded for the rods' constants; by default `mesh`.
    plate_factor
        Reading of the rods' beam, see `PlateFactor`.
    reporter
        Told of stages, states and notes.

    Returns
    -------
    CrossCheck
        Rows with differences, beside what was expected beforehand.

    Raises
    ------
    ModelError, DesignError
        Another kind of machine, remodelled tissue, tension that rods cannot have.
    MeshError
        Pillars that are no boxes.
    SolveError
        A model that finds no state at all.

    Notes
    -----
    Both float, without weight. The rods get no number of the solid machine; beyond closed forms they take constants
    that loads on its parts alone give, see `Stiffness`.
    """
    reporter = Keeping(reporter or Silent())
    factor = PlateFactor(plate_factor)
    expectation = expect(design, plate=factor is PlateFactor.plane_strain)
    if design.value("muscle.reference") != "as_moulded":
        raise ModelError(
            f"muscle.reference: found {design.value('muscle.reference')}, expected as_moulded for a cross-check: the "
            "natural length of remodelled tissue is each model's own"
        )
    levels = list(tensions) if tensions is not None else tensions_of(design)
    if solved and len(solved) != len(levels):
        raise ModelError(f"solved: found {len(solved)} states, expected one for each of {len(levels)} tensions")
    if not levels or any(not T > 0.0 for T in levels) or any(b <= a for a, b in pairwise(levels)):
        raise ModelError(f"tensions: found {levels}, expected some above 0 kPa that rise")
    rods = reduce(design, beam_elements=_BEAM_ELEMENTS, plate_factor=factor)
    notes: list[str] = []
    if mesh is None:
        mesh, more = mesh_for(design)
        notes += more
    refuse_own_pillars(design, mesh)
    plain, _ = RodSide(design, rods).states(levels, Silent())
    parts = parts_of(design, mesh if parts_mesh is None else parts_mesh, rods, plain, reporter)
    sides: dict[Stiffness, RodSide | LoadedRods] = {
        Stiffness.closed_form: RodSide(design, rods),
        Stiffness.mesh_beam: RodSide(design, with_sections(rods, parts.sections)),
        Stiffness.mesh: parts.side(),
        Stiffness.mesh_at_load: parts,
    }
    solid = SolidSide(design, mesh, solved[0].model if solved else None)
    if solved:
        observed, states = [solid.observe(s, T) for s, T in zip(solved, levels, strict=True)], list(solved)
    else:
        reporter.stage("solid", len(levels))
        observed, states = solid.states(levels, reporter)
    own = solid.squeezed(levels[: len(observed)], reporter)
    observed = [beyond(each, *energy) for each, energy in zip(observed, own, strict=True)]
    reporter.stage("rods at the tensions of the solid", len(sides))
    by_rods = {name: side.states(levels, reporter) for name, side in sides.items()}
    size = np.diff(stations(design))
    for name in (Stiffness.mesh_beam, Stiffness.mesh, Stiffness.mesh_at_load):
        seen, found = by_rods[name]
        at_load = name is Stiffness.mesh_at_load
        by_rods[name] = [_apart(each, parts.sections, size, at_load=at_load) for each in seen], found
    # about the passive state, or the last that all reached
    standing = levels.index(design.tension(0.0)) if design.tension(0.0) in levels else len(levels) - 1
    common = min(standing, len(states) - 1, *(len(found) - 1 for _, found in by_rods.values()))
    reporter.stage(f"natural motions at {levels[common]:.3g} kPa", 1 + len(sides))
    at = seen_positions(design)
    moving = solid.motions(states[common], at, MODES)
    reporter.advance("solid")
    pairs: dict[Stiffness, tuple[Pair, ...]] = {}
    for name, (_, found) in by_rods.items():
        motions = RodSide(design, found[common].model).motions(found[common], at, 2 * MODES)
        pairs[name] = tuple(paired(moving, motions, MODES))
        reporter.advance(f"rods, {name.replace('_', ' ')}")
    shown = [(i, name) for i in sorted({common, min(len(states), *(len(f) for _, f in by_rods.values())) - 1})
             for name in (Stiffness.closed_form, Stiffness.mesh_at_load)]  # fmt: skip
    outlines = {
        f"{levels[i]:.3g} kPa, rods {'in closed form' if name is Stiffness.closed_form else 'from the mesh'}": (
            solid_outline(solid, states[i]),
            rod_outline(RodSide(design, by_rods[name][1][i].model), design, by_rods[name][1][i]),
        )
        for i, name in shown
    }
    return CrossCheck(
        design,
        expectation,
        tuple(observed),
        {name: tuple(found) for name, (found, _) in by_rods.items()},
        parts.sections,
        pairs,
        {"elements_1": mesh.n_elements, "unknowns_1": solid.model.n_dofs},
        outlines,
        (*notes, *reporter.notes),
        level_both(solid, states, RodSide(design, rods), by_rods[Stiffness.closed_form][1], levels),
        levels[common],
    )


def _apart(seen: Observed, sections: MeshSections, size: Array, *, at_load: bool) -> Observed:
    """A state of rods with sections from the mesh, what the roots yield told apart from the beam's curvature."""
    curvature, roots = sections.without_roots(seen.curvature, size, at_load=at_load)
    return replace(seen, curvature=curvature, roots=seen.roots + roots)


def _last(found: CrossCheck) -> int:
    """Number of the last tension that all reached."""
    return min(len(found.solid), *(len(states) for states in found.rods.values())) - 1


def root_rows(found: CrossCheck) -> list[dict[str, Any]]:
    """What the beam's roots yield at the last common tension, turns of the pillars beyond its ends, one row a model."""
    last = _last(found)
    models = {"solid": found.solid[last], **{f"rods_{name}": states[last] for name, states in found.rods.items()}}
    return [
        {"model": name, **dict(zip(("short_deg", "long_deg"), np.rad2deg(state.roots).tolist(), strict=True))}
        for name, state in models.items()
    ]


def curvature_rows(found: CrossCheck) -> list[dict[str, Any]]:
    """Curvature along the beam at the last common tension, without what its roots yield, one row a stretch."""
    last = _last(found)
    x = np.linspace(-found.design.span / 2, found.design.span / 2, len(found.solid[last].curvature) + 1)
    middle = 0.5 * (x[1:] + x[:-1])
    return [
        {
            "x_mm": float(middle[i]),
            "solid_1_per_mm": float(found.solid[last].curvature[i]),
            **{f"rods_{name}_1_per_mm": float(states[last].curvature[i]) for name, states in found.rods.items()},
        }
        for i in range(len(middle))
    ]

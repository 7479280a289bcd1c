"""Study: what the solid teaches the rods.

Question
--------
Solid and rods of one design walk under one drive, and stroke and step differ. Which property of the solid, measured on
it and put into the rods, closes how much of that: the plate's stiffness, the effective span, the moment arm with the
muscle's rings, the compliance of the feet, all of these together, or the stroke itself?

Run: ``python studies/solid_teaches_rods.py [--level smoke|full] [--out FOLDER]``; five minutes at level full.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from fem_biobot.config import load_design
from fem_biobot.design import Design
from fem_biobot.link.parts import BONDS, part_of, wrench
from fem_biobot.link.rod_side import RodSide
from fem_biobot.link.sections import MeshSections, sections_from_mesh, with_sections
from fem_biobot.link.solid_side import SolidSide
from fem_biobot.link.strip import StripSections, strip_from_mesh, with_strip
from fem_biobot.link.stroke import stroke_law
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.mesh.committed import mesh_for
from fem_biobot.progress import show_tables
from fem_biobot.rod.anatomy import anatomy
from fem_biobot.rod.ensemble import walk_ensemble
from fem_biobot.rod.ground import ContactPoints
from fem_biobot.rod.landmarks import Landmarks
from fem_biobot.rod.model import RodModel
from fem_biobot.rod.records import Body, Rigid, Rod
from fem_biobot.rod.reduce import ground_of, reduce
from fem_biobot.rod.section import RodMaterial, Section
from fem_biobot.solid.from_design import law_of
from fem_biobot.solid.model import SolidModel, solve
from fem_biobot.solid.records import Fix, Step, Traction
from fem_biobot.solid.walk import solid_walk
from fem_biobot.study.outputs import write_table
from fem_biobot.study.reporter import Silent
from fem_biobot.tables import Table

Row = dict[str, Any]

# --- design -----------------------------------------------------------------------------------------------------------
#
# The junction bot in air as in `solid_walk.py`: 0.9 kPa at rest and 2.7 kPa at full drive, friction 0.42 / 0.3.

DESIGN = "junction_bot"
TENSIONS = ("muscle.passive_tension = 0.9 kPa", "muscle.active_tension = 2.7 kPa")


@dataclass(frozen=True)
class Level:
    """Mesh size [mm], strokes a second, strokes, those left out; steps of solid and rods [s], starts of the rods."""

    size: float
    frequency: float
    strokes: int
    discard: int
    solid_step: float
    rod_step: float
    starts: int


LEVELS = {"smoke": Level(14.0, 4.0, 2, 1, 5e-3, 2.5e-3, 2), "full": Level(5.0, 2.0, 5, 2, 2e-3, 1e-3, 6)}

# --- quantity, and why it can converge --------------------------------------------------------------------------------
#
# All properties come from static solutions of parts of the solid under small loads; the walk's own time series is asked
# for stroke and step alone, means over the strokes after the transient. One machine has several gaits: of the rods the
# median of walks from perturbed starts is told, and their spread.
#
# * plate: E I of the beam's middle over the closed form, evenly along it (`link.sections`).
# * span: E I of each stretch over that of the middle: ends that yield make the span longer.
# * arm: the junction as a clamped rod with its rings (`link.strip`), which lifts the line of its pull.
# * feet: a sole under unit forces along it and on it and a unit couple that rocks it, its pillar's bond held; the rods'
#   soles are bodies on short rods of those three stiffnesses.
# * stroke: tensions with which the rods close as the solid does (`link.stroke`), floating.

_STUB = 0.2  # mm, length of the rods on which the soles are
_LIGHT = 1e-3  # of the machine's mass, that of a sole
_SOLES = ("foot_short", "foot_long")


@dataclass
class Study:
    """What was measured on the solid, and one row for each machine that walked."""

    measured: Row = field(default_factory=dict)
    rows: list[Row] = field(default_factory=list)

    def row(self, name: str) -> Row:
        return next(row for row in self.rows if row["machine"] == name)


def foot_stiffness(design: Design, mesh: BodyMesh) -> list[tuple[float, float, float]]:
    """Of each sole against its held bond: along the ground and normal to it [mN/mm], and in rocking [uJ]."""
    body = part_of(mesh, "skeleton")
    law, found = {"skeleton": law_of(design.value("skeleton.material"))}, []
    for sole in _SOLES:
        corners = body.points[:, np.unique(body.surfaces[sole])]
        middle = 0.5 * (corners.min(axis=1) + corners.max(axis=1))
        unit = 1e-3 * np.eye(3)
        cases = {
            "along": (unit[0], 0.0 * unit[0]),
            "normal": (unit[2], 0.0 * unit[0]),
            "rock": (0.0 * unit[0], unit[1]),
        }
        loads = [Traction(sole, wrench(body, sole, f, m, middle), name=name) for name, (f, m) in cases.items()]
        model = SolidModel(body, law, {}, [Fix(bond) for bond in BONDS], loads, element=design.mesh.element)
        states = solve(model, [Step(0.0, 0.0, {name: 1.0}) for name in cases]).states
        work = [
            float(np.sum(sum(f for n, f in model.system.dead_loads if n == name) * state.u.T))
            for name, state in zip(cases, states, strict=True)
        ]
        found.append((1e-6 / work[0], 1e-6 / work[1], 1e-6 / work[2]))
    return found


# --- run --------------------------------------------------------------------------------------------------------------


def with_soles(model: RodModel, stiffness: list[tuple[float, float, float]]) -> RodModel:
    """The same machine on soles of their own, each on a short rod from its pillar."""
    bodies, rods, joints, contacts = list(model.bodies), list(model.rods), list(model.joints), []
    for foot, (along, normal, rock) in zip(model.contacts, stiffness, strict=True):
        assert isinstance(foot.part, str)
        name, middle = f"sole_{foot.part}", np.mean(foot.points, axis=0)
        top = middle + np.array([0.0, 0.0, _STUB])
        mass = _LIGHT * model.mass
        bodies.append(Body(tuple(middle), mass, np.full(3, mass), name))
        # with E = 1 and G = 1/2 of a unit section: stiffness over length is what the stub has
        plain = Section.rectangle(1.0, 1.0, poisson=0.0)
        section = replace(
            plain, I1=rock * _STUB, I2=rock * _STUB, J=2.0 * rock * _STUB, stretch_factor=normal * _STUB,
            shear_factors=(2.0 * along * _STUB, 2.0 * along * _STUB),
        )  # fmt: skip
        stub = f"stub_{foot.part}"
        material = RodMaterial(young=1.0, density=1e-6, poisson=0.0)
        rods.append(Rod(np.array([middle, top]), section, material, stub, normal=(0.0, 1.0, 0.0), mass=0.0))
        joints += [Rigid((stub, 1), (foot.part, tuple(top))), Rigid((stub, 0), (name, tuple(middle)))]
        contacts.append(ContactPoints(name, foot.points))
    beam = model.rods[0]
    chains = [tuple(str(getattr(model.members[i], "name", "")) for i in chain) for chain in anatomy(model).chains]
    marks = Landmarks((beam.name, 0), (beam.name, -1), (beam.name, (len(beam.points) - 1) // 2), chains)
    parts = (model.supports, model.loads, model.members, contacts)
    return RodModel(rods, joints, bodies, *parts, model.damping_time, model.touches, marks)


def lessons(
    design: Design, sections: MeshSections, strip: StripSections, feet: list[tuple[float, float, float]]
) -> dict[str, Callable[[RodModel], RodModel]]:
    """Name of each property to what it makes of a reduced model."""
    closed, along = sections.closed_form, np.array(sections.mesh.EI_along)
    middle = along[len(along) // 2]

    def beam(EI: np.ndarray) -> Callable[[RodModel], RodModel]:
        changed = replace(sections, mesh=replace(closed, EI=float(EI.mean()), EI_along=tuple(EI.tolist())))
        return lambda model: with_sections(model, changed)

    return {
        "plate": beam(np.full_like(along, middle)),
        "span": beam(closed.EI * along / middle),
        "arm": lambda model: with_strip(model, design, strip),
        "feet": lambda model: with_soles(model, feet),
        "all four": lambda model: with_soles(with_strip(beam(along)(model), design, strip), feet),
    }


def floating_stroke(design: Design, model: RodModel) -> tuple[float, float]:
    """Passive closing and stroke of a rod model, afloat [mm]."""
    tensions = [design.tension(drive) for drive in (0.0, 0.5, 1.0)]
    found = RodSide(design, model).states(tensions, Silent())[0]
    closing = [state.numbers["tip_closing_mm"] for state in found]
    return closing[0], closing[-1] - closing[0]


def run(level: str) -> Study:
    """The solid, the rods as they are, and the rods with each lesson."""
    size, study = LEVELS[level], Study()
    design = load_design(DESIGN, TENSIONS).with_values({"mesh.size": size.size})
    mesh = mesh_for(design)[0]
    sections, strip, feet = (
        sections_from_mesh(design, mesh),
        strip_from_mesh(design, mesh),
        foot_stiffness(design, mesh),
    )
    along = np.array(sections.mesh.EI_along)
    middle = along[len(along) // 2]
    study.measured = {
        "plate_1": middle / sections.closed_form.EI,
        "span_mm": float((design.span / len(along) * middle / along).sum()),
        "muscle_EA_mN": design.span / float((np.diff(strip.x) / strip.EA).sum()),
        **{f"{sole}_{way}": v for sole, k in zip(_SOLES, feet, strict=True)
           for way, v in zip(("along_mN_per_mm", "normal_mN_per_mm", "rocking_uJ"), k, strict=True)},
    }  # fmt: skip
    given: dict[str, Any] = {
        "frequency": size.frequency, "duration": size.strokes / size.frequency, "discard": size.discard,
    }  # fmt: skip
    states = SolidSide(design, mesh).states([design.tension(d) for d in (0.0, 0.5, 1.0)], Silent())[0]
    closing = [state.numbers["tip_closing_mm"] for state in states]
    solid = solid_walk(design, mesh, step=size.solid_step, **given)
    study.rows.append(_row("solid", closing[0], closing[-1] - closing[0], [solid.summary()]))
    machines: dict[str, tuple[Design, RodModel]] = {"rods": (design, reduce(design))}
    for name, taught in lessons(design, sections, strip, feet).items():
        machines[f"rods, {name}"] = (design, taught(reduce(design)))
    law = stroke_law(design, mesh)
    machines["rods, stroke"] = (law.design, reduce(law.design))
    for name, (own, model) in machines.items():
        found = walk_ensemble(
            model, starts=size.starts, ground=ground_of(design), step=size.rod_step, waveform=design.drive, **given
        ).walks
        study.rows.append(_row(name, *floating_stroke(own, model), [one.summary() for one in found]))
    _closed(study)
    return study


def _row(name: str, passive: float, floating: float, walks: list[Row]) -> Row:
    """Medians over walks, and between which steps they lie."""
    steps = [one["step_mm"] for one in walks]
    walked = {
        key: float(np.median([one[key] for one in walks])) for key in ("passive_closing_mm", "stroke_mm", "step_mm")
    }
    ends = {"least_step_mm": min(steps), "largest_step_mm": max(steps)}
    return {"machine": name, "floating_closing_mm": passive, "floating_stroke_mm": floating, **walked, **ends}


def _closed(study: Study) -> None:
    """Share of the difference between rods and solid that each lesson closes [1]; above 1 it goes too far."""
    solid, rods = study.row("solid"), study.row("rods")
    for row in study.rows:
        for key in ("floating_stroke_mm", "stroke_mm", "step_mm"):
            row[f"closed_{key[:-3]}_1"] = (rods[key] - row[key]) / (rods[key] - solid[key])


# --- found ------------------------------------------------------------------------------------------------------------
#
# Level full, 8073 unknowns; medians of six starts of the rods, the least and the largest step in brackets.
#
#                       stroke afloat  closed   stroke, walking  closed   step                       closed
#   solid               1.02 mm                 0.268 mm                  0.028 mm
#   rods                1.20 mm                 0.403 mm                  0.142 mm (0.127 to 0.148)
#   plate, 1.195 E I    1.08 mm        66 %     0.329 mm         55 %     0.113 mm (0.105 to 0.118)   26 %
#   span, 7.78 mm       1.25 mm       -30 %     0.452 mm        -36 %     0.017 mm (-0.064 to 0.080) 111 %
#   arm and rings       1.11 mm        52 %     0.346 mm         42 %     0.106 mm (0.061 to 0.118)   32 %
#   feet                1.20 mm         0 %     0.413 mm         -7 %     0.117 mm (0.088 to 0.150)   22 %
#   all four            1.05 mm        82 %     0.336 mm         50 %     0.109 mm (0.060 to 0.115)   29 %
#   stroke              1.02 mm       100 %     0.174 mm        170 %     0.041 mm (0.023 to 0.043)   89 %
#
# * Afloat the four close four fifths of what parts the strokes, to 3 %; parts about the load that they bear do better
#   (the cross-check), and about one load they walk (`walking_gap.py`). Plate and arm matter most, the span takes back
#   some.
# * On the ground the solid makes a quarter of its stroke afloat and the rods a third: feet that stick take the rest.
#   There the four close half.
# * Feet are stiff: 3 to 8 N/mm against half a millinewton of friction, less than a thousandth of a millimetre. As
#   springs they close nothing of the stroke; the step changes by what any change does to a gait with several answers.
# * A stroke taken over afloat is too short on the ground: with less tension the feet break loose later. It closes most
#   of the step's difference, and by the wrong way.
# * What is left of stroke and step is not in the beam, nor in the muscle, nor in soles as springs: it is in soles that
#   the rings pinch, which bear friction across the machine and break loose along it before they should
#   (`walking_gap.py`).
#
# Not looked at: finer meshes, ensembles of the solid, other frequencies, soles whose points break loose one by one.

# --- expect -----------------------------------------------------------------------------------------------------------


def expect(study: Study, level: str) -> None:
    """What must hold at every level."""
    measured = study.measured
    # a mesh of one element through the beam is stiffer than any plate
    most = (1.15 if level == "smoke" else 1.0) / (1.0 - 0.45**2)
    assert 1.0 < measured["plate_1"] < most, f"plate: {measured['plate_1']:.3g} is no plate's"
    assert 7.0 < measured["span_mm"] < 9.0, f"span: {measured['span_mm']:.3g} mm"
    solid, rods = study.row("solid"), study.row("rods")
    assert solid["floating_stroke_mm"] < rods["floating_stroke_mm"], "the solid closes further than its rods"
    share = {row["machine"]: row["closed_floating_stroke_1"] for row in study.rows}
    assert share["rods, plate"] > 0.3, f"plate: closes {share['rods, plate']:.2g} of the stroke"
    assert share["rods, span"] < 0.0, "span: a longer span makes the stroke shorter"
    assert share["rods, arm"] > 0.1, f"arm: closes {share['rods, arm']:.2g} of the stroke"
    assert abs(share["rods, feet"]) < 0.02, "feet: matter afloat"
    assert abs(share["rods, stroke"] - 1.0) < 0.05, "stroke: is not the solid's"
    if level == "full":
        assert abs(share["rods, all four"] - 1.0) < 0.2, f"all four: close {share['rods, all four']:.2g} of the stroke"


def tables(study: Study) -> list[Table]:
    """What was found, for the terminal."""
    names = tuple(study.rows[0])
    lines = tuple(tuple(row[name] for name in names) for row in study.rows)
    measured = tuple((key, value) for key, value in study.measured.items())
    return [Table("Measured on the solid", ("what", "value"), measured), Table("Lessons", names, lines)]


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description="What the solid teaches the rods.")
    parser.add_argument("--level", choices=list(LEVELS), default="full")
    parser.add_argument("--out", type=Path, default=Path("runs") / "studies" / "solid_teaches_rods")
    options = parser.parse_args()
    study = run(options.level)
    options.out.mkdir(parents=True, exist_ok=True)
    write_table(options.out / "lessons.csv", study.rows)
    write_table(options.out / "measured.csv", [study.measured])
    show_tables(tables(study))
    expect(study, options.level)
    print("every expectation holds")


if __name__ == "__main__":
    main()

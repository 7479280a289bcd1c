"""Study: whether the muscle or the skeleton parts rods with constants of the mesh from the solid.

Question
--------
Rods about the load that they bear take every constant from loads on skeleton and muscle alone. What is left between
them and the machine's solid, is it the muscle's or the skeleton's? Each part of the mesh by itself is moved, or loaded,
as the rods move or load it: the muscle's bonds come together and turn as the rods' pillars do, the skeleton bears the
force and the couple of the rods' muscle. Rods whose junction bends as unit loads say stand beside those whose turned
ends hold the line of pull as the muscle's do.

Run: ``python studies/parts_alone.py [--level smoke|full] [--out FOLDER]``; two minutes at level full.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from fem_biobot.config import load_design
from fem_biobot.design import Design
from fem_biobot.files import replacing
from fem_biobot.link.alone import MuscleAlone, Pull, heights
from fem_biobot.link.at_load import LoadedRods, parts_of
from fem_biobot.link.crosscheck import tensions_of
from fem_biobot.link.parts import BONDS, balanced, part_of
from fem_biobot.link.rod_side import RodSide
from fem_biobot.link.solid_side import SolidSide
from fem_biobot.link.strip import STRIP
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.mesh.committed import mesh_for
from fem_biobot.progress import show_tables
from fem_biobot.rod.reduce import reduce
from fem_biobot.solid.from_design import law_of, supports
from fem_biobot.solid.model import SolidModel, solve
from fem_biobot.solid.records import Step
from fem_biobot.study.outputs import write_table
from fem_biobot.study.reporter import Silent
from fem_biobot.tables import Table

Row = dict[str, Any]

# --- design -----------------------------------------------------------------------------------------------------------

DESIGN = "junction_bot"
SIZE = {"smoke": 2.0, "full": 0.9}  # mm
LEVELS = {"smoke": (-1,), "full": (1, 3, 5)}  # out of the tensions of the cross-check
UNIT, FIRM = "bending by unit loads", "ends as firm as the muscle's"
_PANELS = {
    "muscle_force_over_rods_1": "force of the muscle, moved as the rods",
    "muscle_arm_over_rods_1": "arm of its line of pull",
    "skeleton_turn_over_rods_1": "turn of the skeleton, loaded as the rods",
}
ROUNDS, CLOSE = 6, 1e-4  # in which the couple on the skeleton is found, and to what share

# --- quantity, and why it can converge --------------------------------------------------------------------------------
#
# Force and line of pull of the muscle, turn of the pillars: of a part of the mesh over that of the rods, less 1, at the
# same motion or the same load. Both sides are of one mesh, so what the mesh leaves out is in both.


@dataclass
class Study:
    """Rows of every tension and kind of rods."""

    rows: list[Row] = field(default_factory=list)

    def last(self, rods: str) -> Row:
        """At the highest tension."""
        return [row for row in self.rows if row["rods"] == rods][-1]


def run(level: str) -> Study:
    """Both kinds of rods, and each part as they move and load it."""
    design = load_design(DESIGN).with_values({"mesh.size": SIZE[level]})
    mesh, reduced, tensions = mesh_for(design)[0], reduce(design), tensions_of(design)
    made = parts_of(design, mesh, reduced, RodSide(design, reduced).states(tensions, Silent())[0], Silent())
    assert made.strip is not None
    plain = replace(made.strip, firmness=np.ones_like(made.strip.firmness), height=np.zeros_like(made.strip.height))
    study = Study()
    for name, rods in ((UNIT, replace(made, strip=plain)), (FIRM, made)):
        observed, states = rods.states(tensions, Silent())
        for k in LEVELS[level]:
            study.rows.append({"rods": name, **beside(rods, observed[k].tension, observed[k].numbers, states[k], mesh)})
    return study


def beside(rods: LoadedRods, tension: float, numbers: Mapping[str, float], state: Any, mesh: BodyMesh) -> Row:
    """The parts of the mesh beside a state of rods."""
    design, turn = rods.design, float(np.deg2rad(numbers["pillar_rotation_deg"]))
    half, z = design.span / 2, design.value("muscle.junction_height")
    side = RodSide(design, state.model)
    # both ends of a level chord; the machine's feet alone are of two lengths
    axis = side.points(state).level().axis[-1, 2]
    raw = side.points(state)
    chord = raw.axis[-1] - raw.axis[0]
    up = np.array([-chord[2], 0.0, chord[0]]) / np.linalg.norm(chord)
    ends = [state.at((name, (x, 0.0, z))) for name, x in (("pillar_short", -half), ("pillar_long", half))]
    strip = state.points(STRIP)
    level = float((0.5 * (ends[0] + ends[1]) - 0.5 * (raw.axis[0] + raw.axis[-1])) @ up)
    rise = float((strip[len(strip) // 2] - 0.5 * (ends[0] + ends[1])) @ up)
    pull = Pull(tension, rods.bearing(side, state).approach, turn)
    alone = MuscleAlone(design, mesh).turned(pull)
    force = float(alone.reaction(BONDS[1])[0])
    lifted = heights(design, [alone], [(-half + 0.5 * pull.approach, half - 0.5 * pull.approach)])[0]
    arm, of_muscle = axis - level - rise, axis - level - lifted
    by_rods = numbers["muscle_force_mN"]
    turned = skeleton_turn(design, mesh, by_rods, by_rods * arm)
    return {
        "tension_kPa": tension,
        "force_mN": by_rods,
        "muscle_force_over_rods_1": force / by_rods - 1.0,
        "arm_mm": arm,
        "muscle_arm_over_rods_1": of_muscle / arm - 1.0,
        "turn_deg": float(np.rad2deg(turn)),
        "skeleton_turn_over_rods_1": turned / turn - 1.0,
    }


def skeleton_turn(design: Design, mesh: BodyMesh, force: float, moment: float) -> float:
    """Mean turn of the pillars of the skeleton [rad] under a force [mN] and a moment about the beam's ends [uJ].

    Dead loads on the bonds, at the junction's height; a couple besides is found with which the moment is right where
    the bonds have moved.
    """
    body = part_of(mesh, "skeleton")
    at = np.array([0.0, 0.0, design.value("muscle.junction_height")])
    one, none = np.eye(3), np.zeros(3)
    loads = [*balanced(body, "force", -one[0], none, at), *balanced(body, "couple", none, one[1], at)]
    law = law_of(design.value("skeleton.material"))
    model = SolidModel(body, {"skeleton": law}, {}, supports(design, body), loads, element=design.mesh.element)
    side, dead = SolidSide(design, body, model), model.system.dead_loads
    nodal = {name: np.asarray(sum(f for n, f in dead if n == name)) for name in ("force", "couple")}

    def borne(couple: float) -> tuple[float, float]:
        """Moment about the beam's end where the long bond has moved to [uJ], and the pillars' turn [rad]."""
        state = solve(model, [Step(load=0.0, tension=0.0, loads={"force": force, "couple": couple})]).last
        points, long = side.points(state), state.X[0] > 0.0
        acting = (force * nodal["force"] + couple * nodal["couple"])[long]
        found = np.cross((state.X + state.u).T[long] - points.axis[-1], acting).sum(axis=0)
        return float(found[1]), float(points.pillar_turns.mean())

    before, (first, _) = 0.0, borne(0.0)
    couple = moment - first
    found, turn = borne(couple)
    for _ in range(ROUNDS):
        if abs(found - moment) < CLOSE * abs(moment):
            return turn
        slope = (found - first) / (couple - before)
        before, first, couple = couple, found, couple + (moment - found) / slope
        found, turn = borne(couple)
    raise AssertionError(f"skeleton: found a moment of {found:.4g} uJ, expected {moment:.4g} uJ")


# --- expect -----------------------------------------------------------------------------------------------------------


def expect(study: Study) -> None:
    """Bending by unit loads leaves the line of pull too far from the beam; with firm ends both parts are the rods'."""
    unit, firm = study.last(UNIT), study.last(FIRM)
    assert -0.08 < unit["muscle_arm_over_rods_1"] < -0.03, "by unit loads: the arm is right"
    assert abs(unit["muscle_force_over_rods_1"]) < 0.02, "by unit loads: the muscle itself is off"
    assert abs(firm["muscle_arm_over_rods_1"]) < 0.01, "firm: the arm is off"
    assert abs(firm["muscle_force_over_rods_1"]) < 0.02, "firm: the muscle's force is off"
    for row in study.rows:
        assert abs(row["skeleton_turn_over_rods_1"]) < 0.015, f"the skeleton is off at {row['tension_kPa']:.3g} kPa"


# --- what was found ---------------------------------------------------------------------------------------------------

FOUND = """
Level full (mesh of 0.9 mm, two minutes). Of a part of the mesh over the rods', less 1:

                                tension     force of the muscle   arm of its pull   turn of the skeleton
  bending by unit loads         2.3 kPa     +0.3 %                -1.2 %            -0.3 %
                                6.8         +0.8 %                -3.2 %            -0.7 %
                                10.4        +1.2 %                -4.2 %            -1.0 %
  ends as firm as the muscle's  2.3         -0.1 %                -0.0 %            -0.3 %
                                6.8         -0.4 %                -0.1 %            -0.7 %
                                10.4        -0.8 %                -0.3 %            -0.9 %

* It was the muscle, and of it the arm: turned ends lift the line of its pull by more than bending by unit loads says.
* With firm ends the rods' muscle pulls by up to a percent more than the mesh's, and their beam turns by as much more
  than the skeleton: that is left. To take the resistance too from turned bonds was tried and is not in the program:
  muscle and rod agreed to 0.2 % here, but no state was found where tissue shortens by more, as under a 0.5 mm beam.
"""

# --- what was not looked at -------------------------------------------------------------------------------------------

NOT_LOOKED_AT = """
What bonds do beyond moving as rigid plates: in the machine they are squeezed by their rings.
"""


def tables(study: Study) -> list[Table]:
    """What is printed."""
    return [Table("Parts of the mesh beside rods", tuple(study.rows[0]), tuple(tuple(r.values()) for r in study.rows))]


def write(study: Study, folder: Path) -> None:
    """CSV file of every row, and a picture of what each part does beside the rods, over the tension."""
    folder.mkdir(parents=True, exist_ok=True)
    write_table(folder / "parts_alone.csv", study.rows)
    figure = Figure(figsize=(11.0, 3.4), dpi=150, layout="constrained")
    FigureCanvasAgg(figure)
    for panel, (key, title) in zip(figure.subplots(1, 3, sharey=True), _PANELS.items(), strict=True):
        for rods, style in ((UNIT, "s--"), (FIRM, "o-")):
            rows = [row for row in study.rows if row["rods"] == rods]
            panel.plot(
                [r["tension_kPa"] for r in rows], [100.0 * r[key] for r in rows], style, markersize=4, label=rods
            )
        panel.axhline(0.0, color="0.6", linewidth=0.8)
        panel.set_title(title, fontsize=9)
        panel.set_xlabel("tension [kPa]")
    figure.axes[0].set_ylabel("part of the mesh over rods, less 1 [%]")
    figure.axes[1].legend(frameon=False, fontsize=8)
    with replacing(folder / "parts_alone.png") as temporary:
        figure.savefig(temporary, format="png")


def main() -> None:
    parser = argparse.ArgumentParser(description="Each part of the mesh, moved and loaded as rods do it.")
    parser.add_argument("--level", choices=tuple(SIZE), default="full")
    parser.add_argument("--out", type=Path, default=Path("runs") / "studies" / "parts_alone")
    options = parser.parse_args()
    study = run(options.level)
    show_tables(tables(study))
    write(study, options.out)
    expect(study)
    print("every expectation holds")


if __name__ == "__main__":
    main()

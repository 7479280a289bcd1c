"""Study: what parts the walk of the solid from that of its rods.

Question
--------
Solid and rods of one design walk under one drive on one ground, and stroke and step differ. The same in limits in which
one cause after the other vanishes: without friction, with feet that hold, slowly, with one coefficient of friction for
feet that stick and that slip, on the corners of the soles alone; and rods with the stiffness of the solid's own parts,
and with its closing. Which cause makes how much of the difference, and what is left?

Run: ``python studies/walking_gap.py [--level smoke|full] [--out FOLDER]``; ten minutes at level full on an idle core.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from fem_biobot.config import load_design
from fem_biobot.files import replacing
from fem_biobot.link.at_load import parts_of
from fem_biobot.link.closing import closing_as, closings
from fem_biobot.link.rod_side import RodSide
from fem_biobot.link.solid_side import SolidSide
from fem_biobot.mesh.geometry import build_mesh
from fem_biobot.progress import show_tables
from fem_biobot.rod.ensemble import walk_ensemble
from fem_biobot.rod.reduce import ground_of, reduce
from fem_biobot.rod.walk import walk
from fem_biobot.solid.dynamics.body import MovingBody, holding
from fem_biobot.solid.dynamics.feet import Feet, feet_of
from fem_biobot.solid.model import SolidState
from fem_biobot.solid.standing import FEET, stand
from fem_biobot.solid.walk import solid_walk, walking_body
from fem_biobot.study.outputs import write_table
from fem_biobot.study.reporter import Silent
from fem_biobot.tables import Table

Row = dict[str, Any]

# --- design -----------------------------------------------------------------------------------------------------------
#
# The junction bot in air as in `solid_walk.py`: 0.9 kPa at rest, 2.7 kPa more at full drive. Static and kinetic
# friction 0.42 and 0.3 as published, or as a limit says.

DESIGN = "junction_bot"
TENSIONS = ("muscle.passive_tension = 0.9 kPa", "muscle.active_tension = 2.7 kPa")


@dataclass(frozen=True)
class Pace:
    """Strokes a second, and the steps of solid and rods [s]."""

    frequency: float
    solid_step: float
    rod_step: float


@dataclass(frozen=True)
class Limit:
    """Static and kinetic friction, pace, strokes and those left out; whether the solid walks on its corners too."""

    name: str
    static: float
    kinetic: float
    pace: str
    strokes: int
    discard: int
    corners: bool = False


FREE, HELD, SLOW_ONE, ONE, SLOW, PUBLISHED = LIMITS = (
    Limit("no friction", 0.0, 0.0, "fast", 1, 0),
    Limit("feet that hold, slow", 5.0, 5.0, "slow", 1, 0),
    Limit("0.3 / 0.3, slow", 0.3, 0.3, "slow", 2, 1),
    Limit("0.3 / 0.3", 0.3, 0.3, "fast", 2, 1, True),
    Limit("0.42 / 0.3, slow", 0.42, 0.3, "slow", 2, 1),
    Limit("0.42 / 0.3", 0.42, 0.3, "fast", 3, 1, True),
)


@dataclass(frozen=True)
class Level:
    """Mesh size [mm], paces, starts of the rods, limits."""

    size: float
    paces: dict[str, Pace]
    starts: int
    limits: tuple[Limit, ...]


LEVELS = {
    "smoke": Level(
        9.0, {"slow": Pace(1.0, 1e-2, 1e-2), "fast": Pace(2.0, 1e-2, 2e-3)}, 1,
        tuple(replace(limit, strokes=limit.discard + 1) for limit in (SLOW_ONE, PUBLISHED)),
    ),
    "full": Level(5.0, {"slow": Pace(0.4, 1e-2, 1e-2), "fast": Pace(2.0, 2e-3, 1e-3)}, 4, LIMITS),
}  # fmt: skip

# --- quantity, and why it can converge --------------------------------------------------------------------------------
#
# Stroke and step from the machine at rest on its feet. With one coefficient of friction both repeat from the second
# stroke on and converge with the step; where friction jumps, a machine has several gaits, and rods tell the median of
# walks from perturbed starts and their least and largest. Parts are loaded on the mesh that walks, so that its error
# is in both.
#
# * rods at load: the cross-check's, with constants of their parts about what these bear afloat at half drive (one model
#   for the whole walk; the cross-check takes another for every tension)
# * rods, closing: those with the tensions at which they close, afloat, as the solid does at rest and at full drive
# * solid on corners: the ground stops the four corners of each sole alone, which are the points that rods touch with
# * solid on stiff corners: the same, and nothing on the soles may move across the machine, as nothing of rods does

RODS, LOADED, CLOSING, CORNERS, SOLID = "rods", "rods at load", "rods, closing", "solid on corners", "solid"
STIFF = "solid on stiff corners"


@dataclass
class Study:
    """Closing afloat, a row for each machine in each limit, how soles narrow, the short foot's friction by phase."""

    afloat: list[Row] = field(default_factory=list)
    rows: list[Row] = field(default_factory=list)
    soles: list[Row] = field(default_factory=list)
    courses: dict[str, tuple[np.ndarray, np.ndarray]] = field(default_factory=dict)
    unknowns: int = 0

    def value(self, machine: str, limit: Limit, key: str) -> float:
        return next(r[key] for r in self.rows if (r["machine"], r["limit"]) == (machine, limit.name))

    def stroke_afloat(self, machine: str) -> float:
        row = next(r for r in self.afloat if r["machine"] == machine)
        return row["full_mm"] - row["rest_mm"]


# --- run --------------------------------------------------------------------------------------------------------------


def corners_of(body: MovingBody) -> Feet:
    """The corners of both soles."""
    feet = feet_of(body, FEET)
    X = body.system.space.points[:, feet.nodes]
    chosen = np.zeros(len(feet.nodes), dtype=bool)
    for k in range(len(FEET)):
        own = feet.owner == k
        ends = [(X[i, own].min(), X[i, own].max()) for i in (0, 1)]
        chosen |= own & np.isclose(X[0][:, None], ends[0]).any(axis=1) & np.isclose(X[1][:, None], ends[1]).any(axis=1)
    return feet.only(chosen)


def narrowing(body: MovingBody, rest: SolidState, full: SolidState) -> float:
    """By how much the outer edge of the short sole becomes shorter from one state to another [mm]."""
    feet = corners_of(body)
    X = rest.X[:, feet.nodes]
    outer = (feet.owner == 0) & np.isclose(X[0], X[0].min())
    moved = (full.u - rest.u)[1, feet.nodes[outer]]
    return float(-np.sum(np.sign(X[1, outer]) * moved))


def stiffened(body: MovingBody) -> MovingBody:
    """The same body with soles that keep their width."""
    return holding(body, 3 * feet_of(body, FEET).nodes + 1)


def _row(machine: str, limit: Limit, walks: list[Any]) -> Row:
    """Medians over walks; forces of the kept time."""
    steps = [w.step_mm for w in walks]
    force = [w.foot_force[w.times > w.stroke_ends[w.kept.start] + 1e-9] for w in walks]
    points = [w.motion.contact_force[w.times > w.stroke_ends[w.kept.start] + 1e-9] for w in walks]
    # of points that bear more than a twentieth of a millinewton
    across = [float((np.abs(p[..., 2]) / np.maximum(p[..., 0], 1e-9))[p[..., 0] > 0.05].max()) for p in points]
    ratio = [float((np.abs(f[:, :, 1]) / np.maximum(f[:, :, 0], 1e-9)).max()) for f in force]
    return {
        "machine": machine,
        "limit": limit.name,
        "stroke_mm": float(np.median([w.stroke_mm for w in walks])),
        "step_mm": float(np.median(steps)),
        "least_step_mm": min(steps),
        "largest_step_mm": max(steps),
        "standing_closing_mm": float(walks[0].passive_closing_mm),
        "largest_normal_mN": float(np.median([f[:, :, 0].max() for f in force])),
        "friction_swing_mN": float(np.median([np.ptp(f[:, 0, 1]) for f in force])),
        "friction_over_normal_1": float(np.median(ratio)),
        "across_over_normal_1": float(np.median(across)),
        "slip_short_1": float(np.median([w.foot_slips[0] for w in walks])),
        "slip_long_1": float(np.median([w.foot_slips[1] for w in walks])),
        "contact_1": float(np.median([w.foot_contacts.min() for w in walks])),
    }


def _course(study: Study, machine: str, w: Any) -> None:
    """The short foot's friction over its normal force in the last stroke."""
    inside = w.times > w.stroke_ends[-2] + 1e-9
    force = w.foot_force[inside, 0]
    phase = (w.times[inside] - w.stroke_ends[-2]) * w.frequency
    study.courses[machine] = (phase, force[:, 1] / np.maximum(force[:, 0], 1e-9))


def run(level: str) -> Study:
    """All machines in all limits."""
    size, study = LEVELS[level], Study()
    design = load_design(DESIGN, TENSIONS)
    mesh = build_mesh(design, size=size.size)
    rest, half, _ = tensions = [design.tension(drive) for drive in (0.0, 0.5, 1.0)]
    side = SolidSide(design, mesh)
    seen, states = side.states(tensions, Silent())
    solid = [each.numbers["tip_closing_mm"] for each in seen]
    study.unknowns = side.model.n_dofs
    plain = reduce(design)
    parts = parts_of(design, mesh, plain, RodSide(design, plain).states(tensions, Silent())[0], Silent())
    loaded = parts.about([rest, half]).given
    closing, own_tensions = closing_as(design, loaded, (solid[0], solid[-1]))
    models = {RODS: plain, LOADED: loaded, CLOSING: closing}
    for name, found in (
        (RODS, closings(design, plain, tensions)),
        (LOADED, closings(design, loaded, tensions)),
        (CLOSING, closings(design, loaded, own_tensions)),
        (SOLID, solid),
    ):
        study.afloat.append({"machine": name, "rest_mm": float(found[0]), "full_mm": float(found[-1])})
    for where, found in (("muscle", states), ("rings", side.rings_alone(tensions, Silent()))):
        narrower = narrowing(walking_body(design, mesh), found[0], found[-1])
        study.soles.append({"tension_in": where, "narrowing_mm": narrower})
    for limit in size.limits:
        pace = size.paces[limit.pace]
        own = design.with_values({"ground.static_friction": limit.static, "ground.kinetic_friction": limit.kinetic})
        ground = ground_of(own)
        given: dict[str, Any] = {"frequency": pace.frequency, "duration": limit.strokes / pace.frequency}
        given |= {"discard": limit.discard, "sample_every": 1}
        for name, model in models.items():
            told: dict[str, Any] = {"ground": ground, "step": pace.rod_step, "waveform": design.drive, **given}
            # where friction jumps, from perturbed starts
            jumps = limit.kinetic < limit.static
            walks = list(walk_ensemble(model, starts=size.starts, **told).walks) if jumps else [walk(model, **told)]
            study.rows.append(_row(name, limit, walks))
            if limit is size.limits[-1]:
                _course(study, name, walks[0])
        body = walking_body(own, mesh)
        solids = {SOLID: (body, None)}
        if limit.corners:
            solids = {CORNERS: (body, corners_of(body)), **solids}
        if limit is size.limits[-1]:
            solids = {STIFF: (stiffened(body), corners_of(body)), **solids}
        for name, (moving, feet) in solids.items():
            start = stand(own, moving, ground, feet=feet)
            one = solid_walk(own, moving, step=pace.solid_step, feet=feet, start=start, **given)
            study.rows.append(_row(name, limit, [one]))
            if limit is size.limits[-1]:
                _course(study, name, one)
    return study


CHAIN = (
    ("stiffness of parts", RODS, LOADED),
    ("closing left afloat", LOADED, CLOSING),
    ("body", CLOSING, STIFF),
    ("width of soles", STIFF, CORNERS),
    ("body and width of soles", CLOSING, CORNERS),
    ("points between corners", CORNERS, SOLID),
    ("body and soles", CLOSING, SOLID),
)


def causes(study: Study) -> list[Row]:
    """What each cause does to stroke and step, as a share of the difference between rods and solid in its limit [1].

    From one machine to the next, of those that walked in the limit; shares of a line add up to 1.
    """
    found: list[Row] = []
    for limit in (one for one in LIMITS if one is not HELD):
        have = {row["machine"] for row in study.rows if row["limit"] == limit.name}
        chain = [name for name in (RODS, LOADED, CLOSING, STIFF, CORNERS, SOLID) if name in have]
        # without friction there is no step but the drift of the start
        for key in (("stroke_mm",) if limit is FREE else ("stroke_mm", "step_mm")) if have else ():
            at = {name: study.value(name, limit, key) for name in chain}
            whole = at[RODS] - at[SOLID]
            row: Row = {"limit": limit.name, "of": key[:-3], "difference_mm": whole}
            for cause, a, b in CHAIN:
                row[cause] = (at[a] - at[b]) / whole if whole and (a, b) in pairwise(chain) else None
            found.append(row)
    return found


# --- found ------------------------------------------------------------------------------------------------------------
#
# Level full, 8073 unknowns. Stroke and step [mm]; rods where friction jumps: median of four starts, least and largest.
#
#                          rods         at load      closing      stiff corners  corners  solid
#   no friction, stroke    0.815        0.648        0.619                                0.630
#   0.3/0.3, slow, stroke  0.393        0.310        0.281                                0.290
#   0.3/0.3, stroke        0.427        0.338        0.304                       0.310    0.309
#            step          0.066        0.042        0.055                       0.044    0.053
#   0.42/0.3, slow, stroke 0.358        0.409        0.369                                0.290
#   0.42/0.3, stroke       0.419        0.333        0.265        0.293          0.291    0.266
#             step         0.145        0.109        0.082        0.089          0.000    -0.008
#                     from 0.132, 0.158 0.092, 0.109 0.074, 0.083
#
#   cause -> share of the difference between rods and solid (0.12 and 0.15 mm of stroke, 0.15 mm of step)
#                               stroke, 0.3/0.3  stroke, 0.42/0.3  step, 0.42/0.3
#   stiffness of parts at load       75 %             56 %              24 %
#   closing left afloat (2.3 %)      28 %             45 %              17 %
#   width of soles                                     2 %              59 %
#   points between corners            1 %             16 %               5 %
#   left                             -5 %            -18 %              -5 %
#
# * With one coefficient of friction nothing is left: rods with the stiffness of the solid's parts and its closing
#   afloat have its stroke to 3 % (slowly 0.281 for 0.290, at 2 Hz 0.304 for 0.309 mm), its forces and its step within
#   4 % (closer than a step is worth: see below). Feet that hold bear friction that swings by
#   1.435 mN in the solid, 1.455 and 1.438 in the rods.
# * A stroke on the ground is a small difference: of 1.36 mm that full drive closes the machine by afloat, weight and
#   friction take three fifths, and 0.25 mm of the rest is there from the start, since the long foot lies flat until
#   it tips over its outer edge. 2.3 % too much closing afloat are therefore a tenth of the stroke.
# * Slowly and with one coefficient no machine goes anywhere: the step of 0.3 / 0.3 is inertia's. Constants of the rods
#   that move the stroke by 4 % move it from 0.042 to 0.054 mm, points between the corners from 0.044 to 0.053 mm.
# * Where friction jumps, soles part the models. The rings are tissue that pulls, too, and pinch the pillars: between
#   rest and full drive the outer edge of the short sole becomes shorter by 0.022 mm, afloat, and all of it with rings
#   that pull alone. Feet that stick bear that as friction across the machine, up to 0.38 of the normal force. Corners
#   then break loose with less along it and have the kinetic coefficient before the foot begins to slide. Rigid soles
#   know none of it: the foot's friction goes to 0.42, falls to 0.3, and the fall throws the machine forward. The solid
#   on corners that keep their distance does the same, and steps by 0.089 mm in place of nothing (0.105 and 0.003 on the
#   mesh of level smoke).
# * With whole soles, slowly, the solid's stroke is the same to 0.1 % with 0.42 and with 0.3: statically its soles do
#   not feel the jump at all; the strokes of rods change by a tenth to a third.
# * Not the time step: 0.3 / 0.3 at 1 ms, stroke 0.309 mm and step 0.055 mm. Not what the integrator takes either, 0.002
#   of 0.2 uJ a stroke (`solid_walk.py`).
# * Left: where friction jumps, strokes and steps depend on when a foot sticks again. A fifth of the stroke's difference
#   is not told apart from that, and the solid's own step is one of several: 0.057 mm on 12 156 unknowns, over more
#   strokes; 0.034 mm on the mean of six nudged starts (`solid_gaits.py`). 2.3 % of the closing afloat are left with
#   constants of parts about one tension; the cross-check, which takes others at every tension, leaves 1 % on its mesh.
#
# Ensembles of the solid are in `solid_gaits.py`. Not looked at: finer meshes with jumps, drives between the two paces.

# --- expect -----------------------------------------------------------------------------------------------------------


def expect(study: Study, level: str) -> None:
    """What must hold at every level."""
    whole = study.stroke_afloat(RODS) - study.stroke_afloat(SOLID)
    left = (study.stroke_afloat(LOADED) - study.stroke_afloat(SOLID)) / whole
    assert whole > 0.0, "afloat: the solid closes further than its rods"
    assert abs(left) < 0.4, f"afloat: parts at load leave {left:.2g} of the difference"
    matched = study.stroke_afloat(CLOSING) / study.stroke_afloat(SOLID) - 1.0
    assert abs(matched) < 1e-3, f"closing: rods with the solid's differ by {matched:.2g}"
    for row in study.rows:
        where = f"{row['machine']}, {row['limit']}"
        limit = next(one for one in LIMITS if one.name == row["limit"])
        assert row["friction_over_normal_1"] <= limit.static * 1.001 + 1e-9, f"{where}: more friction than there is"
        if limit is HELD:
            assert row["stroke_mm"] < 0.01, f"{where}: feet that hold let it close by {row['stroke_mm']:.2g} mm"
    for limit in (FREE, SLOW_ONE) if level == "full" else (SLOW_ONE,):
        of = [study.value(name, limit, "stroke_mm") for name in (RODS, LOADED, SOLID)]
        closed = (of[0] - of[1]) / (of[0] - of[2])
        assert closed > 0.5, f"{limit.name}: parts at load close {closed:.2g} of the stroke's difference"
    for name in (RODS, LOADED, SOLID):
        still = study.value(name, SLOW_ONE, "step_mm") / study.value(name, SLOW_ONE, "stroke_mm")
        assert abs(still) < 0.05, f"{name}: goes {still:.2g} of its stroke without inertia and without a jump"
    stiff, soft = ({key: study.value(name, PUBLISHED, key) for key in study.rows[0]} for name in (STIFF, CORNERS))
    hold = stiff["friction_over_normal_1"]
    assert hold > 0.38, f"stiff corners: break loose at {hold:.3g} of their load"
    swing = soft["friction_swing_mN"] / stiff["friction_swing_mN"]
    assert swing < 0.95, f"corners: friction swings by {swing:.3g} of what corners that keep their distance bear"
    assert soft["across_over_normal_1"] > 0.2, f"corners: bear {soft['across_over_normal_1']:.2g} of their load across"
    whole, rings = (row["narrowing_mm"] for row in study.soles)
    assert whole > 0.01, f"soles: become narrower by {whole:.2g} mm"
    assert abs(rings / whole - 1.0) < 0.2, f"rings: make {rings / whole:.2g} of what soles become narrower by"
    assert abs(soft["step_mm"]) < 0.5 * stiff["step_mm"], "corners: step as if they kept their distance"
    if level == "full":
        swing = [study.value(name, HELD, "friction_swing_mN") for name in (LOADED, SOLID)]
        assert abs(swing[0] / swing[1] - 1.0) < 0.05, (
            f"held: the swing of friction is {swing[0]:.4g} of {swing[1]:.4g} mN"
        )


def tables(study: Study) -> list[Table]:
    """What was found, for the terminal."""

    def table(title: str, rows: list[Row]) -> Table:
        names = tuple(rows[0])
        return Table(title, names, tuple(tuple(row[name] for name in names) for row in rows))

    parts = {"Closing afloat": study.afloat, "Soles": study.soles, "Walks": study.rows, "Causes": causes(study)}
    return [table(title, rows) for title, rows in parts.items()]


def write(study: Study, folder: Path) -> None:
    """Tables and a picture."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, found in zip(("afloat", "soles", "walks", "causes"), tables(study), strict=True):
        write_table(folder / f"{name}.csv", [dict(zip(found.header, row, strict=True)) for row in found.rows])
    figure = Figure(figsize=(12.5, 4.2), dpi=150, layout="constrained")
    FigureCanvasAgg(figure)
    strokes, steps, friction = figure.subplots(1, 3, width_ratios=(1.35, 1.0, 1.15))
    machines = (RODS, LOADED, CLOSING, STIFF, CORNERS, SOLID)
    colours = dict(zip(machines, ("C0", "C2", "C8", "C4", "C1", "C3"), strict=True))
    seen = {row["limit"] for row in study.rows}
    for panel, key, limits in (
        (strokes, "stroke_mm", [one for one in LIMITS if one is not HELD and one.name in seen]),
        (steps, "step_mm", [one for one in LIMITS if one not in (FREE, HELD) and one.name in seen]),
    ):
        for k, machine in enumerate(machines):
            rows = {row["limit"]: row for row in study.rows if row["machine"] == machine}
            at = [(i, rows[one.name]) for i, one in enumerate(limits) if one.name in rows]
            x = [i + 0.14 * (k - 2.5) for i, _ in at]
            panel.bar(x, [row[key] for _, row in at], 0.13, color=colours[machine], label=machine)
            if key == "step_mm":
                for where, (_, row) in zip(x, at, strict=True):
                    panel.plot([where] * 2, [row["least_step_mm"], row["largest_step_mm"]], color="k", linewidth=0.8)
        panel.set_xticks(range(len(limits)), [one.name.replace(", ", "\n") for one in limits], fontsize=8)
        panel.axhline(0.0, color="k", linewidth=0.5)
    strokes.set_ylabel("stroke on the ground [mm]")
    strokes.legend(frameon=False, fontsize=8)
    steps.set_ylabel("step, with least and largest [mm]")
    for machine in (LOADED, STIFF, CORNERS, SOLID):
        if machine in study.courses:
            friction.plot(*study.courses[machine], color=colours[machine], linewidth=1.0, label=machine)
    for level in (PUBLISHED.static, PUBLISHED.kinetic):
        for sign in (-1.0, 1.0):
            friction.axhline(sign * level, color="k", linewidth=0.5, linestyle=":")
    friction.set_xlabel(f"share of a stroke, friction {PUBLISHED.name}")
    friction.set_ylabel("friction over normal force, short foot")
    friction.legend(facecolor="white", framealpha=1.0, edgecolor="white", fontsize=8, loc=(0.28, 0.62))
    with replacing(folder / "walking_gap.png") as temporary:
        figure.savefig(temporary, format="png")


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description="What parts the walk of the solid from that of its rods.")
    parser.add_argument("--level", choices=list(LEVELS), default="full")
    parser.add_argument("--out", type=Path, default=Path("runs") / "studies" / "walking_gap")
    options = parser.parse_args()
    study = run(options.level)
    show_tables(tables(study))
    write(study, options.out)
    expect(study, options.level)
    print("every expectation holds")


if __name__ == "__main__":
    main()

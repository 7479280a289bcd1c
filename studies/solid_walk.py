"""Study: the solid itself walks, beside the rods.

Question
--------
What do three strokes of the meshed junction bot at 2 Hz, after settling, say of step, stroke and foot forces; how much
of it is the time step and the scheme, how far is it from the rods under the same drive, and what does it cost?

Run: ``python studies/solid_walk.py [--level smoke|full|long] [--out FOLDER]``; about twenty minutes at level full on an
idle core; level long adds a mesh of about 50 000 unknowns and takes twenty more.
"""

from __future__ import annotations

import argparse
import cProfile
import pstats
import time
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from fem_biobot.config import load_design
from fem_biobot.design import Design
from fem_biobot.mesh.geometry import build_mesh
from fem_biobot.progress import show_tables
from fem_biobot.rod.dynamics.settings import Settings
from fem_biobot.rod.ensemble import walk_ensemble
from fem_biobot.rod.walk import walk
from fem_biobot.solid.dynamics.body import MovingBody
from fem_biobot.solid.dynamics.settings import DynamicsSettings, Scheme
from fem_biobot.solid.gait import SolidWalk
from fem_biobot.solid.standing import Standing, stand
from fem_biobot.solid.walk import solid_ground, solid_walk, walking_body
from fem_biobot.study.outputs import write_table
from fem_biobot.tables import Table

Row = dict[str, Any]

# --- design -----------------------------------------------------------------------------------------------------------
#
# The junction bot in air with the tensions of the published rod code: 0.8 mN at rest and 2.4 mN more at full drive on
# its section of 0.88 mm^2 (with the standing tension of the preset its feet stick and nothing moves). Friction as
# published, 0.42 static and 0.3 kinetic; damping time 0.1 ms.

DESIGN = "junction_bot"
TENSIONS = ("muscle.passive_tension = 0.9 kPa", "muscle.active_tension = 2.7 kPa")
SOFT, EULER = Scheme.soft_landing, Scheme.backward_euler


@dataclass(frozen=True)
class Level:
    """Size of the study: solids as mesh size [mm], scheme and step [s], the best last; strokes; starts of the rods."""

    solids: tuple[tuple[float, Scheme, float], ...]
    frequency: float
    strokes: int
    discard: int
    starts: int
    rod_step: float


LEVELS = {
    "smoke": Level(((14.0, EULER, 1e-2), (14.0, SOFT, 1e-2)), 4.0, 2, 1, 2, 2e-3),
    "full": Level(
        ((3.0, EULER, 4e-3), (3.0, EULER, 2e-3), (3.0, SOFT, 4e-3), (3.0, SOFT, 2e-3), (3.0, SOFT, 1e-3)),
        2.0, 5, 2, 8, 2.5e-4,
    ),
    "long": Level(((3.0, SOFT, 2e-3), (1.1, SOFT, 2e-3)), 2.0, 5, 2, 8, 2.5e-4),
}  # fmt: skip

# --- quantity, and why it can converge --------------------------------------------------------------------------------
#
# The advance of the centre of mass per stroke and the swing of the tip closing, means over the strokes after the first
# second, from the machine at rest on its feet: on one start both converge with the step as long as points break loose
# in the same order. `backward_euler` damps the beam's swinging with a damping ratio of half the step times its angular
# frequency, which is first order with a large constant; `soft_landing` moves the feet alone that way. The rods' own
# scheme is as that one; with their dissipation raised to backward Euler they show what it does to them.

# --- run --------------------------------------------------------------------------------------------------------------


@dataclass
class Study:
    """One row a walk, and where the time of the best solid goes."""

    walks: list[Row] = field(default_factory=list)
    profile: list[Row] = field(default_factory=list)


def design() -> Design:
    """The machine."""
    return load_design(DESIGN, TENSIONS)


@cache
def machine(size: float) -> tuple[MovingBody, Standing]:
    """The meshed machine, and how it stands."""
    body = walking_body(design(), build_mesh(design(), size=size))
    return body, stand(design(), body, solid_ground(design()))


def solid_row(found: SolidWalk, scheme: Scheme, cpu: float) -> Row:
    """Numbers of a walk of the solid."""
    s, kept = found.summary(), found.times > found.stroke_ends[found.kept.start]
    force = found.foot_force[kept]
    return {
        "model": "solid",
        "scheme": str(scheme),
        "unknowns_1": s["unknowns_1"],
        "step_ms": 1e3 * s["step_s"],
        "step_mm": s["step_mm"],
        "spread_mm": s["step_spread_mm"],
        "stroke_mm": s["stroke_mm"],
        "sagitta_stroke_mm": s["sagitta_stroke_mm"],
        "passive_closing_mm": s["passive_closing_mm"],
        "largest_normal_mN": float(force[:, :, 0].max()),
        "largest_friction_mN": float(np.abs(force[:, :, 1]).max()),
        "work_friction_uJ": s["work_friction_uJ"],
        "work_integrator_uJ": s["work_integrator_uJ"],
        "energy_error_1": s["energy_error_1"],
        "iterations_per_step_1": s["iterations_1"] / s["time_steps_1"],
        "factorisations_per_step_1": s["factorisations_1"] / s["time_steps_1"],
        "cpu_s_per_s": cpu / s["duration_s"],
    }


def rod_rows(level: Level) -> list[Row]:
    """The rods' ensemble, and one walk of theirs with backward Euler's dissipation at the solids' steps."""
    given: dict[str, Any] = {"duration": level.strokes / level.frequency, "discard": level.discard}
    ensemble = walk_ensemble(design(), level.frequency, starts=level.starts, step=level.rod_step, **given)
    rows = [_rod_row(list(ensemble.walks), f"ensemble of {level.starts}", level.rod_step)]
    for step in sorted({step for _, _, step in level.solids}, reverse=True):
        damped = Settings(dissipation=0.5 / step, parts=1)
        one = walk(design(), frequency=level.frequency, step=step, settings=damped, **given)
        rows.append(_rod_row([one], "backward_euler", step))
    return rows


def _rod_row(walks: list[Any], scheme: str, step: float) -> Row:
    kept = [w.foot_force[w.times > w.stroke_ends[w.kept.start]] for w in walks]
    steps = np.array([w.step_mm for w in walks])
    return {
        "model": "rods",
        "scheme": scheme,
        "step_ms": 1e3 * step,
        "step_mm": float(np.median(steps)),
        "spread_mm": float(np.ptp(steps)) if len(steps) > 1 else None,
        "stroke_mm": float(np.median([w.stroke_mm for w in walks])),
        "sagitta_stroke_mm": float(np.median([w.sagitta_stroke_mm for w in walks])),
        "passive_closing_mm": float(walks[0].passive_closing_mm),
        "largest_normal_mN": float(max(f[:, :, 0].max() for f in kept)),
        "largest_friction_mN": float(max(np.abs(f[:, :, 1]).max() for f in kept)),
        "work_friction_uJ": float(np.median([w.work_friction_uJ for w in walks])),
        "energy_error_1": float(max(w.energy_error_1 for w in walks)),
    }


# what takes the time of a step, by the function that does it
_PARTS = {
    "factorisations": ("_factorise",),
    "compliance of the feet": ("_learn",),
    "contact problem": ("solve_friction",),
    "forces": ("forces",),
    "book of energies": ("entered",),
    "all of the walk": ("solid_walk",),
}


def profile_rows(profile: cProfile.Profile) -> list[Row]:
    """Share of the walk's time in each part [1]; what is left is the solutions with the factor."""
    stats: Any = pstats.Stats(profile)
    spent = {part: 0.0 for part in _PARTS}
    for (_, _, name), (*_, cumulative, _) in stats.stats.items():
        for part, names in _PARTS.items():
            if name in names:
                spent[part] += cumulative
    whole = spent.pop("all of the walk")
    rows = [{"part": part, "share_1": seconds / whole} for part, seconds in spent.items()]
    return [*rows, {"part": "solutions and the rest", "share_1": 1.0 - sum(row["share_1"] for row in rows)}]


def run(level: str) -> Study:
    """All walks of a level; the last of the solids is profiled."""
    size, study = LEVELS[level], Study()
    for mesh, scheme, step in size.solids:
        body, stood = machine(mesh)
        profile, began = cProfile.Profile(), time.process_time()
        found = profile.runcall(
            solid_walk, design(), body, frequency=size.frequency, duration=size.strokes / size.frequency, step=step,
            discard=size.discard, start=stood, settings=DynamicsSettings(scheme),
        )  # fmt: skip
        study.walks.append(solid_row(found, scheme, time.process_time() - began))
        study.profile = profile_rows(profile)
    study.walks += rod_rows(size)
    return study


# --- found ------------------------------------------------------------------------------------------------------------
#
# Walks at 12 156 and 45 294 unknowns (whose static closings are 1.6 % apart), five strokes each, and, where said so,
# at 7440 over three.
#
# * The solid walks toward its long pillar. With `soft_landing` a step is 0.056 mm at 1 ms and 0.057 mm at 2 ms (strokes
#   from 0.047 to 0.067), with `backward_euler` 0.037, 0.044 and 0.049 mm at 4, 2 and 1 ms; at 7440 unknowns 0.039,
#   0.041 and 0.042 mm at 4, 2 and 1 ms. Backward Euler takes 0.028 uJ a stroke at 4 ms, a tenth of the muscle's work,
#   soft landing 0.002 uJ at 2 ms and 0.0007 at 1 ms. Rods say the same of it: with backward Euler's dissipation 0.0005,
#   0.086 and 0.111 mm at 4, 2 and 1 ms, with their own scheme 0.133 mm at 1 and at 0.25 ms.
# * On the finer mesh, at 2 ms, a step is 0.065 mm, from the second stroke on the same to 2e-8 mm, and the stroke 0.321
#   mm against 0.281: halving the step moves the walk by a hundredth, the mesh by an eighth, stroke and step alike: a
#   step is 0.20 of the stroke on both. With 0.3 for both coefficients the stroke is 0.309, 0.318 and 0.324 mm at 8073,
#   12 156 and 45 294 unknowns, as the statics say (1.6 % more compliant is 0.008 mm more of what closes on the ground);
#   so the eighth of the stroke is the jump's, and the points' that break loose one by one. The step is 0.053, 0.053 and
#   0.059 mm, 0.17 to 0.18 of the stroke: what inertia makes of it is settled to a tenth, no better.
# * Beside the rods (0.128 to 0.144 mm for seven of eight starts, 0.031 mm for one) the solid's step is less than
#   half. What parts them is the jump from static to kinetic friction: with 0.3 for both the solid makes 0.054 mm a
#   step (7440 unknowns, 2 ms) and the rods 0.067, a fifth apart; 0.42 / 0.3 doubles the rods' step and leaves the
#   solid's about where it was. A rigid sole breaks loose at all its corners at once. The muscle's
#   rings pinch a compliant one: its points bear friction across the machine and break loose with less along it, one
#   after the other, and the whole foot hardly feels the static coefficient (`walking_gap.py`).
# * The stroke is 0.28 mm, the rods' 0.38 mm, with equal coefficients 0.30 and 0.43 mm: seven tenths either way. Half
#   of that is stiffness: floating, full drive closes the solid by 1.04 mm and the rods (no plate factor) by 1.20 mm.
#   The rest is the same 2 % afloat, seen in a stroke that the ground has shortened (`walking_gap.py`).
# * Largest forces on a foot: 1.51 mN normal and 0.40 mN of friction on both meshes, the rods' 1.76 and 0.53 mN. The
#   book of energies closes to 1e-9 of the muscle's work.
# * Cost at 2 ms, beside other work: 287 processor-seconds a simulated second and 1.0 GiB at 45 294 unknowns (5.3
#   iterations a step, a factorisation every 15 steps), 49 at 12 156, 23 at 7440. Of the first 39 % are solutions with
#   the factor, 23 % the compliance of the feet, 18 % the contact problem, 15 % forces, 4 % factorisations.
#
# Not looked at: ensembles of the solid's starts, meshes beyond 50 000 unknowns, steps below 2 ms on the finest.

# --- expect -----------------------------------------------------------------------------------------------------------


def expect(study: Study, level: str) -> None:
    """What must hold at every level."""
    solids = [row for row in study.walks if row["model"] == "solid"]
    rods = [row for row in study.walks if row["model"] == "rods"]
    assert len(solids) == len(LEVELS[level].solids), "a walk of the solid is missing"
    for row in solids:
        where = f"{row['scheme']}, {row['step_ms']:g} ms"
        assert row["energy_error_1"] < 1e-5, f"{where}: the book leaves {row['energy_error_1']:.2g} unexplained"
        share = row["largest_friction_mN"] / row["largest_normal_mN"]
        assert share <= 0.42 * 1.001, f"{where}: friction is {share:.3g} of the normal force"
        apart = row["stroke_mm"] / rods[0]["stroke_mm"]
        assert 0.4 < apart < 1.6, f"{where}: the stroke is {apart:.3g} of the rods'"
    lost = {row["scheme"]: row["work_integrator_uJ"] for row in solids}
    if len(lost) == 2:
        assert lost[str(SOFT)] < 0.7 * lost[str(EULER)], f"soft_landing takes {lost[str(SOFT)]:.2g} uJ a stroke"
    assert abs(sum(row["share_1"] for row in study.profile) - 1.0) < 1e-9, "profile: shares do not add up"
    if level == "smoke":
        return
    steps = [row["step_mm"] for row in solids if row["scheme"] == str(SOFT)]
    assert min(steps) > 0.0, "the machine walks toward its short pillar"
    assert abs(steps[-1] / steps[-2] - 1.0) < 0.25, f"the step changes to {steps[-1]:.3g} mm with the last refinement"


def tables(study: Study) -> list[Table]:
    """What was found, for the terminal."""
    names = list(dict.fromkeys(name for row in study.walks for name in row))
    body = tuple(tuple(row.get(name) for name in names) for row in study.walks)
    shares = tuple((row["part"], row["share_1"]) for row in study.profile)
    return [Table("Solid and rods", tuple(names), body), Table("Time of the last solid", ("part", "share [1]"), shares)]


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description="The solid walks, beside the rods.")
    parser.add_argument("--level", choices=list(LEVELS), default="smoke")
    parser.add_argument("--out", type=Path, default=Path("runs") / "solid_walk")
    given = parser.parse_args()
    study = run(given.level)
    given.out.mkdir(parents=True, exist_ok=True)
    write_table(given.out / "walks.csv", study.walks)
    write_table(given.out / "profile.csv", study.profile)
    show_tables(tables(study))
    expect(study, given.level)


if __name__ == "__main__":
    main()

"""Study: where the junction bot walks, and what moves it.

Question
--------
Which step, speed, efficiency, slip and direction has the bot at 0.5, 1, 2 and 4 Hz with the paper's active forces, in
air and submerged, on grounds of different friction, with much and with little standing tension? And which mechanism
moves it: what is left when heel and toe, unequal pillars, static above kinetic friction, or inertia are taken away?

Run: ``python studies/walking_map.py [--level smoke|full] [--out FOLDER]``; about fifteen minutes at level full.
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from fem_biobot.config import load_design
from fem_biobot.design import Design
from fem_biobot.ensembles import Nudge
from fem_biobot.errors import SolveError
from fem_biobot.files import replacing
from fem_biobot.muscle.drive import paper_amplitude
from fem_biobot.progress import show_tables
from fem_biobot.rod.ensemble import walk_ensemble
from fem_biobot.rod.gait import Walk
from fem_biobot.rod.ground import Ground
from fem_biobot.rod.model import RodModel
from fem_biobot.rod.records import Gravity
from fem_biobot.rod.reduce import reduce
from fem_biobot.solid.sharing import usable_threads
from fem_biobot.study.outputs import write_table
from fem_biobot.tables import Table

Row = dict[str, Any]

# --- design -----------------------------------------------------------------------------------------------------------

DESIGN = "junction_bot"
# standing and active tension: the preset's, after the paper's forces; and those of the published rod code
TISSUES = {
    "preset, 9.09 kPa": (),
    "published, 0.9 kPa": ("muscle.passive_tension = 0.9 kPa", "muscle.active_tension = 2.7 kPa"),
}
PUBLISHED = "published, 0.9 kPa"
# tissue and drive: with the paper's active forces, or all that the tissue has
MUSCLES = {
    "smoke": ((PUBLISHED, "full"),),
    "full": (*((tissue, "paper's force") for tissue in TISSUES), (PUBLISHED, "full")),
}
MEDIA = {"air": "air", "submerged": "submerged"}
RATIO = 0.3 / 0.42  # kinetic over static friction, as published
STATIC = {"smoke": (0.42,), "full": (0.05, 0.1, 0.2, 0.42, 0.5)}
FREQUENCIES = {"smoke": (4.0,), "full": (0.5, 1.0, 2.0, 4.0)}
STEP = {"smoke": 1e-3, "full": 5e-4}  # s
ELEMENTS = {"smoke": 8, "full": 16}
STARTS, STROKES, DISCARD = {"smoke": 1, "full": 2}, {"smoke": 4, "full": 6}, {"smoke": 2, "full": 3}
STUCK = 0.005  # mm of stroke, below which feet are called stuck
# forward and reverse coefficient, static; slip toward the long pillar meets the first
UNEQUAL = {"smoke": ((0.2, 0.42),), "full": ((0.2, 0.42), (0.42, 0.2), (0.3, 0.42), (0.42, 0.3))}
# what the paper prints of its machines, seed_locomotion.csv: speed [mm/s] and efficiency [1]
PRINTED = {0.5: ("-", "0.71 +- 0.21"), 1.0: ("-", "0.46 +- 0.02"), 2.0: ("-", "-"), 4.0: ("> 0.5", "0.52 +- 0.20")}

SMOOTH, SLOW_SMOOTH = "without static above kinetic friction", "without static friction and inertia"
EVEN_SMOOTH, FRICTIONLESS = "without static friction and unequal pillars", "without friction"

# --- quantity, and why it can converge --------------------------------------------------------------------------------
#
# The step is the advance of the centre of mass in a stroke, mean over the strokes after the transient and over the
# starts; positive toward the long pillar. Its error from mesh and step is of the order of one per cent of the stroke
# (studies/gait_accuracy.py), and where static exceeds kinetic friction that of the gait a start happens to find, which
# the spread over the starts shows. A direction is told where the step exceeds a hundredth of the stroke and its spread,
# and the stroke 0.005 mm.
#
# Drives: `paper_amplitude`, 0.5, 1.0 and 1.4 mN at 0.5, 1 and 2 Hz, and at 4 Hz those of 2 Hz, since none is printed;
# or full drive, which with the published tensions is 2.4 mN, as in the published code.
#
# Mechanisms are switched off one by one in the machine that walks best, published tissue in air at full drive: feet
# touch along a line across the sole's middle instead of at its corners; both pillars are as long as the short one and
# the long one in the mean; static friction is lowered to the kinetic; masses are divided by a hundred and gravity
# multiplied by it, which keeps every weight and takes inertia away.


@dataclass
class Study:
    """Rows of the map, of unequal friction, and of the mechanisms."""

    map: list[Row] = field(default_factory=list)
    unequal: list[Row] = field(default_factory=list)
    mechanisms: list[Row] = field(default_factory=list)


@dataclass(frozen=True)
class Case:
    """One ensemble of walks: names for the table, machine, ground, and drive."""

    names: dict[str, Any]
    machine: RodModel
    ground: Ground
    frequency: float
    amplitude: float
    level: str
    nudge: Nudge | None = None


# --- run --------------------------------------------------------------------------------------------------------------


def design_of(tissue: str, medium: str = "air", *more: str) -> Design:
    """The bot with a tissue, in a medium."""
    return load_design(DESIGN, [*TISSUES[tissue], f'ground.immersion = "{MEDIA[medium]}"', *more])


def point_feet(model: RodModel) -> RodModel:
    """Feet that touch along a line across the middle of each sole: no heel, no toe."""
    feet = []
    for group in model.contacts:
        points = np.array(group.points, dtype=float)
        points[:, 0] = points[:, 0].mean()
        feet.append(replace(group, points=np.unique(points, axis=0)))
    return rebuilt(model, contacts=feet)


def weightless_inertia(model: RodModel, factor: float = 0.01) -> RodModel:
    """Masses times `factor`, gravity over it: equal weights and stiffness, less inertia."""
    rods = [replace(rod, material=replace(rod.material, density=factor * rod.material.density)) for rod in model.rods]
    bodies = [replace(b, mass=factor * b.mass, inertia=factor * np.asarray(b.inertia)) for b in model.bodies]
    loads = []
    for load in model.loads:
        if isinstance(load, Gravity):
            x, y, z = (g / factor for g in load.acceleration)
            load = Gravity((x, y, z), factor * load.medium_density)
        loads.append(load)
    return rebuilt(model, rods=rods, bodies=bodies, loads=loads)


def rebuilt(model: RodModel, **changed: Any) -> RodModel:
    """The model with some of its lists replaced."""
    names = ("rods", "joints", "bodies", "supports", "loads", "members", "contacts", "damping_time")
    return RodModel(**{name: changed.get(name, getattr(model, name)) for name in names})


def numbers(case: Case) -> Row:
    """One row: an ensemble's means, or why there is none."""
    row = dict(case.names) | {"frequency_Hz": case.frequency, "active_mN": None}
    strokes = STROKES[case.level]
    try:
        found = walk_ensemble(
            case.machine,
            case.frequency,
            ground=case.ground,
            starts=STARTS[case.level],
            duration=strokes / case.frequency,
            discard=DISCARD[case.level],
            amplitude=case.amplitude,
            step=STEP[case.level],
            nudge=case.nudge,
        )
    except SolveError as error:
        return row | {"remark": error.reason or str(error)}
    return row | measured(found.walks)


def measured(walks: tuple[Walk, ...]) -> Row:
    """Means over walks from several starts."""

    def mean(name: str) -> float | None:
        value = float(np.mean([getattr(w, name) for w in walks]))
        return value if math.isfinite(value) else None

    steps = np.array([w.step_mm for w in walks])
    spread = float(np.ptp(steps)) / 2
    stroke = mean("stroke_mm") or 0.0
    step = float(steps.mean())
    told = abs(step) > max(spread, 0.01 * stroke)
    direction = ("toward long" if step > 0.0 else "toward short") if told else "none"
    return {
        "active_mN": walks[0].active_force_mN,
        "weight_mN": walks[0].weight_mN,
        "step_mm": step,
        "spread_mm": spread,
        "speed_mm_per_s": mean("speed_mm_per_s"),
        "stroke_mm": stroke,
        "camera_stroke_mm": mean("camera_stroke_mm"),
        "efficiency_1": mean("efficiency_1"),
        "mechanical_efficiency_1": mean("mechanical_efficiency_1"),
        "slip_1": mean("slip_fraction_1"),
        "contact_1": float(np.mean([w.foot_contacts.mean() for w in walks])),
        "direction": "sticks" if stroke < STUCK else direction,
        "halved_1": sum(w.motion.halved for w in walks),
        "remark": "; ".join(dict.fromkeys(event.name for w in walks for event in w.events)) or None,
    }


def amplitude(design: Design, drive: str, frequency: float) -> float:
    """Of the drive [1]."""
    return 1.0 if drive == "full" else paper_amplitude(design, frequency)[0]


def map_cases(level: str) -> list[Case]:
    """Tissues, media, friction with and without static above kinetic, frequencies."""
    cases = []
    for tissue, drive in MUSCLES[level]:
        for medium in MEDIA:
            design = design_of(tissue, medium)
            model = reduce(design, beam_elements=ELEMENTS[level])
            for static in STATIC[level]:
                for law, kinetic in (("static > kinetic", RATIO * static), ("equal", static)):
                    names = {"tissue": tissue, "drive": drive, "medium": medium}
                    names |= {"static_1": static, "kinetic_1": kinetic, "law": law}
                    cases += [
                        Case(names, model, Ground(static, kinetic), f, amplitude(design, drive, f), level)
                        for f in FREQUENCIES[level]
                    ]
    return cases


def unequal_cases(level: str) -> list[Case]:
    """Ground that resists slip forward and in reverse differently; published tissue."""
    cases = []
    for medium in MEDIA:
        design = design_of(PUBLISHED, medium)
        model = reduce(design, beam_elements=ELEMENTS[level])
        for forward, reverse in UNEQUAL[level]:
            ground = Ground(forward, forward, reverse_static_friction=reverse, reverse_kinetic_friction=reverse)
            names = {"tissue": PUBLISHED, "medium": medium, "forward_1": forward, "reverse_1": reverse}
            cases += [Case(names, model, ground, f, paper_amplitude(design, f)[0], level) for f in FREQUENCIES[level]]
    return cases


def mechanism_cases(level: str) -> list[Case]:
    """The walking machine, and what is left without each mechanism."""
    design, n = design_of(PUBLISHED), ELEMENTS[level]
    both = ("skeleton.short_pillar_height = 3.1 mm", "skeleton.long_pillar_height = 3.1 mm")
    whole, even = reduce(design, beam_elements=n), reduce(design_of(PUBLISHED, "air", *both), beam_elements=n)
    real, smooth, slick = Ground(0.42, 0.3), Ground(0.3, 0.3), Ground(0.0, 0.0)
    light = weightless_inertia
    machines: list[tuple[str, Callable[[], RodModel], Ground]] = [
        ("all four", lambda: whole, real),
        ("without heel and toe", lambda: point_feet(whole), real),
        ("without unequal pillars", lambda: even, real),
        (SMOOTH, lambda: whole, smooth),
        ("without inertia", lambda: light(whole), real),
        (SLOW_SMOOTH, lambda: light(whole), smooth),
        ("without static friction, heel and toe", lambda: point_feet(whole), smooth),
        ("without static friction, inertia, heel and toe", lambda: light(point_feet(whole)), smooth),
        (EVEN_SMOOTH, lambda: even, smooth),
        (FRICTIONLESS, lambda: whole, slick),
    ]
    return [
        # without friction a start keeps the momentum it is given
        Case({"mechanisms": name}, model, ground, f, 1.0, level, Nudge(velocity=0.0) if ground is slick else None)
        for name, make, ground in machines
        for model in [make()]
        for f in FREQUENCIES[level]
    ]


def run(level: str) -> Study:
    """All walks of a level, two at a time where there are two processors."""
    study = Study()
    lists = (map_cases(level), unequal_cases(level), mechanism_cases(level))
    with ThreadPoolExecutor(min(2, usable_threads())) as pool:
        study.map, study.unequal, study.mechanisms = (list(pool.map(numbers, cases)) for cases in lists)
    return study


# --- expect -----------------------------------------------------------------------------------------------------------


def expect(study: Study) -> None:
    """What must hold at every level."""
    assert study.map, "the map is empty"
    assert study.unequal, "no unequal friction"
    for row in study.mechanisms:
        name = row["mechanisms"]
        where = f"{name}, {row['frequency_Hz']:g} Hz"
        assert "step_mm" in row, f"{where}: {row['remark']}"
        share = row["step_mm"] / row["stroke_mm"]
        if name == FRICTIONLESS:
            # no force acts along the ground; the drop of the start has none either
            assert abs(share) < 1e-6, f"{where}: the centre of mass moves by {share:.2g} of the stroke"
        if name == EVEN_SMOOTH:
            assert abs(share) < 1e-3, f"{where}: equal pillars step by {share:.2g} of the stroke"
        if name == SLOW_SMOOTH:
            assert abs(share) < 0.01, f"{where}: without inertia it steps by {share:.2g} of the stroke"
        if name == SMOOTH and row["frequency_Hz"] >= 1.0:
            assert row["direction"] == "toward long", f"{where}: walks {row['direction']}"
    for row in study.unequal:
        where = (
            f"{row['medium']}, {row['forward_1']:g} forward, {row['reverse_1']:g} reverse, {row['frequency_Hz']:g} Hz"
        )
        assert "step_mm" in row, f"{where}: {row['remark']}"
        against = "toward short" if row["forward_1"] < row["reverse_1"] else "toward long"
        if 2.0 * min(row["forward_1"], row["reverse_1"]) < max(row["forward_1"], row["reverse_1"]):
            assert row["direction"] != against, f"{where}: walks {against}, against the less resisted direction"


# --- what was found ---------------------------------------------------------------------------------------------------

FOUND = """
``python studies/walking_map.py`` on two cores shared with other work (26 minutes); steps of 0.5 ms, 16 elements, six
strokes of which three are counted, two starts; 312 cases, every walk to its end, 18 steps of the map's halved. Positive
is toward the long pillar. Weight on the feet 2.54 mN in air, 0.26 mN submerged.

* Air, the paper's forces (0.5, 1.0, 1.4 and 1.4 mN at 0.5, 1, 2 and 4 Hz). With a static coefficient of 0.42 or more
  nothing walks: with the preset's standing tension of 9.09 kPa the stroke is at most 0.0015 mm, with the published
  0.9 kPa at most 0.04 mm and the step below 0.0005 mm. At 0.2 the preset walks at 0.03, 0.05 and 0.09 mm/s at 1, 2 and
  4 Hz (0, 0.05 and 0.20 with equal coefficients) and sticks at 0.5 Hz; at 0.05 it walks backward, 0.18 mm/s at 4 Hz.
* Air, the published tissue at full drive (2.4 mN), 0.42 / 0.3: steps of 0.088, 0.127, 0.131 and 0.131 mm, which is
  0.04, 0.13, 0.26 and 0.52 mm/s; 0, 0.01, 0.14 and 0.32 mm/s with 0.42 for both. The paper prints more than 0.5 mm/s at
  4 Hz. Efficiency (step over the sagitta's swing) 0.83, 0.94, 1.2 and 0.80 where the paper prints 0.71, 0.46, none and
  0.52; with equal coefficients 0.01, 0.13, 0.91 and 0.70. Feet slip for 4, 11, 12 and 26 % of their time on the ground.
  Speed grows with friction from 0.1 to 0.5; at 0.05 it is slow and mostly backward. At 4 Hz another gait goes backward
  (studies/gait_accuracy.py): the numbers with static above kinetic friction are those of the gait found.
* Submerged, strokes are 0.1 to 0.8 mm with the paper's forces and 1.1 to 1.3 mm at full drive, whatever the friction,
  and the way is backward: at 2 and 4 Hz in 59 of 60 cases, down to -0.62 mm/s (full drive, 2 Hz, 0.42 / 0.3); the one
  other does not move. At 0.5 Hz it moves by 0.02 mm a stroke or less with the paper's force, either way.
* Unequal friction decides the direction in every case that moves. Submerged, 0.2 forward and 0.42 in reverse, both
  equal when sticking and slipping: 0.11, 0.49, 1.43 and 2.6 mm/s forward, nearly the whole stroke as a step; turned
  round -0.11, -0.49, -1.41 and -2.5. In air 0.09 mm/s at 2 Hz and 0.18 at 4 Hz, and as much backward turned round.
* Mechanisms, published tissue in air, full drive, steps at 0.5, 1, 2 and 4 Hz [mm]:
  all four                       0.088     0.127    0.131    0.131
  no heel and toe               -0.122    -0.121    0.108   -0.015 (+- 0.05)
  equal pillars                  below 1e-14 at all
  no static above kinetic        0.0004    0.019    0.066    0.066
  no inertia                     0.0003    0.0002   0.0001   0.00001
  neither of the last two        below 2e-6 at all
  neither static nor heel, toe   0.0000   -0.005   -0.002    0.069
  So inertia and unequal pillars are both needed: without either there is no step, whatever else there is. At 0.5 and
  1 Hz the inertia is that of the release of a foot that stuck, for with equal coefficients next to nothing is left
  there; at 2 and 4 Hz half of the step is left, that of the machine's swing. Heel and toe make the step forward at 0.5
  and 1 Hz; with points for feet it is as large, and backward.
* These are numbers of steps of one length, made before elements bent within and before a foot that gives way late in a
  step was released in it; where static friction exceeds kinetic, such steps find gaits that shorter ones do not
  (studies/gait_accuracy.py). By adaptive steps (0.5 ms, 2e-7 mm, same starts and strokes), 0.5, 1, 2 and 4 Hz:
  all four                       0.092     0.061    0.082 (+- 0.053)   -0.025
  no heel and toe               -0.118    -0.121    0.111              -0.001 (+- 0.018)
  no static above kinetic        0.0007    0.020    0.067               0.069
  no inertia                    -0.002    -0.004   -0.003              -0.002
  0.42 for both                  0.0009    0.010    0.071               0.077
  What each mechanism does holds; that the machine goes forward at 4 Hz does not, and a mean of three strokes is little
  where strokes differ. Machines without inertia ring too fast for adaptive steps of this error at 2 Hz with equal
  coefficients, which is refused.
"""

# --- what was not looked at -------------------------------------------------------------------------------------------

NOT_LOOKED_AT = """
More than two starts a case, hence shares of gaits; drag of the medium, which the submerged bot lacks; stimulation that
changes with frequency otherwise than in its amplitude; flexible pillars; a ring that touches the ground (with
the preset's standing tension that of the short pillar reaches 0.14 mm below it, which no contact resists; remarked as
buried, as are the soles' edges beside feet of a line).
"""


def place_of(row: Row) -> tuple[str, str, str]:
    """Tissue, drive and medium of a row of the map."""
    return row["tissue"], row["drive"], row["medium"]


def places(study: Study) -> list[tuple[str, str, str]]:
    """All of them, in their order."""
    return list(dict.fromkeys(place_of(row) for row in study.map))


def tables(study: Study) -> list[Table]:
    """What is printed."""
    common = ("frequency_Hz", "active_mN", "step_mm", "spread_mm", "speed_mm_per_s", "stroke_mm", "efficiency_1")
    common += ("slip_1", "contact_1", "direction")
    printed = ("printed mm/s", "printed efficiency")
    shown = []
    for place in places(study):
        names = ("static_1", "kinetic_1", *common)
        cells = tuple(
            (*(row.get(name) for name in names), *PRINTED[row["frequency_Hz"]], row.get("remark"))
            for row in study.map
            if place_of(row) == place
        )
        shown.append(Table("; ".join(place), (*names, *printed, "remark"), cells))
    for title, rows, first in (
        ("Unequal friction, published tissue", study.unequal, ("medium", "forward_1", "reverse_1")),
        ("Mechanisms, published tissue in air at full drive", study.mechanisms, ("mechanisms",)),
    ):
        names = (*first, *common, "remark")
        shown.append(Table(title, names, tuple(tuple(row.get(name) for name in names) for row in rows)))
    return shown


def write(study: Study, folder: Path) -> None:
    """CSV of the three lists, and a picture of the map and the mechanisms."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in ("map", "unequal", "mechanisms"):
        write_table(folder / f"{name}.csv", getattr(study, name))
    frequencies = list(dict.fromkeys(row["frequency_Hz"] for row in study.map))
    figure = Figure(figsize=(11.0, 10.0), dpi=150, layout="constrained")
    FigureCanvasAgg(figure)
    upper, lower = figure.subfigures(2, 1, height_ratios=(1.7, 1.0))
    panels = upper.subplots(len(MEDIA), len(places(study)) // len(MEDIA), squeeze=False).T.ravel()
    for panel, place in zip(panels, places(study), strict=True):
        for number, frequency in enumerate(frequencies):
            for law, line in (("static > kinetic", "-o"), ("equal", "--")):
                rows = [
                    row
                    for row in study.map
                    if (place_of(row), row["law"]) == (place, law)
                    and row["frequency_Hz"] == frequency
                    and "step_mm" in row
                ]
                panel.plot(
                    [row["static_1"] for row in rows],
                    [row["speed_mm_per_s"] for row in rows],
                    line,
                    color=f"C{number}",
                    markersize=3,
                    linewidth=1.0,
                    label=f"{frequency:g} Hz, {law}",
                )
        panel.axhline(0.0, color="0.7", linewidth=0.7, zorder=0)
        panel.set_title("; ".join(place), fontsize=8)
        panel.set_xlabel("static friction [1]")
        panel.set_ylabel("speed [mm/s]")
        low, high = panel.get_ylim()
        panel.set_ylim(min(low, -0.05), max(high, 0.05))  # so that rest looks like rest
    panels[0].legend(frameon=False, fontsize=6)
    bars = lower.subplots()
    names = list(dict.fromkeys(row["mechanisms"] for row in study.mechanisms))
    height = 0.8 / len(frequencies)
    for number, frequency in enumerate(frequencies):
        steps = [
            next(
                r.get("step_mm", 0.0)
                for r in study.mechanisms
                if (r["mechanisms"], r["frequency_Hz"]) == (n, frequency)
            )
            for n in names
        ]
        at = np.arange(len(names)) + height * (number - (len(frequencies) - 1) / 2)
        bars.barh(at, steps, height, color=f"C{number}", label=f"{frequency:g} Hz")
    bars.set_yticks(np.arange(len(names)), names, fontsize=7)
    bars.invert_yaxis()
    bars.axvline(0.0, color="0.7", linewidth=0.7)
    bars.set_xlabel("advance per stroke [mm], published tissue in air, full drive")
    bars.legend(frameon=False, fontsize=7)
    with replacing(folder / "walking_map.png") as temporary:
        figure.savefig(temporary, format="png")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--level", choices=tuple(STATIC), default="full")
    parser.add_argument("--out", type=Path, default=Path("runs") / "studies" / "walking_map")
    options = parser.parse_args()
    begin = time.perf_counter()
    study = run(options.level)
    show_tables(tables(study))
    write(study, options.out)
    print(f"\n{time.perf_counter() - begin:.0f} s; files in {options.out}")
    expect(study)
    print("every expectation holds")


if __name__ == "__main__":
    main()

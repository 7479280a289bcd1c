"""Study: where the junction bot walks, and what moves it.

Question
--------
Which step, speed, efficiency, slip and direction has the bot at 0.5, 1, 2 and 4 Hz with the paper's active forces, in
air and submerged, on grounds of different friction, with much and with little standing tension? And which mechanism
moves it: what is left when heel and toe, unequal pillars, static above kinetic friction, or inertia are taken away?

Run: ``python studies/walking_map.py [--level smoke|full] [--out FOLDER] [--afresh]``; half an hour of one core
at level full. Every row is kept as it comes: after a stop the same command goes on, ``--afresh`` begins anew.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import math
import time
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from fem_biobot import ensembles, strokes
from fem_biobot.config import load_design
from fem_biobot.design import Design
from fem_biobot.ensembles import Nudge, gaits
from fem_biobot.errors import SolveError
from fem_biobot.files import replacing
from fem_biobot.muscle.drive import paper_amplitude
from fem_biobot.progress import show_tables
from fem_biobot.rod.dynamics.settings import Settings
from fem_biobot.rod.ensemble import walk_ensemble
from fem_biobot.rod.gait import Walk
from fem_biobot.rod.ground import Ground
from fem_biobot.rod.model import RodModel
from fem_biobot.rod.records import Gravity
from fem_biobot.rod.reduce import ground_of, reduce
from fem_biobot.study.outputs import write_table
from fem_biobot.study.provenance import code_digest
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
    "full": ((PUBLISHED, "full"), *((tissue, "paper's force") for tissue in TISSUES)),
}
MEDIA = {"air": "air", "submerged": "submerged"}
DROPS, EQUAL = "static > kinetic", "equal"
RATIO = 0.3 / 0.42  # kinetic over static friction, as published
STATIC = {"smoke": (0.42,), "full": (0.05, 0.1, 0.2, 0.42, 0.5)}
FREQUENCIES = {"smoke": (4.0,), "full": (0.5, 1.0, 2.0, 4.0)}
ELEMENTS = {"smoke": 8, "full": 16}
STEP = 5e-4  # s, made in parts so that
ERROR = {"smoke": 2e-6, "full": 2e-7}  # mm, in the positions, are not exceeded in it


@dataclass(frozen=True)
class Plan:
    """Starts, strokes and strokes left out of the means."""

    starts: int
    strokes: int
    discard: int


WIDE = {"smoke": Plan(1, 4, 2), "full": Plan(2, 6, 3)}
# for the published machine where it walks, and its mechanisms where friction jumps, so that starts and strokes differ
CLOSE = {"smoke": Plan(1, 4, 2), "full": Plan(4, 12, 4)}
STUCK = 0.005  # mm of stroke, below which feet are called stuck
DIFFER = 0.02  # of the stroke, above which strokes are told apart
# shares of the masses that are left, with static above kinetic friction and with equal coefficients
LIGHT = {"smoke": (0.1,), "full": (0.3, 0.1, 0.03, 0.01)}
SMOOTH_LIGHT = {"smoke": (0.01,), "full": (0.1, 0.01)}
# the preset as it is, by its own step of one length and by adaptive ones
OWN_STEP, ADAPTIVE = 1e-3, "adaptive"  # s
OWN = {"smoke": (Plan(1, 2, 1), (4.0,)), "full": (Plan(1, 12, 6), (0.5, 1.0, 2.0))}
# forward and reverse coefficient, static; slip toward the long pillar meets the first
UNEQUAL = {"smoke": ((0.2, 0.42),), "full": ((0.2, 0.42), (0.42, 0.2), (0.3, 0.42), (0.42, 0.3))}
# what the paper prints of its machines, seed_locomotion.csv: speed [mm/s] and efficiency [1]
PRINTED = {0.5: ("-", "0.71 +- 0.21"), 1.0: ("-", "0.46 +- 0.02"), 2.0: ("-", "-"), 4.0: ("> 0.5", "0.52 +- 0.20")}

WHOLE, STICKY = "all four", "0.42 for both coefficients"
SMOOTH, EVEN_SMOOTH = "without static above kinetic friction", "without static friction and unequal pillars"
FRICTIONLESS = "without friction"


def lighter(factor: float, *more: str) -> str:
    """Name of the machine with less inertia."""
    return ", ".join((f"masses times {factor:g}", *more))


SLOW_SMOOTH = lighter(0.01, "without static friction")

# --- quantity, and why it can converge --------------------------------------------------------------------------------
#
# The step is the advance of the centre of mass in a stroke, mean over the strokes after the transient and over the
# starts; positive toward the long pillar. Steps adapt: their error in positions is bounded and changes of contact are
# located, which agrees with explicit steps within 0.4 % where coefficients are equal, and within 1.4 % of a gait where
# static exceeds kinetic friction (studies/gait_accuracy.py). Which gait a start finds there, and from which to which a
# walk changes, is another matter: where strokes differ by more than a fiftieth of the stroke, kinds of strokes are told
# with their shares, and so are starts (`fem_biobot.ensembles.gaits`). A direction is told where the step exceeds a
# hundredth of the stroke and half of its range over the starts, and the stroke 0.005 mm.
#
# Drives: `paper_amplitude`, 0.5, 1.0 and 1.4 mN at 0.5, 1 and 2 Hz, and at 4 Hz those of 2 Hz, since none is printed;
# or full drive, which with the published tensions is 2.4 mN, as in the published code.
#
# Mechanisms are switched off one by one in the machine that walks best, published tissue in air at full drive: feet
# touch along a line across the sole's middle instead of at its corners; both pillars are as long as the short one and
# the long one in the mean; static friction is lowered to the kinetic, or kinetic raised to the static.
#
# Inertia is taken away by a factor e: masses times e and gravity over it keep every weight. In time counted in units of
# sqrt(e) that is the whole machine driven sqrt(1 / e) times more slowly, with a damping time longer by as much: no
# machine is without inertia, and what is shown is the trend. Steps are shorter by sqrt(1 / e), rounded up to a whole
# number, with the same error: equal steps would ring too fast for their shortest parts, and are refused.
#
# The preset as it is, 0.42 / 0.3 with its own drive (1.14 mN), walks from rest by steps of one length, 1 ms, and by
# adaptive ones: twelve strokes, of which six are counted.


@dataclass
class Study:
    """Rows of the map, of unequal friction, of the mechanisms, and of the preset by two kinds of steps."""

    map: list[Row] = field(default_factory=list)
    unequal: list[Row] = field(default_factory=list)
    mechanisms: list[Row] = field(default_factory=list)
    steps: list[Row] = field(default_factory=list)


@dataclass(frozen=True)
class Case:
    """One ensemble of walks: names for the table, machine, ground, drive, plan and how it is computed."""

    names: dict[str, Any]
    machine: RodModel
    ground: Ground
    frequency: float
    amplitude: float
    plan: Plan
    error: float | None  # mm; None for steps of one length
    step: float = STEP  # s
    nudge: Nudge | None = None

    def key(self) -> str:
        """What tells it from others, and rows of this code from those of another."""
        given = (self.names, asdict(self.ground), self.frequency, self.amplitude, asdict(self.plan))
        nudge = asdict(self.nudge or Nudge())
        return json.dumps([*given, self.step, self.error, nudge, digest_of(self.machine), code_digest(), own_digest()])


def digest_of(model: RodModel) -> str:
    """Name of a machine by what is computed with: its nodes as drawn, all arrays of the kernels and its landmarks."""
    found = hashlib.sha256(repr(model.landmarks).encode())

    def take(values: Any) -> None:
        if isinstance(values, tuple):
            found.update(f"({len(values)}".encode())
            for each in values:
                take(each)
        else:
            array = np.ascontiguousarray(values)
            found.update(f"{array.dtype.str}{array.shape}".encode() + array.tobytes())

    take((model.built.x, model.assembly))
    return found.hexdigest()[:16]


def own_digest() -> str:
    """Name of the source that makes rows of walks: this study, how starts are drawn and how strokes are measured."""
    found = hashlib.sha256()
    for file in (__file__, ensembles.__file__, strokes.__file__):
        found.update(Path(file).read_bytes().replace(b"\r\n", b"\n") + b"\0")
    return found.hexdigest()[:16]


class Rows:
    """Rows of cases, each kept in a line of a file when it is there, so that what a stop leaves is not done again."""

    def __init__(self, file: Path | None = None) -> None:
        self.file, self.kept = file, dict[str, Row]()
        if file is not None and file.is_file():
            for line in file.read_text(encoding="utf-8").splitlines(keepends=True):
                if line.endswith("\n"):  # else the stop came while it was written
                    self.kept.update(json.loads(line))

    def of(self, cases: list[Case]) -> list[Row]:
        """Those of the cases, in their order."""
        return [self._row(case) for case in cases]

    def _row(self, case: Case) -> Row:
        key = case.key()
        if key not in self.kept:
            self.kept[key] = numbers(case)
            if self.file is not None:
                with self.file.open("a", encoding="utf-8") as file:
                    file.write(json.dumps({key: self.kept[key]}) + "\n")
        return self.kept[key]


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
    row |= {"time_step_ms": 1e3 * case.step, "largest_error_nm": 1e6 * case.error if case.error else None}
    try:
        found = walk_ensemble(
            case.machine,
            case.frequency,
            ground=case.ground,
            starts=case.plan.starts,
            duration=case.plan.strokes / case.frequency,
            discard=case.plan.discard,
            amplitude=case.amplitude,
            step=case.step,
            settings=Settings(largest_error=case.error),
            nudge=case.nudge,
        )
    except SolveError as error:
        return row | {"remark": str(error)}
    return row | measured(found.walks)


def measured(walks: tuple[Walk, ...]) -> Row:
    """Means over walks from several starts."""

    def mean(name: str) -> float | None:
        value = float(np.mean([getattr(w, name) for w in walks]))
        return value if math.isfinite(value) else None

    steps = np.array([w.step_mm for w in walks])
    advances = np.concatenate([w.advances[w.kept] for w in walks])
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
        "starts_mm": shown_kinds(kinds(steps, stroke)),
        "strokes_mm": shown_kinds(kinds(advances, stroke)),
        "backward_1": float(np.mean(advances < -0.01 * stroke)),
        "speed_mm_per_s": mean("speed_mm_per_s"),
        "stroke_mm": stroke,
        "camera_stroke_mm": mean("camera_stroke_mm"),
        "efficiency_1": mean("efficiency_1"),
        "mechanical_efficiency_1": mean("mechanical_efficiency_1"),
        "slip_1": mean("slip_fraction_1"),
        "contact_1": float(np.mean([w.foot_contacts.mean() for w in walks])),
        "direction": "sticks" if stroke < STUCK else direction,
        "halved_1": sum(w.motion.halved for w in walks),
        "energy_error_1": mean("energy_error_1"),
        "processor_s": sum(w.wall_time for w in walks),
        "remark": "; ".join(dict.fromkeys(event.name for w in walks for event in w.events)) or None,
        "kinds": kinds(advances, stroke),
        "advances_mm": [w.advances.tolist() for w in walks],
    }


def kinds(values: np.ndarray, stroke: float) -> list[tuple[float, float, float]]:
    """Mean, standard deviation [mm] and share [1] of each kind of advances; one where they hardly differ."""
    if np.ptp(values) <= max(DIFFER * stroke, 1e-3):
        return [(float(values.mean()), float(values.std()), 1.0)]
    return [(gait.step_mm, float(values[list(gait.members)].std()), gait.share) for gait in gaits(values)]


def shown_kinds(found: list[tuple[float, float, float]]) -> str | None:
    """In a cell; none where all are alike."""
    if len(found) == 1 and found[0][1] < 1e-3:
        return None
    return ", ".join(f"{mean:.3f} +- {spread:.3f} ({share:.0%})" for mean, spread, share in found)


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
                for law, kinetic in ((DROPS, RATIO * static), (EQUAL, static)):
                    names = {"tissue": tissue, "drive": drive, "medium": medium}
                    names |= {"static_1": static, "kinetic_1": kinetic, "law": law}
                    plan = CLOSE[level] if published(names) else WIDE[level]
                    cases += [
                        Case(names, model, Ground(static, kinetic), f, amplitude(design, drive, f), plan, ERROR[level])
                        for f in FREQUENCIES[level]
                    ]
    return cases


def published(names: Row) -> bool:
    """Whether the machine, drive and static friction are those of the published walker in air."""
    return (*place_of(names), names["static_1"]) == (PUBLISHED, "full", "air", 0.42)


def unequal_cases(level: str) -> list[Case]:
    """Ground that resists slip forward and in reverse differently; published tissue."""
    cases = []
    for medium in MEDIA:
        design = design_of(PUBLISHED, medium)
        model = reduce(design, beam_elements=ELEMENTS[level])
        for forward, reverse in UNEQUAL[level]:
            ground = Ground(forward, forward, reverse_static_friction=reverse, reverse_kinetic_friction=reverse)
            names = {"tissue": PUBLISHED, "medium": medium, "forward_1": forward, "reverse_1": reverse}
            cases += [
                Case(names, model, ground, f, paper_amplitude(design, f)[0], WIDE[level], ERROR[level])
                for f in FREQUENCIES[level]
            ]
    return cases


def mechanism_cases(level: str) -> list[Case]:
    """What is left of the walking machine without each mechanism."""
    design, n = design_of(PUBLISHED), ELEMENTS[level]
    both = ("skeleton.short_pillar_height = 3.1 mm", "skeleton.long_pillar_height = 3.1 mm")
    whole, even = reduce(design, beam_elements=n), reduce(design_of(PUBLISHED, "air", *both), beam_elements=n)
    real, smooth, slick = Ground(0.42, 0.3), Ground(0.3, 0.3), Ground(0.0, 0.0)
    point = point_feet(whole)
    machines: list[tuple[str, RodModel, Ground, float]] = [
        ("without heel and toe", point, real, 1.0),
        ("without unequal pillars", even, real, 1.0),
        (SMOOTH, whole, smooth, 1.0),
        ("without static friction, heel and toe", point, smooth, 1.0),
        (EVEN_SMOOTH, even, smooth, 1.0),
        (FRICTIONLESS, whole, slick, 1.0),
    ]
    machines += [(lighter(e), weightless_inertia(whole, e), real, e) for e in LIGHT[level]]
    for e in SMOOTH_LIGHT[level]:
        machines.append((lighter(e, "without static friction"), weightless_inertia(whole, e), smooth, e))
    least = SMOOTH_LIGHT[level][-1]
    name = lighter(least, "without static friction, heel and toe")
    machines.append((name, weightless_inertia(point, least), smooth, least))
    return [
        Case(
            {"mechanisms": name, "inertia_1": factor},
            model,
            ground,
            f,
            1.0,
            CLOSE[level] if factor == 1.0 and ground is real else WIDE[level],
            ERROR[level],
            STEP / math.ceil(factor**-0.5 - 1e-9),
            # without friction a start keeps the momentum it is given
            Nudge(velocity=0.0) if ground is slick else None,
        )
        for name, model, ground, factor in machines
        for f in FREQUENCIES[level]
    ]


def step_cases(level: str) -> list[Case]:
    """The preset's own walks from rest, by its own steps and by adaptive ones."""
    plan, frequencies = OWN[level]
    cases = []
    for medium in MEDIA:
        design = design_of("preset, 9.09 kPa", medium)
        model, still = reduce(design, beam_elements=ELEMENTS[level]), Nudge(0.0, 0.0, 0.0)
        for f in frequencies:
            for name, step, error in ((f"{1e3 * OWN_STEP:g} ms", OWN_STEP, None), (ADAPTIVE, STEP, ERROR[level])):
                names = {"medium": medium, "steps": name}
                cases.append(Case(names, model, ground_of(design), f, 1.0, plan, error, step, still))
    return cases


def run(level: str, rows: Rows | None = None) -> Study:
    """All walks of a level, one after the other."""
    rows = rows or Rows()
    study = Study(unequal=rows.of(unequal_cases(level)))
    # the machine with all its mechanisms is the map's
    mechanisms = rows.of(mechanism_cases(level))
    study.map = rows.of(map_cases(level))
    study.steps = rows.of(step_cases(level))
    for name, law in ((STICKY, EQUAL), (WHOLE, DROPS)):
        found = [row for row in study.map if published(row) and row["law"] == law]
        mechanisms = [row | {"mechanisms": name, "inertia_1": 1.0} for row in found] + mechanisms
    study.mechanisms = mechanisms
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
    assert study.steps, "the preset does not walk by two kinds of steps"
    for row in study.steps:
        where = f"the preset, {row['medium']}, {row['frequency_Hz']:g} Hz, {row['steps']}"
        assert "step_mm" in row, f"{where}: {row['remark']}"
        sticks = row["direction"] == "sticks"
        assert sticks == (row["medium"] == "air"), f"{where}: {row['direction']}, expected feet to stick in air alone"
    for one, adaptive in zip(study.steps[::2], study.steps[1::2], strict=True):
        ratio = one["stroke_mm"] / adaptive["stroke_mm"]
        where = f"the preset, {one['medium']}, {one['frequency_Hz']:g} Hz"
        assert abs(ratio - 1.0) < 0.05, f"{where}: steps of one length close {ratio:.3f} times as far as adaptive ones"


# --- what was found ---------------------------------------------------------------------------------------------------

FOUND = """
``python studies/walking_map.py`` on a share of one core (54 minutes, 23 of processor time); adaptive steps, 16
elements, two starts of six strokes of which three are counted, four of twelve and eight where said; 324 cases, every
walk to its end, every expectation holds, and the energy book of none leaves more than 6e-6 unexplained. Positive is
toward the long pillar. Weight on the feet 2.54 mN in air, 0.26 mN submerged.

* Air, the paper's forces (0.5, 1.0, 1.4 and 1.4 mN at 0.5, 1, 2 and 4 Hz). With a static coefficient of 0.42 or more
  nothing walks: with the preset's standing tension of 9.09 kPa the stroke is at most 0.0015 mm, with the published
  0.9 kPa at most 0.042 mm and the step 0.00004 mm. At 0.2 the preset walks at 0.03 and 0.09 mm/s at 1 and 2 Hz, sticks
  at 0.5 Hz, and at 4 Hz one start goes forward by 0.028 mm a stroke and one backward by 0.020 (with equal coefficients
  0, 0.05 and 0.20 mm/s at 1, 2 and 4 Hz); at 0.05 it walks backward from 1 Hz on, 0.18 mm/s at 4 Hz.
* Air, the published tissue at full drive (2.4 mN), 0.42 / 0.3, four starts of twelve strokes, eight counted:
  0.5 Hz  two starts make 0.090 mm a stroke (0.096, 0.096, 0.071), two stay where they are (0.003); 0.023 mm/s in all
  1 Hz    75 % of the strokes make 0.114, 22 % -0.036 and 3 % -0.060; by start 0.053 to 0.097 a stroke; 0.076 mm/s
  2 Hz    0.135 (0.147, 0.125, 0.132); three of 48 strokes, one of those counted, make -0.19; 0.25 mm/s
  4 Hz    all four starts go backward, 0.0247 a stroke, -0.099 mm/s; 4 of 16 go forward in studies/gait_accuracy.py
  The paper prints more than 0.5 mm/s at 4 Hz, and efficiencies (step over the sagitta's swing) of 0.71, 0.46, none and
  0.52: these have 0.33, 0.65, 1.1 and 0.16. Feet slip for 4, 10, 12 and 26 % of their time on the ground. With 0.42 for
  both every stroke is alike: steps of 0.0009, 0.010, 0.071 and 0.077 mm, 0.000, 0.010, 0.14 and 0.31 mm/s, efficiency
  0.01, 0.14, 0.92 and 0.69.
  With equal coefficients speed grows with friction at 4 Hz, -0.12, 0.01, 0.15, 0.31 and 0.33 mm/s from 0.05 to 0.5, and
  up to 0.42 at 2 Hz. With static above kinetic it does not: -0.01, 0.23, 0.21, -0.10 and 0.76 at 4 Hz.
* Strokes differ by more than 2 % of the stroke in none of the 101 cases that move with equal coefficients, and in 36 of
  104 with static above kinetic: there a mean is that of the strokes that were made, not of a gait.
* Submerged, strokes are 0.1 to 0.8 mm with the paper's forces and 1.1 to 1.3 mm at full drive, whatever the friction,
  and the way is backward: at 2 and 4 Hz in 59 of 60 cases, down to -0.62 mm/s (full drive, 2 Hz, 0.42 / 0.3); the one
  other does not move. At 1 Hz 27 of 30 go backward. At 0.5 Hz it moves by 0.027 mm a stroke or less with the paper's
  force, either way; at full drive 0.38 backward at 0.05 to 0.11 forward at 0.5 static.
* Unequal friction decides the direction in every case that moves. Submerged, 0.2 forward and 0.42 in reverse, both
  equal when sticking and slipping: 0.11, 0.49, 1.43 and 2.6 mm/s forward, nearly the whole stroke as a step; turned
  round -0.11, -0.49, -1.41 and -2.5. In air 0, 0.02, 0.09 and 0.18 mm/s, and as much backward turned round.
* Mechanisms, published tissue in air, full drive, steps at 0.5, 1, 2 and 4 Hz [mm]; with * strokes differ:
  all four                            0.047*     0.076*     0.125*    -0.025
  0.42 for both                       0.0009     0.010      0.071      0.077
  no static above kinetic (0.3)       0.0007     0.020      0.067      0.069
  no heel and toe                    -0.139*    -0.109*     0.107*    -0.004*
  equal pillars                      -0.005*     0.003*     0.000      0.000
  masses times 0.3                    0.074      0.090      0.098*     0.000*
    0.1                              -0.003      0.065      0.085*     0.121*
    0.03                             -0.002     -0.003     -0.003      0.056*
    0.01                             -0.003     -0.003     -0.003     -0.003
  no static above kinetic, and
    equal pillars                     below 1e-13 at all
    no heel and toe                   0.0000    -0.005     -0.003      0.068
    masses times 0.1                  0.0000     0.0000     0.0001     0.030
    0.01                              below 2e-5 at all; without heel and toe 2e-9
  no friction                         0
  (Equal pillars: at 0.5 and 1 Hz one stroke of 32 breaks the symmetry, -0.144 and 0.081; all others are 0.)
  So inertia and unequal pillars are both needed: without either next to nothing is left, whatever else there is. Equal
  pillars share the load alike at all times, so that none is transferred from foot to foot. Masses of a hundredth are
  taken along at the pace at which the muscle pulls, and leave 0.7 % of the stroke, backward, at all frequencies: what a
  release does by itself, for it is not there with equal coefficients. Between, a machine is the whole one driven more
  slowly, and damped more: with a tenth of the mass at 1 Hz, as slow as 0.3 Hz, a released foot still overshoots.
  At 0.5 and 1 Hz the step is that of the release of a foot that stuck, for with equal coefficients next to nothing is
  left there; at 2 Hz half of it is left, that of the machine's swing. At 4 Hz the swing alone walks forward, and
  releases turn most walks round. Heel and toe make the step forward at 0.5 and 1 Hz; with points for feet it is larger,
  and backward.
* The preset as it is, 0.42 / 0.3, 1.14 mN at every frequency, from rest, six strokes of twelve (12 cases, 68 s,
  rows of later code). In air its feet stick at 0.5, 1 and 2 Hz by either kind of steps, and strokes of 0.0012 mm are
  0.2 % apart at most. Submerged, strokes of 0.4 mm are 3 % apart at most, and steps are not the same [mm]:
                        0.5 Hz                       1 Hz                        2 Hz
  1 ms                  0.046 (-0.068 to 0.107)      0.066                      -0.005
  adaptive              0.010 (0.007 to 0.015)       0.044 (0.066, 0.022)        0.011
  With half the error, 0.1 nm, adaptive steps give 0.034 (0.025, 0.043, 0.033) and 0.011 at 1 and 2 Hz: which gait is
  found at 1 Hz hangs on that still, the one of 2 Hz does not. Steps of 1 ms turn the latter round.
"""

# --- what was not looked at -------------------------------------------------------------------------------------------

NOT_LOOKED_AT = """
More than two starts and three strokes a case but for the published tissue in air at full drive, hence shares of gaits;
machines of less than a hundredth of the mass; drag of the medium, which the submerged bot lacks; stimulation that
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
    common += ("slip_1", "contact_1", "direction", "starts_mm", "strokes_mm")
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
    made = ("time_step_ms", "largest_error_nm", "remark")
    for title, rows, first in (
        ("Unequal friction, published tissue", study.unequal, ("medium", "forward_1", "reverse_1")),
        ("Mechanisms, published tissue in air at full drive", study.mechanisms, ("mechanisms",)),
        ("The preset as it is, by two kinds of steps", study.steps, ("medium", "steps")),
    ):
        names = (*first, *common, *made)
        shown.append(Table(title, names, tuple(tuple(row.get(name) for name in names) for row in rows)))
    return shown


def write(study: Study, folder: Path) -> None:
    """CSV of the four lists, and a picture of the map and the mechanisms."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in ("map", "unequal", "mechanisms", "steps"):
        plain = [{k: v for k, v in row.items() if not isinstance(v, list)} for row in getattr(study, name)]
        write_table(folder / f"{name}.csv", plain)
    frequencies = list(dict.fromkeys(row["frequency_Hz"] for row in study.map))
    figure = Figure(figsize=(11.0, 12.0), dpi=150, layout="constrained")
    FigureCanvasAgg(figure)
    upper, lower = figure.subfigures(2, 1, squeeze=False, height_ratios=(1.2, 1.0)).ravel()
    panels = upper.subplots(len(MEDIA), len(places(study)) // len(MEDIA), squeeze=False).T.ravel()
    for panel, place in zip(panels, places(study), strict=True):
        for number, frequency in enumerate(frequencies):
            for law, line in ((DROPS, "-o"), (EQUAL, "--")):
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
        rows = [r for r in study.mechanisms if r["frequency_Hz"] == frequency]
        at = [names.index(r["mechanisms"]) + height * (number - (len(frequencies) - 1) / 2) for r in rows]
        bars.barh(at, [r.get("step_mm", 0.0) for r in rows], height, color=f"C{number}", label=f"{frequency:g} Hz")
        # kinds of strokes, where they differ, by their shares, and how far each scatters
        dots = [(y, *kind) for r, y in zip(rows, at, strict=True) for kind in _several(r)]
        if dots:
            y, x, spread, share = np.array(dots).T
            bars.hlines(y, x - spread, x + spread, colors="k", linewidth=0.7, zorder=3)
            bars.scatter(x, y, 30.0 * share, facecolors="w", edgecolors="k", linewidths=0.7, zorder=4)
    bars.set_yticks(np.arange(len(names)), names, fontsize=7)
    bars.invert_yaxis()
    bars.axvline(0.0, color="0.7", linewidth=0.7)
    bars.set_xlabel(
        "advance per stroke [mm], published tissue in air, full drive; circles: kinds of strokes by share, deviation"
    )
    bars.legend(frameon=False, fontsize=7)
    with replacing(folder / "walking_map.png") as temporary:
        figure.savefig(temporary, format="png")


def _several(row: Row) -> list[tuple[float, float, float]]:
    """Kinds of strokes of a row, where there are several, or where one scatters."""
    found = row.get("kinds", [])
    return found if len(found) > 1 or any(spread > DIFFER * row["stroke_mm"] for _, spread, _ in found) else []


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--level", choices=tuple(STATIC), default="full")
    parser.add_argument("--out", type=Path, default=Path("runs") / "studies" / "walking_map")
    parser.add_argument("--afresh", action="store_true", help="do rows again that the folder has")
    options = parser.parse_args()
    begin = time.perf_counter()
    options.out.mkdir(parents=True, exist_ok=True)
    file = options.out / f"rows_{options.level}.jsonl"
    if options.afresh:
        file.unlink(missing_ok=True)
    rows = Rows(file)
    if rows.kept:
        print(f"{len(rows.kept)} rows are there; those of this code and of these cases are taken from {file}")
    study = run(options.level, rows)
    show_tables(tables(study))
    write(study, options.out)
    print(f"\n{time.perf_counter() - begin:.0f} s; files in {options.out}")
    expect(study)
    print("every expectation holds")


if __name__ == "__main__":
    main()

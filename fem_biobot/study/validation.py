"""Every printed number of the paper that the software can predict, predicted; the others with the reason why not.

Nothing is fitted: designs are the presets, whose assumed inputs are listed with what each does to the predictions.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.interpolate import PchipInterpolator

from fem_biobot.config import load_design
from fem_biobot.design import Design
from fem_biobot.errors import DesignError, ModelError, SolveError
from fem_biobot.link.observed import Observed
from fem_biobot.link.rod_side import RodSide
from fem_biobot.link.shapes import Both, level_both
from fem_biobot.link.solid_side import SolidSide
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.muscle.compaction import compacted_section
from fem_biobot.muscle.drive import paper_amplitude
from fem_biobot.muscle.maturation import ACTIVE_TENSION, PASSIVE_TENSION
from fem_biobot.muscle.myotubes import mean_sine
from fem_biobot.rod.gait import Walk
from fem_biobot.rod.reduce import PlateFactor, reduce
from fem_biobot.rod.walk import walk
from fem_biobot.solid.measures import eq3_stiffness
from fem_biobot.study.claims import Claim
from fem_biobot.study.other_machines import other_machines
from fem_biobot.study.paper import (
    EFFICIENCY,
    MEASURED_WIDTHS,
    PASSIVE_FORCE,
    SIMULATED_FORCE_TO_DEFLECTION,
    SPEED_4_HZ,
    STROKE_FORCE_2_HZ,
    STROKE_FORCE_4_HZ,
    WALKED_FREQUENCIES,
    Printed,
)
from fem_biobot.study.reporter import Reporter, Silent

# tensions from rest at which the path to the simulated forces is taken [kPa]
_PATH = (0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 6.0)
_STROKES, _DISCARD = 10, 4
_SPREAD = np.deg2rad(15.0)  # of fibres at 15 days, facts/seed_alignment.csv
# inputs that are assumptions, and the factors by which they are varied
ASSUMED = {
    "muscle.junction_width": (0.8, 1.2),
    "muscle.junction_thickness": (0.8, 1.2),
    "muscle.junction_height": (0.93, 1.07),
    "muscle.material.young": (0.5, 2.0),
    "skeleton.material.young": (0.9, 1.1),
    "skeleton.beam_thickness": (0.95, 1.05),
}


@dataclass(frozen=True)
class Sensitivity:
    """What an assumed input does to a prediction of the rods: values at both ends of its range, and as it is."""

    quantity: str
    key: str
    factors: tuple[float, float]
    low: float | None
    high: float | None
    as_is: float


def validate(design: Design, mesh: BodyMesh, reporter: Reporter) -> tuple[list[Claim], list[Sensitivity], Both]:
    """Predict the paper's numbers with a design of its machine.

    Parameters
    ----------
    design
        The bot with a junction; its tissue as moulded.
    mesh
        Of the solid.
    reporter
        Told of stages and notes.

    Returns
    -------
    list of Claim, list of Sensitivity, Both
        In the order of the paper's sections, the rods' sensitivities to assumed inputs, and the states of both models.
    """
    tensions = sorted({*_PATH, design.tension(0.0), design.tension(design.drive.amplitude)})
    reporter.stage("solid and rods from rest to full drive", len(tensions) + 2)
    solid_side, rod_side = SolidSide(design, mesh), RodSide(design, reduce(design))
    solid, solid_states = solid_side.states(tensions, reporter)
    rods, rod_states = rod_side.states(tensions, reporter)
    claims = [*_deflections(solid, rods), *_forces(design, solid, rods), *_widths(design)]
    claims += [*_walking(design, reporter), *other_machines(reporter)]
    both = level_both(solid_side, solid_states, rod_side, rod_states, tensions)
    return [*claims, *_sizes(design), *_not_predicted()], sensitivities(design), both


def _deflections(solid: Sequence[Observed], rods: Sequence[Observed]) -> list[Claim]:
    """Closing at the active forces of the paper's own simulation."""
    return [
        Claim(
            f"pillar deflection at {force:g} mN",
            printed,
            closing_at(solid, force),
            closing_at(rods, force),
            simulated=printed.value,
            why="from the unstressed machine; the printed value is the paper's simulation, approximate",
        )
        for force, printed in SIMULATED_FORCE_TO_DEFLECTION
    ]


def closing_at(states: Sequence[Observed], force: float) -> float | None:
    """Closing at a muscle force [mm], between the states of a path; None beyond them."""
    forces = np.array([0.0, *(s.numbers["muscle_force_mN"] for s in states)])
    closings = np.array([0.0, *(s.numbers["tip_closing_mm"] for s in states)])
    if not all(b > a for a, b in pairwise(forces)) or force > forces[-1]:
        return None
    return float(PchipInterpolator(forces, closings)(force))


def _forces(design: Design, solid: Sequence[Observed], rods: Sequence[Observed]) -> list[Claim]:
    """Forces as an experiment infers them from the beam's sagitta by Eq. 3."""
    k = eq3_stiffness(design)
    passive, peak = design.tension(0.0), design.tension(design.drive.amplitude)
    muscle = design.value("muscle")

    def inferred(states: Sequence[Observed], tension: float) -> float | None:
        found = [s for s in states if abs(s.tension - tension) < 1e-9]
        return k * found[0].numbers["sagitta_mm"] if found else None

    def stroke(states: Sequence[Observed]) -> float | None:
        ends = inferred(states, passive), inferred(states, peak)
        return None if None in ends else ends[1] - ends[0]  # type: ignore[operator]

    section = design.junction_section
    factor = muscle.gamma * float(np.sin(muscle.theta))
    tension_of_day = "the tension is that of the paper's Eq. 2 input, split as at 15 days"
    claims = [
        Claim(
            "passive force, 15 days",
            PASSIVE_FORCE,
            inferred(solid, passive),
            inferred(rods, passive),
            design.tension(0.0) * section * float(np.sin(muscle.theta)),
            why=f"inferred by Eq. 3 from the sagitta; equations: Eq. 1; {tension_of_day}",
        )
    ]
    for printed, frequency in ((STROKE_FORCE_2_HZ, 2), (STROKE_FORCE_4_HZ, 4)):
        claims.append(
            Claim(
                f"active force at {frequency} Hz, 15 days",
                printed,
                stroke(solid),
                stroke(rods),
                muscle.active_tension * section * factor,
                simulated=1.4 if frequency == 2 else None,
                why="full drive at every frequency; inferred by Eq. 3 from the change of the sagitta",
            )
        )
    claims.append(
        Claim(
            "active force from the share of the total, 15 days",
            Printed(1.207, "mN", "derived: 12.5 % of the total with 8.45 mN passive, section 2.4"),
            stroke(solid),
            stroke(rods),
            muscle.active_tension * section * factor,
            why="as at 2 and 4 Hz",
        )
    )
    return claims


def _widths(design: Design) -> list[Claim]:
    """Forces by seeding width: Eq. 1 with the section that compaction leaves and the spread of 15 days."""
    theta = float(design.value("muscle.theta"))
    alignment = mean_sine(theta, float(_SPREAD))
    claims = []
    for width, forces in MEASURED_WIDTHS.items():
        final, thickness = compacted_section(width)
        for kind, tension in (("active", ACTIVE_TENSION), ("passive", PASSIVE_TENSION)):
            value, deviation = forces[f"{kind}_mN"], forces[f"{kind}_sd_mN"]
            if value is None:
                continue
            claims.append(
                Claim(
                    f"{kind} force, seeded {width:g} mm wide",
                    Printed(value, "mN", "section 2.5, Fig. 6", deviation),
                    equations=tension * final * thickness * alignment,
                    why="Eq. 1: compacted width times the trench's depth, spread 15 degrees, tension of 15 days",
                )
            )
    return claims


def _walking(design: Design, reporter: Reporter) -> list[Claim]:
    """Speed and efficiency by the rods, driven with the active forces of the paper's simulation.

    The weight on the feet is the least known number: the scaffold in air and submerged are its bounds.
    """
    claims = []
    for immersion, place in (("air", "in air"), ("submerged", "submerged")):
        reporter.stage(f"walks {place} at the paper's frequencies", len(WALKED_FREQUENCIES))
        walks = _walks(design.with_values({"ground.immersion": immersion}), reporter)
        why = f"rods alone walk; {place}, one bound of the weight on the feet"
        speed = walks[4.0].speed_mm_per_s if 4.0 in walks else None
        claims.append(Claim(f"walking speed at 4 Hz, {place}", SPEED_4_HZ, rods=speed, bound=">", why=why))
        for frequency, printed in EFFICIENCY.items():
            value = walks[frequency].efficiency_1 if frequency in walks else None
            claims.append(Claim(f"efficiency at {frequency:g} Hz, {place}", printed, rods=value, why=why))
    return claims


def _walks(design: Design, reporter: Reporter) -> dict[float, Walk]:
    """Walks by frequency [Hz]; one that fails is said and left out."""
    walks: dict[float, Walk] = {}
    for frequency in WALKED_FREQUENCIES:
        amplitude, _ = paper_amplitude(design, frequency)
        duration = _STROKES / frequency
        try:
            walks[frequency] = walk(
                design, frequency=frequency, duration=duration, amplitude=amplitude, discard=_DISCARD
            )
        except (ModelError, SolveError) as failure:
            reporter.note(f"walk at {frequency:g} Hz: {failure}")
        reporter.advance(f"{frequency:g} Hz")
    return walks


def _sizes(design: Design) -> list[Claim]:
    """Numbers of geometry that follow from the drawing."""
    return [
        Claim(
            "second moment of the large skeleton",
            Printed(0.2, "mm^4", "section 2.3, rounded"),
            equations=design.second_moment,
            why="of the drawn rectangle",
        ),
        Claim(
            "second moment of the small skeleton",
            Printed(0.04, "mm^4", "section 2.3"),
            equations=load_design("ring_bot").second_moment,
            why="an input of that preset",
        ),
    ]


def _not_predicted() -> list[Claim]:
    """Printed numbers that are inputs here, or for which the paper does not print what a prediction needs."""

    def claim(name: str, value: float, unit: str, where: str, why: str, sd: float | None = None) -> Claim:
        return Claim(name, Printed(value, unit, where, sd), why=why)

    by_day = "an input: tension by day is scaled with it (fem_biobot.muscle.maturation)"
    return [
        claim("passive force, 5 days", 7.99, "mN", "section 2.4", by_day, 0.54),
        claim("passive force, 10 days", 8.38, "mN", "section 2.4", by_day, 0.40),
        claim("active over total, 5 days, below", 3.0, "%", "section 2.4", by_day),
        claim("active over total, 10 days", 7.5, "%", "section 2.4", by_day),
        claim("compaction at 3.5 mm", 1.58, "1", "section 2.5", "an input of the law of compaction"),
        claim("compaction at 14 mm", 3.08, "1", "section 2.5", "an input of the law of compaction"),
        claim("spread of fibres, 5 days, above", 30.0, "deg", "section 2.6", "remodelling is not modelled"),
        claim("spread of fibres, 15 days", 15.0, "deg", "section 2.6", "an input", 15.0),
        claim(
            "force per mean over spread of the fibres", 0.15, "mN", "section 2.6",
            "the points of the line stand in a figure only", 0.03,
        ),
        claim("force of myotube- over myoblast-seeded tissue", 3.0, "1", "section 2.2", "an input of Eq. 1"),
        claim("viable fraction of the ring", 0.83, "1", "section 2.3", "needs a consumption: studies/oxygen.py"),
        claim("viable fraction of the junction", 1.0, "1", "section 2.3", "needs a consumption: studies/oxygen.py"),
        claim("speed over that of the earlier machine", 2.0, "1", "section 2.7", "its gait is not described"),
    ]  # fmt: skip


# --- what the assumptions do ------------------------------------------------------------------------------------------


def sensitivities(design: Design) -> list[Sensitivity]:
    """Predictions of the rods with each assumed input at both ends of its range, and with the beam as a plate."""
    as_is = _quantities(design)
    found = []
    for key, factors in ASSUMED.items():
        value = float(design.value(key))
        ends = [_tried(design, {key: factor * value}) for factor in factors]
        found += [
            Sensitivity(name, key, factors, *(end.get(name) for end in ends), as_is=base)  # type: ignore[misc]
            for name, base in as_is.items()
        ]
    plate = _tried(design, {}, PlateFactor.plane_strain)
    found += [Sensitivity(n, "plate factor", (1.0, 1.0), base, plate.get(n), base) for n, base in as_is.items()]
    return found


def _tried(design: Design, values: Mapping[str, float], factor: PlateFactor = PlateFactor.none) -> Mapping[str, float]:
    """Quantities of a changed design; none where its parts do not fit, or where it has no state."""
    try:
        return _quantities(design.with_values(dict(values)), factor)
    except (DesignError, ModelError, SolveError):
        return {}


def _quantities(design: Design, factor: PlateFactor = PlateFactor.none) -> dict[str, float]:
    """Deflection at 1 mN, passive force and stroke force as Eq. 3 infers them, by rods."""
    passive, peak = design.tension(0.0), design.tension(design.drive.amplitude)
    tensions = sorted({*_PATH, passive, peak})
    states, _ = RodSide(design, reduce(design, plate_factor=factor)).states(tensions, Silent())
    # the experimenter's stiffness is the paper's, whatever the machine is
    k = eq3_stiffness(load_design("junction_bot"))
    sagitta = {s.tension: s.numbers["sagitta_mm"] for s in states}
    found = {
        "passive force by Eq. 3 [mN]": k * sagitta[passive],
        "stroke force by Eq. 3 [mN]": k * (sagitta[peak] - sagitta[passive]),
    }
    closing = closing_at(states, 1.0)
    return found if closing is None else {"deflection at 1 mN [mm]": closing, **found}

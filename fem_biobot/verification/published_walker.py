"""B3: the walker of the published open rod code, rebuilt from its own numbers with its oddities."""

from __future__ import annotations

from functools import cache

import numpy as np

from fem_biobot import Walk, load_design, walk
from fem_biobot.rod.published.course import diagnostics
from fem_biobot.verification.records import Case, Claim, Curve, Finding, Graph

FREQUENCY = 2.0
STATIC, GRAVITY, DENSITY = 0.42, 9810.0, 1.12e-6
# both beams with half their mass, four legs, four cross rods: radius [mm], length [mm], share that weighs
RODS = ((0.8786, 2 * 14.0, 0.5), (1.75, 2 * (3.4 + 2.8), 1.0), (0.72, 4 * 3.5, 1.0))
WEIGHT = DENSITY * GRAVITY * sum(np.pi * radius**2 * length * share for radius, length, share in RODS)
# of both beams in the flexible span [mm^4], of four fibres at the height of a stroke [mN], of the feet [mm]
SECOND_MOMENT, FORCE, STROKE = 0.18296, 1.4, 1.0


@cache
def walked() -> Walk:
    """One stroke as published, from its feet."""
    return walk(load_design("elastica_walker"), frequency=FREQUENCY, duration=1.0 / FREQUENCY, discard=0)


def published_walker() -> Finding:
    """B3: the machine that the published rod code walks with.

    Problem: eighteen rods with the numbers of the code and what it does besides, one stroke at 2 Hz.
    Measured: weight; second moment of both beams between the pillars; largest force of the four fibres; by how much
        friction at a foot is more than the static coefficient times the normal force; what the book of energies leaves;
        stroke of the feet.
    Tolerance: rounding for weight and friction; the last digit printed for the second moment and the force that the
        code states for its muscle; 1e-3 of the energy. The paper's stroke is approximate and of ten strokes: shown.
    Cannot see: position and friction of the published run over time, which are not printed.
    Catches: beams with their whole mass, one beam counted for two, fibres without what their stretch takes from them,
        a coefficient of friction applied twice.
    """
    found = walked()
    course = diagnostics(found.motion)
    model = found.motion.model
    beams = [rod.sections[len(rod.sections) // 2] for rod in model.rods if rod.name in ("beam_right", "beam_left")]
    normal, friction = found.foot_force[:, :, 0], np.abs(found.foot_force[:, :, 1:]).max(axis=2)
    values = [
        found.weight_mN,
        sum(section.I1 for section in beams),
        found.muscle_force.sum(axis=1).max(),
        max(0.0, float((friction - STATIC * normal).max())),
        found.energy_error_1,
        np.ptp(course["foot_distance_mm"]),
    ]
    times = course["time_s"]
    bound = STATIC * course["normal_long_mN"]
    curves = (
        Curve("0.42 of the normal force, long pillar", times, bound, known=True),
        Curve("and against it", times, -bound, known=True),
        Curve("friction, long pillar", times, course["friction_long_mN"]),
        Curve("push of the rings on the long pillar", times, course["ring_push_long_mN"]),
    )
    return Finding.of(values, Graph("time [s]", "force [mN]", curves))


_CODE = "Zhang et al. 2019, open code, case walker"
B3 = Case(
    "B3",
    "the published rod walker",
    (
        Claim("weight", WEIGHT, 1e-9, "mN", f"{_CODE}: rho g sum of pi r^2 l"),
        Claim("second moment of both beams in the span", SECOND_MOMENT, 5e-6, "mm^4", f"{_CODE}: 2 pi r^4 / 4"),
        Claim("largest force of the four fibres", FORCE, 0.05, "mN", f"{_CODE}, ExternalContact.h: F_m"),
        Claim("friction at a foot beyond its bound", 0.0, 1e-9, "mN", f"{_CODE}: static coefficient 0.42"),
        Claim("energy that the book leaves", 0.0, 1e-3, "1", "conservation of energy"),
        Claim("stroke of the feet", STROKE, None, "mm", "Pagan-Diaz et al. 2018, section 2.4, Fig. 5d, approximate"),
    ),
    published_walker,
)

CASES = (B3,)

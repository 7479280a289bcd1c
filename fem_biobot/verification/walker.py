"""C6: walks whose steps are known beforehand: equal, anchored and one-way feet; and the order of stick and slip."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from fem_biobot import Design, Ground, RodModel, Walk, load_design, reduce, walk
from fem_biobot.rod.rest import contact_positions
from fem_biobot.verification.records import Case, Claim, Curve, Finding, Graph

Array = NDArray[np.float64]
Visits = list[tuple[float, int]]

# --- feet that go nowhere, and feet that go by what they open ---------------------------------------------------------

FREQUENCY, AMPLITUDE, DURATION = 2.0, 1.2, 5.0


@cache
def submerged() -> Design:
    """The junction bot under water, so that its feet slip."""
    return load_design("junction_bot", ["ground.immersion = submerged"])


@cache
def machine() -> RodModel:
    """Its model."""
    return reduce(submerged())


@cache
def equal_walk() -> Walk:
    """A walk of the bot with equal pillars."""
    heights = {"skeleton.short_pillar_height": 3.1, "skeleton.long_pillar_height": 3.1}
    return walk(submerged().with_values(heights), frequency=FREQUENCY, amplitude=AMPLITUDE, duration=DURATION)


@cache
def anchored_walk() -> Walk:
    """A walk on friction that always holds."""
    return walk(machine(), ground=Ground(50.0), frequency=FREQUENCY, amplitude=AMPLITUDE, duration=DURATION)


@cache
def one_way_walk() -> Walk:
    """A slow walk on feet that slide easily forward and never back."""
    ground = Ground(0.1, reverse_static_friction=50.0, reverse_kinetic_friction=50.0)
    return walk(machine(), ground=ground, frequency=0.5, amplitude=AMPLITUDE, duration=8.0, step=2e-3, discard=1)


def inner_edges(walked: Walk) -> Array:
    """Positions along x of one inner corner of the hind foot and one of the fore foot, (s, 2) [mm]."""
    return contact_positions(machine(), walked.motion.x, walked.motion.Q)[:, [0, 5], 0]


def opening(walked: Walk) -> float:
    """How far the distance of the two corners swings after the first stroke [mm]."""
    edges = inner_edges(walked)[walked.times > 2.0]
    return float(np.ptp(edges[:, 1] - edges[:, 0]))


# --- the order of stick and slip --------------------------------------------------------------------------------------

# steps of the coarser run: visits as short as that are left out, and events as near as that may change places
NEAR = 3
# tensions of the published rod code, and what each machine is
PUBLISHED = ("muscle.passive_tension = 0.9 kPa", "muscle.active_tension = 2.7 kPa")
MACHINES = {
    "preset, submerged": ("ground.immersion = submerged", "numerics.damping_time = 5 ms"),
    "published tensions, submerged": (*PUBLISHED, "ground.immersion = submerged", "numerics.damping_time = 1 ms"),
    "published tensions, in air": (*PUBLISHED, "numerics.damping_time = 5 ms"),
    "preset, submerged, lightly damped": ("ground.immersion = submerged", "numerics.damping_time = 0.1 ms"),
}


@dataclass(frozen=True)
class Resolution:
    """Time step [s] and elements of the beam."""

    step: float
    elements: int


@cache
def contact_states(machine: str, run: Resolution, duration: float) -> tuple[Array, NDArray[np.int64]]:
    """Times (s,) and states of both feet and all corners (s, 10), at every step of a slow walk."""
    walked = walk(
        load_design("junction_bot", MACHINES[machine]),
        frequency=0.25,
        duration=duration,
        step=run.step,
        beam_elements=run.elements,
        sample_every=1,
        discard=0,
    )
    return walked.times, np.hstack([walked.foot_state, walked.motion.touch])


def visits(times: Array, state: NDArray[np.int64], shortest: float) -> Visits:
    """States in order and since when, without visits that are not longer than `shortest` [s]."""
    begins = np.concatenate([[0], np.flatnonzero(np.diff(state)) + 1])
    ends = np.append(times[begins[1:]], times[-1])
    found: Visits = []
    for i, end in zip(begins, ends, strict=True):
        if end - times[i] > shortest and not (found and found[-1][1] == state[i]):
            found.append((float(times[i]), int(state[i])))
    return found


def disagreements(machine: str, coarse: Resolution, fine: Resolution, duration: float) -> list[str]:
    """What differs in the order of events of two runs.

    Of each foot and corner the sequence of states must be the same; of two of them, no two events that lie further
    apart than `NEAR` steps may change places.
    """
    near = NEAR * coarse.step * (1.0 + 1e-6)
    runs = [
        [visits(times, column, near) for column in state.T]
        for times, state in (contact_states(machine, run, duration) for run in (coarse, fine))
    ]
    found = []
    for point, (a, b) in enumerate(zip(*runs, strict=True)):
        if [s for _, s in a] != [s for _, s in b]:
            found.append(f"point {point}: {len(a)} and {len(b)} visits")
    if not found:
        times = [[np.array([t for t, _ in each[1:]]) for each in run] for run in runs]
        for p in range(len(times[0])):
            for q in range(p):
                before, after = (np.subtract.outer(run[p], run[q]) for run in times)
                changed = int(((np.abs(before) > near) & (before * after <= 0.0)).sum())
                if changed:
                    found.append(f"points {p} and {q}: {changed} events change places")
    return found


STROKE = 4.1  # s, one stroke at a quarter a second
HALVED = {
    "step": (Resolution(1e-3, 16), Resolution(5e-4, 16)),
    "mesh": (Resolution(1e-3, 8), Resolution(1e-3, 16)),
}
ORDERED = tuple(MACHINES)[:2]

# --- the case ---------------------------------------------------------------------------------------------------------


def walker_symmetry() -> Finding:
    """C6: the walker under symmetries, and the order of its events.

    Problem: the reduced junction bot under water with equal pillars; with feet that always hold; with feet that never
        slip back, driven slowly; and well damped, at a quarter of a stroke a second, with the step or the mesh halved.
    Measured: largest advance of any stroke; advance per stroke over the swing of the distance of the feet's edges;
        how many feet and corners have another sequence of lifting, sticking and slipping, or exchange events.
    Tolerance: 1e-9 mm for equal feet, rounding; 1e-6 mm for anchored ones, where an edge about which its foot turns
        creeps by 1e-9 mm a stroke; 2e-3 for one-way feet, which inertia lets slide on by a thousandth; less than one
        for counts.
    Cannot see: any order where damping is light.
    Catches: a contact point or mass on one side only, creep of sticking points, reverse friction against the wrong
        direction, stick and slip decided by a threshold of velocity.
    """
    one_way = one_way_walk()
    values = [
        np.abs(equal_walk().advances).max(),
        np.abs(anchored_walk().advances[4:]).max(),
        one_way.step_mm / opening(one_way),
        *(len(disagreements(name, *pair, STROKE)) for name in ORDERED for pair in HALVED.values()),
    ]
    times, edges = one_way.times, inner_edges(one_way)
    hind = edges[:, 0] - np.interp(2.0, times, edges[:, 0])
    strokes = np.arange(1.0, times[-1] * 0.5 + 1e-9)
    curves = (
        Curve(
            "one-way feet: the stroke, each time",
            2.0 * strokes,
            (strokes - 1.0) * opening(one_way),
            known=True,
            joined=False,
        ),
        Curve("one-way feet: hind edge", times[::20], hind[::20]),
        Curve("equal feet: centre of mass", equal_walk().times[::20], _advance(equal_walk())[::20]),
    )
    return Finding.of(values, Graph("time [s]", "advance [mm]", curves))


def _advance(walked: Walk) -> Array:
    return walked.position[:, 0] - walked.position[0, 0]


C6 = Case(
    "C6",
    "walker symmetry",
    (
        Claim("largest advance of a stroke, equal feet", 0.0, 1e-9, "mm", "symmetry"),
        Claim("largest advance of a stroke, anchored feet", 0.0, 1e-6, "mm", "Coulomb: feet that stick stay"),
        Claim("advance of one-way feet over their opening", 1.0, 2e-3, "1", "ratchet: net displacement is the stroke"),
        *(
            Claim(f"changed orders of stick and slip, {name}, halved {what}", 0.0, 0.5, "1", "quasi-static limit")
            for name in ORDERED
            for what in HALVED
        ),
    ),
    walker_symmetry,
)

CASES = (C6,)

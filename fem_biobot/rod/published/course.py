"""How the published walker begins and is driven, and what its code writes of a run."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from fem_biobot.design import Design
from fem_biobot.rod.anatomy import path
from fem_biobot.rod.dynamics.integrate import Motion
from fem_biobot.rod.model import RodModel, RodState
from fem_biobot.rod.published.description import ElasticaWalker, Start
from fem_biobot.rod.published.design import walker_of
from fem_biobot.rod.published.machine import FRONT, LEG_ELEMENTS, PILLARS, SIDES

Array = NDArray[np.float64]

BEGIN = 0.1  # s, before which the published machine falls and nothing pulls
GROWTH = 1.0  # mN/s of the base force
RATE = 120.0  # samples a second of the diagnostics


def published_drive(walker: ElasticaWalker, strokes: Callable[[float], float]) -> Callable[[float], float]:
    """Drive of a machine that starts as published: base force and strokes, over the active force [1].

    Parameters
    ----------
    walker
        The machine; its base force is part of the drive.
    strokes
        Drive by the time since the first stroke [s: 1]; the code's is ``|sin(2 pi t)|``, two strokes a second.
    """
    share = walker.base_force / walker.active_force if walker.active_force > 0.0 else 0.0
    growth = GROWTH / walker.active_force if walker.active_force > 0.0 else 0.0

    def drive(time: float) -> float:
        since = time - BEGIN
        return 0.0 if since <= 0.0 else min(growth * since, share) + strokes(since)

    return drive


def beginning(
    design: Design, model: RodModel, strokes: Callable[[float], float]
) -> tuple[RodState | None, Callable[[float], float]]:
    """Start and drive of a design's walk: None for one that stands first, and the strokes themselves."""
    if design.walker is None or design.walker.start != Start.published:
        return None, strokes
    return model.drawn(), published_drive(walker_of(design), strokes)


def diagnostics(motion: Motion, rate: float = RATE) -> dict[str, Array]:
    """What the published code writes of its run, at equal times, and the feet's normal forces: columns with units.

    Notes
    -----
    *beam_middle*: node 8 of the right beam, along the machine. *foot_distance*: between the inner corners of the right
    feet. *friction*: of both feet of a pillar, forward, mean since the sample before (the code writes the kinetic part
    for the long pillar alone). *ring_push*: of the rings on the long pillar's outer side, forward, mean like friction.
    """
    model, times = motion.model, motion.times
    locate = model.atlas.locate
    found: dict[str, Array] = {"beam_middle_x_mm": path(motion, locate(("beam_right", 8)))[:, 0]}
    soles = []
    for pillar, inward in zip(PILLARS, (1.0, -1.0), strict=True):
        node, offset = locate((f"leg_{pillar}_right", LEG_ELEMENTS))
        radius = model.atlas.rods[f"leg_{pillar}_right"].sections[-1].radius or 0.0
        soles.append(path(motion, (node, offset + np.array([inward * radius, 0.0, 0.0]))))
    found["foot_distance_mm"] = np.linalg.norm(soles[1] - soles[0], axis=1)
    at = np.arange(int(np.floor((times[-1] - times[0]) * rate + 1e-9)) + 1) / rate + times[0]
    columns = {name: np.interp(at, times, values) for name, values in found.items()}
    held = {}
    for pillar in PILLARS:
        feet = [
            k
            for k, node in enumerate(model.assembly.contacts.node)
            if node in [locate((f"leg_{pillar}_{side}", LEG_ELEMENTS))[0] for side in SIDES]
        ]
        held[f"friction_{pillar}_mN"] = motion.contact_force[:, feet, 1].sum(axis=1)
        held[f"normal_{pillar}_mN"] = motion.contact_force[:, feet, 0].sum(axis=1)
    push, first = np.zeros(len(times)), 0
    for record in model.touches:
        count = len(record.nodes or ())
        if record.rod.startswith("ring_long") and record.nodes == tuple(FRONT):
            push -= motion.touch_force[:, first : first + count, 0].sum(axis=1)
        first += count
    held["ring_push_long_mN"] = push
    for name, force in held.items():
        columns[name] = _means(times, force, at)
    return {"time_s": at, **columns}


def _means(times: Array, force: Array, at: Array) -> Array:
    """Means of forces between the times `at` from means between `times`; the first is the first force."""
    impulse = np.concatenate([[0.0], np.cumsum(force[1:] * np.diff(times))])
    whole = np.diff(np.interp(at, times, impulse)) / np.diff(at)
    return np.concatenate([force[:1], whole])

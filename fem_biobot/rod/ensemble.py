"""Walks of rods from slightly different starts: the standing machine with small rigid motions added."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np

from fem_biobot.design import Design
from fem_biobot.ensembles import SEED, Ensemble, Nudge, check_counts, generator_of
from fem_biobot.rod.gait import Walk
from fem_biobot.rod.ground import Ground
from fem_biobot.rod.model import RodModel, RodState
from fem_biobot.rod.reduce import ground_of, reduce
from fem_biobot.rod.rest import Stance, stance
from fem_biobot.rod.walk import settings_of, walk


def nudged(standing: Stance, nudge: Nudge, generator: np.random.Generator) -> RodState:
    """The standing machine with a rigid motion drawn from the generator."""
    state = standing.state
    lift, velocity, spin = nudge.drawn(generator)
    v = np.concatenate([velocity + np.cross(spin, state.x - state.centre_of_mass), np.tile(spin, (len(state.x), 1))], 1)
    return RodState(state.model, state.x + lift, state.Q, v)


def walk_ensemble(
    machine: Design | RodModel,
    frequency: float | None = None,
    *,
    starts: int = 8,
    seed: int = SEED,
    nudge: Nudge | None = None,
    ground: Ground | None = None,
    beam_elements: int = 16,
    plate_factor: str = "none",
    listener: Callable[[int, Walk], None] | None = None,
    threads: int = 1,
    **keywords: Any,
) -> Ensemble[Walk]:
    """Walks of a machine from perturbed starts.

    Parameters
    ----------
    machine, frequency, ground, beam_elements, plate_factor
        As in `walk`.
    starts, seed
        Number of walks; the start of each follows from the seed and its number.
    nudge
        How far starts differ.
    listener
        Given the number and each walk, in the order of the numbers.
    threads
        Walks made side by side: the compiled steps hold no lock, and each motion is the same whatever runs beside it.
        An interrupt waits for those under way.
    keywords
        Of `walk`.

    Raises
    ------
    ModelError
        Fewer than one start or thread; what `walk` refuses.
    SolveError
        As `walk`.
    """
    check_counts("walk_ensemble", starts=starts, threads=threads)
    model = machine
    if isinstance(machine, Design):
        model = reduce(machine, beam_elements=beam_elements, plate_factor=plate_factor)
        ground = ground or ground_of(machine)
        given = {
            "frequency": machine.drive.frequency,
            "duration": machine.drive.duration,
            "step": machine.numerics.step,
            "settings": settings_of(machine),
        }
        given |= {"amplitude": machine.drive.amplitude, "waveform": machine.drive}
        keywords = given | {name: value for name, value in keywords.items() if value is not None}
    assert isinstance(model, RodModel)
    keywords |= {} if frequency is None else {"frequency": frequency}
    ground = ground or Ground()
    standing = stance(model, ground)

    def one(number: int) -> Walk:
        start = nudged(standing, nudge or Nudge(), generator_of(seed, number))
        return walk(model, ground=ground, start=start, rest=standing, **keywords)

    walks = []
    with ThreadPoolExecutor(threads) as pool:
        for number, found in enumerate(pool.map(one, range(starts)) if threads > 1 else map(one, range(starts))):
            walks.append(found)
            if listener is not None:
                listener(number, found)
    return Ensemble.of(walks, seed, "rod")

"""Walks of one solid from slightly different starts: the standing machine with small rigid motions added."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from fem_biobot.design import Design
from fem_biobot.ensembles import SEED, Ensemble, Nudge, check_counts, generator_of
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.solid.dynamics.body import MovingBody
from fem_biobot.solid.dynamics.book import begun
from fem_biobot.solid.dynamics.contact import untouched
from fem_biobot.solid.dynamics.motion import SolidCheckpoint
from fem_biobot.solid.gait import SolidWalk
from fem_biobot.solid.standing import Standing, stand
from fem_biobot.solid.walk import refuse_unwalkable, solid_ground, solid_walk, walking_body


def nudged(body: MovingBody, standing: Standing, nudge: Nudge, generator: np.random.Generator) -> SolidCheckpoint:
    """The standing machine with a rigid motion drawn from the generator; points above the ground bear nothing."""
    still = standing.checkpoint.state
    lift, velocity, spin = nudge.drawn(generator)
    x = body.system.space.points.T + still.u
    centre = body.node_mass @ x / body.total_mass
    v = velocity + np.cross(spin, x - centre)
    u = still.u + lift
    state = still._replace(u=u, v=v, change=np.zeros_like(v), touch=untouched(len(still.touch.state)))
    return SolidCheckpoint(state, begun(body, u, v, still.p), 0.0)


def solid_ensemble(
    design: Design,
    mesh: BodyMesh | MovingBody,
    frequency: float | None = None,
    *,
    starts: int = 8,
    seed: int = SEED,
    nudge: Nudge | None = None,
    start: Standing | None = None,
    listener: Callable[[int, SolidWalk], None] | None = None,
    **keywords: Any,
) -> Ensemble[SolidWalk]:
    """Walks of a design's solid from perturbed starts; its body, and how it stands, are found once for all.

    Parameters
    ----------
    design, mesh, frequency
        As in `solid_walk`.
    starts, seed
        Number of walks; the start of each follows from the seed and its number, and is that of the rods' with the same.
    nudge
        How far starts differ.
    start
        How the machine stands; found first by default.
    listener
        Given the number and each walk, in the order of the numbers.
    keywords
        Of `solid_walk`.

    Returns
    -------
    Ensemble
        Walks whose `start` is the standing machine without its nudge, from which closings count, and their gaits.

    Raises
    ------
    ModelError
        Fewer than one start.
    DesignError, MeshError, SolveError
        As `solid_walk`.
    """
    check_counts("solid_ensemble", starts=starts)
    refuse_unwalkable(design)
    body = mesh if isinstance(mesh, MovingBody) else walking_body(design, mesh)
    given = {name: keywords[name] for name in ("feet", "settings") if name in keywords}
    stood = start or stand(design, body, solid_ground(design), **given)
    walks: list[SolidWalk] = []
    for number in range(starts):
        pushed = nudged(body, stood, nudge or Nudge(), generator_of(seed, number))
        found = solid_walk(
            design, body, frequency=frequency, start=replace(stood, checkpoint=pushed), **keywords
        )  # fmt: skip
        walks.append(replace(found, start=stood))
        if listener is not None:
            listener(number, walks[-1])
    return Ensemble.of(walks, seed, "solid")

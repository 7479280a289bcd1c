"""Both models levelled, their chord along x: from the side, for a picture that lays one over the other, and whole."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np

from fem_biobot.design import Design
from fem_biobot.link.observed import Array, rotation
from fem_biobot.link.rod_side import PILLARS, RodSide
from fem_biobot.link.solid_side import SolidSide
from fem_biobot.mesh.facets import facets
from fem_biobot.rod.model import RodState
from fem_biobot.solid.model import SolidState

State = TypeVar("State", SolidState, RodState)


@dataclass(frozen=True, eq=False)
class Levelled(Generic[State]):
    """A state of a model at a tension [kPa], and what levels it: `turn` (3, 3) about `middle` (3,) [mm]."""

    tension: float
    state: State
    turn: Array
    middle: Array

    def place(self, points: Array) -> Array:
        """Positions (3, n) [mm] of the model, levelled."""
        return self.turn @ (points - self.middle[:, None])


Both = tuple[tuple[Levelled[SolidState], Levelled[RodState]], ...]


def level_both(
    solid: SolidSide,
    solid_states: Sequence[SolidState],
    rods: RodSide,
    rod_states: Sequence[RodState],
    tensions: Sequence[float],
) -> Both:
    """States of both models at the tensions [kPa] that both reached, with what levels them."""

    def levelled(side: SolidSide | RodSide, state: State, tension: float) -> Levelled[State]:
        points = side.points(state)  # pyright: ignore[reportArgumentType]  (each side has its own states)
        return Levelled(tension, state, rotation(-points.tilt), 0.5 * (points.axis[0] + points.axis[-1]))

    return tuple(
        (levelled(solid, a, tension), levelled(rods, b, tension))
        for tension, a, b in zip(tensions, solid_states, rod_states, strict=False)
    )


def solid_outline(side: SolidSide, state: SolidState) -> Array:
    """Triangles of the deformed surface in x and z, (f, 3, 2) [mm]."""
    found = facets(side.mesh.cells)
    corners = found.triples[:, found.boundary]
    # vertices come first among the nodes
    x = side.model.system.space.points[:, : side.mesh.n_vertices] + state.u[:, : side.mesh.n_vertices]
    points = side.points(state)
    level = (x.T - 0.5 * (points.axis[0] + points.axis[-1])) @ rotation(-points.tilt).T
    return np.asarray(level[corners.T][..., (0, 2)], dtype=float)


def rod_outline(side: RodSide, design: Design, state: RodState) -> list[Array]:
    """Beam axis, the edges of the pillars, and the muscles, polylines in x and z, (p, 2) [mm] each."""
    points = side.points(state)
    middle, turn = 0.5 * (points.axis[0] + points.axis[-1]), rotation(-points.tilt)
    half, z = design.value("skeleton.pillar_length") / 2, design.beam_axis_height
    lines = [points.axis]
    for name, (x, height) in zip(PILLARS, (design.pillars[0], design.pillars[-1]), strict=True):
        corners = [(x - half, z), (x - half, z - height), (x + half, z - height), (x + half, z), (x - half, z)]
        lines.append(np.array([state.at((name, (a, 0.0, b))) for a, b in corners]))
    for k, ends in enumerate(side.model.assembly.members.nodes):
        offsets = side.model.assembly.members.offset[k]
        lines.append(np.array([state.x[n] + state.Q[n].T @ r for n, r in zip(ends, offsets, strict=True)]))
    return [((line - middle) @ turn.T)[:, (0, 2)] for line in lines]

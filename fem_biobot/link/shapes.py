"""Both models from the side, levelled: what a picture lays one over the other."""

from __future__ import annotations

import numpy as np

from fem_biobot.design import Design
from fem_biobot.link.observed import Array, rotation
from fem_biobot.link.rod_side import PILLARS, RodSide
from fem_biobot.link.solid_side import SolidSide
from fem_biobot.mesh.facets import facets
from fem_biobot.rod.model import RodState
from fem_biobot.solid.model import SolidState


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

"""Pictures of a solid and of rods that walked under one drive: over time, in phase space, one laid over the other."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from fem_biobot.mesh.facets import facets
from fem_biobot.rod.gait import Walk
from fem_biobot.rod.records import Muscle
from fem_biobot.solid.gait import SolidWalk
from fem_biobot.view.animation import Outline, Silhouette, write_gait
from fem_biobot.view.machine import GEL, MUSCLE
from fem_biobot.view.together import Way, phase_portrait, together

Array = np.ndarray

_SHOWN, _RATE = 2.0, 25.0  # s of a walk in the film, in whole strokes; frames a second
_LINE = "#0b3d91"


def draw_together(figures: Path, solid: SolidWalk, rods: Walk) -> list[tuple[Path, str]]:
    """Position, stroke and foot forces over time, the phase portrait, and the film, with captions."""
    at, name = f"{solid.frequency:g} Hz", f"{solid.frequency:g}Hz".replace(".", "p")
    ways = {"solid": way_of(solid), "rods": way_of(rods)}
    out = [(figures / f"together_{name}.png", f"Solid and rods under one drive at {at}.")]
    together(out[-1][0], ways, strokes=solid.stroke_ends, title=f"Solid and rods at {at}")
    out.append((figures / f"phase_{name}.png", f"Phase portrait of solid and rods at {at}, without the transient."))
    since = float(solid.stroke_ends[solid.kept.start]) if solid.strokes else 0.0
    phase_portrait(out[-1][0], ways, since=since, title=f"Phase portrait at {at}")
    if solid.strokes and rods.strokes:
        words = f"The solid (filled) and the rods (lines) at {at}, the last strokes at life's speed, on one ground."
        out.append((figures / f"together_{name}.gif", words))
        film(out[-1][0], solid, rods)
    return out


def way_of(walk: SolidWalk | Walk) -> Way:
    """A walk as it is drawn beside others."""
    names = walk.feet if isinstance(walk, SolidWalk) else walk.anatomy.feet
    forces = {name: walk.foot_force[:, k, :2] for k, name in enumerate(names)}
    return Way(walk.times, walk.advance, walk.tip_closing, forces)


def film(path: Path, solid: SolidWalk, rods: Walk) -> int:
    """Both machines from the side at the same times, over the last whole strokes that both made; frames written."""
    ends = solid.stroke_ends
    last = min(solid.strokes, rods.strokes)
    first = max(0, last - max(1, math.floor(_SHOWN * solid.frequency + 1e-9)))
    inside = (solid.times >= ends[first] - 1e-9) & (solid.times <= ends[last] + 1e-9)
    times, plane = solid.times[inside], np.array([solid.ground.axes[1], solid.ground.axes[0]])
    motion = solid.motion
    system, mesh = motion.body.system, motion.body.model.mesh
    # vertices come first among the nodes
    X = system.space.points[:, : mesh.n_vertices]
    seen = np.array([plane @ (X + motion.u[i][:, : mesh.n_vertices]) for i in np.flatnonzero(inside)])
    parts = []
    for region, colour in (("skeleton", GEL), ("muscle", MUSCLE)):
        found = facets(mesh.cells[:, mesh.regions[region]])
        used, triangles = np.unique(found.triples[:, found.boundary], return_inverse=True)
        parts.append(Silhouette(seen[:, :, used], triangles.reshape(3, -1), colour))
    lines = [Outline(_resampled(line, rods.times, times), _LINE, "rods") for line in _lines(rods, plane)]
    title = f"{solid.design.name} at {solid.frequency:g} Hz: solid and rods"
    return write_gait(path, times, parts, {}, outlines=lines, ground=solid.ground.height, rate=_RATE, title=title)


def _lines(walk: Walk, plane: Array) -> list[Array]:
    """Beams, edges of the bodies that stand on the ground, and muscles of rods, from the side, (t, 2, n) each."""
    atlas, motion = walk.model.atlas, walk.motion

    def seen(places: list[tuple[str, int | tuple[float, float, float]]]) -> Array:
        found = []
        for node, offset in (atlas.locate(place) for place in places):
            found.append(motion.x[:, node] + np.einsum("tji,j->ti", motion.Q[:, node], offset))
        return np.einsum("ac,ntc->tan", plane, np.array(found))

    lines = [seen([(rod.name, i) for i in range(len(rod.points))]) for rod in walk.model.rods]
    for body in walk.model.bodies:
        for centre, edges in body.boxes:
            x, y, z = centre
            a, c = edges[0] / 2.0, edges[2] / 2.0
            corners = [(x - a, y, z - c), (x + a, y, z - c), (x + a, y, z + c), (x - a, y, z + c), (x - a, y, z - c)]
            lines.append(seen([(body.name, corner) for corner in corners]))
    lines += [seen([member.a, member.b]) for member in walk.model.members if isinstance(member, Muscle)]
    return lines


def _resampled(values: Array, times: Array, wanted: Array) -> Array:
    """Values (t, 2, n) at other times, linear between samples."""
    flat = values.reshape(len(times), -1)
    i = np.clip(np.searchsorted(times, wanted, side="right") - 1, 0, len(times) - 2)
    share = np.clip((wanted - times[i]) / (times[i + 1] - times[i]), 0.0, 1.0)[:, None]
    return ((1.0 - share) * flat[i] + share * flat[i + 1]).reshape(len(wanted), *values.shape[1:])

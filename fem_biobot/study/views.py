"""Interactive views of results: the solid in its states, rods in states or over time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fem_biobot.design import Design
from fem_biobot.link.shapes import Both
from fem_biobot.rod.gait import Walk
from fem_biobot.rod.ground import Ground
from fem_biobot.rod.model import RodState
from fem_biobot.rod.tube_stress import normal_stress
from fem_biobot.rod.tubes import Piece, ground_square, pieces
from fem_biobot.solid.model import SolidState
from fem_biobot.study.outputs import machine_of, nodal_fields, shape_of
from fem_biobot.study.plan import Found
from fem_biobot.view.interactive import Moving
from fem_biobot.view.machine import GEL, MUSCLE, Shape
from fem_biobot.view.moving import GROUND, machine_view, side_by_side, stress_field
from fem_biobot.view.surface import feature_edges

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

ROD_STRESS = "normal stress along rods and muscles, size [kPa]"
MOST_WALKS = 6  # of one page: browsers keep a limited number of views alive
_SHOWN = 2.0  # s of a walk, in whole strokes
_MOST_TIMES = 160
_LINES = 12  # of the grid on the ground, about, along its longer side


def solid_views(design: Design, states: Sequence[Found]) -> list[Moving]:
    """Interactive views of a job's states, one for each state of the tissue: as moulded, and remodelled."""
    machine, views = machine_of(design, states[0].state), []
    rest = next((f for f in states if f.wanted.key in ("rest", "load_0")), None)
    for reference, word in (("as_moulded", ""), ("remodelled", ", remodelled tissue")):
        own = [f for f in states if f.wanted.reference == reference and f is not rest]
        own.sort(key=lambda f: (f.state.step.load, f.state.step.tension))
        if not own:
            continue
        shapes = [shape_of(design, f.state, f.wanted.key, f.wanted.label) for f in (*([rest] if rest else []), *own)]
        views.append(machine_view(machine, shapes, title=f"Solid model{word}"))
    return views


def both_view(design: Design, levelled: Both) -> Moving:
    """The solid and, behind it, the rods at the same tensions, levelled, under one colour bar."""
    solids, rods = zip(*levelled, strict=True)
    labels = [f"{each.tension:.3g} kPa" for each in solids]
    machine, shapes = machine_of(design, solids[0].state), []
    for each, label in zip(solids, labels, strict=True):
        fields, points = nodal_fields(each.state), each.state.model.system.space.points
        shapes.append(Shape("", label, each.place(points + each.state.u) - points, fields["von_mises_kPa"]))
    first = machine_view(machine, shapes, title="", from_rest=False)
    second = rod_view([each.state for each in rods], title="", labels=labels)
    placed = np.array([each.place(p) for each, p in zip(rods, second.points, strict=True)])
    return side_by_side(
        first,
        replace(second, points=placed),
        title="Solid and rods at the same tensions",
        words=("solid:", "rods:"),
        label="stress [kPa]: von Mises in the solid, normal stress (its size) in the rods",
    )


def state_view(design: Design, state: SolidState, *, title: str, label: str) -> Moving:
    """A body at rest and in one state."""
    nothing = np.zeros_like(state.u)
    rest = shape_of(design, replace(state, u=nothing), "rest", "at rest")
    flat = {name: None if (v := getattr(rest, name)) is None else 0.0 * v for name in ("von_mises", "fibre_stress")}
    return machine_view(
        machine_of(design, state), [replace(rest, **flat), shape_of(design, state, "state", label)], title=title
    )


def walk_view(walk: Walk, *, shown: float = _SHOWN) -> Moving:
    """Rods of a walk's last whole strokes, as many as `shown` seconds hold but at least one, over a grid on the ground.

    A walk without a whole stroke is shown whole.
    """
    motion = walk.motion
    times, strokes = walk.times, min(walk.strokes, max(1, math.floor(shown * walk.frequency + 1e-9)))
    begin, end = (walk.stroke_ends[-1 - strokes], walk.stroke_ends[-1]) if strokes else (times[0], times[-1])
    inside = np.flatnonzero((times >= begin - 1e-9) & (times <= end + 1e-9))
    inside = inside[:: math.ceil(len(inside) / _MOST_TIMES)]
    where = "" if walk.design is None else ", in air" if walk.design.ground.immersion == "air" else ", submerged"
    return rod_view(
        [motion.state(int(i)) for i in inside],
        title=f"Rods walking at {walk.frequency:g} Hz{where}",
        times=times[inside],
        ground=walk.ground,
    )


def rod_view(
    states: Sequence[RodState],
    *,
    title: str,
    labels: Sequence[str] = (),
    times: Array | None = None,
    ground: Ground | None = None,
) -> Moving:
    """Surfaces of an assembly in states, or at times, coloured by the size of their normal stress.

    Parameters
    ----------
    states
        Of one model.
    title, labels, times
        As of `Moving`.
    ground
        Drawn as a grid; None for none.
    """
    parts = pieces(states[0].model)
    x, Q = np.array([s.x for s in states]), np.array([s.Q for s in states])
    points = np.concatenate([piece.points(x, Q) for piece in parts], axis=2)
    stress = np.abs([normal_stress(state, parts) for state in states])
    counts = [piece.points(x[0], Q[0]).shape[1] for piece in parts]
    first = np.cumsum([0, *counts[:-1]])
    triangles = np.hstack([piece.triangles + k for piece, k in zip(parts, first, strict=True)])
    of_piece = np.repeat(np.arange(len(parts)), [piece.triangles.shape[1] for piece in parts])
    edges = feature_edges(points[0], triangles, group=of_piece)
    names = {"hydrogel": GEL, "muscle": MUSCLE}
    part = np.repeat([int(is_tissue(piece)) for piece in parts], counts)
    caption = "To scale."
    if ground is not None:
        grid, lines, spacing = _grid(ground, points)
        edges = np.hstack([edges, lines + points.shape[2]])
        points = np.concatenate([points, np.broadcast_to(grid, (len(points), *grid.shape))], axis=2)
        part = np.concatenate([part, np.full(grid.shape[1], len(names))])
        stress = np.hstack([stress, np.full((len(stress), grid.shape[1]), np.nan)])
        names |= {"ground": GROUND}
        caption += f" Lines on the ground: {spacing:g} mm apart."
    field = [stress_field(ROD_STRESS, stress, stress)] if np.isfinite(stress).any() else []
    first = 0 if times is not None else -1
    return Moving(title, points, triangles, part, names, labels, times, edges, field, caption, first)


def is_tissue(piece: Piece) -> bool:
    """Whether a piece is muscle tissue rather than gel."""
    return piece.kind == "muscle" or piece.name.startswith(("ring", "fibre"))


def _grid(ground: Ground, points: Array) -> tuple[Array, Ints, float]:
    """Points (3, p) and lines (2, l) of a grid below the points (k, 3, n) of all moments, and its spacing [mm]."""
    square = ground_square(ground, points.swapaxes(0, 1).reshape(3, -1), margin=0.1)
    corner, ahead, across = square[:, 0], square[:, 1] - square[:, 0], square[:, 3] - square[:, 0]
    lengths = [float(np.linalg.norm(side)) for side in (ahead, across)]
    spacing = next(s for s in (a * 10.0**e for e in range(-3, 7) for a in (1, 2, 5)) if max(lengths) / s <= _LINES)
    found = []
    for side, other, length in ((ahead, across, lengths[0]), (across, ahead, lengths[1])):
        for k in range(math.floor(length / spacing) + 1):
            start = corner + side / length * spacing * k
            found += [start, start + other]
    grid = np.array(found).T
    return grid, np.arange(grid.shape[1]).reshape(-1, 2).T, spacing

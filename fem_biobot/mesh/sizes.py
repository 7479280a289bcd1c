"""How large elements are: in proportion to a design's parts, or as a solution on another mesh asks for.

Speaks to the Gmsh that it is handed and imports none, as `solids` does.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem_biobot.mesh.facets import signed_volumes
from fem_biobot.mesh.layout import Box, Layout

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

# Element sizes as shares of the general size. At a size equal to the beam's thickness the thin muscle has two
# elements across, whatever its thickness, and a ring one.
JUNCTION_ACROSS = 2.0
RING_ACROSS = 1.0
CORNER_SHARE = 0.4
# the middle of a corner line, where the stress is averaged in a ball, within this share of the beam's thickness
CORNER_MIDDLE_SHARE = 0.2
CORNER_MIDDLE_REACH = 0.4
# The same of meshes for the closing, found by halving one after the other and asking what that gives for its unknowns:
# the junction's middle has no share in the closing's error, the beam's span and corners have, and most of all the
# edges by which a junction enters the rings.
CLOSING_JUNCTION_ACROSS = 1.2
CLOSING_CORNER_SHARE, CLOSING_SPAN_SHARE = 0.112, 0.45
ENTRY_SHARE, LEG_SHARE = 0.09, 0.24
# of a ring's thickness: how far about the edges; of a junction's half width: how far along the ring's leg
ENTRY_REACH, LEG_REACH = 0.15, 1.8
# of a ring's thickness: how far about the pillars' vertical edges, where it wraps around them unbonded
EDGE_REACH = 0.15
# how fast elements grow with the distance from a refined part
GROWTH, CLOSING_GROWTH = 0.45, 0.5


@dataclass(frozen=True, eq=False)
class SizeField:
    """Element sizes at the vertices of a mesh.

    Attributes
    ----------
    points, cells
        Vertices (3, n) [mm] and tetrahedra (4, e) of the mesh on which the sizes are known.
    values
        Sizes at its vertices, (n,) [mm].
    """

    points: Array
    cells: Ints
    values: Array

    @property
    def n_elements(self) -> float:
        """About how many elements they ask for: volume over that of a regular tetrahedron of the size."""
        volumes = np.abs(signed_volumes(self.points, self.cells))
        return float(np.sum(volumes * 6.0 * np.sqrt(2.0) / self.values[self.cells].mean(axis=0) ** 3))

    def shortened(self, factor: float) -> SizeField:
        """The same elements, in number, on a body whose lengths along y are divided by `factor`."""
        divided = np.array([1.0, factor, 1.0])[:, None]
        return SizeField(self.points / divided, self.cells, self.values / factor ** (1.0 / 3.0))


def set_sizes(field: Any, plan: Layout, h: float, corner_share: float) -> None:
    """Element size: `h` in general, finer in thin muscle, rings and re-entrant corners, growing smoothly away."""
    growth = CLOSING_GROWTH if plan.for_closing else GROWTH
    tags = []
    for box, inside in _zones(plan, h, corner_share):
        if inside >= h:
            continue
        tag = field.add("Box")
        for key, value in zip(("XMin", "YMin", "ZMin"), box.low, strict=True):
            field.setNumber(tag, key, value)
        for key, value in zip(("XMax", "YMax", "ZMax"), box.high, strict=True):
            field.setNumber(tag, key, value)
        field.setNumber(tag, "VIn", inside)
        field.setNumber(tag, "VOut", h)
        field.setNumber(tag, "Thickness", (h - inside) / growth)
        tags.append(tag)
    everywhere = field.add("MathEval")
    field.setString(everywhere, "F", repr(h))
    smallest = field.add("Min")
    field.setNumbers(smallest, "FieldsList", [*tags, everywhere])
    field.setAsBackgroundMesh(smallest)


def take_sizes(gmsh: Any, sizes: SizeField) -> None:
    """Element sizes from values at the vertices of another mesh of the same body."""
    corners = sizes.points[:, sizes.cells]  # (axis, corner, e)
    rows = np.concatenate([corners.reshape(12, -1), sizes.values[sizes.cells]]).T
    view = gmsh.view.add("sizes")
    gmsh.view.addListData(view, "SS", len(rows), rows.ravel())
    field = gmsh.model.mesh.field
    tag = field.add("PostView")
    field.setNumber(tag, "ViewTag", view)
    field.setAsBackgroundMesh(tag)


def _zones(plan: Layout, h: float, corner_share: float) -> Iterator[tuple[Box, float]]:
    """Refined parts of a bot and their element sizes; a strip or a cantilever is meshed evenly."""
    if not plan.pillars or plan.beam is None:
        return
    thickness = plan.beam.high[2] - plan.beam.low[2]
    across = JUNCTION_ACROSS
    if plan.for_closing:
        across, corner_share = CLOSING_JUNCTION_ACROSS, min(corner_share, CLOSING_CORNER_SHARE)
        yield from _closing_zones(plan, h)
    for box in plan.thin:
        yield box, (box.high[2] - box.low[2]) * h / (across * thickness)
    for hole in plan.holes:
        ring = next(box for box in plan.muscle if box not in plan.thin and box.low[0] < hole.low[0] < box.high[0])
        yield ring, (hole.low[0] - ring.low[0]) * h / (RING_ACROSS * thickness)
    if plan.edge_share < 1.0:
        yield from _edge_zones(plan, h / thickness)
    r = plan.fillet_radius
    for start, end, sign in plan.corner_lines:
        x0, x1 = sorted((start[0], start[0] + sign * r))
        box = Box((x0, start[1], start[2] - r), (x1, end[1], end[2]))
        # two elements along a fillet's arc
        yield box, min(corner_share * h, r * np.pi / 4) if r else corner_share * h
    for name in ("corner_short", "corner_long"):
        x, y, z = plan.landmarks[name]
        d = CORNER_MIDDLE_REACH * thickness
        yield Box((x - d, y - d, z - d), (x + d, y + d, z + d)), min(corner_share, CORNER_MIDDLE_SHARE) * h


def _edge_zones(plan: Layout, coarseness: float) -> Iterator[tuple[Box, float]]:
    """About the pillars' vertical edges, as high as the rings and a little higher; elements in proportion to these."""
    hole, ring = plan.holes[0], plan.muscle[0]
    w = hole.low[0] - ring.low[0]
    d = EDGE_REACH * w
    for pillar in plan.pillars:
        for x in (pillar.low[0], pillar.high[0]):
            for y in (pillar.low[1], pillar.high[1]):
                box = Box((x - d, y - d, hole.low[2] - d), (x + d, y + d, hole.high[2] + d))
                yield box, plan.edge_share * w * coarseness / RING_ACROSS


def _closing_zones(plan: Layout, h: float) -> Iterator[tuple[Box, float]]:
    """Where the tips' closing is decided: spans of the beam, legs of rings at a junction, edges of its entries."""
    assert plan.beam is not None
    for left, right in pairwise(plan.pillars):
        low, high = plan.beam.low, plan.beam.high
        yield Box((left.high[0], low[1], low[2]), (right.low[0], high[1], high[2])), CLOSING_SPAN_SHARE * h
    for junction in plan.thin:
        half, (_, _, z0), (_, _, z1) = junction.high[1], junction.low, junction.high
        for ring, hole in zip((box for box in plan.muscle if box not in plan.thin), plan.holes, strict=True):
            w, reach = hole.low[0] - ring.low[0], LEG_REACH * half
            d = ENTRY_REACH * w
            # the ring's leg on the junction's side, and its face there
            if abs(junction.low[0] - hole.high[0]) < w:
                leg, face = (hole.high[0], ring.high[0]), ring.high[0]
            elif abs(junction.high[0] - hole.low[0]) < w:
                leg, face = (ring.low[0], hole.low[0]), ring.low[0]
            else:
                continue
            yield Box((leg[0], -reach, ring.low[2]), (leg[1], reach, ring.high[2])), LEG_SHARE * h
            for z in (z0, z1):
                yield Box((face - d, -half, z - d), (face + d, half, z + d)), ENTRY_SHARE * h
            for y in (-half, half):
                yield Box((face, y, z0), (face, y, z1)), ENTRY_SHARE * h

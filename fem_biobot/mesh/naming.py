"""Find the named surfaces and landmarks of a design in a mesh of it, by position and neighbourhood.

Works on any mesh that fits the design, so our own and a stranger's get their names in the same way.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from fem_biobot.errors import MeshError
from fem_biobot.mesh.facets import Facets, row_keys
from fem_biobot.mesh.layout import Face, Layout

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

# positions within this share of the body's size are the same: far above rounding, far below any element
SAME = 1e-7


def named_surfaces(plan: Layout, points: Array, table: Facets, region_of: Ints, names: list[str]) -> dict[str, Ints]:
    """Surfaces of a design as vertex triples, (3, f) each.

    Boundary surfaces look out of their region, `interface` from skeleton to muscle, sections toward +x.

    Parameters
    ----------
    plan
        Layout of the design.
    points
        Vertices, (3, n) [mm].
    table
        Facets of the mesh.
    region_of
        Number of the region of each element, (e,).
    names
        Names of the regions by number.
    """
    scale = float(np.ptp(points, axis=1).max())
    surfaces = {}
    for name, box_face in plan.faces.items():
        face = _reaching(plan, name, box_face)
        chosen = _on_face(face, points, table, SAME * scale)
        if face.region is None:
            number = names.index("muscle")
            inside = region_of[table.elements[:, chosen]] == number
            keep = inside.all(axis=0) & (table.elements[1, chosen] >= 0)
            surfaces[name] = _toward(points, table.triples[:, chosen[keep]], face.axis)
        elif face.region in names:
            own = region_of == names.index(face.region)
            surfaces[name] = _skin(table, own, chosen)
            if not surfaces[name].size and name.startswith("pillar_"):
                surfaces[name] = _facing(
                    face,
                    _place(plan, face),
                    points,
                    _skin(table, own, np.arange(table.triples.shape[1])),
                    SAME * scale,
                )
    if {"skeleton", "muscle"} <= set(names):
        surfaces["interface"] = interface(table, region_of, names)
    return {name: triples for name, triples in surfaces.items() if triples.size}


def interface(table: Facets, region_of: Ints, names: list[str]) -> Ints:
    """Facets between skeleton and muscle, (3, f), with the normal from skeleton to muscle."""
    inner = np.flatnonzero(table.elements[1] >= 0)
    pair = region_of[table.elements[:, inner]]
    between = pair[0] != pair[1]
    triples = table.triples[:, inner[between]]
    flip = pair[0, between] != names.index("skeleton")
    triples[:, flip] = triples[::-1, flip]
    return triples


def oriented(surfaces: Mapping[str, Ints], table: Facets, region_of: Ints, names: list[str]) -> dict[str, Ints]:
    """The same surfaces, looking out of the body, and from skeleton to muscle where they lie between these.

    Facets inside one region keep their side; a file may number the others either way round.
    """
    n = int(table.triples.max()) + 1
    turned = {}
    for name, triples in surfaces.items():
        keys = row_keys(np.concatenate([table.triples, triples], axis=1), n)
        known, asked = keys[: table.triples.shape[1]], keys[table.triples.shape[1] :]
        order = np.argsort(known)
        facet = order[np.searchsorted(known[order], asked)]
        first, second = table.elements[:, facet]
        same = (second >= 0) & (region_of[first] == region_of[second])
        # out of the first element, which is the skeleton's at an interface
        wanted = table.triples[:, facet].copy()
        if "skeleton" in names:
            back = (second >= 0) & ~same & (region_of[first] != names.index("skeleton"))
            wanted[:, back] = wanted[::-1, back]
        wanted[:, same] = triples[:, same]
        turned[name] = wanted
    return turned


def named_landmarks(wanted: Mapping[str, tuple[float, float, float]], points: Array) -> dict[str, int]:
    """Vertices at the given positions; those of `wanted` at which no vertex lies are left out."""
    scale = float(np.ptp(points, axis=1).max())
    found = {}
    for name, position in wanted.items():
        distance = np.linalg.norm(points - np.array(position)[:, None], axis=0)
        nearest = int(distance.argmin())
        if distance[nearest] <= SAME * scale:
            found[name] = nearest
    return found


class MissingError(MeshError):
    """A mesh lacks what its design names; `kind` is ``surface`` or ``landmark``."""

    def __init__(self, kind: str, names: list[str]) -> None:
        self.kind = kind
        super().__init__(f"the mesh has no {kind} {', '.join(names)}, which its design asks for")


def require(kind: str, wanted: Mapping[str, object], found: Mapping[str, object]) -> None:
    """Refuse a mesh that lacks a surface or landmark which the design promises; see `MissingError`."""
    missing = sorted(set(wanted) - set(found))
    if missing:
        raise MissingError(kind, missing)


def _reaching(plan: Layout, name: str, face: Face) -> Face:
    """A pillar's face, for pillars wider than their boxes: all widths, and soles to half way between pillars."""
    if not name.startswith(("foot_", "pillar_")) or not plan.pillars:
        return face
    low, high = list(face.low), list(face.high)
    low[1], high[1] = -np.inf, np.inf
    if face.axis == 2:
        low[0], high[0] = _place(plan, face)
    return replace(face, low=(low[0], low[1], low[2]), high=(high[0], high[1], high[2]))


def _place(plan: Layout, face: Face) -> tuple[float, float]:
    """Where along x a pillar is whose face this is: half way to the next ones, with no end beyond the outermost."""
    ends = [-np.inf, *(0.5 * (p.high[0] + q.low[0]) for p, q in pairwise(plan.pillars)), np.inf]
    k = int(np.searchsorted(ends, 0.5 * (face.low[0] + face.high[0]))) - 1
    return ends[k], ends[k + 1]


def _on_face(face: Face, points: Array, table: Facets, tolerance: float) -> Ints:
    inside = np.abs(points[face.axis] - face.at) <= tolerance
    for k in range(3):
        if k != face.axis:
            inside &= (points[k] >= face.low[k] - tolerance) & (points[k] <= face.high[k] + tolerance)
    return np.flatnonzero(inside[table.triples].all(axis=0))


def _skin(table: Facets, own: NDArray[np.bool_], chosen: Ints) -> Ints:
    """Those facets that bound `own` elements, (e,), as triples that look out of them, (3, f)."""
    first, second = table.elements[:, chosen]
    inside, beyond = own[first], (second >= 0) & own[second]
    triples = table.triples[:, chosen]
    triples[:, beyond] = triples[::-1, beyond]
    return triples[:, inside != beyond]


def _facing(face: Face, place: tuple[float, float], points: Array, triples: Ints, tolerance: float) -> Ints:
    """Of a skin's triples those on the side of a pillar that is no box: they look as the face does, more than else.

    They are between the face's heights, and from the box's middle on its side to the pillar's `place` along x.
    """
    corners = points[:, triples]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0], axis=0)
    middle = 0.5 * (face.low[0] + face.high[0])
    side = np.sign(face.at - middle)
    looks = (side * normal[0] > 0.0) & (np.abs(normal[0]) >= np.abs(normal[1:]).max(axis=0))
    near = (side * (corners[0] - middle) >= -tolerance) & (corners[0] >= place[0]) & (corners[0] <= place[1])
    inside = (corners[2] >= face.low[2] - tolerance) & (corners[2] <= face.high[2] + tolerance)
    return triples[:, looks & (near & inside).all(axis=0)]


def _toward(points: Array, triples: Ints, axis: int) -> Ints:
    """The triangles turned so that their normals have a positive component along `axis`."""
    a, b, c = (points[:, row] for row in triples)
    back = np.cross(b - a, c - a, axis=0)[axis] < 0
    turned = triples.copy()
    turned[:, back] = triples[::-1, back]
    return turned

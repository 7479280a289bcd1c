"""Find the named surfaces and landmarks of a design in a mesh of it, by position and neighbourhood.

Works on any mesh that fits the design, so our own and a stranger's get their names in the same way.
"""

from __future__ import annotations

from collections.abc import Mapping

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
    for name, face in plan.faces.items():
        chosen = _on_face(face, points, table, SAME * scale)
        first = region_of[table.elements[0, chosen]]
        second = np.where(table.elements[1, chosen] < 0, -1, region_of[table.elements[1, chosen]])
        triples = table.triples[:, chosen]
        if face.region is None:
            number = names.index("muscle")
            keep = (first == number) & (second == number)
            surfaces[name] = _toward(points, triples[:, keep], face.axis)
        elif face.region in names:
            number = names.index(face.region)
            keep = (first == number) != (second == number)
            flip = keep & (second == number)
            triples[:, flip] = triples[::-1, flip]
            surfaces[name] = triples[:, keep]
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


def _on_face(face: Face, points: Array, table: Facets, tolerance: float) -> Ints:
    inside = np.abs(points[face.axis] - face.at) <= tolerance
    for k in range(3):
        if k != face.axis:
            inside &= (points[k] >= face.low[k] - tolerance) & (points[k] <= face.high[k] + tolerance)
    return np.flatnonzero(inside[table.triples].all(axis=0))


def _toward(points: Array, triples: Ints, axis: int) -> Ints:
    """The triangles turned so that their normals have a positive component along `axis`."""
    a, b, c = (points[:, row] for row in triples)
    back = np.cross(b - a, c - a, axis=0)[axis] < 0
    turned = triples.copy()
    turned[:, back] = triples[::-1, back]
    return turned

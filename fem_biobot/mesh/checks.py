"""What every solver relies on: whole regions, right-handed elements, no orphan, no seam that only looks closed.

Each check raises `MeshError` on the first defect, with what was found, where, and what was expected.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from fem_biobot.errors import MeshError
from fem_biobot.mesh.facets import Facets, facets, row_keys, signed_volumes

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

# An element flatter than this share of the cube of its longest edge has no volume left but rounding.
FLAT = 1e-12
# Vertices closer than this share of the shortest edge are meant to be one.
TOGETHER = 1e-4
# A coordinate beyond this [mm] is a damaged number, not a body.
FAR = 1e9
# other units of length that a mesh may come in, in mm
UNITS = {"m": 1e3, "cm": 10.0, "um": 1e-3}
# Straight-sided bodies meet their closed-form volumes to rounding of a sum of many elements.
VOLUME = 1e-9


def check(
    points: Array,
    cells: Ints,
    regions: Mapping[str, Ints],
    surfaces: Mapping[str, Ints],
    landmarks: Mapping[str, int],
) -> None:
    """Refuse a mesh that a solver could not trust; see `BodyMesh` for the arguments."""
    _shapes(points, cells)
    region_of = _regions(regions, cells.shape[1])
    names = list(regions)
    _orientation(points, cells, region_of, names)
    _duplicate_cells(cells)
    _orphans(cells, points.shape[1], landmarks)
    table = facets(cells)
    _crowded(points, table)
    _coincident(points, cells, region_of, names)
    _seams(points, table, region_of, names)
    _connected(table, cells.shape[1])
    _surfaces(surfaces, table, points.shape[1])


def check_regions(found: Collection[str], expected: Collection[str]) -> None:
    """Refuse a mesh that has not the regions of the design."""
    if set(found) != set(expected):
        missing, extra = [n for n in expected if n not in found], [n for n in found if n not in expected]
        words = [f"no {_list(missing)}"] if missing else []
        words += [f"{_list(extra)}, which the design has not"] if extra else []
        raise MeshError(
            f"the mesh has the regions {_list(found)}: found {' and '.join(words)}, expected {_list(expected)}; "
            "name a volume of another name with --rename NAME=REGION"
        )


def check_volumes(
    found: Mapping[str, float], expected: Mapping[str, float], slack: Mapping[str, float], of: str = "the design"
) -> None:
    """Refuse a mesh whose regions are not those of the design.

    Parameters
    ----------
    found, expected
        Region to volume, in the mesh and in closed form [mm^3].
    slack
        Region to the allowed deviation beyond rounding, from straight facets on curved faces [mm^3].
    of
        Whose volumes are expected, in words.
    """
    check_regions(found, expected)
    for name, volume in expected.items():
        if abs(found[name] - volume) > VOLUME * volume + slack.get(name, 0.0):
            ratio = found[name] / volume
            hint = next((f"; it seems to be in {unit}" for unit, k in UNITS.items() if 0.5 < ratio * k**3 < 2), "")
            raise MeshError(
                f"region {name} of the mesh has a volume of {found[name]:.6g} mm^3, but that of {of} has "
                f"{volume:.6g} mm^3{hint}"
            )


def _list(names: object) -> str:
    return ", ".join(sorted(names)) or "none"  # type: ignore[call-overload]


def _at(point: Array) -> str:
    return "({:.4g}, {:.4g}, {:.4g}) mm".format(*point)


def _shapes(points: Array, cells: Ints) -> None:
    if points.ndim != 2 or points.shape[0] != 3:
        raise MeshError(f"points must have the shape (3, n), found {points.shape}")
    if cells.ndim != 2 or cells.shape[0] != 4 or cells.shape[1] == 0:
        raise MeshError(f"cells must be one or more tetrahedra of the shape (4, e), found {cells.shape}")
    if cells.min() < 0 or cells.max() >= points.shape[1]:
        raise MeshError(f"cells name the vertices {cells.min()} to {cells.max()}, but there are {points.shape[1]}")
    bad = np.flatnonzero(~(np.abs(points) < FAR).all(axis=0))
    if bad.size:
        raise MeshError(
            f"{bad.size} vertices have a coordinate that is not finite or beyond {FAR:g} mm, the first is vertex "
            f"{bad[0]}"
        )


def _regions(regions: Mapping[str, Ints], n: int) -> Ints:
    region_of = np.full(n, -1, dtype=np.int64)
    if not regions:
        raise MeshError("the mesh has no region; expected skeleton, muscle or both")
    for number, (name, elements) in enumerate(regions.items()):
        if elements.size == 0:
            raise MeshError(f"region {name} is empty")
        if elements.min() < 0 or elements.max() >= n:
            raise MeshError(f"region {name} names the elements {elements.min()} to {elements.max()}, but there are {n}")
        taken = elements[region_of[elements] >= 0]
        if taken.size or np.unique(elements).size != elements.size:
            where = int(taken[0]) if taken.size else int(elements[0])
            raise MeshError(f"region {name} holds an element twice or shares it with another region: element {where}")
        region_of[elements] = number
    lost = np.flatnonzero(region_of < 0)
    if lost.size:
        raise MeshError(f"{lost.size} elements belong to no region, the first is element {lost[0]}")
    return region_of


def _orientation(points: Array, cells: Ints, region_of: Ints, names: list[str]) -> None:
    volume = signed_volumes(points, cells)
    corners = points[:, cells]
    longest = np.ptp(corners, axis=1).max(axis=0)
    bad = np.flatnonzero(volume <= FLAT * longest**3)
    if bad.size:
        e = int(bad[0])
        word = "inverted" if volume[e] < 0 else "flat"
        raise MeshError(
            f"element {e} in region {names[region_of[e]]} at {_at(corners[:, :, e].mean(axis=1))} is {word} (volume "
            f"{volume[e]:.3g} mm^3); {bad.size} of {volume.size} elements have no positive volume"
        )


def _duplicate_cells(cells: Ints) -> None:
    keys = np.sort(row_keys(cells, int(cells.max()) + 1))
    twice = int((np.diff(keys) == 0).sum())
    if twice:
        raise MeshError(f"{twice} elements have the same four vertices as another one")


def _orphans(cells: Ints, n: int, landmarks: Mapping[str, int]) -> None:
    used = np.zeros(n, dtype=bool)
    used[cells.ravel()] = True
    for name, vertex in landmarks.items():
        if not 0 <= vertex < n or not used[vertex]:
            raise MeshError(f"landmark {name} is vertex {vertex}, which belongs to no element")
    orphans = np.flatnonzero(~used)
    if orphans.size:
        raise MeshError(f"{orphans.size} orphan vertices belong to no element, the first is vertex {orphans[0]}")


def _crowded(points: Array, table: Facets) -> None:
    if table.crowded.size:
        where = points[:, table.triples[:, table.crowded[0]]].mean(axis=1)
        raise MeshError(f"{table.crowded.size} facets belong to more than two elements, the first at {_at(where)}")


def _coincident(points: Array, cells: Ints, region_of: Ints, names: list[str]) -> None:
    """Two vertices in one place: parts that touch but are not joined."""
    a, b = points[:, cells[0]], points[:, cells[1]]
    shortest = float(np.linalg.norm(b - a, axis=0).min())
    distance, partner = (np.asarray(found) for found in KDTree(points.T).query(points.T, k=2))
    twins = np.flatnonzero(distance[:, 1] < TOGETHER * shortest)
    if twins.size:
        v = int(twins[0])
        owner = {names[region_of[np.flatnonzero((cells == w).any(axis=0))[0]]] for w in (v, int(partner[v, 1]))}
        raise MeshError(
            f"{twins.size} vertices coincide with another one that they are not joined to, the first at "
            f"{_at(points[:, v])} in {_list(owner)}; merge them (in Gmsh: fragment the volumes, or Coherence Mesh)"
        )


def _seams(points: Array, table: Facets, region_of: Ints, names: list[str]) -> None:
    """Boundary facets that lie on other boundary facets: parts in contact with different triangulations."""
    outer = table.boundary
    corners = points[:, table.triples[:, outer]]  # (3 axes, 3 corners, f)
    centre = corners.mean(axis=1)
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    normal = np.cross(b - a, c - a, axis=0)
    double_area = np.linalg.norm(normal, axis=0)
    normal = normal / double_area
    reach = np.linalg.norm(corners - centre[:, None], axis=0).max(axis=0)
    tree = KDTree(centre.T)
    near = tree.query_ball_point(centre.T, reach)
    count = np.array([len(k) for k in near])
    big = np.repeat(np.arange(outer.size), count)
    small = np.concatenate([np.asarray(k, dtype=np.int64) for k in near])
    big, small = big[big != small], small[big != small]
    offset = centre[:, small] - a[:, big]
    flat = np.abs((offset * normal[:, big]).sum(axis=0)) < TOGETHER * reach[big]
    big, small = big[flat], small[flat]
    inside = np.ones(big.size, dtype=bool)
    for p, q in ((a, b), (b, c), (c, a)):
        turn = np.cross(q[:, big] - p[:, big], centre[:, small] - p[:, big], axis=0)
        inside &= (turn * normal[:, big]).sum(axis=0) > -TOGETHER * double_area[big]
    hit = np.flatnonzero(inside)
    if hit.size:
        pair = [int(big[hit[0]]), int(small[hit[0]])]
        owner = {names[region_of[table.elements[0, outer[k]]]] for k in pair}
        raise MeshError(
            f"the parts do not share their facets: {hit.size} boundary facets lie on others, the first at "
            f"{_at(centre[:, pair[1]])} in {_list(owner)}; mesh the parts together (in Gmsh: fragment the volumes)"
        )


def _connected(table: Facets, n: int) -> None:
    a, b = table.elements[:, table.elements[1] >= 0]
    graph = coo_array((np.ones(a.size, dtype=np.int8), (a, b)), shape=(n, n))
    pieces, label = connected_components(graph, directed=False)
    if pieces > 1:
        sizes = sorted(np.bincount(label).tolist(), reverse=True)
        raise MeshError(
            f"the body falls into {pieces} pieces that share no facet, of {', '.join(map(str, sizes[:4]))} elements"
            f"{' and more' if pieces > 4 else ''}; expected one"
        )


def _surfaces(surfaces: Mapping[str, Ints], table: Facets, n: int) -> None:
    for name, triples in surfaces.items():
        if triples.ndim != 2 or triples.shape[0] != 3 or triples.shape[1] == 0:
            raise MeshError(f"surface {name} must be one or more triangles of the shape (3, f), found {triples.shape}")
        if triples.min() < 0 or triples.max() >= n:
            raise MeshError(f"surface {name} names the vertices {triples.min()} to {triples.max()}, but there are {n}")
        # keys of both at once, since they need not mean the same from call to call
        keys = row_keys(np.concatenate([table.triples, triples], axis=1), n)
        strange = int((~np.isin(keys[table.triples.shape[1] :], keys[: table.triples.shape[1]])).sum())
        if strange:
            raise MeshError(f"surface {name} has {strange} triangles that are no facets of the tetrahedra")

"""A mesh whose muscle is not bonded to the skeleton: nodes of the interface doubled, else the same.

Elements, their order and the skeleton's vertices stay as they are; the muscle's copies of the interface's vertices come
after all others. Both sides match node by node, so gaps begin at zero.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from fem_biobot.errors import MeshError
from fem_biobot.mesh.body import Array, BodyMesh, Ints
from fem_biobot.mesh.facets import facets, row_keys

BEARING, BODY = "pillar_sides", "interface_muscle"
# facets that meet at less than this angle belong to one smooth side [rad]
SMOOTH = np.deg2rad(30.0)
# how far the sides reach beyond the interface, in its own extent
_BEYOND = 0.5


def unbonded(mesh: BodyMesh) -> BodyMesh:
    """The mesh with the muscle's side of ``interface`` on vertices of its own.

    Returns
    -------
    BodyMesh
        With two more surfaces: ``interface_muscle``, the muscle's side, looking out of the muscle, and
        ``pillar_sides``, the skeleton's side continued over its smooth surface by half of the interface's extent, so
        that the muscle may slide there. Surfaces inside the muscle have its vertices.

    Raises
    ------
    MeshError
        No interface between regions named skeleton and muscle.
    """
    if "interface" not in mesh.surfaces or not {"skeleton", "muscle"} <= set(mesh.regions):
        raise MeshError("interface: found no such surface between skeleton and muscle, expected one to slide on")
    faces = mesh.surfaces["interface"]
    n = mesh.n_vertices
    shared = np.unique(faces)
    copy = np.arange(n)
    copy[shared] = n + np.arange(shared.size)
    cells = mesh.cells.copy()
    muscle = mesh.regions["muscle"]
    cells[:, muscle] = copy[cells[:, muscle]]
    table = facets(mesh.cells)
    of_muscle = np.isin(table.elements, muscle) | (table.elements < 0)
    inside = row_keys(table.triples[:, of_muscle.all(axis=0)], n)
    surfaces = {}
    for name, triples in mesh.surfaces.items():
        own = np.isin(row_keys(triples, n), inside)
        surfaces[name] = np.where(own, copy[triples], triples)
    surfaces[BODY] = copy[faces[::-1]]
    surfaces[BEARING] = _continued(mesh.points, mesh.cells[:, mesh.regions["skeleton"]], faces)
    points = np.concatenate([mesh.points, mesh.points[:, shared]], axis=1)
    return BodyMesh(points, cells, mesh.regions, surfaces, mesh.landmarks, mesh.source)


def _continued(points: Array, cells: Ints, faces: Ints) -> Ints:
    """The facets (3, f) first, then those of the skeleton's boundary that continue them smoothly nearby."""
    table = facets(cells)
    outer = table.triples[:, table.boundary]
    n = points.shape[1]
    known = np.isin(row_keys(outer, n), row_keys(faces, n))
    # a facet of the interface is on the boundary of the skeleton alone
    near = known.copy()
    for part in range(parts := connected(outer[:, known])[0]):
        own = np.flatnonzero(known)[connected(outer[:, known])[1] == part]
        X = points[:, np.unique(outer[:, own])]
        low, high = X.min(axis=1), X.max(axis=1)
        reach = _BEYOND * (high - low)
        centres = points[:, outer].mean(axis=1)
        inside = np.all((centres > (low - reach)[:, None]) & (centres < (high + reach)[:, None]), axis=0)
        patch = smooth_patches(points, outer)
        near |= inside & np.isin(patch, patch[own])
    assert parts
    rest = outer[:, near & ~known]
    return np.concatenate([faces, rest], axis=1)


def connected(triples: Ints) -> tuple[int, Ints]:
    """Number of connected parts of a surface, and the part of each facet, (f,)."""
    vertices, place = np.unique(triples, return_inverse=True)
    place = place.reshape(triples.shape)
    n = vertices.size
    rows, columns = np.concatenate([place[0], place[1]]), np.concatenate([place[1], place[2]])
    count, label = connected_components(coo_array((np.ones(rows.size), (rows, columns)), shape=(n, n)), directed=False)
    return int(count), np.asarray(label, dtype=np.int64)[place[0]]


def smooth_patches(points: Array, triples: Ints) -> Ints:
    """Number of the smooth side that each facet of a surface is in, (f,): sides end at edges sharper than `SMOOTH`."""
    corners = points[:, triples]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0], axis=0)
    normal /= np.linalg.norm(normal, axis=0)
    f = triples.shape[1]
    sides = np.concatenate([triples[[0, 1]], triples[[1, 2]], triples[[2, 0]]], axis=1)
    owner = np.tile(np.arange(f), 3)
    keys = row_keys(sides, points.shape[1])
    order = np.argsort(keys, kind="stable")
    same = np.flatnonzero(keys[order][1:] == keys[order][:-1])
    one, two = owner[order[same]], owner[order[same + 1]]
    flat = np.einsum("if,if->f", normal[:, one], normal[:, two]) > np.cos(SMOOTH)
    graph = coo_array((np.ones(flat.sum()), (one[flat], two[flat])), shape=(f, f))
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)

"""Does the deformed body run into itself? Pillars or muscle that touch are an event, never ignored.

Detection only: a vertex of the surface that lies inside a deformed element it does not belong to. No contact force.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from fem_biobot.material.law import Array
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.solid.model import SolidModel

Ints = NDArray[np.int64]


def in_contact(model: SolidModel) -> Ints:
    """Vertices of surfaces whose contact the model solves itself; none where all parts are bonded."""
    if model.sliding is None:
        return np.zeros(0, dtype=np.int64)
    surfaces = model.mesh.surfaces
    return np.unique(np.concatenate([surfaces[model.sliding.bearing], surfaces[model.sliding.body]], axis=1))


def interpenetration(mesh: BodyMesh, u: Array) -> tuple[Ints, Ints]:
    """Surface vertices that lie inside an element of which they are no corner, and those elements.

    Parameters
    ----------
    mesh
        The body.
    u
        Displacement of its vertices, (3, n) or more columns [mm].

    Returns
    -------
    tuple of Ints
        Vertices and elements, pair by pair; empty if the body does not touch itself. Sides are taken straight between
        vertices, so a penetration shallower than the sag of a curved element side goes unseen.
    """
    x = mesh.points + u[:, : mesh.points.shape[1]]
    cells = mesh.cells
    faces = np.sort(
        np.concatenate([cells[[1, 2, 3]], cells[[0, 2, 3]], cells[[0, 1, 3]], cells[[0, 1, 2]]], axis=1), axis=0
    )
    owner = np.tile(np.arange(cells.shape[1]), 4)
    n = mesh.points.shape[1]
    keys = (faces[0] * n + faces[1]) * n + faces[2]
    _, first, count = np.unique(keys, return_index=True, return_counts=True)
    outer = first[count == 1]
    vertices = np.unique(faces[:, outer])
    elements = np.unique(owner[outer])
    corners = x[:, cells[:, elements]]  # (3, 4, k)
    centres = corners.mean(axis=1)
    radius = np.linalg.norm(corners - centres[:, None], axis=0).max(axis=0)
    tree = KDTree(x[:, vertices].T)
    near = tree.query_ball_point(centres.T, radius)
    which = np.repeat(np.arange(len(elements)), [len(found) for found in near])
    candidates = vertices[np.concatenate([np.asarray(found, dtype=np.int64) for found in near])]
    foreign = ~np.any(cells[:, elements[which]] == candidates, axis=0)
    which, candidates = which[foreign], candidates[foreign]
    edges = corners[:, 1:, which] - corners[:, :1, which]
    local = np.linalg.solve(np.moveaxis(edges, 2, 0), (x[:, candidates] - corners[:, 0, which]).T[:, :, None])[:, :, 0]
    inside = np.minimum(local.min(axis=1), 1.0 - local.sum(axis=1)) > 1e-6
    return candidates[inside], elements[which[inside]]


def touching_parts(mesh: BodyMesh, u: Array, allowed: Ints | None = None) -> str:
    """Which parts touch, in words such as "muscle against muscle at 4 vertices near x = -2.8 mm"; empty if none do.

    `allowed` are vertices whose contact with another region is none of our affair (see `in_contact`).
    """
    vertices, elements = interpenetration(mesh, u)
    if not vertices.size:
        return ""
    names = list(mesh.regions)
    region_of = mesh.region_of()
    belongs = np.zeros(mesh.points.shape[1], dtype=np.int64)
    for k in range(len(names)):
        belongs[mesh.cells[:, region_of == k]] = k
    if allowed is not None:
        foreign = ~(np.isin(vertices, allowed) & (belongs[vertices] != region_of[elements]))
        vertices, elements = vertices[foreign], elements[foreign]
        if not vertices.size:
            return ""
    pairs = sorted(
        {
            " against ".join(sorted((names[belongs[v]], names[region_of[e]])))
            for v, e in zip(vertices, elements, strict=True)
        }
    )
    where = mesh.points[0, vertices]
    near = f"x = {where.min():.2g} mm" if np.ptp(where) < 1.0 else f"x = {where.min():.2g} and {where.max():.2g} mm"
    return f"{', '.join(pairs)} at {np.unique(vertices).size} vertices near {near} of the undeformed body"

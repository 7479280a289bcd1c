"""Skeleton and muscle of a mesh as bodies of their own, loaded by wrenches where they are bonded to each other.

The two parts of a bot meet on the sides of its pillars: `bond_short` and `bond_long` are those surfaces. What a part
is as a member of rods is measured between them, by loads that are in balance by themselves.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from fem_biobot.design import Design
from fem_biobot.errors import MeshError
from fem_biobot.link.observed import Array
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.solid.records import Traction

BONDS = ("bond_short", "bond_long")
Field = Callable[[Array], Array]


def part_of(mesh: BodyMesh, region: str) -> BodyMesh:
    """The elements of a region alone, with its own landmarks and surfaces and the bonds to the other region.

    Raises
    ------
    MeshError
        A mesh in which skeleton and muscle do not meet.
    """
    cells = mesh.cells[:, mesh.regions[region]]
    used = np.unique(cells)
    number = np.full(mesh.points.shape[1], -1, dtype=np.int64)
    number[used] = np.arange(len(used))
    if "interface" not in mesh.surfaces or not mesh.surfaces["interface"].size:
        raise MeshError("interface: found no such surface in the mesh, expected one where muscle and skeleton meet")
    faces = mesh.surfaces["interface"]
    long = mesh.points[0, faces].mean(axis=0) > 0.0
    surfaces = dict(zip(BONDS, (faces[:, ~long], faces[:, long]), strict=True))
    boundary = ("foot_short", "foot_long")
    surfaces |= {name: mesh.surfaces[name] for name in boundary if name in mesh.surfaces}
    own = {name: number[f] for name, f in surfaces.items() if (number[f] >= 0).all()}
    marks = {name: int(number[k]) for name, k in mesh.landmarks.items() if number[k] >= 0}
    return BodyMesh(mesh.points[:, used], number[cells], {region: np.arange(cells.shape[1])}, own, marks)


def wrench(body: BodyMesh, surface: str, force: Array, moment: Array, about: Array) -> Field:
    """Traction on a surface that is linear in position and has a given resultant.

    Parameters
    ----------
    body, surface
        Where it acts.
    force, moment
        Resultant force (3,) [mN] and moment (3,) [uJ] about a point.
    about
        The point, (3,) [mm].

    Returns
    -------
    callable
        From positions (3, k) [mm] to tractions (3, k) [kPa], ``f / A + (J^-1 m) x r``.
    """
    corners = body.points[:, body.surfaces[surface]]  # (3, 3, f)
    area = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0], axis=0), axis=0)
    total = float(area.sum())
    centre = corners.mean(axis=1) @ area / total
    arms = corners - centre[:, None, None]
    # over a triangle the mean of r r^T is that of its corners and of three times its centroid, over twelve
    whole = arms.sum(axis=1)
    second = (np.einsum("icf,jcf,f->ij", arms, arms, area) + np.einsum("if,jf,f->ij", whole, whole, area)) / 12.0
    inertia = np.trace(second) * np.eye(3) - second
    turn = np.linalg.solve(inertia, moment - np.cross(centre - about, force))

    def traction(X: Array) -> Array:
        return (force / total)[:, None] + np.cross(turn, X - centre[:, None], axisb=0, axisc=0)

    return traction


def balanced(body: BodyMesh, name: str, force: Array, moment: Array, about: Array) -> tuple[Traction, Traction]:
    """A wrench on the long bond and its opposite on the short one, both driven by `name`."""
    short, long = BONDS
    return (
        Traction(long, wrench(body, long, force, moment, about), name=name),
        Traction(short, wrench(body, short, -force, -moment, about), name=name),
    )


def middle_of(design: Design) -> Array:
    """The point of the beam's axis at mid-span, (3,) [mm]."""
    return np.array([0.0, 0.0, design.beam_axis_height])

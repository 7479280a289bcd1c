"""Surfaces from STL files: closed, or refused; triangles of one plane joined to one face.

An STL file has triangles without connection, without a unit and without volumes. What is read here is a closed surface
in mm whose plane regions are whole faces again, so that a mesh is not bound to the triangles of a drawing.
"""

from __future__ import annotations

import os
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from fem_biobot.errors import MeshError
from fem_biobot.files import file_error

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

UNITS = {"mm": 1.0, "cm": 10.0, "m": 1e3, "um": 1e-3, "in": 25.4}
MOST_FACES = 5000  # each is a face of its own in the mesh
_TOGETHER = 1e-6  # of the longest edge of the box: vertices nearer than this are one
_PLANE = 1e-6  # of the same: a plane face may be this uneven
_ALIKE = 1e-7  # of 1 - cos of the angle between two triangles of one plane


@dataclass(frozen=True, eq=False)
class PlaneFaces:
    """A closed surface of plane faces.

    Attributes
    ----------
    points
        Corners, (3, n) [mm].
    loops
        For each face its loops of corners, the outer one first, then those of its holes.
    volume
        That it encloses [mm^3].
    """

    points: Array
    loops: tuple[tuple[list[int], ...], ...]
    volume: float


def read_stl(path: str | os.PathLike[str], unit: str) -> PlaneFaces:
    """Closed surface of an STL file, text or binary.

    Parameters
    ----------
    path
        The file.
    unit
        Of its numbers, out of `UNITS`: the file itself does not say.

    Raises
    ------
    FileError
        It cannot be read.
    MeshError
        It is no STL file, or its triangles do not close to one body, or they are too many faces.
    """
    if unit not in UNITS:
        raise MeshError(f"{path}: unit: found {unit!r}, expected one of: {', '.join(UNITS)}")
    try:
        data = Path(path).read_bytes()
    except OSError as error:
        raise file_error(error, path, doing="read") from None
    try:
        return plane_faces(_corners(data) * UNITS[unit])
    except MeshError as error:
        raise MeshError(f"{path}: {error}") from None


def _corners(data: bytes) -> Array:
    """Corners of the triangles, (f, 3, 3): triangle, corner, axis."""
    count = int.from_bytes(data[80:84], "little")
    if len(data) >= 84 and len(data) == 84 + 50 * count:
        kind = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
        found = np.frombuffer(data, kind, count, 84)["corners"].astype(float)
    elif data.lstrip()[:5] == b"solid":
        words = re.findall(rb"vertex\s+(\S+)\s+(\S+)\s+(\S+)", data)
        try:
            found = np.array(words, dtype=float).reshape(-1, 3, 3)
        except ValueError:
            raise MeshError(f"found {len(words)} vertices, expected three numbers each and three a triangle") from None
    else:
        raise MeshError("this is no STL file: found neither its text nor a count of triangles that fits its length")
    if not len(found) or not np.isfinite(found).all():
        raise MeshError(f"found {len(found)} triangles, expected some with finite corners")
    return found


def plane_faces(corners: Array) -> PlaneFaces:
    """Closed surface of triangles, (f, 3, 3) [mm], with those of one plane joined."""
    reach = float(np.ptp(corners.reshape(-1, 3), axis=0).max())
    # single precision leaves noise in the eighth digit; the grid is far below what a mesh resolves
    grid = _TOGETHER * float(10.0 ** np.floor(np.log10(reach))) if reach > 0.0 else 1.0
    whole = np.rint(corners.reshape(-1, 3) / grid).astype(np.int64)
    points, place = np.unique(whole, axis=0, return_inverse=True)
    triangles = place.reshape(-1, 3)
    distinct = (np.diff(np.sort(triangles, axis=1), axis=1) > 0).all(axis=1)
    triangles, X = triangles[distinct], np.asarray(points * grid, dtype=float)
    ends, owner = _refuse_open(triangles, X)
    parts = coo_array((np.ones(len(ends)), (owner[:, 0], owner[:, 1])), shape=(len(triangles),) * 2)
    bodies = connected_components(parts, directed=False)[0]
    if bodies > 1:
        raise MeshError(f"found {bodies} closed surfaces that do not touch, expected one body")
    a, b, c = X[triangles].transpose(1, 0, 2)
    normal = np.cross(b - a, c - a)
    area = np.linalg.norm(normal, axis=1)
    volume = float(np.einsum("fi,fi->", a - X[0], normal)) / 6.0
    if abs(volume) < 1e-9 * reach**3:
        raise MeshError(f"found a volume of {volume:.3g} mm^3 within the triangles, expected a body")
    normal = normal / np.maximum(area, 1e-300)[:, None]
    group = _planes(triangles, X, normal, ends, owner, _PLANE * reach)
    loops = _loops(triangles, X, group)
    if len(loops) > MOST_FACES:
        raise MeshError(
            f"found {len(loops)} plane faces, expected at most {MOST_FACES}: give a STEP file, or fewer triangles"
        )
    used, numbers = np.unique(np.concatenate([loop for face in loops for loop in face]), return_inverse=True)
    renamed = iter(numbers.tolist())
    faces = tuple(tuple([next(renamed) for _ in loop] for loop in face) for face in loops)
    return PlaneFaces(X[used].T.copy(), faces, abs(volume))


def _refuse_open(triangles: Ints, X: Array) -> tuple[Ints, Ints]:
    """Edges (k, 2) and the two triangles at each, (k, 2); every edge has two or the surface is not closed."""
    edges = np.sort(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1)
    ends, which, count = np.unique(edges, axis=0, return_inverse=True, return_counts=True)
    odd = np.flatnonzero(count != 2)
    if odd.size:
        where = ", ".join(f"{v:.4g}" for v in X[ends[odd[0]]].mean(axis=0))
        word = "a gap" if count[odd[0]] == 1 else f"{count[odd[0]]} triangles"
        raise MeshError(
            f"not watertight: {odd.size} of {len(ends)} edges have not two triangles, the first has {word}, at "
            f"({where}) mm; repair the surface"
        )
    order = np.argsort(which.reshape(-1), kind="stable")
    owner = np.tile(np.arange(len(triangles)), 3)[order].reshape(-1, 2)
    return ends, owner


def _planes(triangles: Ints, X: Array, normal: Array, ends: Ints, owner: Ints, slack: float) -> Ints:
    """Number of the plane face of each triangle; a region that is not plane as a whole stays triangles."""
    flat = np.abs(np.einsum("ki,ki->k", normal[owner[:, 0]], normal[owner[:, 1]])) > 1.0 - _ALIKE
    pairs = owner[flat]
    count = len(triangles)
    graph = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(count, count))
    group = connected_components(graph, directed=False)[1].astype(np.int64)
    own = int(group.max()) + 1
    for k in np.unique(group):
        members = np.flatnonzero(group == k)
        largest = members[np.argmax(np.linalg.norm(np.ptp(X[triangles[members]], axis=1), axis=1))]
        corners = X[triangles[members].ravel()]
        if np.abs((corners - X[triangles[largest, 0]]) @ normal[largest]).max() > slack:
            group[members] = own + np.arange(members.size)
            own += members.size
    return group


def _loops(triangles: Ints, X: Array, group: Ints) -> list[tuple[list[int], ...]]:
    """Loops of every plane face, with the corners alone: what lies straight between two faces is left out."""
    sides = [(int(a), int(b)) for t in triangles for a, b in zip(t, np.roll(t, -1), strict=True)]
    face_of = dict(zip(sides, np.repeat(group, 3).tolist(), strict=True))
    if len(face_of) < len(sides):
        raise MeshError("neighbouring triangles turn differently; expected all of them to look outward")
    following: dict[int, dict[int, int]] = {}
    beside: dict[int, set[tuple[int, int]]] = {}
    for (a, b), face in face_of.items():
        other = face_of[b, a]
        if other == face:
            continue
        if following.setdefault(face, {}).setdefault(a, b) != b:
            raise MeshError(
                "a plane face touches itself at a corner, expected faces whose edges do not (a round pillar flush with "
                "the beam's end makes one): give a STEP file"
            )
        for end in (a, b):
            beside.setdefault(end, set()).add((min(face, other), max(face, other)))
    found = []
    for after in following.values():
        loops, left = [], set(after)
        while left:
            loop = [min(left)]
            while (ahead := after[loop[-1]]) != loop[0]:
                loop.append(ahead)
            left -= set(loop)
            loops.append(_corners_of(loop, X, beside))
        # the outer loop goes round the largest area
        found.append(tuple(sorted(loops, key=lambda loop: -_area(X[loop]))))
    return found


def _corners_of(loop: list[int], X: Array, beside: dict[int, set[tuple[int, int]]]) -> list[int]:
    """A loop without the points at which one edge between the same two faces goes straight on."""
    kept = list(loop)
    for k, point in enumerate(loop):
        before, after = X[loop[k - 1]], X[loop[(k + 1) % len(loop)]]
        one, two = X[point] - before, after - X[point]
        straight = np.linalg.norm(np.cross(one, two)) <= 1e-6 * np.linalg.norm(one) * np.linalg.norm(two)
        if len(beside[point]) == 1 and straight and one @ two > 0.0:
            kept.remove(point)
    return kept


def _area(polygon: Array) -> float:
    return float(np.linalg.norm(np.cross(polygon, np.roll(polygon, -1, axis=0)).sum(axis=0))) / 2.0

"""Bodies that cases are set up with: boxes of distorted tetrahedra, generic directions, holds, the committed bot."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from functools import cache

import numpy as np
from numpy.typing import NDArray

from fem_biobot import BodyMesh, Design, Fix, MeshError, SolidState, load_design, measures
from fem_biobot.mesh.committed import committed_mesh
from fem_biobot.solid.newton import NewtonSettings

Array = NDArray[np.float64]

# far below the default, so that answers are exact up to rounding
TIGHT = NewtonSettings(tolerance=1e-13, max_iterations=20)
FACES = ("x0", "x1", "y0", "y1", "z0", "z1")


def generator(seed: int = 2718) -> np.random.Generator:
    """A fixed stream of numbers; the same in every run."""
    return np.random.default_rng(seed)


def rotation(seed: int = 31) -> Array:
    """A generic proper rotation, (3, 3)."""
    Q, R = np.linalg.qr(generator(seed).normal(size=(3, 3)))
    Q = Q * np.sign(np.diag(R))
    return Q if np.linalg.det(Q) > 0 else -Q


def unit(*v: float) -> Array:
    """Unit vector along `v`, (3,)."""
    return np.array(v) / np.linalg.norm(v)


def box_mesh(
    n: int | tuple[int, int, int] = 2,
    size: tuple[float, float, float] = (1.0, 1.0, 1.0),
    *,
    shift: float = 0.15,
    layers: Sequence[float] = (1.0,),
    names: Sequence[str] = ("muscle",),
    bend: Callable[[Array], Array] | None = None,
    seed: int = 77,
) -> BodyMesh:
    """Box ``[0, size]`` of tetrahedra whose inner vertices are moved off their grid.

    Parameters
    ----------
    n
        Cells along each axis; each is cut into six tetrahedra.
    shift
        Largest move of an inner vertex, in cells; faces of the box stay plane and opposite faces are meshed alike.
    layers, names
        Upper ends in z (shares of the height) and names of the regions; a layer's face must be a grid plane, and its
        vertices move within it only.
    bend
        Smooth map of the unit cube onto itself, applied before sizing, instead of random moves.
    """
    counts = (n, n, n) if isinstance(n, int) else n
    axes = [np.linspace(0.0, 1.0, k + 1) for k in counts]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"))  # (3, nx+1, ny+1, nz+1)
    number = np.arange(grid[0].size).reshape(grid.shape[1:])
    X = grid.reshape(3, -1).copy()
    move = shift * generator(seed).uniform(-1.0, 1.0, X.shape) / np.array(counts)[:, None]
    inner = np.all((X > 1e-9) & (X < 1.0 - 1e-9), axis=0)
    move[:, ~inner] = 0.0
    for end in layers:
        move[2, np.abs(X[2] - end) < 1e-9] = 0.0
    corner = np.stack(np.meshgrid(*[np.arange(k) for k in counts], indexing="ij")).reshape(3, -1)
    cells = []
    for order in itertools.permutations(range(3)):
        # the path from one corner of the cell to the opposite one along its edges
        at = corner.copy()
        path = [number[tuple(at)]]
        for axis in order:
            at = at.copy()
            at[axis] += 1
            path.append(number[tuple(at)])
        odd = np.linalg.det(np.eye(3)[list(order)]) < 0
        cells.append(np.stack(path if not odd else [path[0], path[2], path[1], path[3]]))
    t = np.concatenate(cells, axis=1)
    height = X[2, t].mean(axis=0)
    X = bend(X) if bend is not None else X + move
    regions = {}
    low = 0.0
    for name, high in zip(names, layers, strict=True):
        regions[name] = np.flatnonzero((height > low) & (height < high))
        low = high
    faces = _outer_faces(t)
    surfaces = {
        f"{letter}{side}": faces[:, np.all(np.abs(X[axis, faces] - side) < 1e-9, axis=0)]
        for axis, letter in enumerate("xyz")
        for side in (0, 1)
    }
    corners = {
        "".join(map(str, c)): int(np.argmin(np.linalg.norm(X - np.array(c)[:, None], axis=0)))
        for c in itertools.product((0, 1), repeat=3)
    }
    landmarks = {f"corner_{name}": index for name, index in corners.items()}
    return BodyMesh(X * np.array(size)[:, None], t, regions, surfaces, landmarks).checked()


def _outer_faces(t: NDArray[np.int64]) -> NDArray[np.int64]:
    """Facets of the boundary, looking out, (3, f)."""
    # each face opposite to vertex 0, 1, 2, 3 of a positively oriented tetrahedron, counter-clockwise from outside
    faces = np.concatenate([t[list(k)] for k in ((1, 2, 3), (0, 3, 2), (0, 1, 3), (0, 2, 1))], axis=1)
    _, first, count = np.unique(np.sort(faces, axis=0), axis=1, return_index=True, return_counts=True)
    return faces[:, first[count == 1]]


def on_three_corners(size: tuple[float, float, float] = (1.0, 1.0, 1.0)) -> list[Fix]:
    """Supports of a box that hold its six rigid motions and carry no force."""
    return [Fix((0.0, 0.0, 0.0), "xyz"), Fix((size[0], 0.0, 0.0), "yz"), Fix((0.0, size[1], 0.0), "z")]


def turned_about(mesh: BodyMesh, Q: Array, offset: Array | float = 0.0) -> BodyMesh:
    """The mesh rotated by `Q`, then moved by `offset`."""
    points = Q @ mesh.points + np.reshape(np.broadcast_to(offset, 3), (3, 1))
    return BodyMesh(points, mesh.cells, mesh.regions, mesh.surfaces, mesh.landmarks)


def hold_everywhere(value: Callable[[Array], Array] | float = 0.0, faces: Sequence[str] = FACES) -> list[Fix]:
    """All components prescribed on the faces of a box."""
    return [Fix(face, "xyz", value) for face in faces]


@cache
def committed_bot(size: float = 2.0) -> tuple[Design, BodyMesh]:
    """The junction bot and its committed mesh of the size nearest to `size`, so that Gmsh is not needed.

    Raises
    ------
    MeshError
        The package came without its meshes, or they are of another geometry.
    """
    design = load_design("junction_bot")
    mesh = committed_mesh(design, size)
    if mesh is None:
        raise MeshError("junction_bot: found no committed mesh of its geometry, expected one beside the package")
    return design, mesh


def measured(state: SolidState, design: Design) -> dict[str, float]:
    """The measures that the design has."""
    return {name: value for name, value in measures(state, design).items() if value is not None}

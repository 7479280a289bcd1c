"""What several tests share: small meshes, generic deformations, Taylor slopes, watched inputs.

Imports the package only for its records; no expected number is made here.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from fem_biobot.config import load_design
from fem_biobot.design import Design
from fem_biobot.material.law import PAIRS
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.mesh.committed import committed_mesh
from fem_biobot.solid.newton import NewtonSettings
from fem_biobot.solid.records import Fix

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


def generic_gradients(n: int = 10, size: float = 0.35, seed: int = 2718) -> Array:
    """Generic deformation gradients with ``0.4 < det F < 2.5``, far from symmetric, (3, 3, n)."""
    draw = generator(seed)
    found: list[Array] = []
    while len(found) < n:
        F = np.eye(3) + size * draw.normal(size=(3, 3))
        if 0.4 < np.linalg.det(F) < 2.5:
            found.append(F)
    return np.stack(found, axis=-1)


def taylor_slope(value: Callable[[float], Array], derivative: Array) -> Array:
    """Rate at which ``value(eps) - value(0) - eps derivative`` falls with eps, for every trailing entry.

    2 for a right derivative, 1 for a wrong one. `value` returns (..., n); norms are taken over the leading axes.
    """
    eps = 2.0 ** -np.arange(6, 13)
    at0 = value(0.0)
    rest = np.stack([_norms(value(e) - at0 - e * derivative) for e in eps])  # (steps, n)
    x = np.log(eps) - np.log(eps).mean()
    return (x @ (np.log(rest) - np.log(rest).mean(axis=0))) / (x @ x)


def _norms(a: Array) -> Array:
    return np.sqrt(np.sum(a.reshape(-1, a.shape[-1]) ** 2, axis=0))


def slope(h: Sequence[float], error: Sequence[float]) -> float:
    """Least-squares rate of `error` with `h` in logarithms."""
    return float(np.polyfit(np.log(h), np.log(error), 1)[0])


@contextmanager
def unchanged(*arrays: Array) -> Iterator[None]:
    """The arrays hold the same bytes afterwards."""
    before = [a.tobytes() for a in arrays]
    yield
    assert [a.tobytes() for a in arrays] == before, "an input was changed"


def unpack(packed: Array) -> Array:
    """Symmetric tensor (3, 3, ...) from its six components (6, ...) in the order of `PAIRS`."""
    full = np.empty((3, 3, *packed.shape[1:]))
    for a, (i, j) in enumerate(PAIRS):
        full[i, j] = full[j, i] = packed[a]
    return full


def unpack_tangent(packed: Array) -> Array:
    """Fourth-order tensor (3, 3, 3, 3, ...) with both minor symmetries from its packed upper triangle (21, ...)."""
    full = np.empty((3, 3, 3, 3, *packed.shape[1:]))
    place = 0
    for a, (i, j) in enumerate(PAIRS):
        for k, m in PAIRS[a:]:
            for p, q in ((i, j), (j, i)):
                for r, s in ((k, m), (m, k)):
                    full[p, q, r, s] = full[r, s, p, q] = packed[place]
            place += 1
    return full


@contextmanager
def plain_python(module: object, *names: str) -> Iterator[None]:
    """Compiled kernels of `module` replaced by the Python they were compiled from."""
    with pytest.MonkeyPatch.context() as patch:
        for name in names:
            kernel = getattr(module, name)
            patch.setattr(module, name, getattr(kernel, "py_func", kernel))
        yield


# --- meshes -----------------------------------------------------------------------------------------------------------


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
    """The junction bot and its committed mesh of the size nearest to `size`, so that Gmsh is not needed."""
    design = load_design("junction_bot")
    mesh = committed_mesh(design, size)
    assert mesh is not None, "no committed mesh of junction_bot: make them anew"
    return design, mesh

"""Fibre directions of any tissue from Laplace problems on its mesh: between named ends, and around named walls.

A fibre field has no sense: a direction and its opposite are the same fibre. The functions here take a tagged mesh of
any generator and know no design.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from fem_biobot.errors import MeshError
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.muscle.laplace import Region

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

Names = str | Sequence[str]
# a gradient shorter than this share of the region's largest is none
_NONE = 1e-9


def fibres_between(mesh: BodyMesh, start: Names, end: Names, region: str = "muscle") -> Array:
    """Fibres that run from one set of surfaces to another and follow the walls between them.

    Parameters
    ----------
    mesh
        Any tagged mesh.
    start, end
        Names of surfaces of the mesh, one or several each, that touch the region: where fibres begin and end.
    region
        The tissue.

    Returns
    -------
    Array
        Unit directions of the region's elements, (3, e) [1], from start to end.

    Raises
    ------
    MeshError
        No such region or surface, a surface that is not on the tissue, ends that share vertices, a part of the tissue
        that touches neither, or elements between equal potentials, where no fibre has a direction.

    Notes
    -----
    The gradient of the potential that is 0 at the start and 1 at the end with no flux through the other walls. A
    straight strip gives its axis exactly, an annular sector the tangent in the limit of small elements.
    """
    tissue = Region.of(mesh, region)
    low, high = _vertices(mesh, tissue, start), _vertices(mesh, tissue, end)
    return unit(tissue.recovered(tissue.gradient(_potential(tissue, low, high, (start, end)))))


def fibres_around(
    mesh: BodyMesh, inner: Names, outer: Names, region: str = "muscle", axis: Sequence[float] = (0.0, 0.0, 1.0)
) -> Array:
    """Fibres that run around: along the walls of a ring, whatever its outline, and across the axis.

    Parameters
    ----------
    mesh, region
        As of `fibres_between`.
    inner, outer
        Names of the ring's inner and outer walls.
    axis
        Normal of the plane in which the fibres lie, (3,); any length.

    Returns
    -------
    Array
        Unit directions, (3, e) [1], counter-clockwise about the axis.

    Raises
    ------
    MeshError
        As of `fibres_between`; walls that lie across the axis.

    Notes
    -----
    ``axis x grad u`` of the potential that is 0 at the inner and 1 at the outer wall. No cut is needed, since this
    potential does not wind. Between coaxial cylinders it is exactly tangential in the limit of small elements.
    """
    normal = np.asarray(axis, dtype=float)
    length = np.linalg.norm(normal)
    if normal.shape != (3,) or not (np.isfinite(length) and length > 0.0):
        raise MeshError(f"axis: found {list(axis)}, expected three numbers that are not all zero")
    tissue = Region.of(mesh, region)
    low, high = _vertices(mesh, tissue, inner), _vertices(mesh, tissue, outer)
    outward = tissue.gradient(_potential(tissue, low, high, (inner, outer)))
    return unit(tissue.recovered(np.cross(normal / length, outward, axisb=0, axisc=0)))


def unit(vectors: Array) -> Array:
    """Vectors (3, e) at unit length; refused where one has none."""
    length = np.sqrt(np.einsum("ie,ie->e", vectors, vectors))
    none = length <= _NONE * length.max()
    if none.any():
        raise MeshError(
            f"muscle: found {int(none.sum())} elements without a fibre direction (the potential is flat there), "
            "expected ends or walls that lead through the whole tissue"
        )
    found = vectors / length
    # once more, so that the length is one to rounding
    return found / np.sqrt(np.einsum("ie,ie->e", found, found))


def _potential(tissue: Region, low: Ints, high: Ints, names: tuple[Names, Names]) -> Array:
    both = np.intersect1d(low, high)
    if both.size:
        raise MeshError(
            f"{_text(names[0])}, {_text(names[1])}: found {both.size} vertices on both, expected surfaces apart"
        )
    fixed = np.concatenate([low, high])
    return tissue.harmonic(fixed, np.repeat([0.0, 1.0], [len(low), len(high)]))


def _vertices(mesh: BodyMesh, tissue: Region, names: Names) -> Ints:
    """Vertices of the tissue on the named surfaces."""
    wanted = [names] if isinstance(names, str) else list(names)
    if not wanted:
        raise MeshError("surfaces: found no name, expected at least one")
    found = []
    for name in wanted:
        if name not in mesh.surfaces:
            known = ", ".join(mesh.surfaces) or "none"
            raise MeshError(f"{name}: found no such surface in the mesh ({known}), expected one")
        vertices = tissue.local(mesh.surfaces[name])
        if not vertices.size:
            raise MeshError(f"{name}: found no vertex of this surface on the tissue, expected it to touch it")
        found.append(vertices)
    return np.unique(np.concatenate(found))


def _text(names: Names) -> str:
    return names if isinstance(names, str) else " and ".join(names)

"""Fibre directions of a design's muscle: along the junction at theta, around the pillars in the rings.

``muscle.fibres`` says how. Piecewise: inside the junction block (which runs from pillar face to pillar face, through
the rings' inner sides) the field is constant; elsewhere in a ring it is tangent to the pillar's outline, turning
smoothly about its corners (the mesh's own outline, where the pillars are no boxes); the field jumps where a ring meets
the junction block. Smooth: no jump, see `smooth_fibres`.
Anything else is a file: see `fibre_table`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fem_biobot.design import Design
from fem_biobot.design_kinds import FILE_KEYS
from fem_biobot.errors import DesignError
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.mesh.layout import layout
from fem_biobot.mesh.own_shape import pillar_outlines
from fem_biobot.muscle.blocks import in_junction, junction_blocks, junction_direction
from fem_biobot.muscle.fibre_table import fibres_from_file
from fem_biobot.muscle.smooth_fibres import smooth_fibres

__all__ = ["fibre_field", "in_junction", "junction_blocks", "junction_direction", "piecewise_fibres"]

Array = NDArray[np.float64]


def fibre_field(design: Design, mesh: BodyMesh) -> Array:
    """Unit fibre direction of every muscle element.

    Parameters
    ----------
    design
        A design with a muscle.
    mesh
        Mesh of it.

    Returns
    -------
    Array
        (3, e) [1] in the order of ``mesh.regions["muscle"]``; its sense means nothing.

    Raises
    ------
    DesignError, MeshError
        The design has no muscle, or the mesh is not of this design.
    FileError
        A file of directions that is none.
    """
    muscle = design.muscle
    if muscle is None:
        raise DesignError(f"muscle: found none (kind {design.kind}), expected one for a fibre field")
    if muscle.fibres not in FILE_KEYS["muscle.fibres"]:
        X = mesh.points[:, mesh.cells[:, mesh.regions["muscle"]]]
        return fibres_from_file(muscle.fibres, X.mean(axis=1), (X.min(axis=(1, 2)), X.max(axis=(1, 2))))
    # a strip is one junction: both are constant
    if muscle.fibres == "smooth" and design.kind == "bot":
        return smooth_fibres(design, mesh)
    return piecewise_fibres(design, mesh)


def piecewise_fibres(design: Design, mesh: BodyMesh) -> Array:
    """Piecewise field from the elements' centroids, (3, e) [1].

    The junction block's faces should be conforming, so that no element lies on both sides.
    """
    muscle = design.muscle
    assert muscle is not None
    X = mesh.points[:, mesh.cells[:, mesh.regions["muscle"]]].mean(axis=1)
    along = junction_direction(muscle.theta)
    if design.kind == "strip":
        return np.repeat(along[:, None], X.shape[1], axis=1)
    outlines = pillar_outlines(layout(design), mesh)
    if outlines is not None:
        return np.where(in_junction(design, X), along[:, None], _along_outlines(outlines, X))
    tangent, normal = _around_pillars(design, X)
    if muscle.layout == "ring":
        # theta turns the fibres of the loop out of its own direction, in the sense of a junction's
        return np.sin(muscle.theta) * tangent - np.cos(muscle.theta) * normal
    return np.where(in_junction(design, X), along[:, None], tangent)


def _along_outlines(lines: Array, X: Array) -> Array:
    """Tangent of the offset of the nearest of lines in the plane, (2, 2, k): end, axis, line; at positions, (3, e)."""
    start, way = lines[0], lines[1] - lines[0]
    length = np.maximum(np.sum(way**2, axis=0), 1e-300)
    found = np.empty((2, X.shape[1]))
    for e, x in enumerate(X[:2].T):
        share = np.clip(np.sum((x[:, None] - start) * way, axis=0) / length, 0.0, 1.0)
        out = x[:, None] - start - share * way
        k = int(np.sum(out**2, axis=0).argmin())
        found[:, e] = out[:, k]
    away = np.linalg.norm(found, axis=0)
    if np.any(away == 0.0):
        raise DesignError("muscle: found tissue on the outline of a pillar, expected it outside")
    return np.stack([-found[1] / away, found[0] / away, np.zeros(X.shape[1])])


def _around_pillars(design: Design, X: Array) -> tuple[Array, Array]:
    """Tangent and outward normal of the offset outline of the nearest pillar (or of all, for one loop), (3, e)."""
    skeleton, muscle = design.skeleton, design.muscle
    assert skeleton is not None
    assert muscle is not None
    half_x, half_y = skeleton.pillar_length / 2, skeleton.pillar_width / 2
    centres = np.array([x for x, _ in design.pillars])
    if muscle.layout == "ring":
        low, high = centres.min() - half_x, centres.max() + half_x
        nearest_x = np.clip(X[0], low, high)
    else:
        nearest = centres[np.argmin(np.abs(X[0][:, None] - centres), axis=1)]
        nearest_x = np.clip(X[0], nearest - half_x, nearest + half_x)
    out = np.stack([X[0] - nearest_x, X[1] - np.clip(X[1], -half_y, half_y)])
    length = np.linalg.norm(out, axis=0)
    # a centroid on the outline itself can only come from a mesh that is not of this design
    if np.any(length == 0.0):
        raise DesignError("muscle: found tissue inside the outline of a pillar, expected a mesh of this design")
    n = out / length
    zero = np.zeros(n.shape[1])
    return np.stack([-n[1], n[0], zero]), np.stack([n[0], n[1], zero])

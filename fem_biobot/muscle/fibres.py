"""Fibre directions of a design's muscle: along the junction at theta, around the pillars in the rings.

Piecewise: inside the junction block (which runs from pillar face to pillar face, through the rings' inner sides) the
field is constant; elsewhere in a ring it is tangent to the pillar's outline, turning smoothly about its corners. The
field jumps where a ring meets the junction block; a field smooth through that transition is not built yet.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from fem_biobot.design import Design
from fem_biobot.errors import DesignError
from fem_biobot.mesh.body import BodyMesh

Array = NDArray[np.float64]


def junction_direction(theta: float) -> Array:
    """Fibre direction in the junction, ``(sin theta, cos theta, 0)``, (3,) [1]; `theta` [rad] from the lateral axis."""
    return np.array([np.sin(theta), np.cos(theta), 0.0])


def junction_blocks(design: Design) -> list[tuple[float, float]]:
    """Extent in x of the junction block of each bay, or of the strip [mm]."""
    if design.kind == "strip":
        return [(-design.span / 2, design.span / 2)]
    half = design.value("skeleton.pillar_length") / 2
    centres = [x for x, _ in design.pillars]
    return [(a + half, b - half) for a, b in pairwise(centres)]


def in_junction(design: Design, X: Array) -> NDArray[np.bool_]:
    """Which positions (3, ...) [mm] lie in a junction block; for a ring layout, between the pillars of a strand."""
    muscle = design.muscle
    if muscle is None:
        raise DesignError(f"muscle: found none (kind {design.kind}), expected one for a fibre field")
    x = X[0]
    inside = np.zeros(x.shape, dtype=bool)
    for low, high in junction_blocks(design):
        inside |= (x > low) & (x < high)
    if muscle.layout == "ring" and design.kind == "bot":
        return inside
    across = np.abs(X[1]) < muscle.junction_width / 2
    return inside & across & (np.abs(X[2] - muscle.junction_height) < muscle.junction_thickness / 2)


def fibre_field(design: Design, mesh: BodyMesh) -> Array:
    """Unit fibre direction of every muscle element, from its centroid.

    Parameters
    ----------
    design
        A design with a muscle.
    mesh
        Mesh of it; the junction block's faces should be conforming, so that no element lies on both sides.

    Returns
    -------
    Array
        (3, e) [1] in the order of ``mesh.regions["muscle"]``.
    """
    muscle = design.muscle
    if muscle is None:
        raise DesignError(f"muscle: found none (kind {design.kind}), expected one for a fibre field")
    X = mesh.points[:, mesh.cells[:, mesh.regions["muscle"]]].mean(axis=1)
    along = junction_direction(muscle.theta)
    if design.kind == "strip":
        return np.repeat(along[:, None], X.shape[1], axis=1)
    tangent, normal = _around_pillars(design, X)
    if muscle.layout == "ring":
        # theta turns the fibres of the loop out of its own direction, as it does those of a junction
        return np.sin(muscle.theta) * tangent + np.cos(muscle.theta) * normal
    return np.where(in_junction(design, X), along[:, None], tangent)


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

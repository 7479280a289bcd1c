"""Smooth fibre directions of a bot's muscle: round the pillars and into the junctions, without a jump.

Fibres follow the flow of a potential through the tissue: from behind the first pillar around both its sides, together
into the junction, around the next pillar, and so on. Nothing flows through the walls, so fibres run along them.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fem_biobot.design import Design
from fem_biobot.errors import DesignError, MeshError
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.mesh.layout import layout
from fem_biobot.mesh.own_shape import pillar_outlines
from fem_biobot.muscle.blocks import bay_cores, in_junction, junction_direction
from fem_biobot.muscle.directions import unit
from fem_biobot.muscle.laplace import Region

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

# shares of lengths: what lies on a plane up to rounding
_TOUCH = 1e-6


def smooth_fibres(design: Design, mesh: BodyMesh) -> Array:
    """Smooth fibre field of a bot.

    Parameters
    ----------
    design
        A bot.
    mesh
        Mesh of it, of any generator; nothing but the region ``muscle`` is asked for.

    Returns
    -------
    Array
        Unit directions in the x-y plane, (3, e) [1], in the order of ``mesh.regions["muscle"]``; independent of the
        numbering up to rounding.

    Raises
    ------
    DesignError, MeshError
        The mesh is not of this design: tissue inside a pillar, no tissue in the middle of a bay or behind a pillar; or
        its pillars are no boxes.

    Notes
    -----
    The direction is that of the gradient of a harmonic potential, less its part along z, since fibres are taken to lie
    in the muscle's plane. The potential is 0 behind the first pillar where the two ways around it meet, on the middle
    plane y = 0, and 1 there behind the last. In the middle half of the tissue behind them, and of each bay, where what
    happens at corners and mouths has died away, the direction is set to the lateral one and to that of theta: there it
    is exact. Theta turns the field by ``90 deg - theta`` in the junctions and not at the walls of the rings, with the
    share between harmonic; in a loop of layout ring it turns all of it.

    No planar field can join a ring and a junction without a line about which it turns by half a turn. Here it lies
    where the flow parts: on the pillar's face behind the junction's middle, and across the ring above and below.
    """
    muscle = design.muscle
    assert muscle is not None
    if pillar_outlines(layout(design), mesh) is not None:
        raise DesignError("muscle.fibres: found smooth, expected piecewise or a file for pillars that are no boxes")
    tissue = Region.of(mesh, "muscle")
    X = tissue.points[:, tissue.cells].mean(axis=1)
    _refuse_inside(design, X)
    fixed, values = _meeting(design, tissue)
    flow = tissue.gradient(tissue.harmonic(fixed, values))
    behind, core = _behind(design, X) != 0, _core(design, X) > 0
    flow = tissue.recovered(flow)
    flow[2] = 0.0
    flow[:, behind] = np.array([[0.0], [1.0], [0.0]])
    flow[:, core] = np.array([[1.0], [0.0], [0.0]])
    a0 = unit(flow)
    turn = 0.5 * np.pi - muscle.theta
    if turn != 0.0:
        angle = turn * _share_of_theta(design, tissue)
        c, s = np.cos(angle), np.sin(angle)
        a0 = unit(np.stack([c * a0[0] - s * a0[1], s * a0[0] + c * a0[1], a0[2]]))
    a0[:, core] = junction_direction(muscle.theta)[:, None]
    return a0


def _meeting(design: Design, tissue: Region) -> tuple[Ints, Array]:
    """Vertices at the middle plane behind the outer pillars, and their potential."""
    behind = _behind(design, tissue.points)
    y = tissue.points[1, tissue.cells]
    astride = (y.min(axis=0) <= 0.0) & (y.max(axis=0) >= 0.0)
    ends = []
    for number, name in ((1, "first"), (2, "last")):
        found = np.unique(tissue.cells[:, astride])
        found = found[behind[found] == number]
        if not found.size:
            raise MeshError(
                f"muscle: found no vertex of the tissue behind the {name} pillar, expected a mesh of this design, or a "
                "finer one"
            )
        ends.append(found)
    return np.concatenate(ends), np.repeat([0.0, 1.0], [len(v) for v in ends])


def _core(design: Design, X: Array) -> Ints:
    """Number of the bay, from 1, in whose middle half each position (3, k) lies; 0 elsewhere."""
    muscle = design.muscle
    assert muscle is not None
    number = np.zeros(X.shape[1], dtype=np.int64)
    inside = in_junction(design, X, slack=_TOUCH * design.span)
    for k, (low, high) in enumerate(bay_cores(design), start=1):
        number[inside & (X[0] >= low) & (X[0] <= high)] = k
    return number


def _behind(design: Design, X: Array) -> Ints:
    """1 behind the first pillar and 2 behind the last, in the middle half of its width; 0 elsewhere, (k,)."""
    skeleton = design.skeleton
    assert skeleton is not None
    half_x, reach = 0.5 * skeleton.pillar_length, 0.25 * skeleton.pillar_width
    slack = _TOUCH * design.span
    first, last = design.pillars[0][0] - half_x, design.pillars[-1][0] + half_x
    middle = np.abs(X[1]) <= reach
    return np.where(middle & (X[0] <= first + slack), 1, np.where(middle & (X[0] >= last - slack), 2, 0))


def _share_of_theta(design: Design, tissue: Region) -> Array:
    """How much of theta's turn each element makes, (e,) [1]: 1 in the junctions, 0 at the rings' walls."""
    muscle = design.muscle
    assert muscle is not None
    if muscle.layout == "ring":
        return np.ones(tissue.cells.shape[1])
    junction = ~_in_ring_boxes(design, tissue.points, grown=_TOUCH)
    triangles, normals = tissue.boundary
    upright = np.abs(normals[2]) < 0.7 * np.linalg.norm(normals, axis=0)
    middle = tissue.points[:, triangles].mean(axis=1)
    of_ring = upright & _in_ring_boxes(design, middle, grown=_TOUCH)
    ring = np.setdiff1d(np.unique(triangles[:, of_ring]), np.unique(triangles[:, upright & ~of_ring]))
    ones, zeros = np.flatnonzero(junction), np.setdiff1d(ring, np.flatnonzero(junction))
    fixed = np.concatenate([ones, zeros])
    share = tissue.harmonic(fixed, np.repeat([1.0, 0.0], [len(ones), len(zeros)]))
    return share[tissue.cells].mean(axis=0)


def _in_ring_boxes(design: Design, X: Array, grown: float) -> Bools:
    skeleton, muscle = design.skeleton, design.muscle
    assert skeleton is not None
    assert muscle is not None
    reach = 0.5 * skeleton.pillar_length + muscle.ring_thickness + grown * design.span
    centres = np.array([x for x, _ in design.pillars])
    return np.any(np.abs(X[0][:, None] - centres) <= reach, axis=1)


def _refuse_inside(design: Design, X: Array) -> None:
    skeleton = design.skeleton
    assert skeleton is not None
    slack = _TOUCH * design.span
    half_x, half_y = 0.5 * skeleton.pillar_length - slack, 0.5 * skeleton.pillar_width - slack
    centres = np.array([x for x, _ in design.pillars])
    if np.any((np.abs(X[0][:, None] - centres) < half_x) & (np.abs(X[1])[:, None] < half_y)):
        raise DesignError("muscle: found tissue inside the outline of a pillar, expected a mesh of this design")

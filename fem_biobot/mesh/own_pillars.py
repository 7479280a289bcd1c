"""Pillars of a person's own shape: their sections, and rings that follow these where they are no boxes.

Speaks to the OpenCASCADE model that it is handed and imports no Gmsh, as `solids`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem_biobot.errors import MeshError
from fem_biobot.mesh.layout import Box, Layout, pillar_names
from fem_biobot.mesh.own_shape import is_box, sizes_told

Array = NDArray[np.float64]
Entities = list[tuple[int, int]]

# elements around a pillar that is no box: their chords lack 1 % of a circle's area
AROUND = 24
# how fast elements grow away from there
_GROWTH = 0.45
# by which OpenCASCADE's boxes are wider than their bodies, on each side [mm]
_MARGIN = 1e-7


@dataclass(frozen=True)
class PillarSection:
    """A pillar cut across in the middle of its ring, and beside it the rectangle of the design's box.

    Attributes
    ----------
    name
        Of the pillar.
    z
        Height of the cut [mm].
    low, high
        Ends along x and y, (2,) each [mm].
    area, perimeter
        Of the section [mm^2], and of its outline [mm].
    box
        The design's.
    """

    name: str
    z: float
    low: Array
    high: Array
    area: float
    perimeter: float
    box: Box

    @property
    def is_box(self) -> bool:
        """Whether it is the design's rectangle but for details."""
        return is_box(self.box, self)


def pillar_sections(occ: Any, plan: Layout, skeleton: Entities) -> list[tuple[PillarSection, Entities]]:
    """Sections of the pillars where the muscle lies, each with its plane faces in the model.

    Raises
    ------
    MeshError
        A pillar that is not there, or is more than one body at that height.
    """
    if not plan.pillars or not plan.muscle:
        return []
    ring = next(box for box in plan.muscle if box not in plan.thin)
    z = 0.5 * (ring.low[2] + ring.high[2])
    low, high = _box(occ, skeleton)
    middles = [0.5 * (p.high[0] + q.low[0]) for p, q in pairwise(plan.pillars)]
    ends = [low[0] - 1.0, *middles, high[0] + 1.0]
    found = []
    for name, box, x0, x1 in zip(pillar_names(len(plan.pillars)), plan.pillars, ends[:-1], ends[1:], strict=True):
        tool = [(2, occ.addRectangle(x0, low[1] - 1.0, z, x1 - x0, high[1] - low[1] + 2.0))]
        faces = [entity for entity in occ.intersect(tool, occ.copy(skeleton))[0] if entity[0] == 2]
        if len(faces) != 1:
            raise MeshError(
                f"pillar {name}: found {len(faces)} parts of the skeleton at z = {z:.4g} mm, expected the one that its "
                "ring goes round"
            )
        if len(occ.getCurveLoops(faces[0][1])[1]) > 1:
            raise MeshError(
                f"pillar {name}: found a hole in it at z = {z:.4g} mm, expected none where its ring goes round; give "
                "the muscle with --muscle"
            )
        found.append((_section(occ, name, box, z, faces), faces))
    return found


def _section(occ: Any, name: str, box: Box, z: float, faces: Entities) -> PillarSection:
    (_, tag), (low, high) = faces[0], _box(occ, faces)
    around = sum(float(occ.getMass(1, curve)) for curve in _outline(occ, tag))
    return PillarSection(name, z, low[:2], high[:2], float(occ.getMass(2, tag)), around, box)


def following_rings(occ: Any, plan: Layout, skeleton: Entities) -> tuple[Entities, list[PillarSection]]:
    """The muscle's solids around given pillars, not yet cut by these, and the sections that a ring follows.

    Nothing where all pillars are the design's boxes: then the muscle is the design's. Else a ring whose pillar is the
    design's box but for details is the design's, and others are as thick all round as the design says, about the
    section at their middle height; a junction goes on into them.

    Raises
    ------
    MeshError
        A loop round all pillars, which follows none; a pillar that is not there; a section that cannot be followed.
    """
    sections = pillar_sections(occ, plan, skeleton)
    followed = [section for section, _ in sections if not section.is_box]
    if followed and not plan.thin:
        a, b = (followed[0].box.high[k] - followed[0].box.low[k] for k in (0, 1))
        raise MeshError(
            f"pillar {followed[0].name}: found a section of {sizes_told(followed[0])}, expected the design's {a:.4g} x "
            f"{b:.4g} mm, in its place, within 2 %: a loop round all pillars follows boxes; give it with --muscle"
        )
    if not followed:
        occ.remove([face for _, faces in sections for face in faces], recursive=True)
        return [], []
    solids: Entities = []
    rings = [box for box in plan.muscle if box not in plan.thin]
    for box, pillar, (section, faces) in zip(rings, plan.pillars, sections, strict=True):
        if section.is_box:
            solids.append(_solid(occ, box.low, box.high))
        else:
            solids.append(_around(occ, box, pillar.low[0] - box.low[0], section, faces))
        occ.remove(faces, recursive=True)
    for box, (left, _), (right, _) in zip(plan.thin, sections[:-1], sections[1:], strict=True):
        # on into what a ring that is no box leaves free, without a face that would touch a round pillar
        low = box.low[0] if left.is_box else 0.5 * float(left.low[0] + left.high[0])
        high = box.high[0] if right.is_box else 0.5 * float(right.low[0] + right.high[0])
        solids.append(_solid(occ, (low, *box.low[1:]), (high, *box.high[1:])))
    return solids, followed


def _around(occ: Any, box: Box, thickness: float, section: PillarSection, faces: Entities) -> tuple[int, int]:
    """A solid about a section, `thickness` wider on all sides, as high as a ring's box."""
    try:
        loop = occ.addCurveLoop(_outline(occ, faces[0][1]))
        wider = [tag for dim, tag in occ.offsetCurve(loop, thickness) if dim == 1]
        face = occ.addPlaneSurface([occ.addCurveLoop(wider)])
        area = float(occ.getMass(2, face))
        # of a convex section (Steiner); of any other it is less
        most = section.area + section.perimeter * thickness + math.pi * thickness**2
        if not section.area < area <= most * (1.0 + 1e-6):
            raise ValueError(f"found {area:.4g} mm^2 about {section.area:.4g}")
    except Exception as error:  # Gmsh raises bare Exception
        raise MeshError(
            f"pillar {section.name}: its section at z = {section.z:.4g} mm could not be made {thickness:.4g} mm wider "
            f"for its ring; give the muscle with --muscle ({error})"
        ) from error
    occ.translate([(2, face)], 0.0, 0.0, box.low[2] - section.z)
    made = occ.extrude([(2, face)], 0.0, 0.0, box.high[2] - box.low[2])
    return next(entity for entity in made if entity[0] == 3)


def _outline(occ: Any, face: int) -> list[int]:
    """Curves around a plane face."""
    return [abs(int(tag)) for tag in occ.getCurveLoops(face)[1][0]]


def refine_round(gmsh: Any, followed: list[PillarSection], h: float) -> None:
    """Elements at the edges of round pillars small enough for their curves, besides the sizes there are."""
    field = gmsh.model.mesh.field
    sizes = [int(tag) for tag in field.list()]
    curved = [tag for _, tag in gmsh.model.getEntities(1) if gmsh.model.getType(1, tag) != "Line"]
    added = []
    for section in followed:
        inside = section.perimeter / AROUND
        own = [tag for tag in curved if _level_within(gmsh.model, tag, section)]
        if inside >= h or not own:
            continue
        away, size = field.add("Distance"), field.add("Threshold")
        field.setNumbers(away, "CurvesList", own)
        field.setNumber(away, "Sampling", 4 * AROUND)
        for key, value in (
            ("InField", away),
            ("SizeMin", inside),
            ("SizeMax", h),
            ("DistMin", 0.0),
            ("DistMax", (h - inside) / _GROWTH),
        ):
            field.setNumber(size, key, value)
        added.append(size)
    if added:
        smallest = field.add("Min")
        # the one that holds all sizes of the design is the last
        field.setNumbers(smallest, "FieldsList", [max(sizes), *added])
        field.setAsBackgroundMesh(smallest)


def _level_within(model: Any, curve: int, section: PillarSection) -> bool:
    """Whether a curve runs level and across no more than about the section."""
    low, high = np.reshape(model.getBoundingBox(1, curve), (2, 3))
    first, last = section.low[0], section.high[0]
    reach = 0.5 * (last - first)
    level = high[2] - low[2] < 1e-5 * reach + 4.0 * _MARGIN
    return bool(level and low[0] > first - reach and high[0] < last + reach)


def _solid(occ: Any, low: Any, high: Any) -> tuple[int, int]:
    return 3, occ.addBox(*low, *(b - a for a, b in zip(low, high, strict=True)))


def _box(occ: Any, entities: Entities) -> tuple[Array, Array]:
    corners = np.array([occ.getBoundingBox(*entity) for entity in entities])
    return corners[:, :3].min(axis=0) + _MARGIN, corners[:, 3:].max(axis=0) - _MARGIN

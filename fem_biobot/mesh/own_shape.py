"""A mesh whose pillars are not the boxes of its design: whether it is the design's machine, and what boxes leave out.

The beam and its span, the junction and the thickness and height of the rings are the design's; pillars may be round,
tapered or otherwise their own. What is derived from a design without a mesh takes boxes: that is said with numbers.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fem_biobot.design import Design
from fem_biobot.errors import MeshError
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.mesh.checks import check_volumes
from fem_biobot.mesh.layout import Box, Layout, layout, pillar_names

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

# by which lengths, areas and volumes of a machine may differ in details: rounded edges, chords of a circle
DETAIL = 0.02
# below the beam, of a pillar's height there: where the re-entrant corner is looked for
_BELOW = 0.02


@dataclass(frozen=True)
class Section:
    """A body cut across at a height.

    Attributes
    ----------
    area
        Of the section [mm^2].
    second_moments
        About its own axes along x and along y [mm^4].
    low, high
        Its ends along x and y, (2,) each [mm].
    """

    area: float
    second_moments: tuple[float, float]
    low: Array
    high: Array


def section(points: Array, cells: Ints, z: float) -> Section | None:
    """Section of tetrahedra at a height; none where there is nothing.

    Parameters
    ----------
    points
        Vertices, (3, n) [mm].
    cells
        Tetrahedra, (4, e).
    z
        Height [mm], of no vertex or of some: a facet that lies in it counts once, as that of the elements above.
    """
    above = points[2] >= z
    cut = cells[:, above[cells].any(axis=0) & ~above[cells].all(axis=0)]
    if not cut.size:
        return None
    areas, moments, ends = [], [], []
    for count in (1, 2, 3):
        some = cut[:, above[cut].sum(axis=0) == count]
        order = np.argsort(~above[some], axis=0, kind="stable")
        some = np.take_along_axis(some, order, axis=0)
        up, down = range(count), range(count, 4)
        corners = np.array([_between(points, some[a], some[b], z) for a in up for b in down])  # (corner, 2, e)
        # two above and two below are cut in a quadrangle, whose corners go round as 0, 1, 3, 2
        for a, b, c in ((0, 1, 2), (1, 3, 2))[: len(corners) - 2]:
            p, q, r = corners[a], corners[b], corners[c]
            area = 0.5 * np.abs((q - p)[0] * (r - p)[1] - (q - p)[1] * (r - p)[0])
            areas.append(area)
            # a quadratic is integrated by the middles of the sides
            middles = np.array([p + q, q + r, r + p]) / 2.0
            moments.append(np.array([middles.mean(axis=0) * area, (middles**2).mean(axis=0) * area]))
        ends.append(corners)
    area = float(sum(each.sum() for each in areas))
    first, second = (np.sum([each[k].sum(axis=-1) for each in moments], axis=0) for k in (0, 1))
    about = second - first**2 / area
    every = np.concatenate([corners.transpose(1, 0, 2).reshape(2, -1) for corners in ends], axis=1)
    return Section(area, (float(about[1]), float(about[0])), every.min(axis=1), every.max(axis=1))


def _between(points: Array, one: Ints, other: Ints, z: float) -> Array:
    """Where edges cross a height, (2, e)."""
    a, b = points[:, one], points[:, other]
    share = (z - b[2]) / (a[2] - b[2])
    return (b + share * (a - b))[:2]


def unlike(plan: Layout, mesh: BodyMesh) -> str:
    """Why a mesh is not the bot of a layout with pillars of a shape of their own; nothing if it is.

    Its skeleton has the design's box; its muscle the junction's section, and rings of the design's height and, at the
    machine's ends, thickness; all within 2 % (of the pillar's length, for the thickness). Where their rings lie its
    pillars end along x no farther from the design's than a ring is thick, so that the junction is the design's.
    """
    middle = mesh.surfaces.get("junction_mid")
    if not (plan.pillars and plan.beam and plan.thin and middle is not None and set(mesh.regions) == set(plan.volumes)):
        return "only bots with junctions have pillars of any shape"
    points = mesh.points
    gel, tissue = (points[:, mesh.region_vertices(name)] for name in ("skeleton", "muscle"))
    boxes = [plan.beam, *plan.pillars]
    low, high = np.min([b.low for b in boxes], axis=0), np.max([b.high for b in boxes], axis=0)
    slack = DETAIL * (high - low)
    if np.any(np.abs(gel.min(axis=1) - low) > slack) or np.any(np.abs(gel.max(axis=1) - high) > slack):
        return "its skeleton has another box"
    ring, junction = _ring(plan), plan.thin[0]
    height = DETAIL * (ring.high[2] - ring.low[2])
    if abs(tissue[2].min() - ring.low[2]) > height or abs(tissue[2].max() - ring.high[2]) > height:
        return f"its rings reach from z = {tissue[2].min():.4g} to {tissue[2].max():.4g} mm"
    thickness, length = plan.pillars[0].low[0] - ring.low[0], plan.pillars[0].high[0] - plan.pillars[0].low[0]
    ends = []
    for name, box, found in _sections(plan, mesh, 0.5 * (ring.low[2] + ring.high[2])):
        if found is None or max(abs(found.low[0] - box.low[0]), abs(found.high[0] - box.high[0])) > thickness:
            there = "is not" if found is None else f"reaches from x = {found.low[0]:.4g} to {found.high[0]:.4g} mm"
            return f"its pillar {name} {there} where its ring lies"
        ends.append(found)
    thick = ends[0].low[0] - tissue[0].min(), tissue[0].max() - ends[-1].high[0]
    if max(abs(each - thickness) for each in thick) > DETAIL * length:
        return f"its rings are {thick[0]:.4g} and {thick[1]:.4g} mm thick at its ends"
    p, q, r = (points[:, row] for row in middle)
    area = 0.5 * float(np.linalg.norm(np.cross(q - p, r - p, axis=0), axis=0).sum())
    wanted = (junction.high[1] - junction.low[1]) * (junction.high[2] - junction.low[2])
    return "" if abs(area - wanted) <= DETAIL * wanted else f"its junction has {area:.4g} mm^2 across"


def check_shape(plan: Layout, mesh: BodyMesh) -> None:
    """Refuse a mesh that is not the machine of a layout, whatever its pillars' shape.

    Raises
    ------
    MeshError
        Its volumes are not the design's within 2 %, and it is `unlike` it.
    """
    slack = {name: DETAIL * volume for name, volume in plan.volumes.items()}
    try:
        check_volumes(mesh.region_volumes(), plan.volumes, slack)
    except MeshError as error:
        if not (plan.pillars and plan.thin):
            raise
        if why := unlike(plan, mesh):
            raise MeshError(f"{error}; nor is it the design's with pillars of their own: {why}") from None


def pillar_outlines(plan: Layout, mesh: BodyMesh) -> Array | None:
    """Where pillars that are no boxes meet their rings, as lines in the middle of these; None where all are boxes.

    Returns
    -------
    Array or None
        Both ends along x and y of the lines, (2, 2, k): end, axis, line [mm].
    """
    if "interface" not in mesh.surfaces or not plan.thin:
        return None
    ring = _ring(plan)
    z = 0.5 * (ring.low[2] + ring.high[2])
    found = _sections(plan, mesh, z)
    if all(each is not None and _is_box(box, each) for _, box, each in found) or unlike(plan, mesh):
        return None
    corners = mesh.surfaces["interface"]
    above = mesh.points[2] >= z
    count = above[corners].sum(axis=0)
    lines = []
    for up in (1, 2):
        some = corners[:, count == up]
        # the corner on a side of its own comes first
        order = np.argsort(above[some] if up == 2 else ~above[some], axis=0, kind="stable")
        some = np.take_along_axis(some, order, axis=0)
        lines.append(np.array([_between(mesh.points, some[0], some[k], z) for k in (1, 2)]))
    return np.concatenate(lines, axis=2)


def _ring(plan: Layout) -> Box:
    """A ring's box."""
    return next(box for box in plan.muscle if box not in plan.thin)


def _is_box(box: Box, found: Section) -> bool:
    """Whether a section is a design's rectangle but for details."""
    wanted = (box.high[0] - box.low[0]) * (box.high[1] - box.low[1])
    return abs(found.area - wanted) <= DETAIL * wanted


def _sections(plan: Layout, mesh: BodyMesh, z: float) -> list[tuple[str, Box, Section | None]]:
    """Names, boxes and sections of the pillars at a height."""
    gel = mesh.cells[:, mesh.regions["skeleton"]]
    x = mesh.points[0, gel].mean(axis=0)
    middles = np.array([0.5 * (p.low[0] + p.high[0]) for p in plan.pillars])
    nearest = np.abs(x[:, None] - middles).argmin(axis=1)
    names = pillar_names(len(plan.pillars))
    return [
        (name, box, section(mesh.points, gel[:, nearest == k], z))
        for k, (name, box) in enumerate(zip(names, plan.pillars, strict=True))
    ]


def refuse_own_pillars(design: Design, mesh: BodyMesh) -> None:
    """Refuse a mesh whose pillars are no boxes where rods stand beside it, whose rigid bodies are the design's boxes.

    Raises
    ------
    MeshError
        A pillar whose section differs by more than 2 %.
    """
    plan = layout(design)
    if not (plan.pillars and plan.muscle):
        return
    ring = _ring(plan)
    for name, box, found in _sections(plan, mesh, 0.5 * (ring.low[2] + ring.high[2])):
        if found is None or not _is_box(box, found):
            there = 0.0 if found is None else found.area
            raise MeshError(
                f"pillar {name}: found {there:.4g} mm^2 at its ring, expected the design's box within 2 % for rods "
                "beside the solid"
            )


def shape_notes(design: Design, mesh: BodyMesh) -> list[str]:
    """What a mesh's pillars are where they differ from the design's boxes by more than 2 %, and who takes boxes."""
    plan = layout(design)
    if not (plan.pillars and plan.beam and plan.muscle and "skeleton" in mesh.regions):
        return []
    ring, notes = _ring(plan), []
    for name, box, found in _sections(plan, mesh, 0.5 * (ring.low[2] + ring.high[2])):
        if found is not None and not _is_box(box, found):
            notes.append(_section_note(name, box, found))
    height = min(box.high[2] - box.low[2] for box in plan.pillars)
    for name, box, found in _sections(plan, mesh, plan.pillars[0].high[2] - _BELOW * height):
        notes += _corner_note(plan, name, box, found)
    return notes


def _section_note(name: str, box: Box, found: Section) -> str:
    a, b = box.high[0] - box.low[0], box.high[1] - box.low[1]
    about_x, about_y = found.second_moments
    return (
        f"pillar {name} is no box: at its ring it has {found.area:.3g} mm^2, and second moments of {about_y:.3g} "
        f"(bending in x) and {about_x:.3g} mm^4 (in y); rods, Eq. 3, design check and closed forms take the design's "
        f"{a * b:.3g} mm^2, {b * a**3 / 12.0:.3g} and {a * b**3 / 12.0:.3g} mm^4, and its sole for the feet"
    )


def _corner_note(plan: Layout, name: str, box: Box, found: Section | None) -> list[str]:
    """Where a pillar meets the beam, if not where the design's corner is."""
    mark = f"corner_{name}"
    if found is None or mark not in plan.landmarks:
        return []
    x = plan.landmarks[mark][0]
    end = float(found.high[0] if x > 0.5 * (box.low[0] + box.high[0]) else found.low[0])
    if abs(end - x) <= DETAIL * (box.high[0] - box.low[0]):
        return []
    return [
        f"pillar {name} meets the beam at x = {end:.3g} mm, but the stress about its corner is asked for at "
        f"{x:.3g} mm: give --landmark {mark}=X,Y,Z"
    ]

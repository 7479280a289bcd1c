"""A mesh whose pillars are not the boxes of its design: whether it is the design's machine, and what boxes leave out.

The beam and its span, the junction and the thickness and height of the rings are the design's; pillars may be round,
tapered or otherwise their own. What is derived from a design without a mesh takes boxes: that is said with numbers.
"""

from __future__ import annotations

import math
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from fem_biobot.design import Design
from fem_biobot.errors import MeshError
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.mesh.checks import check_volumes
from fem_biobot.mesh.cuts import Section, distances, lines, section, volume_above
from fem_biobot.mesh.facets import facets
from fem_biobot.mesh.layout import Box, Layout, layout, pillar_names

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

# by which lengths, areas and volumes of a machine may differ in details: rounded edges, chords of a circle
DETAIL = 0.02
# below the beam, of a pillar's height there: where the re-entrant corner is looked for
_BELOW = 0.02
# sections across the beam that are looked at
_ACROSS = 32


def unlike(plan: Layout, mesh: BodyMesh) -> str:
    """Why a mesh is not the bot of a layout with pillars of a shape of their own; nothing if it is.

    Its skeleton has the design's box, and in it the beam: its volume, and no less in sections across it. Its muscle has
    the junction's section, and rings of the design's height and, all round in the middle of it, thickness; all within
    2 % (of the pillar's length, for the thickness). Where their rings lie its pillars end along x no farther from the
    design's than a ring is thick, so that the junction is the design's.
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
    if why := _other_beam(plan.beam, points, mesh.cells[:, mesh.regions["skeleton"]]):
        return why
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
        return f"its rings are {thick[0]:.4g} and {thick[1]:.4g} mm thick at its ends, expected {thickness:.4g}"
    if why := _other_rings(plan, mesh, thickness):
        return why
    p, q, r = (points[:, row] for row in middle)
    area = 0.5 * float(np.linalg.norm(np.cross(q - p, r - p, axis=0), axis=0).sum())
    wanted = (junction.high[1] - junction.low[1]) * (junction.high[2] - junction.low[2])
    if abs(area - wanted) > DETAIL * wanted:
        return f"its junction has {area:.4g} mm^2 across, expected {wanted:.4g}"
    return ""


def _other_beam(beam: Box, points: Array, gel: Ints) -> str:
    """Why the gel above the pillars is not the beam; nothing if it is. Of what stands below, sections have more."""
    long, wide, high = (b - a for a, b in zip(beam.low, beam.high, strict=True))
    for k in range(_ACROSS):
        x = beam.low[0] + (k + 0.5) / _ACROSS * long
        across = section(points[[1, 2, 0]], gel, x)
        area = 0.0 if across is None else across.area
        if area < (1.0 - DETAIL) * wide * high:
            return f"its beam has {area:.4g} mm^2 across at x = {x:.3g} mm, expected {wide * high:.4g}"
    volume = volume_above(points, gel, beam.low[2])
    if abs(volume - beam.volume) > DETAIL * beam.volume:
        return f"its beam has {volume:.4g} mm^3 above z = {beam.low[2]:.4g} mm, expected {beam.volume:.4g}"
    return ""


def _other_rings(plan: Layout, mesh: BodyMesh, thickness: float) -> str:
    """Why rings are not as thick as the design's all round their pillars, in the middle of their height; else nothing.

    Their outsides lie a thickness from the pillars, up to the diagonal of its square at corners; a ring of the design
    about a pillar whose corners are rounded within 2 % of its section is as much farther there. A junction is where
    it is wide.
    """
    ring, pillar, half = _ring(plan), plan.pillars[0], plan.thin[0].high[1]
    z = 0.5 * (ring.low[2] + ring.high[2])
    above = mesh.points[2] >= z
    cut = np.flatnonzero(above[mesh.cells].any(axis=0) & ~above[mesh.cells].all(axis=0))
    table = facets(mesh.cells[:, cut])
    outside = table.elements[1] < 0
    gel = np.isin(cut[table.elements[0]], mesh.regions["skeleton"])
    bare, skin = (lines(mesh.points, table.triples[:, outside & some], z) for some in (gel, ~gel))
    touching = lines(mesh.points, mesh.surfaces.get("interface", np.empty((3, 0), dtype=np.int64)), z)
    free, joined = (float(np.linalg.norm(each[1] - each[0], axis=0).sum()) for each in (bare, touching))
    if free > DETAIL * (free + joined):
        return f"its rings touch {joined:.4g} of {free + joined:.4g} mm around its pillars at z = {z:.4g} mm"
    length, width = (pillar.high[k] - pillar.low[k] for k in (0, 1))
    slack = DETAIL * length
    rounding = math.sqrt(DETAIL * length * width / (4.0 - math.pi))
    most = math.sqrt(2.0) * thickness + (math.sqrt(2.0) - 1.0) * rounding + slack
    places = skin.transpose(1, 0, 2).reshape(2, -1)
    away = distances(touching, places)
    middles = [0.5 * (p.low[0] + p.high[0]) for p in (plan.pillars[0], plan.pillars[-1])]
    bay = (np.abs(places[1]) <= half * (1.0 + DETAIL)) & (middles[0] < places[0]) & (places[0] < middles[1])
    wrong = (away < thickness - slack) | ((away > most) & ~bay)
    if not wrong.any():
        return ""
    worst = int(np.argmax(np.where(wrong, np.abs(away - thickness), 0.0)))
    x, y = places[:, worst]
    return (
        f"its muscle is {away[worst]:.3g} mm thick about its pillar at ({x:.3g}, {y:.3g}) mm, expected {thickness:.4g}"
    )


def check_shape(plan: Layout, mesh: BodyMesh) -> None:
    """Refuse a mesh that is not the machine of a layout, whatever its pillars' shape.

    Raises
    ------
    MeshError
        Its volumes, or its pillars, are not the design's within 2 %, and it is `unlike` it.
    """
    slack = {name: DETAIL * volume for name, volume in plan.volumes.items()}
    own = bool(plan.pillars and plan.thin)
    try:
        check_volumes(mesh.region_volumes(), plan.volumes, slack)
    except MeshError as error:
        if not own:
            raise
        if why := unlike(plan, mesh):
            raise MeshError(f"{error}; nor is it the design's with pillars of their own: {why}") from None
        return
    if own and not _boxes(plan, mesh) and (why := unlike(plan, mesh)):
        raise MeshError(f"the mesh is not that of the design with pillars of their own: {why}")


def pillar_outlines(plan: Layout, mesh: BodyMesh) -> Array | None:
    """Where pillars that are no boxes meet their rings, as lines in the middle of these; None where all are boxes.

    Returns
    -------
    Array or None
        Both ends along x and y of the lines, (2, 2, k): end, axis, line [mm].
    """
    if "interface" not in mesh.surfaces or not plan.thin:
        return None
    if _boxes(plan, mesh) or unlike(plan, mesh):
        return None
    ring = _ring(plan)
    return lines(mesh.points, mesh.surfaces["interface"], 0.5 * (ring.low[2] + ring.high[2]))


def _boxes(plan: Layout, mesh: BodyMesh) -> bool:
    """Whether all pillars are the design's boxes where their rings lie."""
    ring = _ring(plan)
    found = _sections(plan, mesh, 0.5 * (ring.low[2] + ring.high[2]))
    return all(each is not None and is_box(box, each) for _, box, each in found)


def _ring(plan: Layout) -> Box:
    """A ring's box."""
    return next(box for box in plan.muscle if box not in plan.thin)


class Cut(Protocol):
    """What a section has, of a mesh or of a drawing: its area [mm^2], and its ends along x and y [mm]."""

    @property
    def area(self) -> float: ...
    @property
    def low(self) -> Array: ...
    @property
    def high(self) -> Array: ...


def is_box(box: Box, found: Cut) -> bool:
    """Whether a section is a design's rectangle but for details: its area, and where it ends along x and y."""
    low, high = np.array(box.low[:2]), np.array(box.high[:2])
    wanted, slack = float(np.prod(high - low)), DETAIL * (high - low)
    there = np.all(np.abs(found.low - low) <= slack) and np.all(np.abs(found.high - high) <= slack)
    return bool(there) and abs(found.area - wanted) <= DETAIL * wanted


def sizes_told(found: Cut) -> str:
    """Lengths along x and y, and area, in words."""
    return "{:.4g} x {:.4g} mm and {:.4g} mm^2".format(*(found.high - found.low), found.area)


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
        A pillar whose section or its ends differ by more than 2 %.
    """
    plan = layout(design)
    if not (plan.pillars and plan.muscle):
        return
    ring = _ring(plan)
    for name, box, found in _sections(plan, mesh, 0.5 * (ring.low[2] + ring.high[2])):
        if found is None or not is_box(box, found):
            there = "nothing" if found is None else sizes_told(found)
            raise MeshError(
                f"pillar {name}: found {there} at its ring, expected the design's box within 2 % for rods beside the "
                "solid"
            )


def shape_notes(design: Design, mesh: BodyMesh) -> list[str]:
    """What a mesh's pillars are where they differ from the design's boxes by more than 2 %, and who takes boxes."""
    plan = layout(design)
    if not (plan.pillars and plan.beam and plan.muscle and "skeleton" in mesh.regions):
        return []
    ring, notes = _ring(plan), []
    for name, box, found in _sections(plan, mesh, 0.5 * (ring.low[2] + ring.high[2])):
        if found is not None and not is_box(box, found):
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

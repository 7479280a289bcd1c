"""The solids of a layout in Gmsh's OpenCASCADE model: drawn from its numbers, or given by a person's files.

Speaks to the model it is handed and imports no Gmsh: `geometry` starts it, in a process of its own.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem_biobot.errors import MeshError
from fem_biobot.mesh.layout import Box, Layout, pillar_names
from fem_biobot.mesh.own_pillars import PillarSection, following_rings
from fem_biobot.mesh.stl import PlaneFaces

Array = NDArray[np.float64]

# of the longest edge of the skeleton's box: landmarks of the design would lie beside its faces, not on them
ALIGNED = 1e-6
# of the smaller part: beyond this two parts want the same place
OVERLAP = 1e-6
# of a skeleton's volume, after it was cut: far above the rounding of volumes within curved faces
LOST = 1e-4


@dataclass(frozen=True)
class Part:
    """A part of a person's own: the file, and the faces where it was a surface; a STEP file is read by OpenCASCADE."""

    file: str
    faces: PlaneFaces | None = None


@dataclass(frozen=True)
class Given:
    """Parts that are given instead of drawn.

    Attributes
    ----------
    skeleton, muscle
        Each a file; one STEP file may hold both, as solids of these names.
    align
        Whether they are moved so that the skeleton's box is the layout's.
    names
        Names of solids in a STEP file to skeleton or muscle, besides these words themselves.
    """

    skeleton: Part | None = None
    muscle: Part | None = None
    align: bool = False
    names: Mapping[str, str] = field(default_factory=dict)


NONE_GIVEN = Given()


def _add_box(occ: Any, box: Box) -> tuple[int, int]:
    return 3, occ.addBox(*box.low, *(b - a for a, b in zip(box.low, box.high, strict=True)))


def unnamed(tag: int) -> str:
    """Name of a solid in a model without names: none."""
    return ""


def solids(
    occ: Any, plan: Layout, given: Given = NONE_GIVEN, name_of: Callable[[int], str] = unnamed
) -> tuple[dict[str, list[int]], list[PillarSection]]:
    """Volumes of each region, cut against each other and through the landmarks and sections; sections rings follow.

    `name_of` tells the name that the file gave to a solid.

    Raises
    ------
    MeshError
        A given part has no volume, is not where the layout has it, or overlaps another.
    """
    followed: list[PillarSection] = []
    if given.skeleton is None:
        skeleton, came_along = drawn_skeleton(occ, plan), False
        muscle = drawn_muscle(occ, plan, [])
    else:
        skeleton, muscle = given_solids(occ, given, name_of)
        shift = _put_in_place(occ, plan, given.skeleton.file, skeleton, given.align)
        came_along = bool(muscle)
        if came_along:
            occ.translate(muscle, *shift)
        else:
            muscle, followed = muscle_around(occ, plan, skeleton, given.skeleton.file)
    sections = [(2, _section(occ, plan.muscle, x)) for x in plan.cuts]
    if plan.beam:
        sections += [(2, _section(occ, (plan.beam,), x)) for x in plan.beam_cuts]
    # fusing made one face of a pillar's side and the beam's: part them again, so that a pillar's face ends at the beam;
    # a rectangle about a round one would touch its circle, and leave slivers there
    own = {section.name for section in followed}
    boxes = zip(pillar_names(len(plan.pillars)), plan.pillars, strict=True) if plan.pillars else ()
    sections += [(2, _level(occ, box, box.high[2])) for name, box in boxes if name not in own]
    # the middle layer gives every mesh two elements across the thin muscle
    sections += [(2, _level(occ, box, (box.low[2] + box.high[2]) / 2)) for box in plan.thin]
    marks = [(0, occ.addPoint(*position)) for position in plan.landmarks.values()]
    whole = skeleton + muscle
    before = sum(float(occ.getMass(*entity)) for entity in skeleton)
    _, children = occ.fragment(whole, sections + marks)
    if given.skeleton is not None:
        _refuse_loss(occ, given.skeleton.file, before, children[: len(skeleton)])
    if came_along:
        _refuse_overlap(occ, given, children[: len(skeleton)], children[len(skeleton) : len(whole)])
    parts: dict[str, list[int]] = {}
    for name, first, last in (("skeleton", 0, len(skeleton)), ("muscle", len(skeleton), len(whole))):
        found = {tag for child in children[first:last] for dim, tag in child if dim == 3}
        if found:
            parts[name] = sorted(found)
    # what of the sections lies outside the muscle is no part of the body
    loose = {tag for child in children[len(whole) :] for dim, tag in child if dim == 2}
    for tag in sorted(loose):
        occ.remove([(2, tag)], recursive=True)
    return parts, followed


def drawn_skeleton(occ: Any, plan: Layout) -> list[tuple[int, int]]:
    """The skeleton of a layout as one solid; none where it has none."""
    skeleton = [_add_box(occ, box) for box in ([plan.beam] if plan.beam else []) + list(plan.pillars)]
    if plan.fillet_radius > 0:
        skeleton += [_fillet(occ, plan.fillet_radius, *line) for line in plan.corner_lines]
    if len(skeleton) > 1:
        skeleton, _ = occ.fuse(skeleton[:1], skeleton[1:])
    return skeleton


def drawn_muscle(
    occ: Any, plan: Layout, skeleton: list[tuple[int, int]], *, joined: bool = False
) -> list[tuple[int, int]]:
    """The muscle of a layout, as its parts or `joined` to one solid; what lies in a skeleton is cut out."""
    muscle = [_add_box(occ, box) for box in plan.muscle]
    if plan.holes and not (skeleton and plan.thin):
        muscle, _ = occ.cut(muscle, [_add_box(occ, box) for box in plan.holes])
    if muscle and skeleton:
        muscle, _ = occ.cut(muscle, skeleton, removeTool=False)
    if joined and len(muscle) > 1:
        muscle, _ = occ.fuse(muscle[:1], muscle[1:])
    return muscle


def muscle_around(
    occ: Any, plan: Layout, skeleton: list[tuple[int, int]], file: str
) -> tuple[list[tuple[int, int]], list[PillarSection]]:
    """The muscle of a layout built round the very pillars of a given skeleton, and those sections that rings follow.

    What of the skeleton would lie in it is cut out.

    Raises
    ------
    MeshError
        A pillar whose ring cannot be built; the message names the file.
    """
    try:
        solids, followed = following_rings(occ, plan, skeleton)
    except MeshError as error:
        raise MeshError(f"{file}: {error}") from None
    if not followed:
        return drawn_muscle(occ, plan, skeleton), []
    muscle, _ = occ.cut(solids, skeleton, removeTool=False)
    return muscle, followed


def _section(occ: Any, boxes: tuple[Box, ...], x: float) -> int:
    """Rectangle normal to x that cuts through all of the boxes at `x`."""
    boxes = tuple(box for box in boxes if box.low[0] < x < box.high[0])
    y0, y1 = min(b.low[1] for b in boxes), max(b.high[1] for b in boxes)
    z0, z1 = min(b.low[2] for b in boxes), max(b.high[2] for b in boxes)
    return _polygon(occ, [(x, y0, z0), (x, y1, z0), (x, y1, z1), (x, y0, z1)])


def _level(occ: Any, box: Box, z: float) -> int:
    """Rectangle normal to z at the height `z` of a box."""
    (x0, y0, _), (x1, y1, _) = box.low, box.high
    return _polygon(occ, [(x0, y0, z), (x1, y0, z), (x1, y1, z), (x0, y1, z)])


def _polygon(occ: Any, positions: list[tuple[float, float, float]]) -> int:
    corners = [occ.addPoint(*position) for position in positions]
    lines = [occ.addLine(a, b) for a, b in zip(corners, corners[1:] + corners[:1], strict=True)]
    return occ.addPlaneSurface([occ.addCurveLoop(lines)])


def _fillet(occ: Any, r: float, start: tuple[float, ...], end: tuple[float, ...], sign: float) -> tuple[int, int]:
    """Prism that rounds the corner line `start` to `end` of a pillar and the beam's lower face with radius `r`."""
    x, y, z = start
    corner = occ.addPoint(x, y, z)
    under_beam = occ.addPoint(x + sign * r, y, z)
    on_pillar = occ.addPoint(x, y, z - r)
    centre = occ.addPoint(x + sign * r, y, z - r)
    loop = occ.addCurveLoop(
        [
            occ.addLine(corner, under_beam),
            occ.addCircleArc(under_beam, centre, on_pillar),
            occ.addLine(on_pillar, corner),
        ]
    )
    solids = occ.extrude([(2, occ.addPlaneSurface([loop]))], 0, end[1] - y, 0)
    return next(entity for entity in solids if entity[0] == 3)


def _imported(occ: Any, part: Part) -> list[tuple[int, int]]:
    """Solids of a person's part [mm]."""
    if part.faces is not None:
        return [(3, _from_faces(occ, part.faces))]
    found = [entity for entity in occ.importShapes(part.file) if entity[0] == 3]
    if not found:
        raise MeshError(f"{part.file}: holds no volume; expected a solid (in CAD: knit the surfaces into a body)")
    return found


def _from_faces(occ: Any, faces: PlaneFaces) -> int:
    """Solid within plane faces; neighbours share their lines."""
    points = [occ.addPoint(*position) for position in faces.points.T.tolist()]
    lines: dict[tuple[int, int], int] = {}

    def line(a: int, b: int) -> int:
        if (b, a) in lines:
            return -lines[b, a]
        if (a, b) not in lines:
            lines[a, b] = occ.addLine(points[a], points[b])
        return lines[a, b]

    surfaces = []
    for loops in faces.loops:
        wires = [
            occ.addCurveLoop([line(a, b) for a, b in zip(loop, loop[1:] + loop[:1], strict=True)]) for loop in loops
        ]
        surfaces.append(occ.addPlaneSurface(wires))
    return occ.addVolume([occ.addSurfaceLoop(surfaces)])


def given_solids(
    occ: Any, given: Given, name_of: Callable[[int], str] = unnamed
) -> tuple[list[tuple[int, int]], list[tuple[int, int]]]:
    """A person's skeleton as one solid, and the muscle's solids; none of these where it is to be built.

    Raises
    ------
    MeshError
        A file without a volume, a skeleton of parts that do not touch, names that are known in part only.
    """
    assert given.skeleton is not None
    skeleton, muscle = _by_name(given.skeleton.file, _imported(occ, given.skeleton), given, name_of)
    if given.muscle is not None:
        if muscle:
            raise MeshError(f"{given.muscle.file}: found a muscle in {given.skeleton.file}, too; expected one of them")
        muscle = _imported(occ, given.muscle)
    if len(skeleton) > 1:
        skeleton, _ = occ.fuse(skeleton[:1], skeleton[1:])
    if len(skeleton) > 1:
        raise MeshError(
            f"{given.skeleton.file}: holds {len(skeleton)} bodies that do not touch; expected one skeleton, or solids "
            "named skeleton and muscle (--rename NAME=REGION for other names)"
        )
    return skeleton, muscle


def _by_name(
    file: str, solids: list[tuple[int, int]], given: Given, name_of: Callable[[int], str]
) -> tuple[list[tuple[int, int]], list[tuple[int, int]]]:
    """Solids of a file that are skeleton, and those that are muscle; all are skeleton where no name says otherwise."""
    # a STEP file's product, below the assemblies that it is part of
    titles = [name_of(tag).rpartition("/")[2].strip() for _, tag in solids]
    strange = sorted(set(given.names) - set(titles))
    if strange:
        raise MeshError(f"{file}: --rename names {strange[0]}, but the solids are {_listed(titles)}")
    regions = [given.names.get(title, title.lower()) for title in titles]
    if not set(regions) & {"skeleton", "muscle"}:
        return solids, []
    other = [title for title, region in zip(titles, regions, strict=True) if region not in ("skeleton", "muscle")]
    if other:
        raise MeshError(
            f"{file}: the solid {other[0] or 'without a name'} is not known, expected skeleton or muscle, or "
            "--rename NAME=REGION"
        )
    found = [
        [s for s, region in zip(solids, regions, strict=True) if region == name] for name in ("skeleton", "muscle")
    ]
    if not found[0]:
        raise MeshError(f"{file}: found no solid named skeleton, only {_listed(titles)}")
    return found[0], found[1]


def _listed(titles: list[str]) -> str:
    return ", ".join(title or "without a name" for title in titles)


def _put_in_place(occ: Any, plan: Layout, file: str, skeleton: list[tuple[int, int]], align: bool) -> Array:
    """How far a person's skeleton was moved to its place, (3,) [mm]."""
    corners = np.array([occ.getBoundingBox(*entity) for entity in skeleton])
    found = np.array([corners[:, :3].min(axis=0), corners[:, 3:].max(axis=0)])
    shift = shift_to(file, found, skeleton_box(plan), align=align)
    if shift.any():
        occ.translate(skeleton, *shift)
    return shift


def skeleton_box(plan: Layout) -> Array:
    """Lowest and highest corner of a layout's skeleton, rows, (2, 3) [mm]."""
    boxes = [*([plan.beam] if plan.beam else []), *plan.pillars]
    if not boxes:
        raise MeshError("the design has no skeleton; expected a bot or a cantilever")
    return np.array([np.min([b.low for b in boxes], axis=0), np.max([b.high for b in boxes], axis=0)])


def shift_to(file: str, found: Array, wanted: Array, *, align: bool) -> Array:
    """How far a box, rows (2, 3), has to be moved to be another of the same lengths, (3,) [mm]; zero if it is there.

    Raises
    ------
    MeshError
        Its lengths are others (in another unit, or turned, as the message says), or it is elsewhere and shall not be
        moved.
    """
    long, asked = found[1] - found[0], wanted[1] - wanted[0]
    slack = ALIGNED * float(asked.max())
    if np.abs(long - asked).max() > 2.0 * slack:
        hint = "; set the design's lengths to those of the skeleton, or take them from it with --fit"
        factor = float(np.median(asked / np.maximum(long, 1e-300)))
        if np.allclose(long * factor, asked, rtol=0.02) and not 0.5 < factor < 2.0:
            much = f"{factor:.3g} times too small" if factor > 1.0 else f"{1.0 / factor:.3g} times too large"
            hint = f"; all of it is {much}: is its unit right?"
        elif np.abs(np.sort(long) - np.sort(asked)).max() <= 2.0 * slack:
            hint = "; it is turned: x runs from the short to the long pillar, z is up"
        raise MeshError(f"{file}: the skeleton is {_sizes(long)}, but that of the design is {_sizes(asked)}{hint}")
    shift = wanted.mean(axis=0) - found.mean(axis=0)
    if np.abs(shift).max() <= slack:
        return np.zeros(3)
    if not align:
        away = ", ".join(f"{0.0 - d:.4g}" for d in shift)
        raise MeshError(
            f"{file}: the skeleton lies ({away}) mm from its place (x = 0 at mid-span, "
            "y = 0 at mid-width, z = 0 at the sole of the longest pillar); move it, or ask for --align"
        )
    return shift


def _sizes(lengths: Array) -> str:
    return " x ".join(f"{length:.6g}" for length in lengths) + " mm"


def _refuse_loss(occ: Any, file: str, before: float, children: list[Any]) -> None:
    """Refuse a skeleton of which OpenCASCADE lost a part as it was cut; it may where curved faces just touch others."""
    after = sum(float(occ.getMass(*entity)) for entity in {e for child in children for e in child if e[0] == 3})
    if abs(after - before) > LOST * before:
        raise MeshError(
            f"{file}: found {after:.4g} of the skeleton's {before:.4g} mm^3 after it was cut at landmarks and muscle, "
            "expected all: it may be lost where curved faces just touch others, as a pillar's at the beam's end; draw "
            "them 0.01 mm apart"
        )


def _refuse_overlap(occ: Any, given: Given, skeleton: list[Any], muscle: list[Any]) -> None:
    """Refuse a given muscle that lies in the skeleton; a drawn one was cut by it."""
    first, second = ({entity for child in part for entity in child if entity[0] == 3} for part in (skeleton, muscle))
    volumes = {entity: occ.getMass(*entity) for entity in first | second}
    common = sum(volumes[entity] for entity in first & second)
    smaller = min(sum(volumes[entity] for entity in part) for part in (first, second))
    if common > OVERLAP * smaller:
        part = given.muscle or given.skeleton
        assert part is not None
        raise MeshError(f"{part.file}: the muscle overlaps the skeleton in {common:.3g} mm^3; expected none")

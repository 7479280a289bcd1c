"""Where the parts of a design are: boxes, landmarks, planes and closed-form volumes, as plain numbers.

Answers, without a mesh and without Gmsh, what the body of a design looks like; the generator builds it, the checks
compare a mesh with it and the naming finds its surfaces. x runs from the short to the long pillar with zero at
mid-span, z is up with zero at the sole of the longest pillar.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any

from fem_biobot.design import Design

Point = tuple[float, float, float]

# of elements along y to those across, in meshes for the closing: beam, junction and the edges at which their errors
# arise run along y, and what happens there changes little along it
ALONG_EDGES = 1.5
# of a ring's elements along the vertical edges of pillars that it wraps around, to those elsewhere in it, in meshes for
# the edges: what overlaps of unbonded rings there is a share of the facets' length (`studies/ring_contact.py`)
EDGE_SHARE = 0.2


@dataclass(frozen=True)
class Box:
    """Axis-parallel box from corner `low` to corner `high`, (3,) each [mm]."""

    low: Point
    high: Point

    @property
    def volume(self) -> float:
        """Volume [mm^3]."""
        return math.prod(b - a for a, b in zip(self.low, self.high, strict=True))


@dataclass(frozen=True)
class Face:
    """Flat rectangle normal to `axis` at `at`, bounded by `low` and `high` (the entry of `axis` is not used) [mm].

    `region` is the region whose boundary it lies on, or None for an interior section of the muscle.
    """

    axis: int
    at: float
    low: Point
    high: Point
    region: str | None


@dataclass(frozen=True)
class Layout:
    """Everything the shape of a design says, in mm.

    Attributes
    ----------
    beam
        Beam box, or None.
    pillars
        Pillar boxes from short to long; each ends at the beam's lower face.
    muscle
        Solid boxes of the muscle: rings (their pillar is cut out later), loop, junctions or strip.
    holes
        Boxes cut out of the muscle boxes.
    thin
        Boxes of the thin muscle (junctions, strip), to be meshed finest.
    fillet_radius
        Radius of the re-entrant corners; zero for sharp ones.
    corner_lines
        Ends of the re-entrant lines between beam and pillars, with the sign of x away from the pillar.
    landmarks
        Name to position.
    faces
        Name of a surface to its flat rectangle.
    volumes
        Region to closed-form volume [mm^3].
    volume_slack
        Region to the largest excess that straight facets on curved fillets can cause [mm^3]; zero if all is flat.
    cuts
        x of the sections that the mesh must contain as facets of the muscle.
    beam_cuts
        The same for the beam, so that landmarks inside it lie on facets.
    for_closing
        Whether a mesh is to be finer where the tips' closing is decided, with elements that are longer along y.
    edge_share
        Size of a ring's elements along the vertical edges that it wraps around, to those elsewhere in it [1].
    """

    beam: Box | None
    pillars: tuple[Box, ...]
    muscle: tuple[Box, ...]
    holes: tuple[Box, ...]
    thin: tuple[Box, ...]
    fillet_radius: float
    corner_lines: tuple[tuple[Point, Point, float], ...]
    landmarks: Mapping[str, Point]
    faces: Mapping[str, Face]
    volumes: Mapping[str, float]
    volume_slack: Mapping[str, float] = field(default_factory=dict)
    cuts: tuple[float, ...] = ()
    beam_cuts: tuple[float, ...] = ()
    for_closing: bool = False
    edge_share: float = 1.0

    @property
    def grading(self) -> str:
        """What `mesh.grading` comes to for this body: a strip and a cantilever are even."""
        return "closing" if self.for_closing else "edges" if self.edge_share < 1.0 else "even"

    @property
    def lengthened(self) -> float:
        """How much longer the elements of its meshes are along y [1]."""
        return ALONG_EDGES if self.for_closing else 1.0


def shortened(plan: Layout, factor: float) -> Layout:
    """A layout whose lengths along y are divided by `factor`: what is meshed evenly there has longer elements here."""

    def point(p: Point) -> Point:
        return p[0], p[1] / factor, p[2]

    def box(b: Box) -> Box:
        return Box(point(b.low), point(b.high))

    return replace(
        plan,
        beam=plan.beam and box(plan.beam),
        pillars=tuple(box(b) for b in plan.pillars),
        muscle=tuple(box(b) for b in plan.muscle),
        holes=tuple(box(b) for b in plan.holes),
        thin=tuple(box(b) for b in plan.thin),
        corner_lines=tuple((point(start), point(end), sign) for start, end, sign in plan.corner_lines),
        landmarks={name: point(p) for name, p in plan.landmarks.items()},
        faces={},
        volumes={name: volume / factor for name, volume in plan.volumes.items()},
        volume_slack={name: slack / factor for name, slack in plan.volume_slack.items()},
    )


def layout(design: Design) -> Layout:
    """Layout of a design of any kind (bot, strip or cantilever)."""
    if design.kind == "bot":
        return _bot(design)
    if design.kind == "strip":
        return _strip(design)
    return _cantilever(design)


def _strip(design: Design) -> Layout:
    m: Any = design.muscle
    a, b, c, z = m.junction_length / 2, m.junction_width / 2, m.junction_thickness / 2, m.junction_height
    box = Box((-a, -b, z - c), (a, b, z + c))
    faces = {
        "end_minus": Face(0, -a, box.low, box.high, "muscle"),
        "end_plus": Face(0, a, box.low, box.high, "muscle"),
        "junction_mid": Face(0, 0.0, box.low, box.high, None),
    }
    return Layout(None, (), (box,), (), (box,), 0.0, (), design.landmarks(), faces, {"muscle": box.volume}, cuts=(0.0,))


def _cantilever(design: Design) -> Layout:
    s: Any = design.skeleton
    z, b, t = design.beam_axis_height, s.beam_width / 2, s.beam_thickness / 2
    box = Box((0.0, -b, z - t), (s.beam_length, b, z + t))
    faces = {
        "clamp": Face(0, 0.0, box.low, box.high, "skeleton"),
        "tip": Face(0, s.beam_length, box.low, box.high, "skeleton"),
        "beam_top": Face(2, z + t, box.low, box.high, "skeleton"),
    }
    return Layout(box, (), (), (), (), 0.0, (), design.landmarks(), faces, {"skeleton": box.volume})


def pillar_names(count: int) -> list[str]:
    """Names of the pillars from short to long: short, middle_1, ..., long."""
    return ["short", *(f"middle_{k}" for k in range(1, count - 1)), "long"]


def _bot(design: Design) -> Layout:
    s: Any = design.skeleton
    m: Any = design.muscle
    half_length, half_width, half_thickness = s.beam_length / 2, s.beam_width / 2, s.beam_thickness / 2
    z_beam = design.beam_axis_height
    z_low = z_beam - half_thickness
    beam = Box((-half_length, -half_width, z_low), (half_length, half_width, z_beam + half_thickness))
    a, b = s.pillar_length / 2, s.pillar_width / 2
    pillars = [Box((x - a, -b, z_beam - height), (x + a, b, z_low)) for x, height in design.pillars]
    bays = [(p.high[0], q.low[0]) for p, q in pairwise(pillars)]
    if m.layout == "ring":
        muscle, holes, thin, cuts, muscle_volume = _loop(m, pillars)
    else:
        muscle, holes, thin, cuts, muscle_volume = _rings_and_junctions(m, pillars, bays)
    r = s.fillet_radius
    lines = []
    for x0, x1 in bays:
        lines += [
            ((x0, -b, z_low), (x0, b, z_low), 1.0),
            ((x1, -b, z_low), (x1, b, z_low), -1.0),
        ]
    skeleton_volume = beam.volume + sum(p.volume for p in pillars)
    skeleton_volume += len(lines) * (1 - math.pi / 4) * r**2 * s.pillar_width
    # the coarsest mesh replaces the quarter circle by one chord, which adds pi/4 - 1/2 of r^2
    slack = len(lines) * (math.pi / 4 - 0.5) * r**2 * s.pillar_width
    return Layout(
        beam,
        tuple(pillars),
        muscle,
        holes,
        thin,
        r,
        tuple(lines),
        _bot_landmarks(design, pillars),
        _bot_faces(beam, pillars, muscle, cuts),
        {"skeleton": skeleton_volume, "muscle": muscle_volume},
        {"skeleton": slack},
        cuts,
        (pillars[0].high[0], 0.0, pillars[-1].low[0]),
        design.mesh.grading == "closing",
        EDGE_SHARE if design.mesh.grading == "edges" else 1.0,
    )


def _ring_levels(m: Any) -> tuple[float, float]:
    z = m.junction_height + m.ring_offset
    return z - m.ring_height / 2, z + m.ring_height / 2


def _loop(m: Any, pillars: Sequence[Box]) -> tuple[Any, Any, Any, tuple[float, ...], float]:
    half_pillar = pillars[0].high[1]
    z0, z1 = _ring_levels(m)
    x0, x1, w = pillars[0].low[0], pillars[-1].high[0], m.ring_thickness
    outer = Box((x0 - w, -half_pillar - w, z0), (x1 + w, half_pillar + w, z1))
    inner = Box((x0, -half_pillar, z0), (x1, half_pillar, z1))
    return (outer,), (inner,), (), (0.0,), outer.volume - inner.volume


def _rings_and_junctions(
    m: Any, pillars: Sequence[Box], bays: list[tuple[float, float]]
) -> tuple[Any, Any, Any, tuple[float, ...], float]:
    z0, z1 = _ring_levels(m)
    w = m.ring_thickness
    rings = [Box((p.low[0] - w, p.low[1] - w, z0), (p.high[0] + w, p.high[1] + w, z1)) for p in pillars]
    holes = [Box((p.low[0], p.low[1], z0), (p.high[0], p.high[1], z1)) for p in pillars]
    j0, j1 = m.junction_height - m.junction_thickness / 2, m.junction_height + m.junction_thickness / 2
    y = m.junction_width / 2
    junctions = tuple(Box((a, -y, j0), (b, y, j1)) for a, b in bays)
    volume = sum(r.volume - h.volume for r, h in zip(rings, holes, strict=True)) + sum(j.volume for j in junctions)
    # a junction runs through the inner sides of two rings; that part was counted twice
    volume -= len(junctions) * 2 * w * m.junction_width * max(0.0, min(j1, z1) - max(j0, z0))
    # x = 0 itself, not a sum of halves, where the middle bay is centred there
    cuts = tuple(0.0 if abs(a + b) < 1e-9 * (b - a) else (a + b) / 2 for a, b in bays)
    return (*rings, *junctions), tuple(holes), junctions, cuts, volume


def _bot_landmarks(design: Design, pillars: Sequence[Box]) -> dict[str, Point]:
    marks = design.landmarks()
    for name, p in list(zip(pillar_names(len(pillars)), pillars, strict=True))[1:-1]:
        marks[f"foot_{name}_centre"] = ((p.low[0] + p.high[0]) / 2, 0.0, p.low[2])
    return marks


def _bot_faces(beam: Box, pillars: Sequence[Box], muscle: Sequence[Box], cuts: tuple[float, ...]) -> dict[str, Face]:
    faces = {"beam_top": Face(2, beam.high[2], beam.low, beam.high, "skeleton")}
    names = pillar_names(len(pillars))
    for name, p in zip(names, pillars, strict=True):
        faces[f"foot_{name}"] = Face(2, p.low[2], p.low, p.high, "skeleton")
        ends = {"minus": p.low[0], "plus": p.high[0]}
        if name == "short":
            ends = {"outer": p.low[0], "inner": p.high[0]}
        elif name == "long":
            ends = {"inner": p.low[0], "outer": p.high[0]}
        for end, x in ends.items():
            faces[f"pillar_{name}_{end}"] = Face(0, x, p.low, p.high, "skeleton")
    low: Any = tuple(min(b.low[k] for b in muscle) for k in range(3))
    high: Any = tuple(max(b.high[k] for b in muscle) for k in range(3))
    # an odd number of pillars has one at x = 0: its next bay toward the long pillar stands for the middle
    middle = len(cuts) // 2
    faces["junction_mid"] = Face(0, cuts[middle], low, high, None)
    if len(cuts) > 1:
        for k, x in enumerate(cuts, start=1):
            faces[f"junction_mid_{k}"] = Face(0, x, low, high, None)
    return faces

"""From a design to rods: beam, rigid pillars, muscle at its moment arm, masses and feet, in closed form.

Nothing is fitted: every number of the model follows from the design by a formula that stands here. What the reduction
leaves out is listed at `reduce`. Reads the design alone; knows nothing of meshes or of the solid.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem_biobot.design import Design
from fem_biobot.errors import ModelError
from fem_biobot.muscle.oxygenation import viable_gamma
from fem_biobot.rod.activation.curve import MuscleCurve
from fem_biobot.rod.activation.named import force_length_curve
from fem_biobot.rod.build import Load
from fem_biobot.rod.drag.record import Drag
from fem_biobot.rod.ground import ContactPoints, Ground
from fem_biobot.rod.model import RodModel
from fem_biobot.rod.published.design import walker_of
from fem_biobot.rod.published.machine import elastica_walker
from fem_biobot.rod.published.machine import ground_of as published_ground
from fem_biobot.rod.records import Body, Gravity, Hold, Muscle, PointLoad, Rigid, Rod, Vector
from fem_biobot.rod.rest import floating
from fem_biobot.rod.section import RodMaterial, Section

Array = NDArray[np.float64]
GRAVITY = 9810.0  # mm/s^2
# how a muscle's tension must be stated for members that pull along one line by their nominal tension
_PLAIN_TENSION: dict[str, object] = {
    "muscle.convention": "nominal",
    "muscle.spread": 0.0,
    "muscle.transverse": 0.0,
}


class PlateFactor(StrEnum):
    """Which modulus the beam has in bending about its lateral axis and in stretch.

    none
        ``E``: a beam whose section is free to curve sideways. The softest reading of a plate.
    plane_strain
        ``E / (1 - nu^2)``: a plate that cannot curve sideways, 1.25 times as stiff at nu = 0.45. The shear modulus
        stays ``E / (2 (1 + nu))``. A plate as wide as it is long between rigid pillars lies between the two.
    """

    none = "none"
    plane_strain = "plane_strain"


class Strands(StrEnum):
    """What a ring of muscle around all pillars can do where it passes them.

    slide
        It slips freely along the pillars' sides and pulls on the outer faces: its length is the whole machine's.
    bonded
        It is stuck to the pillars: between them alone it can shorten, its length is that of a bay. Stiffer by the
        ratio of the lengths; with the same standing and active force.
    """

    slide = "slide"
    bonded = "bonded"


# centre (3,) [mm], edges (3,) [mm], and volume [mm^3], negative to take it away; a point has edges of zero
Part = tuple[Array, Array, float]


@dataclass(frozen=True)
class Lump:
    """Mass, its centre, the inertia about that, the volume and the looks of a union of boxes of one density."""

    mass: float
    centre: Array
    inertia: Array
    volume: float
    boxes: tuple[tuple[Vector, Vector], ...] = ()

    def body(self, name: str) -> Body:
        """As a rigid body."""
        x, y, z = (float(c) for c in self.centre)
        return Body((x, y, z), self.mass, self.inertia, name, self.volume, self.boxes)


def lump(parts: Sequence[Part], density: float) -> Lump:
    """Sum of boxes and points of one density [kg/mm^3].

    Notes
    -----
    A box of edges a, b, c has the inertia ``m (b^2 + c^2) / 12`` about its centre along a; parallel axes for the rest.
    """
    centres, size = (np.array([part[i] for part in parts], dtype=float) for i in (0, 1))
    volume = np.array([part[2] for part in parts], dtype=float)
    centre = volume @ centres / volume.sum()
    arm = centres - centre
    # second moments of position, from which the inertia is trace minus moment
    second = np.einsum("b,bi,bj->ij", volume, arm, arm) + np.diag(volume @ (size**2 / 12.0))
    inertia = density * (np.trace(second) * np.eye(3) - second)
    return Lump(density * float(volume.sum()), centre, inertia, float(volume.sum()), _solid(parts))


def _solid(parts: Sequence[Part]) -> tuple[tuple[Vector, Vector], ...]:
    """Boxes, centre and edges, that fill what the parts leave: of each, what lies around the boxes taken away."""
    spans = [(centre - edges / 2, centre + edges / 2, volume) for centre, edges, volume in parts if edges.all()]
    left = [(low, high) for low, high, volume in spans if volume > 0.0]
    for a, b, volume in spans:
        if volume < 0.0:
            left = [piece for low, high in left for piece in _around(low, high, a, b)]
    return tuple((_vector((low + high) / 2), _vector(high - low)) for low, high in left)


def _around(low: Array, high: Array, a: Array, b: Array) -> list[tuple[Array, Array]]:
    """What is left of the box from `low` to `high` without that from `a` to `b`, in at most six boxes."""
    if (np.minimum(high, b) <= np.maximum(low, a)).any():
        return [(low, high)]
    found, low, high = [], low.copy(), high.copy()
    for axis in range(3):
        for end, cut in ((low, a), (high, b)):
            below, above = low.copy(), high.copy()
            (above if end is low else below)[axis] = np.clip(cut[axis], low[axis], high[axis])
            if above[axis] > below[axis]:
                found.append((below, above))
            end[axis] = np.clip(cut[axis], low[axis], high[axis])
    return found


def _vector(values: Array) -> Vector:
    x, y, z = (float(v) for v in values)
    return (x, y, z)


def _box(low: Vector, high: Vector, sign: float = 1.0) -> Part:
    a, b = np.array(low), np.array(high)
    return (a + b) / 2, b - a, sign * float((b - a).prod())


def pillar_names(count: int) -> list[str]:
    """Bodies of the pillars from the short to the long one: pillar_short, pillar_middle_1, ..., pillar_long."""
    return ["pillar_short", *(f"pillar_middle_{k}" for k in range(1, count - 1)), "pillar_long"]


def _numbered(name: str, count: int) -> list[str]:
    return [name] if count == 1 else [f"{name}_{k}" for k in range(1, count + 1)]


def ground_of(design: Design) -> Ground:
    """The design's ground: a level plane at z = 0 with its two coefficients."""
    if design.kind == "walker":
        return published_ground(walker_of(design))
    return Ground(design.ground.static_friction, design.ground.kinetic_friction)


def reduce(
    design: Design,
    *,
    beam_elements: int = 16,
    plate_factor: PlateFactor | str = PlateFactor.none,
    strands: Strands | str = Strands.slide,
) -> RodModel:
    """Rods and rigid bodies of a design, in the design's frame.

    Parameters
    ----------
    design
        A bot, a cantilever (clamped rod with its tip force), or the published walker, see `elastica_walker`: of fixed
        elements, without the readings.
    beam_elements
        Elements of each stretch of beam between two pillars, or of a cantilever; even, so that mid-span is a node.
    plate_factor, strands
        Readings that the design leaves open; see `PlateFactor` and `Strands`.

    Returns
    -------
    RodModel
        Rods ``beam`` (``beam_1``, ... with more than two pillars), bodies ``pillar_short``, ``pillar_middle_1``, ...,
        ``pillar_long`` with ``ring_...`` fixed to them, muscles ``muscle`` (``muscle_1``, ...), and one group of four
        contact points a foot, from the short to the long pillar.

    Raises
    ------
    ModelError
        A strip, which is muscle alone; a number of elements that is odd or below two; a part without density; a
        muscle whose tension is stated in a way that members, which pull along one line, do not have.

    Notes
    -----
    *Beam.* Each bay between two pillars is a straight rod of the section ``beam_width x beam_thickness`` on the beam
    axis, with Cowper's shear factor. The beam above a pillar, and the pillar, are one rigid body.
    *Muscle.* Layout ``junction``: a member in each bay at the junction's height, between the pillars' inner faces, of
    the section ``junction_width x junction_thickness``; layout ``ring``: two members beside the pillars, each of the
    section ``ring_thickness x ring_height``. Force after Eq. 2 of the paper, ``A (gamma sin(theta) T + E (s - 1) / s)``
    at the stretch s, gamma once, in the passive and the active tension ``T``, the active one with the factors of
    `muscle.force_length` and of `muscle.force_velocity`. Reference ``as_moulded``: no passive stress as drawn;
    ``remodelled``: none in the shape to which the standing tension alone bends the free machine, weight left out.
    *Masses.* Gel: pillars and beam. Tissue: a frame of ``ring_thickness x ring_height`` around each pillar, bonded to
    it, and the muscle between, half at each end. Each has its own centre, so that buoyancy acts where it should.
    *Damping.* Kelvin-Voigt with ``numerics.damping_time`` in beam and muscle.
    *Drag.* None without ``ground.viscosity``. With it, in the medium at rest: each pillar with its ring as a sphere of
    their volume, each bay of the beam, which is a plate and no slender rod, as one of its volume, linear and quadratic
    (see `Drag`, an assumption: about the size, not the shape). The ground's nearness is left out.

    Left out: the pillars' flexibility and the beam's above them (a corner of gel yields: the solid is softer there),
    fillets, shear lag where the muscle joins a pillar, the rings' own stiffness and tension (they are taken as shrunk
    on, without net force), bending of the muscle, its contact with beam or pillar, and warping of the beam.
    """
    factor, strands = PlateFactor(plate_factor), Strands(strands)
    if design.kind == "walker":
        return elastica_walker(walker_of(design))
    if design.kind == "strip":
        raise ModelError("kind: found strip, a muscle alone, expected a design with a beam for a rod model")
    if isinstance(beam_elements, bool) or not isinstance(beam_elements, int) or beam_elements < 2 or beam_elements % 2:
        raise ModelError(f"beam_elements: found {beam_elements!r}, expected an even number of at least 2")
    if design.kind == "cantilever":
        return _cantilever(design, beam_elements, factor)
    parts = _bot(design, beam_elements, factor, strands)
    if design.value("muscle.reference") == "remodelled":
        parts["members"] = _remodelled(parts)
    return RodModel(**parts)


def _beam_material(design: Design, factor: PlateFactor) -> RodMaterial:
    gel = design.value("skeleton.material")
    if factor is PlateFactor.plane_strain:
        shear = gel.young / (2.0 * (1.0 + gel.poisson))
        return RodMaterial(young=gel.young / (1.0 - gel.poisson**2), density=gel.density, shear_modulus=shear)
    return RodMaterial(young=gel.young, density=gel.density, poisson=gel.poisson)


def _beam(name: str, start: float, end: float, z: float, elements: int, section: Section, material: RodMaterial) -> Rod:
    # from both ends to the middle, so that a symmetric machine has symmetric nodes to the last digit
    s = np.arange(elements + 1) / elements
    x = np.where(s <= 0.5, start + s * (end - start), end - (1.0 - s) * (end - start))
    points = np.column_stack([x, np.zeros_like(x), np.full_like(x, z)])
    return Rod(points, section, material, name, normal=(0.0, 1.0, 0.0))


def _cantilever(design: Design, elements: int, factor: PlateFactor) -> RodModel:
    beam, gel = design.value("skeleton"), design.value("skeleton.material")
    section = Section.rectangle(beam.beam_width, beam.beam_thickness, poisson=gel.poisson)
    rod = _beam(
        "beam", 0.0, beam.beam_length, design.beam_axis_height, elements, section, _beam_material(design, factor)
    )
    load = PointLoad(("beam", -1), force=(0.0, 0.0, design.value("load.tip_force")))
    return RodModel([rod], supports=[Hold(("beam", 0))], loads=[load], damping_time=design.numerics.damping_time)


def _bot(design: Design, elements: int, factor: PlateFactor, strands: Strands) -> dict[str, Any]:
    """Arguments of the model."""
    s, m = design.value("skeleton"), design.value("muscle")
    for key, plain in _PLAIN_TENSION.items():
        if design.value(key) != plain:
            found = design.value(key)
            raise ModelError(f"{key}: found {found}, expected {plain} for a rod model, whose muscles are lines")
    if m.activation is not None:
        raise ModelError("muscle.activation: found one, expected none for a rod model, whose muscles are lines")
    for key in ("skeleton.material.density", "muscle.material.density"):
        if not design.value(key) > 0.0:
            raise ModelError(f"{key}: found {design.value(key):g} kg/mm^3, expected a density above 0 for a rod model")
    axis, names = design.beam_axis_height, pillar_names(s.pillar_count)
    half_x, half_y, half_beam, half_thick = (
        s.pillar_length / 2,
        s.pillar_width / 2,
        s.beam_width / 2,
        s.beam_thickness / 2,
    )
    bays = [(a + half_x, b - half_x) for (a, _), (b, _) in pairwise(design.pillars)]
    section = Section.rectangle(s.beam_width, s.beam_thickness, poisson=s.material.poisson)
    material = _beam_material(design, factor)
    rods = [
        _beam(name, *bay, axis, elements, section, material)
        for name, bay in zip(_numbered("beam", len(bays)), bays, strict=True)
    ]
    bodies, rings, joints, feet = [], [], [], []
    for k, (name, (x, height)) in enumerate(zip(names, design.pillars, strict=True)):
        low, high, sole = x - half_x, x + half_x, axis - height
        pillar = _box((low, -half_y, sole), (high, half_y, axis - half_thick))
        top = _box((low, -half_beam, axis - half_thick), (high, half_beam, axis + half_thick))
        gel = lump([pillar, top], s.material.density).body(name)
        bodies.append(gel)
        ring = lump(_tissue(design, bays, k), m.material.density).body(name.replace("pillar", "ring"))
        rings.append(ring)
        joints.append(Rigid((name, gel.centre), (ring.name, ring.centre)))
        corners = [(low, -half_y, sole), (high, -half_y, sole), (high, half_y, sole), (low, half_y, sole)]
        feet.append(ContactPoints(name, corners))
    for rod, (left, right) in zip(rods, pairwise(names), strict=True):
        joints.append(Rigid((rod.name, 0), (left, tuple(rod.points[0].tolist()))))
        joints.append(Rigid((rod.name, -1), (right, tuple(rod.points[-1].tolist()))))
    medium = design.ground.medium_density if design.ground.immersion == "submerged" else 0.0
    loads: list[Load] = [Gravity((0.0, 0.0, -GRAVITY), medium)]
    if design.ground.viscosity is not None:
        parts = [part.name for part in (*rods, *bodies, *rings)]
        loads.append(Drag(design.ground.viscosity, density=medium, rods=(), spheres=parts))
    return {
        "rods": rods,
        "joints": joints,
        "bodies": [*bodies, *rings],
        "loads": loads,
        "members": _muscles(design, names, bays, strands),
        "contacts": feet,
        "damping_time": design.numerics.damping_time,
    }


def _tissue(design: Design, bays: Sequence[tuple[float, float]], k: int) -> list[Part]:
    """The tissue that moves with pillar `k`: what surrounds it, and at its inner faces half of the muscle beside it."""
    s, m = design.value("skeleton"), design.value("muscle")
    x = design.pillars[k][0]
    low, high, half_y, w = x - s.pillar_length / 2, x + s.pillar_length / 2, s.pillar_width / 2, m.ring_thickness
    z, z_ring, last = m.junction_height, m.junction_height + m.ring_offset, len(bays)
    z0, z1 = z_ring - m.ring_height / 2, z_ring + m.ring_height / 2
    hole = _box((low, -half_y, z0), (high, half_y, z1), -1.0)
    faces = [face for face, inner in ((low, k > 0), (high, k < last)) if inner]
    if m.layout == "ring":
        outer = _box((low - (0.0 if k else w), -half_y - w, z0), (high + (w if k == last else 0.0), half_y + w, z1))
        # the parts across the pillars' outer faces fill the corners; at inner faces the strands go on
        ends, free = [(face, side * (half_y + w / 2)) for face in faces for side in (-1.0, 1.0)], design.bay
        section = w * m.ring_height
    else:
        outer = _box((low - w, -half_y - w, z0), (high + w, half_y + w, z1))
        ends, free = [(face, 0.0) for face in faces], design.bay - 2.0 * w
        section = m.junction_width * m.junction_thickness
    return [outer, hole, *((np.array([face, y, z]), np.zeros(3), section * free / 2) for face, y in ends)]


def _muscles(
    design: Design, names: Sequence[str], bays: Sequence[tuple[float, float]], strands: Strands
) -> list[Muscle]:
    s, m = design.value("skeleton"), design.value("muscle")
    z = m.junction_height
    ends: list[tuple[str, float, str, float]] = [(names[k], bay[0], names[k + 1], bay[1]) for k, bay in enumerate(bays)]
    if m.layout == "junction":
        lines, area = [(0.0, end) for end in ends], m.junction_width * m.junction_thickness
    else:
        if strands is Strands.slide:
            reach = s.beam_length / 2
            ends = [(names[0], -reach, names[-1], reach)]
        y = s.pillar_width / 2 + m.ring_thickness / 2
        lines, area = [(side, end) for side in (-y, y) for end in ends], m.ring_thickness * m.ring_height
    curve = None if m.force_length == "none" else force_length_curve(m.force_length, m.optimal_stretch or 1.0)
    hill = m.force_velocity
    slowed = None if hill is None else MuscleCurve.hill(hill.fastest, hill.curvature, hill.eccentric)
    gamma, active = viable_gamma(design), m.active_tension
    if m.gamma_scales == "active":
        gamma, active = 1.0, gamma * active
    return [
        Muscle(
            (a, (xa, y, z)),
            (b, (xb, y, z)),
            area,
            m.material.young,
            m.passive_tension,
            active,
            gamma,
            m.theta,
            viscosity=m.material.young * design.numerics.damping_time,
            name=name,
            force_length=curve,
            force_velocity=slowed,
        )
        for name, (y, (a, xa, b, xb)) in zip(_numbered("muscle", len(lines)), lines, strict=True)
    ]


def _remodelled(parts: dict[str, Any]) -> list[Muscle]:
    """Muscles without passive stress in the shape to which their standing tension alone bends the free machine."""
    slack = [replace(m, young=0.0, viscosity=0.0) for m in parts["members"]]
    shape = floating(RodModel(**parts), members=slack)
    return [replace(m, rest_length=shape.muscle_length(m.name)) for m in parts["members"]]

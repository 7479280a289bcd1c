"""The published walker as an assembly of rods: what goes where, joined exactly.

Joints are no springs: where the code pulls nodes together they are one point, where it keeps directions they are one
rigid part (its cross rods between the legs, which it leaves free to turn, carry nothing in a symmetric motion).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fem_biobot.rod.build import Joint
from fem_biobot.rod.discretisation import Discretisation
from fem_biobot.rod.drag.linear import LinearDrag
from fem_biobot.rod.drag.record import Drag
from fem_biobot.rod.ground import ContactPoints, Ground
from fem_biobot.rod.guide import Guide
from fem_biobot.rod.landmarks import Landmarks
from fem_biobot.rod.model import RodModel
from fem_biobot.rod.published.description import ElasticaWalker, Oddity, Start
from fem_biobot.rod.records import Gravity, Muscle, Place, PointLoad, Rigid, Rod, Spherical, Vector
from fem_biobot.rod.section import RodMaterial, Section
from fem_biobot.rod.touch import Touch

Array = NDArray[np.float64]

SIDES, PILLARS = ("right", "left"), ("short", "long")
BEAM_ELEMENTS, LEG_ELEMENTS, CROSS_ELEMENTS, FIBRE_ELEMENTS = 16, 6, 5, 4
LEG_AT = {"short": 2, "long": 14}  # node of a beam
SPAN = (4, 12)  # nodes of a beam between which it is flexible
CROSS_AT = 4  # node of the legs whose height the lower cross rods have
CLOSED = 22  # node of a ring that lies on its first
TIED = range(12, 18)  # nodes of an upper ring that stay over those of the lower
FIBRE_AT = (13, 14, 15, 16)  # nodes of the upper rings between which the fibres run
FRONT, LEFT, RIGHT = range(8), range(8, 12), range(18, 22)  # nodes of a ring that can touch its pillar
CONTACT_NODE = {"upper": 3, "lower": 4}  # of the legs, for the rings
_RING_WIDTH, _RING_LENGTH = 7.6, 4.6  # of the rectangle along which a ring is drawn, across and along the machine [mm]
_RING_BEGIN = {"short": -7.33, "long": 7.35}  # x of its outer side [mm]
_JOINT_STIFFNESS, _JOINT_DAMPING = 50.0, 5.0  # of a leg on the beam: uJ a radian and mm of leg; uJ s a radian
_JOINT_SHARE = 0.02  # of a leg's length, in which the joint's turning happens
_GRAVITY = 9810.0  # mm/s^2
_CODE = Discretisation.plain  # elements as the code has them


def elastica_walker(walker: ElasticaWalker | None = None) -> RodModel:
    """Eighteen rods, their joints, muscles, weight and feet.

    Parameters
    ----------
    walker
        The machine; as published by default.

    Returns
    -------
    RodModel
        Rods ``beam_right``, ``beam_left``; ``leg_short_right`` and so on, from the beam down; ``cross_beam_short``,
        ``cross_leg_short``, ..., from right to left; ``ring_short_upper``, ...; ``fibre_1`` to ``fibre_4``, from the
        short pillar to the long one. Muscles ``ring_short_upper_1``, ..., one an element, which carry both the tension
        and the stretch of their rod. Feet in the order short right, short left, long left, long right.

    Notes
    -----
    Muscle resists stretch by ``E area (s - 1) / s``: the code divides its resultant by the stretch s, which makes it
    Eq. 2 of the paper. Its rods bend, twist and shear.

    Rings touch their pillar without friction, as in the code: the nodes of their outer side stay off the line through
    the axes of the pillar's two legs, those of their lateral sides off that through the right or the left legs of both
    pillars, at least by the clearance and however high they are.

    Left out: the code's dashpots of 10 g mm/s along skeleton rods; springs (joints, ground, contact); what bending
    resultants are divided by for stretch.
    """
    w = walker or ElasticaWalker()
    muscle_rods = [*(_ring(w, pillar, level) for pillar in PILLARS for level in CONTACT_NODE), *_fibres(w)]
    rods = [*_beams(w), *_legs(w), *_crosses(w), *muscle_rods]
    drawn = {rod.name: rod for rod in rods}
    return RodModel(
        rods,
        [*_skeleton_joints(), *_muscle_joints(w), *_heights(w, drawn)],
        loads=[Gravity((0.0, 0.0, -_GRAVITY)), *_buoyancy(w, muscle_rods), *_drag(w, rods, muscle_rods)],
        members=[member for rod in muscle_rods for member in _members(w, rod)],
        contacts=_feet(w, drawn),
        touches=_touches(w),
        damping_time=0.0 if w.has(Oddity.absolute_damping) else w.damping_time,
        landmarks=Landmarks(
            start=("beam_right", SPAN[0]),
            end=("beam_right", SPAN[1]),
            crown=("beam_right", BEAM_ELEMENTS // 2),
            muscles=[[f"fibre_{k}_{e + 1}" for e in range(FIBRE_ELEMENTS)] for k in range(1, len(FIBRE_AT) + 1)],
        ),
    )


def ground_of(walker: ElasticaWalker) -> Ground:
    """The walker's ground."""
    times = 2.0 if walker.has(Oddity.friction_twice) else 1.0
    return Ground(times * walker.static_friction, times * walker.kinetic_friction)


def gel(w: ElasticaWalker) -> RodMaterial:
    """Of the skeleton."""
    return RodMaterial(young=w.young, density=w.density, shear_modulus=w.shear_modulus(w.young))


def tissue(w: ElasticaWalker) -> RodMaterial:
    """Of the muscle."""
    return RodMaterial(young=w.muscle_young, density=w.muscle_density, shear_modulus=w.shear_modulus(w.muscle_young))


def _circle(w: ElasticaWalker, radius: float) -> Section:
    return Section.circle(radius, shear_factor=w.shear_factor)


def _side(w: ElasticaWalker, side: str) -> float:
    return (-0.5 if side == "right" else 0.5) * w.beam_spacing


def _beams(w: ElasticaWalker) -> list[Rod]:
    x = w.beam_length * (np.arange(BEAM_ELEMENTS + 1) / BEAM_ELEMENTS - 0.5)
    factor = 0.5 if w.has(Oddity.halved_beam) else 1.0
    thick, thin = _circle(w, w.beam_radius), _circle(w, w.flexible_radius)
    inside = [SPAN[0] <= e < SPAN[1] for e in range(BEAM_ELEMENTS)]
    sections = [thin if flexible else thick for flexible in inside]
    if w.has(Oddity.smeared_step):
        sections = [_smeared(section, e, thick, thin) for e, section in enumerate(sections)]
    # the mass is everywhere that of the thick section
    masses = [factor * thick.area / section.area for section in sections]
    rods = []
    for side in SIDES:
        points = np.column_stack([x, np.full_like(x, _side(w, side)), np.full_like(x, w.beam_height)])
        rods.append(
            Rod(points, sections, gel(w), f"beam_{side}", normal=(0.0, 1.0, 0.0), mass=masses, discretisation=_CODE)
        )
    return rods


def _smeared(section: Section, e: int, thick: Section, thin: Section) -> Section:
    """An element's section with the harmonic mean of the second moments that the code gives to its two nodes."""

    def at(node: int) -> float:
        if node in SPAN:
            return 0.5 * (thick.I1 + thin.I1)
        return thin.I1 if SPAN[0] < node < SPAN[1] else thick.I1

    I = 2.0 / (1.0 / at(e) + 1.0 / at(e + 1))  # noqa: E741
    return replace(section, I1=I, I2=I, J=2.0 * I)


def leg_length(w: ElasticaWalker, pillar: str) -> float:
    """Of a pillar's legs from the beam's axis to the sole [mm]."""
    return w.short_leg if pillar == "short" else w.long_leg


def _legs(w: ElasticaWalker) -> list[Rod]:
    section = _circle(w, w.leg_radius)
    yields = w.has(Oddity.yielding_joints)
    rods = []
    for side in SIDES:
        for pillar in PILLARS:
            length = leg_length(w, pillar)
            depth = length * np.arange(LEG_ELEMENTS + 1) / LEG_ELEMENTS
            if not w.has(Oddity.leg_node_contact):
                # nodes 3 and 4 at the rings' heights
                levels = [w.beam_height - w.upper_ring, w.beam_height - w.lower_ring]
                depth = np.concatenate([
                    np.linspace(0.0, levels[0], 4)[:3], levels, np.linspace(levels[1], length, 3)[1:]
                ])  # fmt: skip
            sections = [section] * LEG_ELEMENTS
            if yields:
                depth[1] = _JOINT_SHARE * length
                I = _JOINT_STIFFNESS * length * depth[1] / w.young  # noqa: E741
                sections[0] = replace(section, I1=I, I2=I)
            x = w.beam_length * (LEG_AT[pillar] / BEAM_ELEMENTS - 0.5)
            points = np.column_stack([np.full(7, x), np.full(7, _side(w, side)), w.beam_height - depth])
            time = _JOINT_DAMPING / (_JOINT_STIFFNESS * length) if yields else None
            rods.append(
                Rod(
                    points,
                    sections,
                    gel(w),
                    f"leg_{pillar}_{side}",
                    normal=(0.0, 1.0, 0.0),
                    damping_time=time,
                    discretisation=_CODE,
                )
            )
    return rods


def _crosses(w: ElasticaWalker) -> list[Rod]:
    y = w.beam_spacing * (np.arange(CROSS_ELEMENTS + 1) / CROSS_ELEMENTS - 0.5)
    rods = []
    for part in ("beam", "leg"):
        for pillar in PILLARS:
            x = w.beam_length * (LEG_AT[pillar] / BEAM_ELEMENTS - 0.5)
            z = w.beam_height - (leg_length(w, pillar) * CROSS_AT / LEG_ELEMENTS if part == "leg" else 0.0)
            points = np.column_stack([np.full_like(y, x), y, np.full_like(y, z)])
            rods.append(
                Rod(
                    points,
                    _circle(w, w.cross_radius),
                    gel(w),
                    f"cross_{part}_{pillar}",
                    normal=(0.0, 0.0, 1.0),
                    discretisation=_CODE,
                )
            )
    return rods


def ring_path(w: ElasticaWalker, pillar: str, level: str) -> Array:
    """Nodes of a ring as drawn, (23, 3) [mm]: the outer side from right to left, left side, inner side, right side.

    With overlapping ends two more, which lie on the second and third.
    """
    inward = 1.0 if pillar == "short" else -1.0
    across, along = np.arange(8) / 7 * _RING_WIDTH, np.arange(1, 5) / 4 * _RING_LENGTH
    outer, inner = np.zeros(7), np.full(7, _RING_LENGTH)
    depth = np.concatenate([outer, [0.0], along, inner, along[::-1][1:], [0.0]])
    y = np.concatenate([across, np.full(4, _RING_WIDTH), across[::-1][1:], np.zeros(4)]) - 0.5 * _RING_WIDTH
    z = np.full(len(y), w.upper_ring if level == "upper" else w.lower_ring)
    once = np.column_stack([_RING_BEGIN[pillar] + inward * depth, y, z])
    return np.vstack([once, once[1:3]]) if w.has(Oddity.overlapping_ends) else once


def _muscle_section(w: ElasticaWalker, radius: float) -> Section:
    return replace(_circle(w, radius), stretch_factor=0.0)


def _ring(w: ElasticaWalker, pillar: str, level: str) -> Rod:
    section = _muscle_section(w, w.ring_radius)
    return Rod(
        ring_path(w, pillar, level),
        section,
        tissue(w),
        f"ring_{pillar}_{level}",
        normal=(0.0, 0.0, 1.0),
        discretisation=_CODE,
    )


def _fibres(w: ElasticaWalker) -> list[Rod]:
    begin, end = (ring_path(w, pillar, "upper") for pillar in PILLARS)
    radius = w.ring_radius if w.has(Oddity.stiff_fibres) else w.fibre_radius
    share = np.arange(FIBRE_ELEMENTS + 1)[:, None] / FIBRE_ELEMENTS
    return [
        Rod(
            (1.0 - share) * begin[node] + share * end[node],
            _muscle_section(w, radius),
            tissue(w),
            f"fibre_{k + 1}",
            normal=(0.0, 0.0, 1.0),
            mass=(w.fibre_radius / radius) ** 2,
            discretisation=_CODE,
        )
        for k, node in enumerate(FIBRE_AT)
    ]


def _members(w: ElasticaWalker, rod: Rod) -> list[Muscle]:
    """What pulls along a rod of muscle and resists its stretch; the overlap of a ring has no tension."""
    section = rod.sections[0]
    area = section.area * rod.masses[0]
    if w.has(Oddity.absolute_damping):
        viscosity = w.stretch_damping / area
    else:
        viscosity = w.damping_time * w.muscle_young * section.area / area
    pulling = CLOSED if rod.name.startswith("ring") else FIBRE_ELEMENTS
    # a base force that grows is part of the drive
    base = w.base_force if w.start is Start.standing else 0.0
    return [
        Muscle(
            (rod.name, e),
            (rod.name, e + 1),
            area,
            w.muscle_young * section.area / area,
            base / area if e < pulling else 0.0,
            w.active_force / area if e < pulling else 0.0,
            viscosity=viscosity,
            name=f"{rod.name}_{e + 1}",
        )
        for e in range(len(rod.sections))
    ]


def _skeleton_joints() -> list[Rigid]:
    joints = []
    for pillar in PILLARS:
        for side, end in zip(SIDES, (0, -1), strict=True):
            leg = f"leg_{pillar}_{side}"
            joints.append(Rigid((f"beam_{side}", LEG_AT[pillar]), (leg, 0)))
            joints.append(Rigid((leg, 0), (f"cross_beam_{pillar}", end)))
            joints.append(Rigid((leg, CROSS_AT), (f"cross_leg_{pillar}", end)))
    return joints


def _muscle_joints(w: ElasticaWalker) -> list[Joint]:
    close = Spherical if w.has(Oddity.overlapping_ends) else Rigid
    joints: list[Joint] = []
    for pillar, end in zip(PILLARS, (0, -1), strict=True):
        upper, lower = f"ring_{pillar}_upper", f"ring_{pillar}_lower"
        joints += [close((ring, 0), (ring, CLOSED)) for ring in (upper, lower)]
        joints += [Guide((upper, i), (lower, i), "xy") for i in TIED]
        joints += [Spherical((f"fibre_{k + 1}", end), (upper, node)) for k, node in enumerate(FIBRE_AT)]
    return joints


def _heights(w: ElasticaWalker, rods: dict[str, Rod]) -> list[Guide]:
    """Joints that hold the rings at their height on the nearer leg, where they can touch."""
    if w.has(Oddity.floating_muscle):
        return []
    joints = []
    for pillar in PILLARS:
        for level, node in CONTACT_NODE.items():
            ring = f"ring_{pillar}_{level}"
            for i in (*FRONT, *LEFT, *RIGHT):
                side = "right" if rods[ring].points[i, 1] < 0.0 else "left"
                joints.append(Guide((ring, i), (f"leg_{pillar}_{side}", node), "z"))
    return joints


def _touches(w: ElasticaWalker) -> list[Touch]:
    """Where rings touch their pillars: walls along the lines through the axes of the legs, at the legs' nodes."""
    touches, up = [], (0.0, 0.0, 1.0)
    for pillar in PILLARS:
        for level, node in CONTACT_NODE.items():
            ring = f"ring_{pillar}_{level}"
            lines: list[tuple[range, list[Place]]] = [(FRONT, [(f"leg_{pillar}_{side}", node) for side in SIDES])]
            for side, nodes in (("left", LEFT), ("right", RIGHT)):
                lines.append((nodes, [(f"leg_{other}_{side}", node) for other in PILLARS]))
            touches += [Touch(ring, line, nodes, w.clearance, endless=True, along=up) for nodes, line in lines]
    return touches


def _buoyancy(w: ElasticaWalker, muscle_rods: list[Rod]) -> list[PointLoad]:
    """What water carries of the muscle, node by node: all of its weight, where it has none."""
    density = w.muscle_density if w.has(Oddity.floating_muscle) else w.water_density
    loads = []
    for rod in muscle_rods:
        spans = np.linalg.norm(np.diff(rod.points, axis=0), axis=1)
        weight = _GRAVITY * density * np.array(rod.masses) * [s.area for s in rod.sections] * spans
        share = 0.5 * (np.append(weight, 0.0) + np.append(0.0, weight))
        loads += [PointLoad((rod.name, i), force=(0.0, 0.0, float(f))) for i, f in enumerate(share)]
    return loads


def _drag(w: ElasticaWalker, rods: list[Rod], muscle_rods: list[Rod]) -> list[LinearDrag | Drag]:
    """Resistance against rest, with the same number for spin (the code's is per mm^2); or that of water."""
    muscle = [rod.name for rod in muscle_rods]
    if not w.has(Oddity.absolute_damping):
        return [Drag(w.viscosity, rods=muscle, spheres=())]
    skeleton = [rod.name for rod in rods if rod.name not in muscle]
    return [LinearDrag(skeleton, w.skeleton_drag, w.skeleton_drag), LinearDrag(muscle, w.muscle_drag, w.muscle_drag)]


def _feet(w: ElasticaWalker, rods: dict[str, Rod]) -> list[ContactPoints]:
    feet = []
    for pillar, side in (("short", "right"), ("short", "left"), ("long", "left"), ("long", "right")):
        place: Place = (f"leg_{pillar}_{side}", LEG_ELEMENTS)
        x, y, z = (float(c) for c in rods[place[0]].points[-1])
        corners: list[Vector] = [(x - w.leg_radius, y, z), (x + w.leg_radius, y, z)]
        feet.append(ContactPoints(place, corners, acts_at=(x, y, z) if w.has(Oddity.centred_reaction) else None))
    return feet

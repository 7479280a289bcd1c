"""Arrays of what can come into contact: points that the ground stops, and rods that touch other parts."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from fem_biobot.errors import ModelError
from fem_biobot.rod.arrays import Contacts, Touches
from fem_biobot.rod.atlas import Atlas
from fem_biobot.rod.ground import ContactPoints
from fem_biobot.rod.records import Place, vector
from fem_biobot.rod.touch import Touch

Array = NDArray[np.float64]


def contact_arrays(contacts: Sequence[ContactPoints], atlas: Atlas) -> Contacts:
    """Contact points with the ground; refuses parts that do not exist."""
    nodes, offsets, radii, axes, elsewhere, acting = [], [], [], [], [], []
    for group in contacts:
        if isinstance(group.part, str):
            if group.part not in atlas.bodies:
                raise ModelError(
                    f"contact points: no body of the name {group.part!r}, expected one of: {', '.join(atlas.bodies)}"
                )
            node = atlas.node_of[group.part, 0]
        else:
            node, _ = atlas.locate(group.part)
        axis = np.zeros(3)
        if group.axis is not None:
            axis = vector("contact points: axis", group.axis)
            axis = axis / np.linalg.norm(axis)
        for position in group.points:
            nodes.append(node)
            offsets.append(position - atlas.centre[node])
            radii.append(group.radius)
            axes.append(axis)
            elsewhere.append(int(group.acts_at is not None))
            acting.append((position if group.acts_at is None else np.array(group.acts_at)) - atlas.centre[node])
    c = len(nodes)
    return Contacts(
        np.array(nodes, dtype=np.int64),
        np.array(offsets, dtype=float).reshape(c, 3),
        np.array(radii, dtype=float),
        np.array(axes, dtype=float).reshape(c, 3),
        np.array(elsewhere, dtype=np.int64),
        np.array(acting, dtype=float).reshape(c, 3),
    )


def _radius(rod: str, atlas: Atlas) -> float:
    """Largest outer radius of a rod's sections [mm]."""
    radii = [section.radius for section in atlas.rods[rod].sections]
    if any(radius is None for radius in radii):
        raise ModelError(f"touch: rod {rod} has a section that is not round, expected a distance between the axes")
    return max(radius for radius in radii if radius is not None)


def _known(what: str, rod: str, atlas: Atlas) -> str:
    if rod not in atlas.rods:
        raise ModelError(f"touch: {what}: no rod of the name {rod!r}, expected one of: {', '.join(atlas.rods)}")
    return rod


def touch_arrays(touches: Sequence[Touch], atlas: Atlas) -> Touches:
    """Nodes that touch and their chains; refuses parts that do not exist and chains without length."""
    node, offset, first, last, distance, radius, friction, endless, along = [], [], [], [], [], [], [], [], []
    segments: list[tuple[list[int], list[Array]]] = []
    for record in touches:
        rod = _known("rod", record.rod, atlas)
        count = len(atlas.drawn[rod])
        places: Sequence[Place]
        if isinstance(record.against, str):
            other = _known("against", record.against, atlas)
            if other == rod:
                raise ModelError(f"touch of {rod}: against: found the rod itself, expected another part")
            places = [(other, i) for i in range(len(atlas.drawn[other]))]
            apart = record.distance or _radius(rod, atlas) + _radius(other, atlas)
        else:
            places = record.against
            if record.distance is None:
                raise ModelError(f"touch of {rod}: found a chain of places without distance, expected one [mm]")
            apart = record.distance
        begin = len(segments)
        found = [atlas.locate(place) for place in places]
        drawn = [atlas.centre[n] + r for n, r in found]
        for k in range(len(places) - 1):
            if not np.linalg.norm(drawn[k + 1] - drawn[k]) > 0.0:
                raise ModelError(
                    f"touch of {rod}: against: {places[k]} and {places[k + 1]} are drawn at one point, expected two"
                )
            (a, ra), (b, rb) = found[k], found[k + 1]
            segments.append(([a, b], [ra, rb]))
        wall = np.zeros(3) if record.along is None else np.array(record.along, dtype=float)
        wall /= np.linalg.norm(wall) or 1.0
        for a, b in pairwise(drawn):
            if not np.linalg.norm(np.cross(b - a, wall)) > 0.0 and wall.any():
                raise ModelError(
                    f"touch of {rod}: along: found {record.along}, the direction of the chain itself, expected another"
                )
        sections = atlas.rods[rod].sections
        for number in range(count) if record.nodes is None else record.nodes:
            if not isinstance(number, int | np.integer) or not -count <= number < count:
                raise ModelError(f"touch of {rod}: nodes: found {number!r}, expected numbers of its {count} nodes")
            n, r = atlas.locate((rod, int(number)))
            section = sections[min(int(number) % count, len(sections) - 1)]
            node.append(n)
            offset.append(r)
            first.append(begin)
            last.append(len(segments))
            distance.append(apart)
            radius.append(min(section.radius or 0.0, apart))
            friction.append(record.friction)
            endless.append(int(record.endless))
            along.append(wall)
    t, s = len(node), len(segments)
    return Touches(
        np.array(node, dtype=np.int64),
        np.array(offset, dtype=float).reshape(t, 3),
        np.array(first, dtype=np.int64),
        np.array(last, dtype=np.int64),
        np.array([pair for pair, _ in segments], dtype=np.int64).reshape(s, 2),
        np.array([arms for _, arms in segments], dtype=float).reshape(s, 2, 3),
        np.array(distance, dtype=float),
        np.array(radius, dtype=float),
        np.array(friction, dtype=float),
        np.array(endless, dtype=np.int64),
        np.array(along, dtype=float).reshape(t, 3),
    )

"""From records to arrays: which places share a node, where each node's centre of mass is, what couples to what."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem_biobot.errors import ModelError
from fem_biobot.rod.activation.build import activations
from fem_biobot.rod.arrays import Assembly, Constraints, Inertia, Loads, Members
from fem_biobot.rod.atlas import Atlas, Built, Member, Moved
from fem_biobot.rod.contacts import contact_arrays, touch_arrays
from fem_biobot.rod.discretisation import Discretisation, residual_bending
from fem_biobot.rod.drag.linear import LinearDrag
from fem_biobot.rod.drag.record import Drag, drag_lumps
from fem_biobot.rod.element import kernels as element
from fem_biobot.rod.element.arrays import Elements
from fem_biobot.rod.frames import node_frames
from fem_biobot.rod.ground import ContactPoints
from fem_biobot.rod.guide import Guide
from fem_biobot.rod.records import (
    Body,
    DistributedLoad,
    Gravity,
    Hinge,
    Hold,
    Muscle,
    PointLoad,
    Resistance,
    Rigid,
    Rod,
    Spherical,
    Spring,
    vector,
)
from fem_biobot.rod.redundant import softness
from fem_biobot.rod.section import stiffness
from fem_biobot.rod.touch import Touch

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Joint = Rigid | Spherical | Hinge | Guide
Load = PointLoad | DistributedLoad | Gravity | Drag | LinearDrag

# parts drawn further apart than this share of the model's size do not meet in a joint
_MEETS = 1e-6


def build(
    rods: Sequence[Rod],
    joints: Sequence[Joint],
    bodies: Sequence[Body],
    supports: Sequence[Hold],
    loads: Sequence[Load],
    members: Sequence[Member],
    contacts: Sequence[ContactPoints],
    touches: Sequence[Touch],
    damping_time: float,
) -> Built:
    """Put an assembly together; refuses what does not fit with one line that names it."""
    atlas, mass, J, volume, moment = _nodes(rods, joints, bodies, members)
    n = len(mass)
    held = np.zeros(n, dtype=np.int64)
    constraints: list[tuple[int, int, Array, Array, Sequence[int], Array]] = []
    moved: list[Moved] = []
    for hold in supports:
        node, offset = atlas.locate(hold.place)
        fully = set(hold.translation) == set(hold.rotation) == set("xyz")
        if hold.moves:
            place = atlas.centre[node] + offset
            moved.append(Moved(node, -1 if fully else len(constraints), hold, place, offset))
        if fully:
            held[node] = 1
            continue
        rows = [int(c in hold.translation) for c in "xyz"] + [int(c in hold.rotation) for c in "xyz"]
        constraints.append((node, -1, offset, atlas.centre[node] + offset, rows, np.eye(3)))
    for joint in joints:
        if isinstance(joint, Rigid):
            continue
        (a, ra), (b, rb) = atlas.locate(joint.a), atlas.locate(joint.b)
        if a == b:
            raise ModelError(f"joint of {joint.a} and {joint.b}: they are one rigid part already")
        if isinstance(joint, Guide):
            along = np.array([c in joint.along for c in "xyz"])
            rb = np.where(along, atlas.centre[a] + ra - atlas.centre[b], rb)
            constraints.append((a, b, ra, rb, [*map(int, along), 0, 0, 0], np.eye(3)))
            continue
        apart = np.linalg.norm(atlas.centre[a] + ra - atlas.centre[b] - rb)
        if apart > _MEETS * _extent(atlas):
            raise ModelError(f"joint of {joint.a} and {joint.b}: drawn {apart:.3g} mm apart, expected at one point")
        rows, frame = [1, 1, 1, 0, 0, 0], np.eye(3)
        if isinstance(joint, Hinge):
            rows, frame = [1, 1, 1, 1, 1, 0], _frame_about(np.array(joint.axis, dtype=float))
        constraints.append((a, b, ra, rb, rows, frame))
    elements, damping = _elements(rods, atlas, damping_time)
    point_loads, histories, gravity = _loads(loads, atlas, elements, volume, moment)
    inertia = Inertia(mass, J, held)
    assembly = Assembly(
        elements,
        damping,
        inertia,
        _members(members, atlas),
        point_loads,
        softness(_constraints(constraints), inertia, atlas.centre),
        contact_arrays(contacts, atlas),
        touch_arrays(touches, atlas),
        gravity,
        drag_lumps(loads, atlas, elements),
        activations(members),
    )
    _refuse_loose_parts(assembly, atlas)
    return Built(assembly, atlas, atlas.centre.copy(), tuple(members), tuple(histories), volume, tuple(moved))


def _nodes(
    rods: Sequence[Rod], joints: Sequence[Joint], bodies: Sequence[Body], members: Sequence[Member]
) -> tuple[Atlas, Array, Array, Array, Array]:
    """Rigid groups with mass (n,), inertia (n, 3, 3), volume (n,) and first moment of volume (n, 3)."""
    names = [r.name for r in rods] + [b.name for b in bodies] + [m.name for m in members if isinstance(m, Muscle)]
    twice = [name for name in names if names.count(name) > 1]
    if twice:
        raise ModelError(f"name {twice[0]!r}: given to {names.count(twice[0])} parts, expected a name for each")
    if not rods and not bodies:
        raise ModelError("model: found neither rods nor bodies, expected at least one")
    keys = [(r.name, i) for r in rods for i in range(len(r.points))] + [(b.name, 0) for b in bodies]
    number = {key: i for i, key in enumerate(keys)}
    drawn = {r.name: r.points for r in rods}
    frames = {
        r.name: node_frames(r.points, None if r.normal is None else np.array(r.normal, dtype=float), r.name)
        for r in rods
    }
    rod_of, body_of = {r.name: r for r in rods}, {b.name: b for b in bodies}
    rough = Atlas(rod_of, body_of, number, drawn, frames, np.zeros((len(keys), 3)))
    root = list(range(len(keys)))

    def find(i: int) -> int:
        while root[i] != i:
            i = root[i]
        return i

    for joint in joints:
        if isinstance(joint, Rigid):
            a, b = find(number[rough.parse(joint.a)[0]]), find(number[rough.parse(joint.b)[0]])
            root[max(a, b)] = min(a, b)
    roots = sorted({find(i) for i in range(len(keys))})
    rank = {r: g for g, r in enumerate(roots)}
    group = {key: rank[find(i)] for key, i in number.items()}
    # lumps of each group: mass, position, inertia about it, volume
    lumps: list[list[tuple[float, Array, Array, float]]] = [[] for _ in roots]
    for rod in rods:
        spans, shares = np.linalg.norm(np.diff(rod.points, axis=0), axis=1), rough.shares(rod.name)
        density = rod.material.density * np.array(rod.masses)
        area, I1, I2 = (np.array([getattr(s, name) for s in rod.sections]) for name in ("area", "I1", "I2"))
        per_element = np.array([density * area, area, density * I1, density * I2]) * spans
        for i, (R, share) in enumerate(zip(frames[rod.name], shares.T, strict=True)):
            # exactly rounded sums do not depend on the end from which a rod is drawn
            mass, volume, J1, J2 = (math.fsum(row) for row in (per_element * share).tolist())
            about = R.T @ np.diag([J1, J2, J1 + J2]) @ R
            lumps[group[rod.name, i]].append((mass, rod.points[i], about, volume))
    for body in bodies:
        lumps[group[body.name, 0]].append((body.mass, np.array(body.centre, dtype=float), body.inertia, body.volume))
    for member in members:
        if isinstance(member, Muscle) and member.mass > 0.0:
            for place in (member.a, member.b):
                key, position = rough.parse(place)
                lumps[group[key]].append((member.mass / 2, position, np.zeros((3, 3)), 0.0))
    n = len(roots)
    mass, J, centre, volume, moment = np.zeros(n), np.zeros((n, 3, 3)), np.zeros((n, 3)), np.zeros(n), np.zeros((n, 3))
    for g, group_lumps in enumerate(lumps):
        mass[g] = sum(m for m, *_ in group_lumps)
        weights = [m if mass[g] > 0.0 else 1.0 for m, *_ in group_lumps]
        centre[g] = sum(w * p for w, (_, p, _, _) in zip(weights, group_lumps, strict=True)) / sum(weights)
        for m, p, about, v in group_lumps:
            d = p - centre[g]
            J[g] += about + m * (d @ d * np.eye(3) - np.outer(d, d))
            volume[g] += v
            moment[g] += v * d
    return Atlas(rod_of, body_of, group, drawn, frames, centre), mass, J, volume, moment


def _elements(rods: Sequence[Rod], atlas: Atlas, damping_time: float) -> tuple[Elements, Array]:
    """Elements of all rods with their natural strains, and their Kelvin-Voigt times (m,)."""
    nodes, offset, turn, C, tau, natural, bends = [], [], [], [], [], [], []
    for rod in rods:
        frames = atlas.frames[rod.name]
        for e, section in enumerate(rod.sections):
            ends = [atlas.node_of[rod.name, i] for i in (e, e + 1)]
            nodes.append(ends)
            offset.append([rod.points[i] - atlas.centre[g] for i, g in zip((e, e + 1), ends, strict=True)])
            turn.append(frames[e : e + 2])
            C.append(stiffness(section, rod.material))
            bends.append(rod.discretisation is Discretisation.corrected)
            tau.append(damping_time if rod.damping_time is None else rod.damping_time)
        given = rod.natural_curvature
        if given is None:
            natural += [None] * len(rod.sections)
        else:
            try:
                natural += list(np.broadcast_to(np.array(given, dtype=float), (len(rod.sections), 3)))
            except ValueError:
                raise ModelError(
                    f"rod {rod.name}: natural_curvature: found shape {np.shape(given)}, expected (3,) or (m, 3)"
                ) from None
            if not np.isfinite(np.array(given, dtype=float)).all():
                raise ModelError(f"rod {rod.name}: natural_curvature: found {given!r}, expected finite numbers")
    m = len(nodes)
    made = Elements(
        np.array(nodes, dtype=np.int64).reshape(m, 2),
        np.array(offset, dtype=float).reshape(m, 2, 3),
        np.ascontiguousarray(np.array(turn, dtype=float).reshape(m, 2, 3, 3)),
        np.ones(m),
        np.zeros((m, 3)),
        np.zeros((m, 3)),
        np.array(C, dtype=float).reshape(m, 6),
        np.array(C, dtype=float).reshape(m, 6),
        np.zeros((m, 2)),
    )
    strain = np.zeros((m, 6))
    n = len(atlas.centre)
    if m:
        element.strains(made, atlas.centre, np.tile(np.eye(3), (n, 1, 1)), strain)
    # with length 1 the strains are the rotation vector and the arc vector less e3
    arc = strain[:, :3] + np.array([0.0, 0.0, 1.0])
    length = np.linalg.norm(arc, axis=1)
    eps0 = arc / length[:, None] - np.array([0.0, 0.0, 1.0])
    kappa0 = strain[:, 3:] / length[:, None]
    for e, curvature in enumerate(natural):
        if curvature is not None:
            eps0[e], kappa0[e] = 0.0, curvature
    corrected = np.array(bends, dtype=bool)[:, None]
    softer, sway = residual_bending(made.section, length)
    softer, sway = np.where(corrected, softer, made.section), np.where(corrected, sway, 0.0)
    made = made._replace(length=length, eps0=eps0, kappa0=kappa0, stiffness=softer, sway=sway)
    return made, np.array(tau, dtype=float)


def _members(members: Sequence[Member], atlas: Atlas) -> Members:
    rows: list[tuple[list[int], list[Array], int, float, float, float]] = []
    for member in members:
        name = f"muscle {member.name}" if isinstance(member, Muscle) else f"spring of {member.a}"
        (a, ra) = atlas.locate(member.a)
        if isinstance(member, Spring) and not isinstance(member.b[0], str):
            b, rb = -1, vector("spring: fixed point", member.b)
        else:
            b, rb = atlas.locate(member.b)  # type: ignore[arg-type]
        end = rb if b < 0 else atlas.centre[b] + rb
        drawn = float(np.linalg.norm(end - atlas.centre[a] - ra))
        if drawn <= 1e-12 * _extent(atlas):
            raise ModelError(f"{name}: its ends are drawn at one point, expected a distance")
        rest = drawn if member.rest_length is None else float(member.rest_length)
        if isinstance(member, Spring):
            rows.append(([a, b], [ra, rb], 0, member.stiffness, rest, member.damping))
        else:
            law = 1 if member.resistance is Resistance.eq2 else 2
            viscosity = member.viscosity * member.area / rest
            rows.append(([a, b], [ra, rb], law, member.young * member.area, rest, viscosity))
    k = len(rows)
    return Members(
        np.array([r[0] for r in rows], dtype=np.int64).reshape(k, 2),
        np.array([r[1] for r in rows], dtype=float).reshape(k, 2, 3),
        np.array([r[2] for r in rows], dtype=np.int64),
        *(np.array([r[i] for r in rows], dtype=float) for i in (3, 4, 5)),
    )


def _loads(
    loads: Sequence[Load], atlas: Atlas, elements: Elements, volume: Array, moment: Array
) -> tuple[Loads, list[Any], Array]:
    """Point loads, the history of each, and the acceleration of gravity."""
    rows: list[tuple[int, Array, Array, Array, int]] = []
    histories: list[Any] = []
    gravity = np.zeros(3)
    for load in loads:
        if isinstance(load, Drag | LinearDrag):
            continue
        if isinstance(load, Gravity):
            g = np.array(load.acceleration, dtype=float)
            gravity = gravity + g
            for node in np.flatnonzero(volume) if load.medium_density > 0.0 else ():
                lift = -load.medium_density * volume[node] * g
                rows.append((int(node), moment[node] / volume[node], lift, np.zeros(3), 0))
                histories.append(None)
            continue
        force, couple = np.array(load.force, dtype=float), np.array(load.moment, dtype=float)
        if isinstance(load, PointLoad):
            node, offset = atlas.locate(load.place)
            rows.append((node, offset, force, couple, int(load.following)))
            histories.append(load.history)
            continue
        if load.rod not in atlas.rods:
            raise ModelError(
                f"distributed load: no rod of the name {load.rod!r}, expected one of: {', '.join(atlas.rods)}"
            )
        points = atlas.drawn[load.rod]
        # spread as the element's mass is
        first = list(atlas.rods).index(load.rod)
        begin = sum(len(r.sections) for r in list(atlas.rods.values())[:first])
        length = elements.length[begin : begin + len(points) - 1]
        share = length @ atlas.shares(load.rod)
        for i, part in enumerate(share):
            node, offset = atlas.locate((load.rod, i))
            rows.append((node, offset, part * force, part * couple, int(load.following)))
            histories.append(load.history)
    count = len(rows)
    offset, force, couple = (np.array([r[i] for r in rows], dtype=float).reshape(count, 3) for i in (1, 2, 3))
    node, following = (np.array([r[i] for r in rows], dtype=np.int64) for i in (0, 4))
    made = Loads(node, offset, force, couple, following)
    return made, histories, gravity


def _constraints(rows: list[tuple[int, int, Array, Array, Sequence[int], Array]]) -> Constraints:
    j = len(rows)
    return Constraints(
        np.array([r[:2] for r in rows], dtype=np.int64).reshape(j, 2),
        np.array([r[2:4] for r in rows], dtype=float).reshape(j, 2, 3),
        np.array([r[4] for r in rows], dtype=np.int64).reshape(j, 6),
        np.array([(r[5], r[5]) for r in rows], dtype=float).reshape(j, 2, 3, 3),
        np.zeros((j, 6)),
    )


def _refuse_loose_parts(assembly: Assembly, atlas: Atlas) -> None:
    """Every part must hang together with the others by rods, joints or members."""
    n = len(atlas.centre)
    root = list(range(n))

    def find(i: int) -> int:
        while root[i] != i:
            i = root[i]
        return i

    world = n
    root.append(world)
    T = assembly.touches
    chains = [(T.node[k], end) for k in range(len(T.node)) for end in T.chain_node[T.first[k] : T.last[k]].ravel()]
    meeting = np.array(chains, dtype=np.int64).reshape(-1, 2)
    pairs = np.concatenate([assembly.elements.nodes, assembly.members.nodes, assembly.constraints.nodes, meeting])
    for a, b in pairs:
        i, j = find(int(a)), find(int(b) if b >= 0 else world)
        root[max(i, j)] = min(i, j)
    for node in np.flatnonzero(assembly.inertia.held):
        root[find(int(node))] = find(world)
    parts = {find(i) for i in range(n)}
    if len(parts) > 1:
        groups = [[key[0] for key, node in atlas.node_of.items() if find(node) == part] for part in sorted(parts)]
        raise ModelError(
            f"model: {groups[0][0]!r} and {groups[1][0]!r} are not connected, expected a joint, a member, a touch or a "
            "support for every part"
        )


def _extent(atlas: Atlas) -> float:
    """Size of the model as drawn [mm]."""
    points = np.concatenate([atlas.centre, *atlas.drawn.values()])
    return max(float(np.linalg.norm(np.ptp(points, axis=0))), 1e-9)


def _frame_about(axis: Array) -> Array:
    """Axes, rows, whose third is `axis`."""
    e3 = axis / np.linalg.norm(axis)
    e1 = np.cross(e3, np.eye(3)[int(np.abs(e3).argmin())])
    e1 = e1 / np.linalg.norm(e1)
    return np.array([e1, np.cross(e3, e1), e3], dtype=float)

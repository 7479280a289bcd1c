"""Where a walking machine's feet, beam and muscles are, and their paths over a motion.

Made from a model: feet are its groups of contact points, the beam its rods in their order and the muscles all of its
own, unless it has `Landmarks`. Reads samples of a motion all at once.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from fem_biobot.errors import ModelError
from fem_biobot.rod.activation.kernels import active_tension
from fem_biobot.rod.assembly.kernels import passive_tension
from fem_biobot.rod.dynamics.integrate import Motion
from fem_biobot.rod.model import RodModel
from fem_biobot.rod.records import Muscle

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Spot = tuple[int, Array]  # a node, and a point in its frame


@dataclass(frozen=True, eq=False)
class Anatomy:
    """Places of a machine that its measures are taken at.

    Attributes
    ----------
    feet
        Names of the feet: of the body that carries the contact points, or ``rod[node]``.
    corners
        Contact points of each foot by number.
    soles
        Middle of each foot's contact points.
    start, end, crown
        Ends of the beam's flexible span, and its middle; None without rods.
    chains
        Numbers among the members of those that make up each muscle, end to end.
    """

    feet: tuple[str, ...]
    corners: tuple[Ints, ...]
    soles: tuple[Spot, ...]
    start: Spot | None
    end: Spot | None
    crown: Spot | None
    chains: tuple[Ints, ...]

    @property
    def muscles(self) -> Ints:
        """Number of the member in the middle of each muscle, whose tension is the muscle's, (m,)."""
        return np.array([chain[len(chain) // 2] for chain in self.chains], dtype=np.int64)


def anatomy(model: RodModel) -> Anatomy:
    """Anatomy of a model; refuses one without feet or without muscles."""
    if not len(model.contacts):
        raise ModelError("model: found no contact points, expected feet for a walk (contacts=[ContactPoints(...)])")
    chains = tuple(np.array([k]) for k, m in enumerate(model.members) if isinstance(m, Muscle))
    if not chains:
        raise ModelError("model: found no muscle, expected one for a walk (members=[Muscle(...)])")
    contacts = model.assembly.contacts
    names, corners, soles, first = [], [], [], 0
    for group in model.contacts:
        numbers = np.arange(first, first + len(group.points))
        first += len(group.points)
        names.append(group.part if isinstance(group.part, str) else f"{group.part[0]}[{group.part[1]}]")
        corners.append(numbers)
        soles.append((int(contacts.node[numbers[0]]), contacts.offset[numbers].mean(axis=0)))
    start = end = crown = None
    if model.landmarks is not None:
        marks = model.landmarks
        start, end, crown = (model.atlas.locate(place) for place in (marks.start, marks.end, marks.crown))
        chains = tuple(np.array([model.muscles[name] for name in chain]) for chain in marks.muscles)
    elif model.rods:
        atlas = model.atlas
        start, end = atlas.locate((model.rods[0].name, 0)), atlas.locate((model.rods[-1].name, -1))
        middle, odd = divmod(len(model.rods), 2)
        if odd:
            rod = model.rods[middle]
            crown = atlas.locate((rod.name, (len(rod.points) - 1) // 2))
        else:
            # between the rods on both sides of the middle, on the part that joins them
            node, before = atlas.locate((model.rods[middle - 1].name, -1))
            after = model.rods[middle].points[0] - model.rods[middle - 1].points[-1]
            crown = (node, before + after / 2)
    return Anatomy(tuple(names), tuple(corners), tuple(soles), start, end, crown, chains)


def path(motion: Motion, spot: Spot) -> Array:
    """Positions of a spot at the samples, (s, 3) [mm]."""
    node, offset = spot
    return motion.x[:, node] + np.einsum("sji,j->si", motion.Q[:, node], offset)


def closing(motion: Motion, found: Anatomy) -> Array:
    """Decrease of the distance between the outermost soles along the chord since the drawing, (s,) [mm].

    Without a beam, of the distance between the soles itself. A design's *tip closing*.
    """
    apart = path(motion, found.soles[-1]) - path(motion, found.soles[0])
    centre = motion.model.atlas.centre
    drawn = centre[found.soles[-1][0]] + found.soles[-1][1] - centre[found.soles[0][0]] - found.soles[0][1]
    if found.start is None or found.end is None:
        return float(np.linalg.norm(drawn)) - np.linalg.norm(apart, axis=1)
    chord = path(motion, found.end) - path(motion, found.start)
    chord /= np.linalg.norm(chord, axis=1)[:, None]
    line = centre[found.end[0]] + found.end[1] - centre[found.start[0]] - found.start[1]
    return float(drawn @ line / np.linalg.norm(line)) - np.einsum("sc,sc->s", apart, chord)


def sagitta(motion: Motion, found: Anatomy) -> Array:
    """Distance of the beam's middle from the chord of its flexible span, (s,) [mm]; zero without a beam."""
    if found.start is None or found.end is None or found.crown is None:
        return np.zeros(len(motion.times))
    start = path(motion, found.start)
    chord = path(motion, found.end) - start
    chord /= np.linalg.norm(chord, axis=1)[:, None]
    arm = path(motion, found.crown) - start
    return np.linalg.norm(arm - np.einsum("sc,sc->s", arm, chord)[:, None] * chord, axis=1)


def muscle_lengths(motion: Motion, found: Anatomy) -> Array:
    """Length of each muscle at the samples, (s, m) [mm]."""
    return np.array([sum(_member_length(motion, k) for k in chain) for chain in found.chains]).T


def _member_length(motion: Motion, k: int) -> Array:
    """Length of a member at the samples, (s,) [mm]."""
    members = motion.model.assembly.members
    begin, end = (path(motion, (int(members.nodes[k, i]), members.offset[k, i])) for i in (0, 1))
    return np.linalg.norm(end - begin, axis=1)


def _member_rate(motion: Motion, k: int) -> Array:
    """Rate of length of a member at the samples, (s,) [mm/s]."""
    members, at, moving = motion.model.assembly.members, [], []
    for node, offset in zip(members.nodes[k], members.offset[k], strict=True):
        arm = np.einsum("sji,j->si", motion.Q[:, node], offset)
        at.append(motion.x[:, node] + arm)
        moving.append(motion.v[:, node, :3] + np.cross(motion.v[:, node, 3:], arm))
    along = (at[1] - at[0]) / np.linalg.norm(at[1] - at[0], axis=1)[:, None]
    return np.einsum("sc,sc->s", along, moving[1] - moving[0])


def added_forces(motion: Motion, found: Anatomy) -> Array:
    """What the drive adds to the tensile force of each muscle, (s, m) [mN]."""
    A = motion.model.assembly
    force = np.array([(motion.model.pull(drive) - motion.model.pull(0.0))[found.muscles] for drive in motion.drive])
    for column, k in enumerate(found.muscles):
        rest, standing = A.members.length[k], A.activation.standing[k]
        for i, (length, rate) in enumerate(zip(_member_length(motion, k), _member_rate(motion, k), strict=True)):
            isometric = force[i, column]
            active, _, _ = active_tension(A.activation, k, rest, length - rate, length, 1.0, 1.0, isometric)
            force[i, column] = active - standing
    return force


def muscle_forces(motion: Motion, found: Anatomy) -> Array:
    """Tensile force of each muscle without its viscous part, (s, m) [mN]."""
    members = motion.model.assembly.members
    force = added_forces(motion, found) + motion.model.assembly.activation.standing[found.muscles]
    for column, k in enumerate(found.muscles):
        lengths = _member_length(motion, k)
        for i in range(len(force)):
            more, _, _ = passive_tension(members.law[k], members.stiffness[k], members.length[k], lengths[i])
            force[i, column] += more
    return force


def sole_gaps(motion: Motion, found: Anatomy) -> Array:
    """Clear distance between the soles of neighbouring feet along the line of their middles, (s, f - 1) [mm].

    Negative where they overlap; for feet of several points that do not turn about the vertical.
    """
    contacts, gaps = motion.model.assembly.contacts, []
    middles = [path(motion, sole) for sole in found.soles]
    for a, b in pairwise(range(len(found.feet))):
        along = middles[b] - middles[a]
        along /= np.maximum(np.linalg.norm(along, axis=1), 1e-300)[:, None]
        reach = [
            np.array([
                np.einsum("sc,sc->s", path(motion, (int(contacts.node[k]), contacts.offset[k])) - middles[a], along)
                for k in found.corners[foot]
            ])
            for foot in (a, b)
        ]  # fmt: skip
        gaps.append(reach[1].min(axis=0) - reach[0].max(axis=0))
    return np.array(gaps).T.reshape(len(motion.times), -1)


def uprightness(motion: Motion, found: Anatomy) -> Array:
    """Cosine of the angle between the feet's mean upward axis and the ground's normal, (s,) [1]."""
    normal = motion.ground.axes[0] if motion.ground is not None else np.array([0.0, 0.0, 1.0])
    up = np.mean([motion.Q[:, node, 2, :] for node, _ in found.soles], axis=0)
    return up @ normal / np.maximum(np.linalg.norm(up, axis=1), 1e-300)

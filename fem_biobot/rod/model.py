"""An assembly of rods, bodies, joints, muscles and loads as one model, and the states that analyses of it return.

One model serves statics, modes and both time integrators. It is not changed by them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from fem_biobot.errors import ModelError
from fem_biobot.rod.activation.kernels import active_tension
from fem_biobot.rod.arrays import Assembly
from fem_biobot.rod.assembly import kernels
from fem_biobot.rod.build import Atlas, Built, Joint, Load, Member, build
from fem_biobot.rod.ground import ContactPoints
from fem_biobot.rod.landmarks import Landmarks
from fem_biobot.rod.records import Body, Hold, Muscle, Place, Rod
from fem_biobot.rod.system import System, system
from fem_biobot.rod.touch import Touch

Array = NDArray[np.float64]


class RodModel:
    """Geometrically exact rods and rigid bodies, joined, held, pulled and loaded.

    Parameters
    ----------
    rods
        `Rod` records.
    joints
        `Rigid`, `Spherical`, `Hinge` or `Guide`. Rigidly joined parts share their unknowns at whatever distance; the
        others are constraints with multipliers. No joint is a spring.
    bodies
        `Body` records.
    supports
        `Hold` records. None is needed for dynamics.
    loads
        `PointLoad`, `DistributedLoad`, `Gravity`, `Drag`, `LinearDrag`.
    members
        `Muscle` and `Spring` records.
    contacts
        `ContactPoints`: where the ground can touch.
    touches
        `Touch` records: rods that stay outside other parts.
    damping_time
        Kelvin-Voigt time of rods that name none [s]: resultants gain this times their rate.
    landmarks
        `Landmarks`: where walks are measured; by default the rods in their order are the beam.

    Raises
    ------
    ModelError
        Parts that do not exist, do not meet or do not hang together; names given twice.

    Notes
    -----
    Rods: two-node elements after Simo (1985) and Reissner (1972) with strains constant along the element and helicoidal
    interpolation (Borri and Bottasso 1994); orders in element length, and the nodes' shares of mass and rotary inertia,
    are told at `Discretisation`. Sections stay plane and keep their shape; material is linear in the strains.
    """

    def __init__(
        self,
        rods: Sequence[Rod] = (),
        joints: Sequence[Joint] = (),
        bodies: Sequence[Body] = (),
        supports: Sequence[Hold] = (),
        loads: Sequence[Load] = (),
        members: Sequence[Member] = (),
        contacts: Sequence[ContactPoints] = (),
        damping_time: float = 0.0,
        touches: Sequence[Touch] = (),
        landmarks: Landmarks | None = None,
    ) -> None:
        if not (np.isfinite(damping_time) and damping_time >= 0.0):
            raise ModelError(f"damping_time: found {damping_time!r}, expected a finite time of at least 0 s")
        self.rods, self.joints, self.bodies = tuple(rods), tuple(joints), tuple(bodies)
        self.supports, self.loads, self.members = tuple(supports), tuple(loads), tuple(members)
        self.contacts, self.touches, self.damping_time = tuple(contacts), tuple(touches), float(damping_time)
        parts = (self.rods, self.joints, self.bodies, self.supports, self.loads, self.members)
        self.built: Built = build(*parts, self.contacts, self.touches, damping_time)
        self.landmarks = landmarks
        if landmarks is not None:
            for place in (landmarks.start, landmarks.end, landmarks.crown):
                self.atlas.locate(place)
            for name in (name for chain in landmarks.muscles for name in chain):
                if name not in self.muscles:
                    known = ", ".join(self.muscles) or "none"
                    raise ModelError(f"landmarks: no muscle of the name {name!r}, expected one of: {known}")

    @property
    def assembly(self) -> Assembly:
        """Arrays of the kernels."""
        return self.built.assembly

    @property
    def atlas(self) -> Atlas:
        """Where the parts went."""
        return self.built.atlas

    @cached_property
    def system(self) -> System:
        """Plan of the block system."""
        return system(self.assembly)

    @property
    def n_nodes(self) -> int:
        """Rigid groups; six unknowns each."""
        return len(self.built.x)

    @cached_property
    def muscles(self) -> Mapping[str, int]:
        """Names of the muscles and their number among the members."""
        return {m.name: k for k, m in enumerate(self.members) if isinstance(m, Muscle)}

    @property
    def mass(self) -> float:
        """Of everything [kg]."""
        return float(self.assembly.inertia.mass.sum())

    def elements_of(self, rod: str) -> slice:
        """Elements of a rod among all."""
        begin = 0
        for each in self.rods:
            if each.name == rod:
                return slice(begin, begin + len(each.points) - 1)
            begin += len(each.points) - 1
        raise ModelError(f"no rod of the name {rod!r}, expected one of: {', '.join(r.name for r in self.rods)}")

    def pull(self, drive: float) -> Array:
        """Active tensile force of every member at a drive between 0 and 1, (k,) [mN]; 0 for springs.

        Standing and stimulated, without the factors of length and velocity.
        """
        force = np.zeros(len(self.members))
        for k, m in enumerate(self.members):
            if isinstance(m, Muscle):
                force[k] = m.isometric(drive)
        return force

    def load_factors(self, time: float) -> Array:
        """Factor of each point load at a time, (l,) [1]."""
        return np.array([1.0 if h is None else float(h(time)) for h in self.built.histories])

    def drawn(self) -> RodState:
        """The assembly as drawn, at rest."""
        n = self.n_nodes
        return RodState(self, self.built.x.copy(), np.tile(np.eye(3), (n, 1, 1)))


@dataclass(frozen=True, eq=False)
class RodState:
    """Where an assembly is.

    Attributes
    ----------
    model
        Whose state it is.
    x, Q
        Node positions (n, 3) [mm] and directors (rows, n, 3, 3); a node is a rigid group at its centre of mass.
    v
        Velocity and angular velocity of the nodes, (n, 6) [mm/s, rad/s].
    drive
        Of the muscles [1].
    time
        [s]
    multiplier
        Force and couple that each joint or partial support exerts on its first part, (j, 6) [mN, uJ].
    load, tension
        Factors on the loads and on the muscles' tension [1]; other than 1 on the way of `statics` only.
    stable
        Of an equilibrium: whether no small motion that supports and joints allow sets energy free; one that costs
        nothing (a turn about an axis of symmetry) does no harm. None if not known.
    residual
        Of an equilibrium: largest force out of balance over the largest force [1].
    """

    model: RodModel
    x: Array
    Q: Array
    v: Array = field(default_factory=lambda: np.zeros((0, 6)))
    drive: float = 0.0
    time: float = 0.0
    multiplier: Array = field(default_factory=lambda: np.zeros((0, 6)))
    load: float = 1.0
    tension: float = 1.0
    stable: bool | None = None
    residual: float = 0.0

    def __post_init__(self) -> None:
        if len(self.v) == 0:
            object.__setattr__(self, "v", np.zeros((len(self.x), 6)))

    def at(self, place: Place) -> Array:
        """Position of a place, (3,) [mm]."""
        node, offset = self.model.atlas.locate(place)
        return np.asarray(self.x[node] + self.Q[node].T @ offset, dtype=float)

    def displacement(self, place: Place) -> Array:
        """Displacement of a place from where it was drawn, (3,) [mm]."""
        return self.at(place) - self.model.atlas.parse(place)[1]

    def velocity(self, place: Place) -> Array:
        """Velocity of a place, (3,) [mm/s]."""
        node, offset = self.model.atlas.locate(place)
        spin = np.cross(self.v[node, 3:], self.Q[node].T @ offset)
        return np.asarray(self.v[node, :3] + spin, dtype=float)

    def points(self, rod: str) -> Array:
        """Positions of a rod's nodes, (n, 3) [mm]."""
        self.model.elements_of(rod)
        return np.array([self.at((rod, i)) for i in range(len(self.model.atlas.drawn[rod]))])

    def directors(self, rod: str) -> Array:
        """Directors at a rod's nodes, rows, (n, 3, 3) [1]; the third is along the rod."""
        self.model.elements_of(rod)
        atlas = self.model.atlas
        return np.array([frame @ self.Q[atlas.node_of[rod, i]] for i, frame in enumerate(atlas.frames[rod])])

    @cached_property
    def _measured(self) -> tuple[Array, Array]:
        assembly = self.model.assembly
        strain, lengths = np.zeros((len(assembly.damping), 6)), np.zeros(len(assembly.members.law))
        kernels.measure(assembly, self.x, self.Q, strain, lengths)
        return strain, lengths

    def strain(self, rod: str) -> tuple[Array, Array]:
        """Shear-stretch `eps` (m, 3) [1] and curvature-twist `kappa` (m, 3) [1/mm] of a rod less the natural ones.

        Those of its sections in the middle of its elements: shear is what the shear force makes of a section, without
        the residual bending of the element.
        """
        part, elements = self.model.elements_of(rod), self.model.assembly.elements
        found = self._measured[0][part]
        eps, kappa = found[:, :3] - elements.eps0[part], found[:, 3:] - elements.kappa0[part]
        eps[:, :2] *= elements.stiffness[part, :2] / elements.section[part, :2]
        return eps, kappa

    def resultants(self, rod: str) -> tuple[Array, Array]:
        """Elastic force `n_force` (m, 3) [mN] and couple `m_couple` (m, 3) [uJ] in a rod, in its material frame."""
        eps, kappa = self.strain(rod)
        C = self.model.assembly.elements.section[self.model.elements_of(rod)]
        return C[:, :3] * eps, C[:, 3:] * kappa

    def muscle_length(self, name: str) -> float:
        """Length of a muscle [mm]."""
        return float(self._measured[1][self._muscle(name)])

    def stretch(self, name: str) -> float:
        """Length of a muscle over its rest length [1]."""
        return self.muscle_length(name) / float(self.model.assembly.members.length[self._muscle(name)])

    def muscle_force(self, name: str) -> float:
        """Tensile force of a muscle without its viscous part [mN]."""
        k, A = self._muscle(name), self.model.assembly
        M, muscle, length = A.members, self.model.members[k], float(self._measured[1][k])
        assert isinstance(muscle, Muscle)
        apart = self.at(muscle.b) - self.at(muscle.a)
        rate = float(apart @ (self.velocity(muscle.b) - self.velocity(muscle.a))) / length
        stimulated = muscle.isometric(self.drive) - muscle.isometric(0.0)
        active, _, _ = active_tension(A.activation, k, M.length[k], length - rate, length, 1.0, 1.0, stimulated)
        passive, _, _ = kernels.passive_tension(M.law[k], M.stiffness[k], M.length[k], length)
        return float(self.tension * active + passive)

    def _muscle(self, name: str) -> int:
        if name not in self.model.muscles:
            known = ", ".join(self.model.muscles) or "none"
            raise ModelError(f"no muscle of the name {name!r}, expected one of: {known}")
        return self.model.muscles[name]

    @property
    def energy(self) -> float:
        """Elastic energy of rods and members [uJ]."""
        elastic, _ = kernels.energies(self.model.assembly, self.x, *self._measured)
        return float(elastic)

    @property
    def kinetic_energy(self) -> float:
        """[uJ]"""
        inertia = self.model.assembly.inertia
        body = np.einsum("nij,nj->ni", self.Q, self.v[:, 3:])
        spin = np.einsum("ni,nij,nj->n", body, inertia.J, body)
        return float(0.5 * (inertia.mass @ (self.v[:, :3] ** 2).sum(axis=1) + spin.sum()))

    @property
    def centre_of_mass(self) -> Array:
        """Of everything, (3,) [mm]."""
        mass = self.model.assembly.inertia.mass
        return (mass @ self.x) / mass.sum()


def refuse_touches(analysis: str, model: RodModel) -> None:
    """Refuse parts that touch in an analysis that does not know of it."""
    if model.touches:
        raise ModelError(
            f"{analysis}: found {len(model.touches)} touches, expected a model without; dynamics with much damping "
            "finds how parts rest on each other"
        )

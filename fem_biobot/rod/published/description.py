"""The published rod walker: its numbers, and what its code does that a machine of rods would not.

Source: the case ``walker`` of the open code ``mattialab/elastica`` (MIT licence; X. Zhang, F. K. Chan, T. Parthasarathy
and M. Gazzola, Nat. Commun. 10, 4825, 2019), files Walker.cpp, ExternalContact.h and Rod.cpp. Its units are g, mm, s
and uN, its frame has the beam along -y from the short pillar at y = -1.75 to the long one at -12.25. Ours:
``x = -7 - y``, ``y = x - 1.75``, ``z = z``: a turn, no reflection, x from the short to the long pillar with 0 at
mid-span, y to the left with 0 between the two beams. Its ground is z = 0 in both.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, fields
from enum import StrEnum

from fem_biobot.errors import ModelError
from fem_biobot.rod.records import _number, _set


class Oddity(StrEnum):
    """What the published code does, each to be had alone; without it the machine has what is named last.

    doubled_shear
        Shear modulus ``E / (1 + nu)`` in shear and twist of all rods; ``E / (2 (1 + nu))``.
    halved_beam
        The beams have half of their mass, an adjustment to an overall weight; all of it.
    smeared_step
        Bending stiffness belongs to nodes, and where the flexible span meets the pillars it is the mean of both sides:
        an element has the harmonic mean of its two ends. The span bends as if 0.5 mm shorter; stiffness as the radii
        say, element by element.
    yielding_joints
        A leg follows the beam by a spring of ``0.0001 x 5e8 uN/mm x 1 mm`` times its length in turning, 140 and 170 uJ
        a radian, and a dashpot of 5 uJ s: each end of the beam yields 5 % more; legs are rigid on the beam.
    stiff_fibres
        The straight fibres have the stiffness of a ring (radius 0.29 mm) with the mass and force of their own radius
        (0.227 mm); the stiffness of their own.
    leg_node_contact
        A ring meets its pillar at the legs' nodes 3 and 4, whatever its own height. Moment arms 1.7 and 2.27 mm at the
        long, 1.4 and 1.87 mm at the short pillar; at the rings' heights as drawn, 2.0 and 2.6 mm below the beam's axis.
    centred_reaction
        The ground's force acts on a leg's last node, without a moment, though the corner that is lower stops it, and
        friction sees that node's velocity; corners bear what touches them.
    friction_twice
        Friction is added for each corner that touches, here as twice the coefficients under all feet, the bound. Not
        part of the published set: the code takes the forces at a foot in turn, the first corner that touches balances
        them, and the second finds nothing left to balance.
    absolute_damping
        Drag against rest on every rod, 0.13 g/(mm s) on the skeleton and 0.05 on muscle, on translation and (times
        1 mm^2) on spin, and 10 g mm/s per rate of stretch in muscle; Kelvin-Voigt damping of all rods, and of muscle
        the drag of slender bodies in water.
    floating_muscle
        Gravity acts on the skeleton alone, and no vertical force on the rings: they stay at the height at which they
        were drawn while the legs move past; muscle weighs what it does in water, and rings are held at their height on
        the legs.
    overlapping_ends
        The last two elements of a ring lie on its first two and hang free, and where it closes it does not resist
        bending; rings of 22 elements, closed rigidly.
    """

    doubled_shear = "doubled_shear"
    halved_beam = "halved_beam"
    smeared_step = "smeared_step"
    yielding_joints = "yielding_joints"
    stiff_fibres = "stiff_fibres"
    leg_node_contact = "leg_node_contact"
    centred_reaction = "centred_reaction"
    friction_twice = "friction_twice"
    absolute_damping = "absolute_damping"
    floating_muscle = "floating_muscle"
    overlapping_ends = "overlapping_ends"


class Start(StrEnum):
    """How the machine begins.

    standing
        At rest on its feet with the base force in its muscles, to which it settled from the drawing; strokes begin at
        once.
    published
        As drawn, at rest, above the ground; it falls. After 0.1 s the base force grows at 1 mN/s up to its size and the
        strokes begin.
    """

    standing = "standing"
    published = "published"


_MAY_VANISH = ("base_force", "active_force", "damping_time", "viscosity", "water_density", "poisson")
AS_PUBLISHED = frozenset(Oddity) - {Oddity.friction_twice}
CORRECTED: frozenset[Oddity] = frozenset()
SETS = {"as_published": AS_PUBLISHED, "corrected": CORRECTED}


@dataclass(frozen=True)
class ElasticaWalker:
    """The published machine: eighteen rods in mm, mN, kPa, s and kg.

    Two beams with a flexible span between the pillars, two legs a pillar, four cross rods, two rings of muscle around
    each pillar and four straight fibres between the upper rings.

    Attributes
    ----------
    oddities
        What is done as in the published code: `AS_PUBLISHED`, `CORRECTED` or any set of `Oddity`.
    start
        See `Start`.
    beam_length, beam_spacing, beam_height
        Of each beam, between the two, and of their axes over the ground as drawn [mm].
    beam_radius, flexible_radius
        Of the beams' mass and of their stiffness over the pillars; of their stiffness between [mm].
    short_leg, long_leg, leg_radius, cross_radius
        Length of the legs from the beam's axis, radii [mm].
    young, poisson, density
        Of the skeleton [kPa, 1, kg/mm^3]; Poisson's ratio of all rods.
    shear_factor
        Of all rods in both directions [1]; the code's.
    muscle_young, muscle_density, ring_radius, fibre_radius
        [kPa, kg/mm^3, mm]
    upper_ring, lower_ring
        Height of the rings over the ground as drawn [mm].
    base_force, active_force
        Tension of every element of a ring or fibre at rest, and what full drive adds [mN].
    skeleton_drag, muscle_drag
        Force against rest per length and velocity [kPa s]; with `absolute_damping`.
    stretch_damping
        Force per rate of stretch in muscle [mN s]; with `absolute_damping`.
    damping_time, viscosity
        Kelvin-Voigt time of all rods and muscle [s], and of the water around muscle [kPa s]; without
        `absolute_damping`.
    water_density
        Around muscle [kg/mm^3]; without `floating_muscle`.
    clearance
        Least distance of a ring's axis from the line through the axes of a pillar's legs [mm].
    static_friction, kinetic_friction
        Of the ground [1].
    """

    oddities: frozenset[Oddity] = AS_PUBLISHED
    start: Start = Start.standing
    beam_length: float = 14.0
    beam_spacing: float = 3.5
    beam_height: float = 3.5
    beam_radius: float = 0.8786
    flexible_radius: float = 0.5842
    short_leg: float = 2.8
    long_leg: float = 3.4
    leg_radius: float = 1.75
    cross_radius: float = 0.72
    young: float = 319.4
    poisson: float = 0.5
    density: float = 1.12e-6
    shear_factor: float = 4.0 / 3.0
    muscle_young: float = 10.0
    muscle_density: float = 1.06e-6
    ring_radius: float = 0.29
    fibre_radius: float = 0.227
    upper_ring: float = 1.5
    lower_ring: float = 0.9
    base_force: float = 0.2
    active_force: float = 0.6
    skeleton_drag: float = 1.3e-4
    muscle_drag: float = 5e-5
    stretch_damping: float = 0.01
    damping_time: float = 1e-4
    viscosity: float = 1e-6
    water_density: float = 1e-6
    clearance: float = 2.04
    static_friction: float = 0.42
    kinetic_friction: float = 0.3

    def __post_init__(self) -> None:
        _set(self, oddities=oddity_set(self.oddities))
        try:
            _set(self, start=Start(self.start))
        except ValueError:
            known = " or ".join(Start)
            raise ModelError(f"elastica walker: start: found {self.start!r}, expected {known}") from None
        for field in fields(self)[2:]:
            zero = field.name in _MAY_VANISH
            _number(f"elastica walker: {field.name}", getattr(self, field.name), 0.0, open_low=not zero)

    def has(self, oddity: Oddity) -> bool:
        """Whether the machine has an oddity."""
        return oddity in self.oddities

    def shear_modulus(self, young: float) -> float:
        """Of a material [kPa]."""
        return young / ((1.0 if self.has(Oddity.doubled_shear) else 2.0) * (1.0 + self.poisson))


def oddity_set(names: Iterable[str]) -> frozenset[Oddity]:
    """Oddities by their names; refuses what is none."""
    known = ", ".join(Oddity)
    if isinstance(names, str):
        raise ModelError(f"oddities: found {names!r}, expected a set out of: {known}")
    found = []
    for name in names:
        try:
            found.append(Oddity(name))
        except ValueError:
            raise ModelError(f"oddities: found {name!r}, expected any of: {known}") from None
    return frozenset(found)

"""A machine as a bow in closed form: what its muscle does to its beam, and what its feet hold, without a mesh or rods.

The beam of a bay is taken for a circular arc, rigid pillars at its ends, the muscle for a string between them at its
moment arm, fixed at a distance o beyond the beam's ends: none for a junction, the pillars' outer faces for a ring,
which slides. With the half angle phi, the beam's length L and the arm l

* moment: ``F (l cos(phi) + o sin(phi) + (8 / pi^2) s)`` in the mean, with the arc's rise
  ``s = L (1 - cos(phi)) / (2 phi)``
* equilibrium: ``phi = moment L / (2 E I)``; small angles give Eq. 3 of Pagan-Diaz et al. (2018) within its linear
  theory, and a beam that gives way at Euler's load ``pi^2 E I / L^2`` of a strut pulled together at its ends
* force: Eq. 2, ``A (gamma sin(theta) T - E e / (1 - e))`` at the muscle's shortening e

Left out: shear, the width of a plate, the pillars' flexibility, how the muscle lifts towards the beam. Beside the rods
of the same design force is within 2 %, closing 4 % and sagitta 6 % up to half angles of 40 degrees (a test holds it to
that).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from scipy.optimize import brentq

from fem_biobot.design import Design
from fem_biobot.equations import equation_1, equation_2
from fem_biobot.mesh.layout import layout
from fem_biobot.muscle.oxygenation import viable_gamma

GRAVITY = 9810.0  # mm/s^2
# mean over a half wave squared, so that the arc gives way at Euler's load
_MEAN_OF_RISE = 8.0 / math.pi**2
# the pillars point at one another: the arc says nothing beyond
_FOLDED = 0.5 * math.pi


@dataclass(frozen=True)
class Bow:
    """A bent machine.

    Attributes
    ----------
    force
        Of the muscle [mN].
    half_angle
        By which each pillar has turned, at most a right angle [rad].
    closing
        Approach of the middles of neighbouring pillars' soles [mm].
    gap
        What is left between neighbouring pillars, or between the rings around them, where they come nearest, along
        the chord; not above 0 where they meet [mm].
    sagitta
        Rise of the beam over its chord [mm].
    shortening
        Of the muscle, over its length [1].
    gel_strain
        Largest in the beam, bending and compression together, as a nominal strain [1].
    """

    force: float
    half_angle: float
    closing: float
    gap: float
    sagitta: float
    shortening: float
    gel_strain: float


def bending_stiffness(design: Design) -> float:
    """``E I`` of the beam [mN mm^2]."""
    return design.value("skeleton.material.young") * design.second_moment


def full_pull(design: Design, drive: float) -> float:
    """Force of the muscle at the length it was made at, Eq. 1: tension, section, ``gamma sin(theta)`` [mN]."""
    muscle, gamma = design.value("muscle"), viable_gamma(design)
    standing = 1.0 if muscle.gamma_scales == "active" else gamma
    tension = standing * muscle.passive_tension + gamma * drive * muscle.active_tension
    return equation_1(tension, design.junction_section, muscle.theta)


def buckling_load(design: Design) -> float:
    """Euler's load of a bay of the beam pulled together at its ends, ``pi^2 E I / L^2`` [mN]."""
    return math.pi**2 * bending_stiffness(design) / design.bay**2


def bow(design: Design, drive: float, *, resisting: bool | None = None) -> Bow:
    """The machine at a drive between 0 and 1.

    Parameters
    ----------
    design
        A bot.
    drive
        Of the muscle [1].
    resisting
        Whether the tissue resists its shortening from the length it was made at; by default where
        ``muscle.reference`` is ``as_moulded``. Remodelled tissue holds its whole standing tension.
    """
    free = full_pull(design, drive)
    if resisting is None:
        resisting = design.value("muscle.reference") == "as_moulded"
    if not free > 0.0:
        return _bent(design, 0.0)
    if not resisting:
        return _bent(design, free)

    def missing(force: float) -> float:
        """What the tissue can pull with at the shape that a force gives, less that force."""
        shortening = min(_bent(design, force).shortening, 1.0 - 1e-9)
        resistance = equation_2(0.0, design.junction_section, design.value("muscle.material.young"), shortening)
        return free + resistance - force

    return _bent(design, float(brentq(missing, 0.0, free, xtol=1e-10 * free)))  # pyright: ignore[reportArgumentType]


def _bent(design: Design, force: float) -> Bow:
    """Shape of the machine under a force of its muscle."""
    L, EI = design.bay, bending_stiffness(design)
    muscle, beam = design.value("muscle"), design.value("skeleton")
    beyond = beam.pillar_length if muscle.layout == "ring" else 0.0

    def arm(phi: float) -> float:
        return design.moment_arm * math.cos(phi) + beyond * math.sin(phi)

    def missing(phi: float) -> float:
        return force * (arm(phi) + _MEAN_OF_RISE * _rise(L, phi)) * L / (2.0 * EI) - phi

    folded = missing(_FOLDED) >= 0.0
    phi = _FOLDED if folded else float(brentq(missing, 0.0, _FOLDED, xtol=1e-13))  # pyright: ignore[reportArgumentType]
    chord = L * math.sin(phi) / phi if phi > 0.0 else L
    heights, turned = sum(height for _, height in design.pillars[:2]), 1.0 - math.cos(phi)
    nearer = L - chord + heights * math.sin(phi)
    shorter = L - chord + 2.0 * (design.moment_arm * math.sin(phi) + beyond * turned)
    middle = force * (arm(phi) + _rise(L, phi))
    bending = middle / EI * beam.beam_thickness / 2.0
    pressed = force / (beam.material.young * beam.beam_width * beam.beam_thickness)
    return Bow(
        force,
        phi,
        nearer + beam.pillar_length * turned,
        chord - _reach(design, phi),
        _rise(L, phi),
        shorter / (L + 2.0 * beyond),
        bending + pressed,
    )


def _reach(design: Design, phi: float) -> float:
    """How far two pillars turned by an angle, with their rings, reach into the bay between them, at most [mm]."""
    low = min(height for _, height in design.pillars[:2])
    reaches = [2.0 * low * math.sin(phi)]
    muscle = design.value("muscle")
    if muscle.layout == "junction":
        ring = design.moment_arm - muscle.ring_offset + muscle.ring_height / 2.0
        reaches.append(2.0 * (min(low, ring) * math.sin(phi) + muscle.ring_thickness * math.cos(phi)))
    return max(reaches)


def _rise(length: float, phi: float) -> float:
    """Rise of an arc over its chord [mm]."""
    return 0.5 * length * math.sin(0.5 * phi) * (math.sin(0.5 * phi) / (0.5 * phi)) if phi > 0.0 else 0.0


def weight(design: Design) -> float:
    """Of the machine on its feet, less its buoyancy where it is submerged [mN]."""
    medium = design.ground.medium_density if design.ground.immersion == "submerged" else 0.0
    volumes = layout(design).volumes
    return GRAVITY * sum(v * (design.value(f"{name}.material.density") - medium) for name, v in volumes.items())


def held_closing(design: Design) -> float:
    """Closing per force with which the ground holds the feet apart, linear theory [mm/mN].

    A force H at soles h1 and h2 below the axis bends the beam by end moments ``H h1`` and ``H h2``:
    ``L (h1^2 + h1 h2 + h2^2) / (3 E I)``.
    """
    (_, a), (_, b) = design.pillars[:2]
    return design.bay * (a * a + a * b + b * b) / (3.0 * bending_stiffness(design))

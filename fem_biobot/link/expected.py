"""How far solid and rods of a bot are expected to differ, cause by cause, from closed forms, without any comparison.

Both models leave something out that the other has. Each cause changes one number of the machine of one angle
(`link.folding`), which says of every measure, at every tension, what that does. At small tension that machine is two
springs in parallel, seen from the muscle: the skeleton, ``k_b = 1 / (l^2 L / (E I))``, and the passive tissue,
``k_m = E_m A / L``. With the skeleton's share ``w = k_b / (k_b + k_m)``, a skeleton more compliant by the fraction
``b`` and tissue stiffer by the fraction ``t``

* closing, strain energy: ``w b - (1 - w) t``
* muscle force: ``-(1 - w) (b + t)``
* rotation of the pillars: that of the force plus ``b``
* sagitta and curvature: that of the force plus the part of ``b`` that lies within the span (the plate's)

At the tensions of a machine that walks the tissue is shortened by a third and its tangent stiffness over twice that at
rest, so the skeleton's share falls, and a stiffer skeleton shows in the force rather than in the closing.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from fem_biobot.design import Design
from fem_biobot.errors import ModelError
from fem_biobot.link.folding import Folding

# rotation of a built-in end, ``16.67 M / (pi E h^2)`` per width: O'Donnell (1960), J. Appl. Mech. 27, 461
_BUILT_IN = 16.67 / math.pi
Interval = tuple[float, float]
Measured = Callable[[Folding], Mapping[str, float] | None]


@dataclass(frozen=True)
class Cause:
    """One reason why solid and rods differ.

    Attributes
    ----------
    name
        What it is.
    key, values
        Number of the machine of one angle that it changes, to these at least and at most; see `Folding`.
    compliance
        By which fraction the solid's skeleton is more compliant than the rods', seen from the muscle [1].
    tissue
        By which fraction the solid's passive tissue is stiffer [1].
    formula
        Where the numbers come from.
    vanishes
        The limit in which it does.
    foreseen
        Whether it was stated before the first comparison; else it was derived after that one, in which force and stroke
        lay outside of what the others, at their shares at rest, leave.
    """

    name: str
    key: str
    values: Interval
    compliance: Interval
    tissue: Interval
    formula: str
    vanishes: str
    foreseen: bool = True


@dataclass(frozen=True)
class Expectation:
    """Expected differences of the solid from the rods, ``solid / rods - 1`` [1].

    Attributes
    ----------
    causes
        Reasons; none for a machine of which nothing is stated.
    rods
        What the rods are in one angle.
    skeleton_share
        ``k_b / (k_b + k_m)`` at rest [1].
    """

    causes: tuple[Cause, ...]
    rods: Folding
    skeleton_share: float

    def at(self, tension: float) -> dict[str, Interval]:
        """Least and most by quantity, at a nominal tension [kPa]; nothing where the machine has no equilibrium."""
        return self._bands(lambda machine: _strained(machine.at(tension)))

    def stroke(self, passive: float, peak: float) -> Interval | None:
        """Least and most of the closing from one tension to another [kPa]."""

        def stroke(machine: Folding) -> Mapping[str, float] | None:
            ends = machine.at(passive), machine.at(peak)
            return None if ends[0] is None or ends[1] is None else {"": _closing(ends[1]) - _closing(ends[0])}

        return self._bands(stroke).get("")

    def _bands(self, measured: Measured) -> dict[str, Interval]:
        """Sums over the causes, each by itself, of the least and of the most that it changes."""
        if not self.causes or (base := measured(self.rods)) is None:
            return {}
        low, high = dict.fromkeys(base, 0.0), dict.fromkeys(base, 0.0)
        for cause in self.causes:
            both = [measured(replace(self.rods, **{cause.key: value})) for value in cause.values]
            if None in both:
                return {}
            for name, value in base.items():
                changes = [other[name] / value - 1.0 for other in both if other is not None]
                low[name] += min(changes)
                high[name] += max(changes)
        return {name: (low[name], high[name]) for name in base}


def _closing(numbers: Mapping[str, float]) -> float:
    return numbers["tip_closing_mm"]


def _strained(numbers: dict[str, float] | None) -> Mapping[str, float] | None:
    """The fibre stretch as its distance from 1, as it is compared."""
    return None if numbers is None else {**numbers, "fibre_stretch_1": 1.0 - numbers["fibre_stretch_1"]}


def skeleton_stiffness(design: Design) -> float:
    """Force of the muscle per closing at its height with rigid pillars, ``E I / (l^2 L)`` [mN/mm]."""
    skeleton = design.skeleton
    assert skeleton is not None
    return skeleton.material.young * design.second_moment / (design.moment_arm**2 * design.span)


def tissue_stiffness(design: Design) -> float:
    """Passive force per shortening of the junction held at its ends alone, ``E_m A / L_m`` [mN/mm]."""
    muscle = design.muscle
    assert muscle is not None
    return muscle.material.young * design.junction_section / design.span


def causes(design: Design, *, plate: bool = False) -> tuple[Cause, ...]:
    """Causes of the difference, each with its closed form.

    Parameters
    ----------
    design
        A bot with two pillars and a junction.
    plate
        Whether the rods' beam has the plate's modulus, ``E / (1 - nu^2)``.

    Raises
    ------
    ModelError
        Another kind of machine.
    """
    s, m = design.skeleton, design.muscle
    if design.kind != "bot" or s is None or m is None or s.pillar_count != 2 or m.layout != "junction":
        raise ModelError(f"{design.name}: found no bot of two pillars with a muscle, expected one for a cross-check")
    nu, h, span = s.material.poisson, s.beam_thickness, design.span
    stiffer = nu**2
    plate_of: Interval = (0.0, stiffer / (1.0 - stiffer)) if plate else (-stiffer, 0.0)
    # both ends, over the rotation M L / (E I) of the beam; between plane strain and plane stress
    ends = 2.0 * _BUILT_IN / 12.0 * h / span * max(1.0 - 2.0 * s.fillet_radius / h, 0.0)
    gel, arm = s.material.young, design.moment_arm
    free = arm - h / 2.0
    inertia, area = s.pillar_width * s.pillar_length**3 / 12.0, s.pillar_width * s.pillar_length
    shear = gel / (2.0 * (1.0 + nu))
    pillar = 2.0 * (free**3 / (3.0 * gel * inertia) + free / (5.0 / 6.0 * shear * area)) * skeleton_stiffness(design)
    held = min(m.junction_width / design.span, 1.0) * (1.0 / (1.0 - m.material.poisson**2) - 1.0)
    rigid = _rigid(design)
    zero = (0.0, 0.0)
    return (
        Cause(
            "beam bends as a plate",
            "plate",
            (-stiffer, 0.0),
            plate_of,
            zero,
            "between E I and E I / (1 - nu^2): free to curve sideways, or not at all",
            "a beam much narrower than it is long; nu = 0",
        ),
        Cause(
            "ends of the beam yield",
            "ends",
            (ends * (1.0 - nu**2), ends),
            (ends * (1.0 - nu**2), ends),
            zero,
            "2 * 16.67 / (12 pi) * h / L (O'Donnell 1960), less in plane strain; none over a fillet's radius",
            "a slender beam, h / L to 0",
        ),
        Cause(
            "pillars bend and shear",
            "ends",
            (0.0, pillar),
            (0.0, pillar),
            zero,
            "2 (c^3 / (3 E I_p) + c / (5/6 G A_p)) E I / (l^2 L), c from the beam to the muscle",
            "rigid pillars: long in x, or stiff",
        ),
        Cause(
            "ends of the muscle cannot narrow",
            "tissue",
            (0.0, held),
            zero,
            (0.0, held),
            "1 / (1 - nu_m^2) over half a width at each end",
            "a strip much narrower than it is long",
        ),
        Cause(
            "law of the muscle in large strain",
            "law",
            (0.0, 1.0),
            zero,
            _law(design),
            "neo-Hookean strip over Eq. 2, (s - s^-2) / 3 over (s - 1) / s, up to full tension",
            "small strain",
        ),
        Cause(
            "rings spread the muscle's pull",
            "rigid",
            rigid,
            zero,
            (rigid[0] / (span - rigid[0]), rigid[1] / (span - rigid[1])),
            "2 (w - int t / (t + c x) dx) over a ring's thickness w, up to its height: a load that spreads by half of "
            "its way on each side, c = 1, to one that does by 45 degrees, c = 2",
            "thin rings, w / L to 0",
            foreseen=False,
        ),
        Cause(
            "clamped ends lift the muscle",
            "clamped",
            (0.0, 1.0),
            (_lifted(design), 0.0),
            zero,
            "arm shorter by the turn times sqrt(E I / N / (1 + N / S)) of the strip (Timoshenko's beam under tension), "
            "and times the thickness of rings that turn as well, as far as they are stiff; up to full tension",
            "a thin strip and thin rings, t / l and w / l to 0; small turns",
            foreseen=False,
        ),
    )


def _rigid(design: Design) -> Interval:
    """Length of the muscle that does not shorten because rings around its ends take part in it [mm], least and most."""
    m = design.value("muscle")
    w, t, height = m.ring_thickness, m.junction_thickness, max(m.ring_height, m.junction_thickness)

    def lost(slope: float) -> float:
        """Of one ring, in which the load's height grows by a slope up to the ring's."""
        full = min(w, (height - t) / slope)
        return w - t / slope * math.log(1.0 + slope * full / t) - (w - full) * t / height

    return 2.0 * lost(1.0), 2.0 * lost(2.0)


def _lifted(design: Design) -> float:
    """By which fraction a muscle that is lifted stiffens the skeleton at full tension: with the square of the arm."""
    machine = Folding(design, clamped=1.0)
    found = Folding(design).at(design.tension(design.drive.amplitude))
    if found is None:
        return -1.0
    way = design.span * (1.0 - found["fibre_stretch_1"])
    lift = machine.lift(way, found["muscle_force_mN"]) * math.radians(found["pillar_rotation_deg"])
    return (1.0 - min(lift / design.moment_arm, 1.0)) ** 2 - 1.0


def _law(design: Design) -> Interval:
    """By how much a neo-Hookean strip resists more than Eq. 2, from no strain to that of full tension in line."""
    force = design.tension(design.drive.amplitude) * design.junction_section
    closing = force / (skeleton_stiffness(design) + tissue_stiffness(design))
    s = max(1.0 - closing / design.span, 0.3)
    if s >= 1.0:
        return 0.0, 0.0
    more = ((s - s**-2) / 3.0) / ((s - 1.0) / s) - 1.0
    return min(more, 0.0), max(more, 0.0)


def expect(design: Design, *, plate: bool = False) -> Expectation:
    """Expected differences of closing, force, sagitta, rotation, energy, curvature, shortening, stroke and frequency.

    None for a muscle that is one ring around both pillars: no closed form is stated for it.

    Raises
    ------
    ModelError
        As `causes`.
    """
    if design.skeleton is None:
        causes(design)  # refuses
    rods = Folding(design, plate=-(design.value("skeleton").material.poisson ** 2) if plate else 0.0)
    if design.kind == "bot" and design.value("muscle.layout") == "ring":
        return Expectation((), rods, math.nan)
    found = causes(design, plate=plate)
    bending, tissue = skeleton_stiffness(design), tissue_stiffness(design)
    return Expectation(found, rods, bending / (bending + tissue))

"""How far solid and rods of a bot are expected to differ, cause by cause, from closed forms, before any comparison.

Both models leave something out that the other has. To first order the machine is two springs in parallel, seen from
the muscle: the skeleton, ``k_b = 1 / (l^2 L / (E I))``, and the passive tissue, ``k_m = E_m A / L_m``. A tension that
would pull with ``F0`` at fixed pillars closes it at the muscle by ``d = F0 / (k_b + k_m)``. With the skeleton's share
``w = k_b / (k_b + k_m)``, a skeleton more compliant by the fraction ``b`` and tissue stiffer by the fraction ``t``

* closing, strain energy: ``w b - (1 - w) t``
* muscle force: ``-(1 - w) (b + t)``
* rotation of the pillars: that of the force plus ``b``
* sagitta and curvature: that of the force plus the part of ``b`` that lies within the span (the plate's)
* frequencies of the closing motion: half of what the closing changes by, less
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

from fem_biobot.design import Design
from fem_biobot.errors import ModelError

# rotation of a built-in end, ``16.67 M / (pi E h^2)`` per width: O'Donnell (1960), J. Appl. Mech. 27, 461
_BUILT_IN = 16.67 / math.pi
Interval = tuple[float, float]


@dataclass(frozen=True)
class Cause:
    """One reason why solid and rods differ.

    Attributes
    ----------
    name
        What it is.
    compliance
        By which fraction the solid's skeleton is more compliant than the rods', least and most [1].
    within_span
        Whether that lies in the beam's span, so that sagitta and curvature feel it, or at its ends.
    tissue
        By which fraction the solid's passive tissue is stiffer, least and most [1].
    formula
        Where the numbers come from.
    vanishes
        The limit in which it does.
    """

    name: str
    compliance: Interval
    within_span: bool
    tissue: Interval
    formula: str
    vanishes: str


@dataclass(frozen=True)
class Expectation:
    """Expected differences of the solid from the rods, ``solid / rods - 1`` [1], by quantity."""

    causes: tuple[Cause, ...]
    skeleton_share: float
    of: dict[str, Interval]


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
    zero = (0.0, 0.0)
    return (
        Cause(
            "beam bends as a plate",
            plate_of,
            True,
            zero,
            "between E I and E I / (1 - nu^2): free to curve sideways, or not at all",
            "a beam much narrower than it is long; nu = 0",
        ),
        Cause(
            "ends of the beam yield",
            (ends * (1.0 - nu**2), ends),
            False,
            zero,
            "2 * 16.67 / (12 pi) * h / L (O'Donnell 1960), less in plane strain; none over a fillet's radius",
            "a slender beam, h / L to 0",
        ),
        Cause(
            "pillars bend and shear",
            (0.0, pillar),
            False,
            zero,
            "2 (c^3 / (3 E I_p) + c / (5/6 G A_p)) E I / (l^2 L), c from the beam to the muscle",
            "rigid pillars: long in x, or stiff",
        ),
        Cause(
            "ends of the muscle cannot narrow",
            zero,
            False,
            (0.0, held),
            "1 / (1 - nu_m^2) over half a width at each end",
            "a strip much narrower than it is long",
        ),
        Cause(
            "law of the muscle in large strain",
            zero,
            False,
            _law(design),
            "neo-Hookean strip over Eq. 2, (s - s^-2) / 3 over (s - 1) / s, up to full tension",
            "small strain",
        ),
    )


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
    """Expected differences of closing, force, sagitta, rotation, energy, curvature and frequency.

    None for a muscle that is one ring around both pillars: no closed form is stated for it.

    Raises
    ------
    ModelError
        As `causes`.
    """
    if design.kind == "bot" and design.value("muscle.layout") == "ring":
        return Expectation((), math.nan, {})
    found = causes(design, plate=plate)
    bending, tissue = skeleton_stiffness(design), tissue_stiffness(design)
    w = bending / (bending + tissue)

    def ranged(of_skeleton: float, of_span: float, of_tissue: float) -> Interval:
        """Sum over causes of the least and of the most, each with its share."""
        terms = [
            (cause.compliance, of_skeleton + (of_span if cause.within_span else 0.0), cause.tissue) for cause in found
        ]
        return _sum([_times(c, share) for c, share, _ in terms] + [_times(t, of_tissue) for *_, t in terms])

    closing = ranged(w, 0.0, -(1.0 - w))
    within = ranged(-(1.0 - w), 1.0, -(1.0 - w))
    return Expectation(
        found,
        w,
        {
            "tip_closing_mm": closing,
            "muscle_force_mN": ranged(-(1.0 - w), 0.0, -(1.0 - w)),
            "sagitta_mm": within,
            "curvature_1_per_mm": within,
            "pillar_rotation_deg": ranged(w, 0.0, -(1.0 - w)),
            "strain_energy_uJ": closing,
            "frequency_Hz": _times(closing, -0.5),
        },
    )


def _times(interval: Interval, share: float) -> Interval:
    low, high = share * interval[0], share * interval[1]
    return min(low, high), max(low, high)


def _sum(intervals: Iterable[Interval]) -> Interval:
    given = list(intervals)
    return sum(low for low, _ in given), sum(high for _, high in given)

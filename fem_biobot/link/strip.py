"""The junction of a bot as a rod clamped to its pillars, with constants that loads on the muscle alone give.

The muscle is bonded to the pillars, so a junction is no string between two points: where its pillars turn, its ends
turn with them, first in the ring around the pillar, then in the strip itself, and lift its middle towards the beam,
against its tension over a length of ``sqrt(E I / N)``. Here it is a Reissner rod with nodes along its middle line, free
to bend and shear, and a chain of members along the same nodes that carries its stretch and its tension.

Constants come from the muscle's mesh alone, its bonds moved as rigid plates, the rings between them and the strip as
they are: stretched, turned, twisted a little without tension; held, under a little tension; and, for what gel and
muscle do at large, pulled together under tension, without a turn and with one. Shear has its closed form; how firmly
turned ends hold the line of pull is found in `link.firm`. What the muscle stores is that of its bonds coming together
as far, and turned by as much, as those of a machine do: under tension a turned end stores less than its bending alone
would say, since fibres turn with it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline, PchipInterpolator

from fem_biobot.design import Design
from fem_biobot.errors import ModelError
from fem_biobot.link.alone import MuscleAlone, Pull, heights, reaction
from fem_biobot.link.observed import Array, Ints
from fem_biobot.link.solid_side import passive_energy
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.rod.landmarks import Landmarks
from fem_biobot.rod.model import RodModel
from fem_biobot.rod.records import Muscle, Resistance, Rigid, Rod
from fem_biobot.rod.section import RodMaterial, Section
from fem_biobot.solid.model import SolidState

STRIP = "junction"
_SMALL = 1e-5
# shear stiffness across over G A that is not exceeded: of a long narrow strip bending leaves next to nothing of its way
_STIFFEST_SHEAR = 10.0
# half-lengths of the free strip at which its sections are read, over its thickness, from the ring on
_READ = (0.0, 0.25, 0.5, 1.0, 2.0)
# elements of the stretches that begin there: the turn of a clamped end fades within a thickness
_PARTS = (3, 3, 4, 4, 3)
_RING_PARTS = 4
_INSIDE = 0.45  # of the thickness, above and below the middle line, where the turn of a section is read


@dataclass(frozen=True)
class StripSections:
    """Constants of a junction between its two bonds.

    Attributes
    ----------
    x
        Where its stretches begin and end, (s + 1,) [mm].
    EA, EI
        Stiffness of each stretch in stretch [mN] and in bending in the machine's plane [mN mm^2], (s,).
    EI_lateral, GJ, GA_lateral
        Of the whole, evenly along it.
    pull
        Force by which each stretch pulls under unit tension, (s,) [mN/kPa].
    stretch, passive
        Of pulls at large: stretch of each stretch (p, s) [1] and its force without that of the tension (p, s) [mN].
    approach, energy
        Of the same pulls with turned bonds, after none: how far the bonds came together [mm], and the passive energy of
        the whole muscle beyond that at the same tension and unmoved bonds [uJ], (p + 1,) each.
    height
        Of the line of each pull above the ends of the strip, with bonds as they are and turned, (p, 2) [mm].
    firmness
        Factor on the bending stiffness at load with which a rod's line of pull is as high, (p,) [1]; see `link.firm`.
    """

    x: Array
    EA: Array
    EI: Array
    EI_lateral: float
    GJ: float
    GA_lateral: float
    pull: Array
    stretch: Array
    passive: Array
    approach: Array
    energy: Array
    height: Array
    firmness: Array

    def clamped(self, approach: float) -> tuple[float, float]:
        """Firmness [1] and height of the line of pull [mm] at an approach of the bonds; beyond the pulls as there."""
        if len(self.approach) == 1:
            return 1.0, 0.0
        self._must_approach()
        at = float(np.clip(approach, *self.approach[[1, -1]]))
        if len(self.approach) == 2:
            return float(self.firmness[0]), float(self.height[0, 0])
        firmness, height = (PchipInterpolator(self.approach[1:], v)(at) for v in (self.firmness, self.height[:, 0]))
        return float(firmness), float(height)

    def _must_approach(self) -> None:
        """Pulls of bonds that do not come together say nothing of what their approach does."""
        if not (np.diff(self.approach) > 0.0).all():
            raise ModelError(
                f"pulls: found approaches {self.approach[1:].tolist()} mm, expected some above 0 that rise"
            )

    def stored(self, approach: float) -> float:
        """Passive energy of the muscle by an approach of its bonds [uJ]; beyond the last pull with its last modulus."""
        self._must_approach()
        small = 0.5 / float((np.diff(self.x) / self.EA).sum())
        modulus = np.concatenate([[small], self.energy[1:] / self.approach[1:] ** 2])
        if len(modulus) == 1:
            return small * approach**2
        curve = PchipInterpolator(self.approach, modulus)
        return float(curve(np.clip(approach, 0.0, self.approach[-1]))) * approach**2

    def resistance(self, stretch: Array) -> tuple[Array, Array]:
        """Passive force of each stretch at its stretch, (s,) [mN], and its derivative, (s,) [mN]."""
        found = []
        for k, at in enumerate(stretch):
            # through no force at no strain; where a stretch grows instead of shortening, by unit loads
            order = np.argsort(self.stretch[:, k])
            s, force = self.stretch[order, k], self.passive[order, k]
            keep = s < 1.0
            if not keep.any():
                found.append((float(self.EA[k]) * (at - 1.0), float(self.EA[k])))
                continue
            ends: Any = ("not-a-knot", (1, float(self.EA[k])))
            curve = CubicSpline([*s[keep], 1.0], [*force[keep], 0.0], bc_type=ends)
            inside = float(np.clip(at, s[keep].min(initial=1.0), 1.0))
            slope = float(curve(inside, 1))
            found.append((float(curve(inside)) + slope * (at - inside), slope))
        force, slope = np.array(found).T
        return force, slope


def read_at(design: Design) -> Array:
    """Positions at which the sections of a junction are read, from bond to bond, (s + 1,) [mm]."""
    muscle = design.value("muscle")
    half, ring = design.span / 2, muscle.ring_thickness
    free = half - ring
    from_ring = [share * muscle.junction_thickness for share in _READ]
    inward = [g for g in from_ring if g < 0.75 * free]
    left = np.array([-half, *(-free + g for g in inward), 0.0])
    return np.concatenate([left, -left[-2::-1]])


def strip_from_mesh(design: Design, mesh: BodyMesh, pulls: Sequence[Pull] = ()) -> StripSections:
    """Constants of the junction by loads on the muscle of a mesh.

    Parameters
    ----------
    design, mesh
        A bot of two pillars with a junction, and its mesh.
    pulls
        Pulls at large, in the order of a path; see `pulled`.

    Raises
    ------
    ModelError
        A muscle that is one ring around both pillars.
    SolveError
        A pull that finds no equilibrium.
    """
    muscle = design.value("muscle")
    if muscle.layout != "junction":
        raise ModelError(f"muscle.layout: found {muscle.layout}, expected junction for a strip between pillars")
    x, alone = read_at(design), MuscleAlone(design, mesh)
    little = _SMALL * muscle.material.young
    stretching, held = alone.moved(0, [(0.0, _SMALL), (little, 0.0)])
    found = [stretching, *(alone.moved(k, [(0.0, _SMALL)])[0] for k in range(1, 6))]
    K = np.array([reaction(state, alone.middle) for state in found]) / _SMALL
    C, L = np.linalg.inv(K), design.span
    size = np.diff(x)
    _, stretched = _sections(design, found[0], x)
    turns, _ = _sections(design, found[4], x)
    EA = K[0, 0] * size / (np.diff(stretched) / _SMALL)
    EI = K[4, 4] * size / (np.diff(turns) / _SMALL)
    own = reaction(held, alone.middle)[0] - EA * np.diff(_sections(design, held, x)[1]) / size
    lateral = L / C[5, 5]
    none, zero = np.zeros((0, len(size))), np.zeros(1)
    G = muscle.material.young / (2.0 * (1.0 + muscle.material.poisson))
    least = L / (_STIFFEST_SHEAR * G * design.junction_section)
    sideways = L / max(C[1, 1] - L**3 / (12.0 * lateral), least)
    pull = own / little
    unloaded = (none, none, zero, zero, np.zeros((0, 2)), np.zeros(0))
    return pulled(design, mesh, StripSections(x, EA, EI, lateral, L / C[3, 3], sideways, pull, *unloaded), pulls)


def pulled(design: Design, mesh: BodyMesh, found: StripSections, pulls: Sequence[Pull]) -> StripSections:
    """The same constants with what pulls at large show, in place of any that they had.

    Each is made thrice: with bonds that come together without a turn, with bonds that turn as well, and, for what is
    stored, with bonds that do not move.

    Parameters
    ----------
    design, mesh
        What `found` is of.
    found
        From `strip_from_mesh`.
    pulls
        At large, in the order of a path; where approaches do not rise, `StripSections.clamped` and `stored` refuse.

    Raises
    ------
    SolveError
        A pull that finds no equilibrium.
    """
    if not pulls:
        return found
    x, size, alone = found.x, np.diff(found.x), MuscleAlone(design, mesh)
    large = alone.moved(0, [(p.tension, -p.approach) for p in pulls])
    unmoved = alone.moved(0, [(p.tension, 0.0) for p in pulls])
    turned = [alone.turned(p) for p in pulls]
    stored = [passive_energy(state)[1] - passive_energy(none)[1] for state, none in zip(turned, unmoved, strict=True)]
    forces = [reaction(state, alone.middle)[0] - found.pull * p.tension for state, p in zip(large, pulls, strict=True)]
    straight = heights(design, large, [(x[0], x[-1] - p.approach) for p in pulls])
    bent = heights(design, turned, [(x[0] + 0.5 * p.approach, x[-1] - 0.5 * p.approach) for p in pulls])
    return replace(
        found,
        stretch=np.array([1.0 + np.diff(_sections(design, state, x)[1]) / size for state in large]),
        passive=np.array(forces),
        approach=np.array([0.0, *(p.approach for p in pulls)]),
        energy=np.array([0.0, *stored]),
        height=np.column_stack([straight, bent]),
        firmness=np.ones(len(pulls)),
    )


def _sections(design: Design, state: SolidState, x: Array) -> tuple[Array, Array]:
    """Small turn about y [rad] and displacement along x [mm] of the sections at `x`, (s + 1,) each."""
    muscle = design.value("muscle")
    z, half = muscle.junction_height, _INSIDE * muscle.junction_thickness
    low, high = (np.array([state.at((float(a), 0.0, z + side))[0] for a in x]) for side in (-half, half))
    return (high - low) / (2.0 * half), 0.5 * (high + low)


def with_strip(
    model: RodModel,
    design: Design,
    found: StripSections,
    *,
    stretch: Array | None = None,
    firmness: float = 1.0,
    height: float = 0.0,
) -> RodModel:
    """A reduced model of two pillars whose muscle is a clamped rod with the constants from the mesh.

    Parameters
    ----------
    model
        From `reduce`: one beam, two pillars, one muscle.
    design
        What it is of.
    found
        Constants of the junction.
    stretch
        Of each stretch, about which the junction is taken instead of about none, (s,) [1]: its force and what that
        changes by are those of the pulls at large, its bending stiffness grows as its modulus and its thickness do.
    firmness
        Factor on that bending stiffness [1].
    height
        Of the junction's ends above their place as drawn [mm].

    Notes
    -----
    Mass stays where `reduce` puts it, half of the junction at each end. Without `stretch` a member along each element
    resists as a neo-Hookean strip does, along the strip's line; with it the rod itself does, across its sections, as
    tissue whose sections have turned against the line does: passive stress turns with the section, that of fibres with
    the line.
    """
    old = model.members[0]
    assert isinstance(old, Muscle)
    x, stretch_of = _elements(found)
    points = np.column_stack([x, np.zeros_like(x), np.full_like(x, design.value("muscle.junction_height") + height)])
    unit = old.isometric(1.0) / design.tension(1.0)  # of one member, with its own section
    along, across, rest = found.EA, np.zeros_like(found.EA), np.ones_like(found.EA)
    bending = twisting = rest
    if stretch is not None:
        force, slope = found.resistance(stretch)
        across, rest = force / (stretch - 1.0), stretch
        # what the secant lacks of the tangent, by a member without force at this stretch
        along = np.maximum(slope - across, 0.0) * stretch
        # what shortens grows across, and its moments of area with the square
        bending, twisting = firmness * slope / found.EA / stretch, 1.0 / stretch
    members = []
    for k, s in enumerate(stretch_of):
        area = old.area * float(found.pull[s]) / unit
        members.append(
            replace(
                old,
                a=(STRIP, k),
                b=(STRIP, k + 1),
                area=area,
                young=float(along[s]) / area,
                viscosity=old.viscosity * old.area / area,
                resistance=Resistance.neo_hooke,
                rest_length=float(rest[s] * (x[k + 1] - x[k])),
                name=f"{old.name}_{k + 1}",
            )
        )
    rod = _rod(design, points, stretch_of, found, bending, twisting, across)
    ends = [Rigid((STRIP, i), (part, tuple(points[i].tolist()))) for i, part in ((0, old.a[0]), (-1, old.b[0]))]
    beam = model.rods[0]
    middle = (len(beam.points) - 1) // 2
    marks = Landmarks((beam.name, 0), (beam.name, -1), (beam.name, middle), [tuple(each.name for each in members)])
    parts = (model.bodies, model.supports, model.loads, members, model.contacts)
    return RodModel([*model.rods, rod], [*model.joints, *ends], *parts, model.damping_time, model.touches, marks)


def _elements(found: StripSections) -> tuple[Array, Ints]:
    """Nodes along the strip, (n + 1,) [mm], and the stretch of each element, (n,)."""
    # each stretch is some elements of the same constants, short ones where the turn of the end fades
    half = [_RING_PARTS, *_PARTS[: len(found.x) // 2 - 1]]
    parts = [*half, *half[::-1]]
    pieces = [np.linspace(a, b, n + 1)[:-1] for a, b, n in zip(found.x[:-1], found.x[1:], parts, strict=True)]
    return np.concatenate([*pieces, found.x[-1:]]), np.repeat(np.arange(len(parts)), parts)


def stretches_of(found: StripSections, points: Array) -> Array:
    """Stretch of each stretch of a strip from the positions of its nodes (n + 1, 3) [mm], (s,) [1]."""
    _, stretch_of = _elements(found)
    length = np.linalg.norm(np.diff(points, axis=0), axis=1)
    return np.bincount(stretch_of, length) / np.diff(found.x)


def _rod(
    design: Design,
    points: Array,
    stretch_of: Ints,
    found: StripSections,
    bending: Array,
    twisting: Array,
    across: Array,
) -> Rod:
    """The strip itself, with the stretch stiffness of each stretch [mN], and factors of its bending and twist."""
    m = design.value("muscle")
    E, nu = m.material.young, m.material.poisson
    G = E / (2.0 * (1.0 + nu))
    plain = Section.rectangle(m.junction_width, m.junction_thickness, poisson=nu)
    lateral = found.GA_lateral / (G * plain.area)
    sections = []
    for s in stretch_of:
        # where the ring helps the strip, it does so in shear as in stretch
        upright = plain.shear_factors[1] * max(float(found.EA[s]) / (E * plain.area), 1.0)
        sections.append(
            replace(
                plain,
                I1=float(found.EI[s] * bending[s]) / E,
                I2=found.EI_lateral * float(bending[s]) / E,
                J=found.GJ * float(twisting[s]) / G,
                stretch_factor=float(across[s]) / (E * plain.area),
                shear_factors=(lateral, upright),
            )
        )
    material = RodMaterial(young=E, density=m.material.density, poisson=nu)
    return Rod(points, sections, material, STRIP, normal=(0.0, 1.0, 0.0), mass=0.0)

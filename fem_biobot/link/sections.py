"""Section constants of the beam as the solid's mesh has them: loads on the skeleton alone, where the muscle is bonded.

Opposite wrenches on the two bonds, small, each about the middle of the beam's axis, give the flexibility of what lies
between them, (6, 6): how far the bonds move against each other, in the sense of the work that the wrench does. Of a
beam of length L with even ends

* stretch ``L / (E A)``, twist ``L / (G J)``, bending across ``L / (E I_2)``
* shear across ``L^3 / (12 E I_2) + L / (k G A)``, shear upright ``sum x^2 / (E I) dx + L / (k G A)``

and a pair of forces that pulls the bonds together at the junction's height, as the muscle does, bends each stretch of
the beam by its own curvature: ``E I`` along the span is the moment there over that. What the bonds turn beyond the
sections at the span's ends counts as the outermost stretches', so all yield of corners and pillars is the beam's, which
is what a model with rigid pillars needs. The same pair of forces, no longer small, gives the moment of each stretch by
its curvature: gel is not linear, corners and a plate that curves sideways are stiffer the more they are bent; and about
each such pull small couples give the torsion (`link.twist`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import PchipInterpolator

from fem_biobot.design import Design
from fem_biobot.errors import ModelError
from fem_biobot.link.observed import Array, Points, drawn_points, stations
from fem_biobot.link.parts import balanced, part_of
from fem_biobot.link.twist import torsion_at
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.rod.model import RodModel
from fem_biobot.rod.records import Rod
from fem_biobot.rod.section import RodMaterial, Section
from fem_biobot.solid.from_design import law_of, supports
from fem_biobot.solid.model import SolidModel, SolidState, solve
from fem_biobot.solid.records import Step

# of the moment that would turn the pillar by a radian: strains stay small, and rounding far
_SMALL = 1e-5
# the beam's shear stiffness over its closed form is not taken above this: corners that shear and turn at once leave
# nothing, or less, of the antisymmetric flexibility for the beam's own shear
_STIFFEST_SHEAR = 10.0
_CASES = ("x", "y", "z", "turn_x", "turn_y", "turn_z")
_PULL = "pull"


@dataclass(frozen=True)
class Stiffnesses:
    """Section stiffnesses of the beam: bending in the machine's plane and across it, torsion, stretch, shear.

    In mN mm^2 the first three, in mN the last three; `GA` upright, `GA_lateral` across.

    `EI` is that of an even beam of the same turn of the pillars, `EI_along` that of each stretch, (m,).
    """

    EI: float
    EI_lateral: float
    GJ: float
    EA: float
    GA: float
    GA_lateral: float
    EI_along: tuple[float, ...]


@dataclass(frozen=True)
class MeshSections:
    """Section stiffnesses from the mesh, and the closed forms beside them.

    Attributes
    ----------
    mesh, closed_form
        By unit loads, and of a rectangle.
    curvatures, moments
        Of each stretch in a pull of rising force, zero first, (p, m) [1/mm], [uJ].
    roots
        Of those curvatures, what the pillars turn beyond the beam, at its short and its long end, (p, 2) [rad].
    torsion
        Torsion stiffness of the beam bent by these pulls, (p,) [mN mm^2].
    """

    mesh: Stiffnesses
    closed_form: Stiffnesses
    curvatures: Array
    moments: Array
    roots: Array
    torsion: Array

    def without_roots(self, curvature: Array, size: Array, *, at_load: bool) -> tuple[Array, Array]:
        """Curvature of the beam without what its roots yield, (m,) [1/mm], and that as a turn of each, (2,) [rad].

        Parameters
        ----------
        curvature
            Of each stretch, its roots' yield with the outermost ones, (m,) [1/mm].
        size
            Length of each stretch, (m,) [mm].
        at_load
            Whether roots yield as they do in pulls at large, or as by unit loads.
        """
        turns = []
        for root, k, at in zip(self.roots.T, self.curvatures[:, [0, -1]].T, curvature[[0, -1]], strict=True):
            turns.append(_curve(k, root, at)[0] if at_load else _curve(k, root, 0.0)[1] * at)
        beam, found = curvature.copy(), np.array(turns)
        beam[[0, -1]] -= found / size[[0, -1]]
        return beam, found

    def twisted(self, curvature: Array) -> float:
        """Torsion stiffness at a curvature of each stretch, (m,) [1/mm]: by their mean; beyond the pulls as there."""
        bent = np.abs(self.curvatures).mean(axis=1)
        return float(PchipInterpolator(bent, self.torsion)(min(float(np.abs(curvature).mean()), float(bent[-1]))))

    def bent(self, curvature: Array) -> tuple[Array, Array]:
        """Moment of each stretch (m,) [uJ] and its derivative (m,) [mN mm^2] at a curvature of each, (m,) [1/mm].

        Beyond the last pull along its tangent.
        """
        pairs = [_curve(k, M, at) for k, M, at in zip(self.curvatures.T, self.moments.T, curvature, strict=True)]
        moment, slope = np.array(pairs).T
        return moment, slope

    def bending_energy(self, curvature: Array) -> Array:
        """Energy per length of each stretch at a curvature of each, (m,) [mN]: its moment over the way there."""
        found = []
        for k, M, at in zip(self.curvatures.T, self.moments.T, np.abs(curvature), strict=True):
            within, beyond = min(at, float(k[-1])), max(at - float(k[-1]), 0.0)
            moment, slope = _curve(k, M, within)
            whole = float(PchipInterpolator(k, M).integrate(0.0, within))
            found.append(whole + moment * beyond + 0.5 * slope * beyond**2)
        return np.array(found)


def _curve(curvatures: Array, moments: Array, at: float) -> tuple[float, float]:
    size, last = abs(at), float(curvatures[-1])
    found = PchipInterpolator(curvatures, moments)
    slope = float(found(min(size, last), 1))
    return float(np.sign(at)) * (float(found(min(size, last))) + slope * max(size - last, 0.0)), slope


def closed_forms(design: Design) -> Stiffnesses:
    """Of a rectangle: ``E I``, ``E I_2``, Saint-Venant's ``G J``, ``E A``, Cowper's ``k G A``."""
    s = design.value("skeleton")
    section = Section.rectangle(s.beam_width, s.beam_thickness, poisson=s.material.poisson)
    E, G = s.material.young, s.material.young / (2.0 * (1.0 + s.material.poisson))
    bending, lateral = sorted((section.I1, section.I2))
    shear = section.shear_factors[0] * G * section.area
    along = (E * bending,) * (len(stations(design)) - 1)
    return Stiffnesses(E * bending, E * lateral, G * section.J, E * section.area, shear, shear, along)


def sections_from_mesh(design: Design, mesh: BodyMesh, forces: Sequence[float] = ()) -> MeshSections:
    """Stiffnesses of the beam between two pillars by loads on the skeleton of a mesh.

    Parameters
    ----------
    design, mesh
        A bot of two pillars, and its mesh.
    forces
        Of the pull beyond the small one, rising [mN].

    Raises
    ------
    MeshError
        A mesh in which skeleton and muscle do not meet.
    SolveError
        A pull that finds no equilibrium.
    """
    known, L = closed_forms(design), design.span
    pulls = [_SMALL * known.EI / (design.moment_arm * L**2), *forces]
    C, pulled = _loaded(design, mesh, pulls)
    bent = [_bent(design, state, F) for state, F in zip(pulled, pulls, strict=True)]
    along = bent[0][1] / bent[0][0]
    compliance = np.diff(stations(design)) / along
    middles = 0.5 * (stations(design)[1:] + stations(design)[:-1])
    upright = C[2, 2] - float(compliance @ (middles**2 + np.diff(stations(design)) ** 2 / 12.0))
    lateral = L / C[5, 5]
    across = C[1, 1] - L**3 / (12.0 * lateral)
    least = L / (_STIFFEST_SHEAR * known.GA)
    stiffnesses = Stiffnesses(
        L / float(compliance.sum()),
        lateral,
        L / C[3, 3],
        L / C[0, 0],
        L / max(upright, least),
        L / max(across, least),
        tuple(float(v) for v in along),
    )
    curvatures, moments, roots = (
        np.concatenate([np.zeros((1, len(each[0]))), each]) for each in zip(*bent, strict=True)
    )
    size = np.diff(stations(design))
    twists = [torsion_at(state, _points(design, state), size, lateral) for state in pulled]
    return MeshSections(stiffnesses, known, curvatures, moments, roots, np.array([twists[0], *twists]))


def flexibility(design: Design, mesh: BodyMesh) -> Array:
    """Motion of the long bond against the short one by a unit wrench on them about mid-span, (6, 6).

    Displacements [mm] and small turns [rad] along and about x, y, z by forces [mN] and moments [uJ]; symmetric.
    """
    return _loaded(design, mesh, [])[0]


def _loaded(design: Design, mesh: BodyMesh, pulls: Sequence[float]) -> tuple[Array, Sequence[SolidState]]:
    """Flexibility of the skeleton between its bonds, and its states under pulls of them [mN]."""
    body, L = part_of(mesh, "skeleton"), design.span
    couple = _SMALL * closed_forms(design).EI / L
    middle = np.array([0.0, 0.0, design.beam_axis_height])
    unit, none = np.eye(3), np.zeros(3)
    loads = []
    for k, name in enumerate(_CASES):
        force, moment = (couple / L * unit[k], none) if k < 3 else (none, couple * unit[k - 3])
        loads += balanced(body, name, force, moment, middle)
    loads += balanced(body, _PULL, -unit[0], design.moment_arm * unit[1], middle)
    # one model, so that what it is solved with is analysed once; each state has one of the loads alone
    law = law_of(design.value("skeleton.material"))
    model = SolidModel(body, {"skeleton": law}, {}, supports(design, body), loads, element=design.mesh.element)
    steps = [Step(load=0.0, tension=0.0, loads={name: 1.0}) for name in _CASES]
    steps += [Step(load=0.0, tension=0.0, loads={_PULL: F}) for F in pulls]
    states = solve(model, steps).states
    force_of = {name: sum(f for n, f in model.system.dead_loads if n == name) for name in _CASES}
    size = np.array([couple / L] * 3 + [couple] * 3)
    work = np.array([[np.sum(force_of[name] * state.u.T) for state in states[:6]] for name in _CASES])
    return work / np.outer(size, size), states[6:]


def _bent(design: Design, state: SolidState, force: float) -> tuple[Array, Array, Array]:
    """Of a beam whose bonds are pulled together: curvature and moment of each stretch, (m,) [1/mm], [uJ], its roots.

    The last is what the pillars turn beyond the sections at the ends, (2,) [rad]; the curvature has it in it.
    """
    points = _points(design, state).level()
    size = np.diff(stations(design))
    curvature = -np.diff(points.turns) / size
    # what the pillars turn beyond the sections at the ends of the span
    beyond = points.pillar_turns - points.turns[[0, -1]] * np.array([1.0, -1.0])
    curvature[[0, -1]] += beyond / size[[0, -1]]
    loads = sum(f for n, f in state.model.system.dead_loads if n == _PULL)
    long = state.X[0] > 0.0
    x = (state.X + state.u)[:, long]
    raw = _points(design, state).axis
    axis = raw[len(raw) // 2]
    # both forces stay parallel to x, and so does the line through the middle of the axis, to the tilt of the whole
    middle = np.cross(x.T - axis, force * np.asarray(loads)[long]).sum(axis=0)[1]
    heights = points.axis[:, 2]
    below = heights[len(heights) // 2] - 0.5 * (heights[1:] + heights[:-1])
    return curvature, middle - force * below, beyond


def _points(design: Design, state: SolidState) -> Points:
    """The points by which models are compared, in a state of the skeleton."""
    drawn = drawn_points(design)
    moved = [
        p + np.array([state.at(tuple(X.tolist())) for X in p])
        for p in (drawn.lower, drawn.upper, drawn.tops, drawn.soles)
    ]
    return Points(*moved)


def with_sections(model: RodModel, found: MeshSections, *, curvature: Array | None = None) -> RodModel:
    """A reduced model whose beam has the stiffnesses from the mesh; masses stay.

    Parameters
    ----------
    model
        From `reduce`, with as many elements in the beam as there are stretches.
    found
        From the mesh.
    curvature
        Of each stretch, about which its bending and its torsion are taken instead of about none, (m,) [1/mm].
    """
    rods = [_changed(rod, found, curvature) for rod in model.rods]
    parts = (model.joints, model.bodies, model.supports, model.loads, model.members, model.contacts)
    return RodModel(rods, *parts, model.damping_time, model.touches, model.landmarks)


def _changed(rod: Rod, found: MeshSections, curvature: Array | None) -> Rod:
    count = len(rod.points) - 1
    if count != len(found.mesh.EI_along):
        raise ModelError(f"{rod.name}: found {count} elements, expected {len(found.mesh.EI_along)}, as stretches")
    each = [rod.section] * count if isinstance(rod.section, Section) else list(rod.section)
    constants, stiffness, natural = found.mesh, np.array(found.mesh.EI_along), np.zeros(count)
    if curvature is not None:
        moment, stiffness = found.bent(curvature)
        natural, constants = curvature - moment / stiffness, replace(constants, GJ=found.twisted(curvature))
    sections = [_with(s, rod.material, constants, EI) for s, EI in zip(each, stiffness, strict=True)]
    if curvature is None:
        return replace(rod, section=sections)
    # arching up is a turn about y; the first director lies along y, or against it
    sense = float(np.sign(np.array(rod.normal or (0.0, 1.0, 0.0))[1]))
    return replace(rod, section=sections, natural_curvature=np.outer(natural, [sense, 0.0, 0.0]))


def _with(section: Section, material: RodMaterial, found: Stiffnesses, EI: float) -> Section:
    """A section of the beam with other stiffnesses, of the same area and so of the same mass."""
    E, G = material.young, material.G
    upright = section.I1 < section.I2  # the first director lies across the machine
    one, two = (EI, found.EI_lateral) if upright else (found.EI_lateral, EI)
    factors = (found.GA_lateral / (G * section.area), found.GA / (G * section.area))
    stretch = found.EA / (E * section.area)
    return replace(
        section,
        I1=one / E,
        I2=two / E,
        J=found.GJ / G,
        shear_factors=factors if upright else factors[::-1],
        stretch_factor=stretch,
    )

"""Section constants of the beam as the solid's mesh has them: unit loads on the skeleton, one pillar held.

The long pillar's sole is loaded by a unit couple about y and by unit forces along x, y and z while the short pillar's
is held. Between rigid pillars and a beam of length L on an axis H above the loaded sole

* a couple about y bends the beam evenly. The turn of its sections from station to station gives ``E I`` along the span;
  what the pillars turn beyond the sections at its ends counts as the outermost stretches'
* a force along x makes the axis longer by ``F L / (E A)``
* a force along y twists it by ``F H``: the pillar turns about x by ``F H L / (G J)``, and about z, with the moment
  ``F (e + L - s)`` along the beam, by ``F (e L + L^2 / 2) / (E I_2)``; `e` leads from the beam's end to the middle of
  the sole
* a force along z shears it: the end of the axis moves by ``F L / (k G A)`` beyond what its own turn gives by bending

so all yield of corners and pillars is counted as the beam's, which is what a model with rigid pillars needs.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fem_biobot.design import Design
from fem_biobot.errors import ModelError
from fem_biobot.link.observed import Array, Points, drawn_points, stations
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.rod.model import RodModel
from fem_biobot.rod.section import RodMaterial, Section
from fem_biobot.solid.from_design import law_of
from fem_biobot.solid.model import SolidModel, SolidState, solve
from fem_biobot.solid.records import Fix, Step, Traction

# of the load that would turn the pillar by a radian: strains stay small, and rounding far
_SMALL = 1e-5


@dataclass(frozen=True)
class Stiffnesses:
    """Section stiffnesses of the beam: bending in the machine's plane and across it, torsion, stretch, shear.

    In mN mm^2 the first three, in mN the last two.

    `EI` is that of an even beam of the same turn of the pillars, `EI_along` that of each stretch, (m,).
    """

    EI: float
    EI_lateral: float
    GJ: float
    EA: float
    GA: float
    EI_along: tuple[float, ...]


@dataclass(frozen=True)
class MeshSections:
    """Section stiffnesses from the mesh, and the closed forms beside them."""

    mesh: Stiffnesses
    closed_form: Stiffnesses


def closed_forms(design: Design) -> Stiffnesses:
    """Of a rectangle: ``E I``, ``E I_2``, Saint-Venant's ``G J``, ``E A``, ``5/6 G A`` (Cowper's for nu = 0)."""
    s = design.value("skeleton")
    section = Section.rectangle(s.beam_width, s.beam_thickness, poisson=s.material.poisson)
    E, G = s.material.young, s.material.young / (2.0 * (1.0 + s.material.poisson))
    # directors: the first along y, so that I1 resists bending in the plane of the machine
    bending, lateral = sorted((section.I1, section.I2))
    factor = section.shear_factors[0 if section.I1 > section.I2 else 1]
    along = (E * bending,) * (len(stations(design)) - 1)
    return Stiffnesses(E * bending, E * lateral, G * section.J, E * section.area, factor * G * section.area, along)


def skeleton_of(mesh: BodyMesh) -> BodyMesh:
    """The skeleton's elements alone, with the vertices and the surfaces that they have."""
    keep = mesh.regions["skeleton"]
    cells = mesh.cells[:, keep]
    used = np.unique(cells)
    number = np.full(mesh.points.shape[1], -1, dtype=np.int64)
    number[used] = np.arange(len(used))
    faces = {name: number[f[:, (number[f] >= 0).all(axis=0)]] for name, f in mesh.surfaces.items()}
    soles = {name: faces[name] for name in ("foot_short", "foot_long")}
    return BodyMesh(mesh.points[:, used], number[cells], {"skeleton": np.arange(cells.shape[1])}, soles)


def sections_from_mesh(design: Design, mesh: BodyMesh) -> MeshSections:
    """Stiffnesses of the beam between two pillars by unit loads on the skeleton of a mesh.

    Raises
    ------
    SolveError
        Never in practice: loads are small.
    """
    body = skeleton_of(mesh)
    s = design.value("skeleton")
    law = law_of(s.material)
    known = closed_forms(design)
    H, L, e = design.pillars[-1][1], design.span, s.pillar_length / 2
    force = _SMALL * known.EI / (H * L)
    corners = body.points[:, body.surfaces["foot_long"]]
    area = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0], axis=0), axis=0)
    couple, slope = force * H, force * H / _second_moment(corners[0] - design.pillars[-1][0], area)

    def linear(X: Array) -> Array:
        """Along z, in proportion to the distance from the sole's middle."""
        return np.array([0.0 * X[0], 0.0 * X[0], slope * (X[0] - design.pillars[-1][0])])

    pull = force / float(area.sum())
    loads = [
        Traction("foot_long", linear, name="couple"),
        Traction("foot_long", (pull, 0.0, 0.0), name="x"),
        Traction("foot_long", (0.0, pull, 0.0), name="y"),
        Traction("foot_long", (0.0, 0.0, pull), name="z"),
    ]
    # one model, so that what it is solved with is analysed once; each state has one of the loads alone
    model = SolidModel(body, {"skeleton": law}, {}, [Fix("foot_short")], loads, element=design.mesh.element)
    found = solve(model, [Step(load=0.0, tension=0.0, loads={load.name: 1.0}) for load in loads])
    bending, along_x, along_y, along_z = found.states
    points = _points(design, bending)
    inward = points.pillar_turns
    # of the pillar on the left, the sections, and the pillar on the right, from x towards z
    turned = np.array([inward[0], *points.turns, -inward[1]])
    bent = (turned[1:] - turned[:-1]) / couple
    longer = float(np.diff(_points(design, along_x).axis[[0, -1], 0])[0] - L) / force
    about_y = _turn_of_sole(along_z)[1] / force
    twist, _, aside = _turn_of_sole(along_y) / force
    fall = float(along_z.at((L / 2, 0.0, design.beam_axis_height))[2]) / force
    stretches = np.concatenate([[bent[0] + bent[1]], bent[2:-2], [bent[-2] + bent[-1]]])
    size = np.diff(stations(design))
    along = size / np.abs(stretches)
    EI = L / abs(float(bent.sum()))
    lateral = (e * L + L**2 / 2.0) / abs(aside)
    # the end's fall by bending alone, of the stiffness that its own turn shows under this load
    own = (e * L + L**2 / 2.0) / abs(about_y)
    sheared = abs(fall) - (e * L**2 / 2.0 + L**3 / 3.0) / own
    # a mesh so coarse that the difference of the two is none tells no shear stiffness: the closed form stays
    GA = L / sheared if sheared > 0.0 else known.GA
    stiffnesses = Stiffnesses(EI, lateral, H * L / abs(twist), L / abs(longer), GA, tuple(float(v) for v in along))
    return MeshSections(stiffnesses, known)


def _second_moment(x: Array, area: Array) -> float:
    """Of triangles with corners at `x` (3, f) [mm] and areas (f,) [mm^2], about x = 0 [mm^4]."""
    products = x[0] ** 2 + x[1] ** 2 + x[2] ** 2 + x[0] * x[1] + x[0] * x[2] + x[1] * x[2]
    return float(area @ products) / 6.0


def _points(design: Design, state: SolidState) -> Points:
    """The points by which models are compared, in a state of the skeleton."""
    drawn = drawn_points(design)
    moved = [
        p + np.array([state.at(tuple(X.tolist())) for X in p])
        for p in (drawn.lower, drawn.upper, drawn.tops, drawn.soles)
    ]
    return Points(*moved)


def _turn_of_sole(state: SolidState) -> Array:
    """Small turn (3,) [rad] of the long pillar's sole: of the motion of its vertices that fits best."""
    mesh = state.model.mesh
    nodes = np.unique(mesh.surfaces["foot_long"])
    X, u = mesh.points[:, nodes], state.u[:, nodes]
    arm, moved = X - X.mean(axis=1, keepdims=True), u - u.mean(axis=1, keepdims=True)
    # least squares of moved = turn x arm
    moments = np.einsum("in,in->", arm, arm) * np.eye(3) - arm @ arm.T
    return np.asarray(np.linalg.solve(moments, np.cross(arm, moved, axis=0).sum(axis=1)), dtype=float)


def with_sections(model: RodModel, found: MeshSections) -> RodModel:
    """A reduced model whose beam has the stiffnesses from the mesh; masses stay."""
    rods = []
    for rod in model.rods:
        count = len(rod.points) - 1
        each = [rod.section] * count if isinstance(rod.section, Section) else list(rod.section)
        if count != len(found.mesh.EI_along):
            raise ModelError(f"{rod.name}: found {count} elements, expected {len(found.mesh.EI_along)}, as stretches")
        changed = [
            _with(section, rod.material, found.mesh, EI) for section, EI in zip(each, found.mesh.EI_along, strict=True)
        ]
        rods.append(replace(rod, section=changed))
    parts = (model.joints, model.bodies, model.supports, model.loads, model.members, model.contacts)
    return RodModel(rods, *parts, model.damping_time, model.touches, model.landmarks)


def _with(section: Section, material: RodMaterial, found: Stiffnesses, EI: float) -> Section:
    """A section of the beam with other stiffnesses, of the same area and so of the same mass."""
    E, G = material.young, material.G
    upright = section.I1 < section.I2  # the first director lies across the machine
    one, two = (EI, found.EI_lateral) if upright else (found.EI_lateral, EI)
    factor, other = found.GA / (G * section.area), section.shear_factors
    factors = (other[0], factor) if upright else (factor, other[1])
    stretch = found.EA / (E * section.area)
    return replace(section, I1=one / E, I2=two / E, J=found.GJ / G, shear_factors=factors, stretch_factor=stretch)

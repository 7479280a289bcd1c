"""From a design and its mesh to a solid model: laws, fibres, tension at full drive, neutral supports, loads."""

from __future__ import annotations

import numpy as np

from fem_biobot.design import Design
from fem_biobot.design_checks import refuse_without_solid
from fem_biobot.design_kinds import LAW_PARAMETERS
from fem_biobot.design_parts import Material, Muscle
from fem_biobot.errors import DesignError, MeshError
from fem_biobot.material.active import ActiveStress
from fem_biobot.material.dispersion import Dispersion
from fem_biobot.material.force_length import force_length
from fem_biobot.material.force_velocity import ForceVelocity
from fem_biobot.material.law import Array, Law
from fem_biobot.material.laws import law_from
from fem_biobot.material.natural_state import NaturalState, isochoric_contraction
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.mesh.unbonded import unbonded
from fem_biobot.muscle.activation import activation_of
from fem_biobot.muscle.fibres import fibre_field, in_junction, piecewise_fibres
from fem_biobot.muscle.oxygenation import viable_share
from fem_biobot.solid.interface.record import Sliding
from fem_biobot.solid.model import SolidModel
from fem_biobot.solid.newton import NewtonSettings
from fem_biobot.solid.records import BodyForce, Fix, Step, Traction


def model_from_design(design: Design, mesh: BodyMesh, pulling: Array | None = None) -> SolidModel:
    """Solid model of a design; see `SolidModel.from_design`.

    With `pulling`, a factor of each element of the muscle, (e,) [1], parts of it do not pull, or less.

    A tension factor of 1 is the tension at full drive, ``design.tension(drive.amplitude)``, or 1 kPa where the design
    has none. Bots are held on three points against the six rigid motions, which carries no force; a strip stands on
    its minus end, free to slide and narrow in that plane (which holds the shear of oblique fibres there); a cantilever
    is clamped. Rings that are not bonded (muscle.attachment) lie on the pillars, on nodes of their own. Planar spread
    of fibres is in the x-y plane.
    """
    refuse_without_solid(design, "solve")
    muscle = design.muscle
    materials: dict[str, Law] = {}
    active: dict[str, ActiveStress] = {}
    for region in ("skeleton", "muscle"):
        part = getattr(design, region)
        if part is None:
            continue
        if region not in mesh.regions:
            raise MeshError(
                f"{region}: found no such region in the mesh ({', '.join(mesh.regions)}), expected one for this design"
            )
        materials[region] = law_of(part.material, _fibres(design, mesh) if region == "muscle" else None)
    if design.muscle is not None:
        share = viable_share(design, mesh)
        share = share if pulling is None else share * pulling
        active["muscle"] = tension_of(design, fibre_field(design, mesh), share)
    loads: list[Traction | BodyForce] = []
    if design.kind == "cantilever" and design.skeleton is not None and design.load is not None:
        area = design.skeleton.beam_width * design.skeleton.beam_thickness
        loads.append(Traction("tip", (0.0, 0.0, design.load.tip_force / area)))
    held, sliding = supports(design, mesh), None
    if muscle is not None and muscle.attachment == "contact":
        mesh = unbonded(mesh)
        sliding = Sliding(friction=muscle.pillar_friction or 0.0, axial_friction=muscle.pillar_axial_friction)
    return SolidModel(mesh, materials, active, held, loads, element=design.mesh.element, sliding=sliding)


def newton_settings(design: Design) -> NewtonSettings:
    """Tolerance and choice of the linear solver that a design asks for."""
    return NewtonSettings(tolerance=design.numerics.tolerance, linear=design.numerics.linear)


def law_of(material: Material, a0: Array | None = None) -> Law:
    """Passive law of a part with the parameters that its design gives; fibres over all elements, or none."""
    own = {name: getattr(material, name) for name in LAW_PARAMETERS[material.law]}
    given = {name: value for name, value in own.items() if value is not None}
    return law_from(material.law, material.young, material.poisson, a0, **given)


def _fibres(design: Design, mesh: BodyMesh) -> Array:
    """The muscle's fibres over all elements of the mesh, (3, e) [1]; elsewhere along x, where no law asks for them."""
    a0 = np.repeat(np.eye(3)[:, :1], mesh.cells.shape[1], axis=1)
    a0[:, mesh.regions["muscle"]] = fibre_field(design, mesh)
    return a0


def tension_of(design: Design, a0: Array, share: float | Array = 1.0) -> ActiveStress:
    """Active tension of a design's muscle at full drive along `a0`, (3,) or (3, e) [1]; times a viable share, (e,)."""
    muscle = design.muscle
    if muscle is None:
        raise DesignError(f"muscle: found none (kind {design.kind}), expected one for an active tension")
    return ActiveStress(
        tension_unit(design) * share,
        a0,
        muscle.convention,
        force_length(muscle.force_length, muscle.optimal_stretch or 1.0),
        muscle.transverse,
        Dispersion(muscle.spread, muscle.spread_kind) if muscle.spread else None,
        standing=design.tension(0.0) * share,
        activation=activation_of(design),
        force_velocity=_force_velocity(muscle),
    )


def _force_velocity(muscle: Muscle) -> ForceVelocity | None:
    found = muscle.force_velocity
    return None if found is None else ForceVelocity(found.fastest, found.curvature, found.eccentric)


def densities(design: Design) -> dict[str, float]:
    """Mass per volume of each region [kg/mm^3], as `solid.modes` asks for it."""
    parts = {"skeleton": design.skeleton, "muscle": design.muscle}
    return {name: part.material.density for name, part in parts.items() if part is not None}


def tension_unit(design: Design) -> float:
    """Tension that a tension factor of 1 stands for [kPa]."""
    return (design.tension(design.drive.amplitude) if design.muscle else 0.0) or 1.0


def tension_step(design: Design, tension: float) -> Step:
    """The step with a given tension [kPa] under the design's whole load."""
    field = None if design.muscle is None else design.muscle.activation
    return Step(load=1.0, tension=tension / tension_unit(design), time=0.0 if field is None else field.instant)


def supports(design: Design, mesh: BodyMesh) -> list[Fix]:
    """Supports that hold the design's body and carry no force of their own."""
    needed = {"cantilever": "clamp", "strip": "end_minus"}.get(design.kind)
    if needed is not None and needed not in mesh.surfaces:
        raise MeshError(f"{needed}: found no such surface in the mesh, expected one to hold a {design.kind} by")
    if design.kind == "cantilever":
        return [Fix("clamp")]
    if design.kind == "strip":
        end = np.unique(mesh.surfaces["end_minus"])
        centre = np.array(design.landmarks()["end_minus_centre"])
        first = int(end[np.argmin(np.linalg.norm(mesh.points[:, end] - centre[:, None], axis=0))])
        arms = mesh.points[:, end] - mesh.points[:, [first]]
        far = int(end[np.argmax(np.linalg.norm(arms[1:], axis=0))])
        # no turning about x, yet free to narrow: the far vertex may move along its line to the first only
        along = mesh.points[:, far] - mesh.points[:, first]
        along[0] = 0.0
        along /= np.linalg.norm(along)
        across = (0.0, -float(along[2]), float(along[1]))
        axes = (across, (0.0, float(along[1]), float(along[2])), (1.0, 0.0, 0.0))
        return [Fix("end_minus", "x"), Fix(_position(mesh, first), "yz"), Fix(_position(mesh, far), (0,), axes=axes)]
    marks = design.landmarks()
    first, second, third = (_vertex(mesh, name, marks[name]) for name in ("corner_short", "corner_long", "edge_short"))
    return [Fix(first, "xyz"), Fix(second, "yz"), Fix(third, "z")]


def remodelled(model: SolidModel, design: Design, natural_stretch: float) -> SolidModel:
    """The same model with the junction's tissue free of passive stress at `natural_stretch` along its fibres.

    The natural state is an isochoric contraction of the junction blocks, each as a whole along the direction of theta:
    contractions that turn with the fibres at a junction's ends would not fit together, and nothing would be free of
    stress. The rings keep the reference body, since the pillars hold them at their length.

    A stretch far from 1 must be approached gradually: `solve` scales loads and tension, never the natural stretch, and
    its undeformed start is no equilibrium of such a model. Solve the moulded model at the tension wanted, then lower
    the natural stretch at that tension in steps, the first of some percent, each begun from the states before it
    (`trial` of `solve`); the study's remodelled reference is found in this way.
    """
    muscle = model.mesh.regions["muscle"]
    X = model.mesh.points[:, model.mesh.cells[:, muscle]].mean(axis=1)
    junction = in_junction(design, X)
    smooth = design.value("muscle.fibres") == "smooth"
    fibres = piecewise_fibres(design, model.mesh) if smooth else np.asarray(model.active["muscle"].a0)
    F0 = np.repeat(np.eye(3)[:, :, None], model.mesh.cells.shape[1], axis=2)
    F0[:, :, muscle[junction]] = isochoric_contraction(natural_stretch, fibres[:, junction])
    law = model.materials["muscle"]
    return model.with_materials({**model.materials, "muscle": NaturalState(law, F0)})


def _vertex(mesh: BodyMesh, name: str, position: tuple[float, float, float]) -> tuple[float, float, float]:
    """The named vertex, or in a mesh without it the vertex nearest to where it belongs (free supports may move)."""
    index = mesh.landmarks.get(name)
    if index is None:
        index = int(np.argmin(np.linalg.norm(mesh.points - np.array(position)[:, None], axis=0)))
    return _position(mesh, index)


def _position(mesh: BodyMesh, index: int) -> tuple[float, float, float]:
    x, y, z = mesh.points[:, index]
    return float(x), float(y), float(z)

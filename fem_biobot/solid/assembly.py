"""From the parts of a model to its discrete equations: what fits is put together, what does not is refused."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from fem_biobot.errors import ModelError
from fem_biobot.material.active import ActiveStress, active_law
from fem_biobot.material.active_strain import ActiveStrain
from fem_biobot.material.law import Law, is_symmetric
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.solid import kernels
from fem_biobot.solid.held import Held, held
from fem_biobot.solid.loading import dead_loads
from fem_biobot.solid.mixed.equations import equations
from fem_biobot.solid.mixed.pressure import Part, check_same_regions, pressure_field, split_laws
from fem_biobot.solid.moduli import poisson_ratio, rest_moduli
from fem_biobot.solid.pattern import pattern
from fem_biobot.solid.records import Foundation, Load, Pressure, Support
from fem_biobot.solid.sharing import shares
from fem_biobot.solid.space import BEARS, Element, Space, space
from fem_biobot.solid.surfaces import are_symmetric, elastic_foundation, follower_pressure, scatter
from fem_biobot.solid.system import Contraction, System


def assemble_system(
    mesh: BodyMesh,
    materials: Mapping[str, Law],
    active: Mapping[str, ActiveStress],
    supports: Sequence[Support],
    loads: Sequence[Load],
    element: Element | str,
    degree: int | None,
) -> System:
    """Check that the parts of a model fit the mesh and make its discrete equations."""
    for what, names in (("materials", materials), ("active", active)):
        for name in names:
            if name not in mesh.regions:
                raise ModelError(f"{what}: found region {name!r}, expected one of {', '.join(mesh.regions)}")
    missing = [name for name in mesh.regions if name not in materials]
    if missing:
        raise ModelError(f"materials: found none for region {missing[0]!r}, expected a law for every region")
    body = space(mesh, element, degree)
    whole, parts = split_laws(mesh, body.element, materials)
    laws = tuple((law, np.ascontiguousarray(mesh.regions[name], dtype=np.int64)) for name, law in whole.items())
    moduli = {name: rest_moduli(law, elements, body) for name, (law, elements) in zip(whole, laws, strict=True)}
    shear = {name: both[0] for name, both in moduli.items()}
    held_nodes = held(mesh, body, supports)
    _refuse_undetermined_pressure(body, parts, held_nodes)
    field = pressure_field(body, parts, shear)
    sparsity = pattern(body.nodes, body.n_nodes, field.nodes if field else None, field.n if field else 0)
    shared = shares(body.nodes, body.points)
    fixed = np.zeros(sparsity.n_dofs, dtype=bool)
    fixed[held_nodes.dofs] = True
    rows = np.repeat(np.arange(sparsity.n_dofs), np.diff(sparsity.starts))
    blocked = np.flatnonzero(fixed[rows] | fixed[sparsity.columns])
    force = dead_loads(mesh, body, loads)
    springs = [elastic_foundation(mesh, body, each) for each in supports if isinstance(each, Foundation)]
    pressures = [follower_pressure(mesh, body, each) for each in loads if isinstance(each, Pressure) and each.follower]
    following = [(term, scatter(term.facets, sparsity, held_nodes)) for term in pressures]
    surfaces = (*((term, scatter(term.facets, sparsity, held_nodes)) for term in springs), *following)
    contractions = tuple(
        _contraction(mesh, body, name, muscle, materials[name], shear[name]) for name, muscle in active.items()
    )
    return System(
        body,
        sparsity,
        laws,
        contractions,
        held_nodes,
        force,
        shared,
        held_nodes.turned if np.any(held_nodes.turned >= 0) else held_nodes.turned[:0],
        blocked,
        sparsity.starts[:-1][fixed].astype(np.int64),
        equations(body, sparsity, field, shared) if field else None,
        _notes(body.element, {name: poisson_ratio(*moduli[name]) for name in materials if name not in parts}),
        surfaces,
        all(is_symmetric(law) for law in (*whole.values(), *(c.law for c in contractions))),
        are_symmetric(following, len(sparsity.columns), blocked, held_nodes),
    )


def _notes(element: Element, poissons: Mapping[str, float]) -> tuple[str, ...]:
    """What is to be said of regions in displacement form whose Poisson's ratio is above what the element bears."""
    limit = BEARS.get(element, BEARS[Element.P2])
    return tuple(
        f"{name}: Poisson's ratio {poisson:.4g} is above the {limit:g} that the displacement element "
        f"{Element.P1 if element is Element.P1 else Element.P2} bears without locking; expected the mixed element "
        f"{Element.P2P1} (with a law that splits) or a lower ratio"
        for name, poisson in poissons.items()
        if poisson > limit + 1e-9
    )


def _refuse_undetermined_pressure(body: Space, parts: Mapping[str, Part], found: Held) -> None:
    """Incompressible regions held all around: a pressure that is the same everywhere does no work there.

    Seen from the nodal forces of a unit pressure in each region: some sum of them vanishes at all free unknowns.
    """
    closed = {name: part for name, part in parts.items() if part.compliance == 0.0}
    if not closed:
        return
    F = np.zeros((3, 3, *body.dV.shape))
    S = np.zeros((6, *body.dV.shape))
    F[0, 0] = F[1, 1] = F[2, 2] = 1.0
    S[:3] = 1.0
    forces = []
    for part in closed.values():
        force, magnitude = np.zeros((body.n_nodes, 3)), np.zeros((body.n_nodes, 3))
        kernels.internal_force(
            part.elements, body.nodes, body.slopes, body.to_reference, body.dV, F, S, force, magnitude
        )
        free = found.to_local(force).ravel()
        free[found.dofs] = 0.0
        forces.append(free / np.linalg.norm(magnitude))
    sizes = np.linalg.svd(np.array(forces), compute_uv=False)
    if sizes[-1] < 1e-10:
        names = ", ".join(closed)
        raise ModelError(
            f"supports: found incompressible tissue ({names}; poisson 0.5) held all around, where nothing determines "
            "the pressure, expected a part of its surface free or a poisson below 0.5"
        )


def with_laws(
    system: System, mesh: BodyMesh, materials: Mapping[str, Law], active: Mapping[str, ActiveStress]
) -> System:
    """The same equations with other passive laws; space and sparsity are shared.

    `materials` and `active` in the order of those that the system was made with.
    """
    whole, parts = split_laws(mesh, system.space.element, materials)
    check_same_regions(parts, system.mixed.field if system.mixed else None)
    laws = tuple((law, elements) for law, (_, elements) in zip(whole.values(), system.laws, strict=True))
    mixed = system.mixed and system.mixed.with_parts(system.space, system.pattern, tuple(parts.values()))
    # active strain contracts the passive law itself
    contractions = tuple(
        replace(c, law=c.law.over(materials[name])) if isinstance(c.law, ActiveStrain) else c
        for name, c in zip(active, system.contractions, strict=True)
    )
    return replace(system, laws=laws, mixed=mixed, contractions=contractions)


def _contraction(mesh: BodyMesh, body: Space, name: str, muscle: ActiveStress, law: Law, shear: float) -> Contraction:
    elements = np.ascontiguousarray(mesh.regions[name], dtype=np.int64)
    n, n_points = body.dV.shape
    tension, a0 = np.zeros((n, n_points)), np.zeros((3, n, n_points))
    for label, given in (
        ("tension", np.asarray(muscle.tension)),
        ("standing", np.asarray(muscle.standing)),
        ("a0", muscle.a0[0]),
    ):
        if given.ndim and given.shape != (len(elements),):
            raise ModelError(
                f"active[{name!r}].{label}: found {given.shape[0]} values, expected one for each of "
                f"{len(elements)} elements of the region"
            )
    tension[elements] = np.asarray(muscle.tension).reshape(-1, 1)
    a0[:, elements] = muscle.a0.reshape(3, -1, 1)
    points = body.quadrature_points if muscle.activation is not None else None
    rise = float(tension.max()) / (3.0 * shear)
    return Contraction(elements, name, tension, a0, rise, active_law(muscle, n, elements, law, points))

"""The discrete equations of a solid model: what a Newton iteration evaluates, with everything constant made once.

Displacements and forces are (n, 3), node by node. Nodes held along directions that are not the global axes are solved
in axes of their own ("turned" nodes); `to_local` and `to_global` go between the two. Vectors of all unknowns hold the
displacements node by node, then the pressures of the mixed form, scaled (see `solid.mixed`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fem_biobot.errors import ModelError
from fem_biobot.material.active import ActiveLaw, ActiveStress, active_law
from fem_biobot.material.active_strain import ActiveStrain
from fem_biobot.material.kernels import extrapolated_stress, smallest_volume_ratio
from fem_biobot.material.law import Array, Law, add_law
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.solid import kernels
from fem_biobot.solid.held import Held, held
from fem_biobot.solid.loading import dead_load
from fem_biobot.solid.mixed.equations import MixedEquations, VolumePoints, equations
from fem_biobot.solid.mixed.pressure import Part, check_same_regions, pressure_field, split_laws
from fem_biobot.solid.moduli import PACKED_ENTRY, poisson_ratio, rest_moduli
from fem_biobot.solid.pattern import Pattern, pattern
from fem_biobot.solid.records import BodyForce, Fix, Symmetry, Traction
from fem_biobot.solid.sharing import Shares, run_parts, shares, split
from fem_biobot.solid.space import BEARS, Element, Ints, Space, space


class Points(NamedTuple):
    """What the laws say at every point: ``F`` (3, 3, e, q), packed ``S`` and ``D``, energy ``psi`` (e, q).

    With a pressure field its stress, moduli and energy are in, and `volume` holds what else it needs.
    """

    F: Array
    S: Array
    D: Array
    psi: Array
    volume: VolumePoints | None = None


class InvertedError(Exception):
    """A trial displacement turns an element inside out; carries the element and its worst determinant."""

    def __init__(self, J: float, element: int) -> None:
        super().__init__(f"element {element} is inverted (det F = {J:.3g})")
        self.J, self.element = J, element


@dataclass(frozen=True)
class Contraction:
    """The active tension of one region prepared for the kernel.

    Attributes
    ----------
    elements
        Elements of the region.
    tension, a0
        Tension (e, q) [kPa] and fibres (3, e, q) over ALL elements.
    rise
        Largest tension over three times the region's passive shear modulus: the strain it would cause alone [1].
    law
        The tension's law at factor 1, over ALL elements.
    """

    elements: Ints
    tension: Array
    a0: Array
    rise: float
    law: ActiveLaw


@dataclass(frozen=True)
class System:
    """Discrete equations; made by `assemble_system`, immutable."""

    space: Space
    pattern: Pattern
    laws: tuple[tuple[Law, Ints], ...]
    contractions: tuple[Contraction, ...]
    held: Held
    dead_load: Array
    shares: Shares
    turned: NDArray[np.int64]
    blocked: NDArray[np.int64]
    diagonal: NDArray[np.int64]
    mixed: MixedEquations | None = None
    notes: tuple[str, ...] = ()

    @property
    def n_dofs(self) -> int:
        """Unknowns, the held ones included."""
        return self.pattern.n_dofs

    @property
    def n_pressures(self) -> int:
        """Pressure unknowns."""
        return self.pattern.n_pressures

    @cached_property
    def rounding_force(self) -> float:
        """Norm of the residual that rounding of the stresses alone leaves [mN].

        Stresses near the natural state are differences of moduli: they carry an error of the order of the modulus
        times the machine's precision, however small the load.
        """
        s = self.space
        F = self.deformation_gradient(np.zeros((s.n_nodes, 3)))
        rest = self.points(F, 0.0)
        modulus = np.zeros_like(rest.S)
        modulus[:3] = rest.D[[PACKED_ENTRY[a, a] for a in range(3)]]
        magnitude = np.zeros((s.n_nodes, 3))
        force = np.zeros((s.n_nodes, 3))
        kernels.internal_force(
            np.arange(s.nodes.shape[1]), s.nodes, s.slopes, s.to_reference, s.dV, F, modulus, force, magnitude
        )
        return float(np.finfo(float).eps * np.linalg.norm(magnitude))

    def to_local(self, v: Array) -> Array:
        """Global components (n, 3) to the axes in which the equations are solved."""
        return self.held.to_local(v)

    def to_global(self, v: Array) -> Array:
        """Back from the axes in which the equations are solved."""
        return self.held.to_global(v)

    def parts(self, x: Array) -> tuple[Array, Array]:
        """Displacement (n, 3) [mm], in global axes, and pressure (m,) [kPa] of a vector of unknowns."""
        n = self.n_dofs - self.n_pressures
        u = self.to_global(x[:n].reshape(-1, 3))
        return u, (x[n:] if self.mixed is None else x[n:] * self.mixed.field.scale)

    def residual(self, points: Points, force: Array, f_ext: Array) -> Array:
        """Internal less external force in local axes, then the volume residual, (dofs,) [mN]."""
        r = self.to_local(force - f_ext).ravel()
        if self.mixed is None or points.volume is None:
            return r
        return np.concatenate([r, self.mixed.residual(points.volume, self.space.dV)])

    def carry(self, points: Points, F: Array, change: Array) -> Array:
        """Stress carried along linearly to the gradient `F` and by a change of the pressures, (6, e, q) [kPa]."""
        S = np.empty_like(points.S)
        extrapolated_stress(points.F, F, points.S, points.D, S)
        if self.mixed is not None and points.volume is not None:
            self.mixed.carry(S, points.volume, change)
        return S

    def deformation_gradient(self, u: Array) -> Array:
        """``F`` at the quadrature points, (3, 3, e, q)."""
        F = np.empty((3, 3, *self.space.dV.shape))
        s = self.space

        def write(elements: Ints) -> None:
            kernels.deformation_gradient(elements, u, s.nodes, s.slopes, s.to_reference, F)

        run_parts(write, split(np.arange(s.nodes.shape[1])))
        return F

    def points(
        self, F: Array, tension: float, p: Array | None = None, *, passive: bool = True, moduli: bool = True
    ) -> Points:
        """Laws at the quadrature points; raises `InvertedError` where an element is inverted.

        With the pressures `p` (m,) [kPa] of the mixed form, by default zero. Without `passive` the active tension
        alone; without `moduli` stress and energy only, with an empty ``D``.
        """
        J, element = smallest_volume_ratio(F)
        if not J > 0.0:
            raise InvertedError(J, element)
        shape = self.space.dV.shape
        S, D, psi = np.zeros((6, *shape)), np.zeros((21 if moduli else 0, *shape)), np.zeros(shape)
        if passive:
            for law, elements in self.laws:
                run_parts(lambda part, law=law: add_law(law, F, part, S, D, psi), split(elements))
        if tension != 0.0:
            for c in self.contractions:
                law = c.law.scaled(tension)
                run_parts(lambda part, law=law: add_law(law, F, part, S, D, psi), split(c.elements))
        volume = None
        if self.mixed is not None and passive:
            volume = self.mixed.add_points(F, np.zeros(self.n_pressures) if p is None else p, S, D, psi)
        return Points(F, S, D, psi, volume)

    def internal_force(self, points: Points) -> tuple[Array, Array]:
        """Internal force (n, 3) [mN] and the sum of the sizes of its element parts."""
        force = np.zeros((self.space.n_nodes, 3))
        magnitude = np.zeros_like(force)
        s = self.space

        def add(elements: Ints) -> None:
            kernels.internal_force(
                elements, s.nodes, s.slopes, s.to_reference, s.dV, points.F, points.S, force, magnitude
            )

        self.shares.run(add)
        return force, magnitude

    def matrix(self, points: Points, S: Array) -> Array:
        """Upper triangle of the whole matrix at `points`, with the stress `S` in its geometric part."""
        data = self.tangent(points.F, S, points.D)
        if self.mixed is not None and points.volume is not None:
            self.mixed.add_matrix(self.space, self.pattern, points.F, points.volume, self.turned, self.held.axes, data)
        return data

    def tangent(self, F: Array, S: Array, D: Array) -> Array:
        """Upper triangle of the displacements' part in local axes, held unknowns included."""
        s, p = self.space, self.pattern
        data = np.zeros(len(p.columns))

        def add(elements: Ints) -> None:
            kernels.tangent(
                elements, s.nodes, s.slopes, s.to_reference, s.dV, F, S, D, p.place, self.turned, self.held.axes, data
            )

        self.shares.run(add)
        return data

    def product(self, data: Array, v: Array) -> Array:
        """Matrix times vector (dofs,), both in local axes."""
        y = np.empty(self.n_dofs)
        kernels.symmetric_product(self.pattern.starts, self.pattern.columns, data, v, y)
        return y

    def block(self, data: Array) -> None:
        """Replace the rows and columns of held unknowns by those of a scaled identity, in place."""
        scale = float(np.mean(data[self.pattern.starts[: self.n_dofs - self.n_pressures]]))
        data[self.blocked] = 0.0
        data[self.diagonal] = scale


def assemble_system(
    mesh: BodyMesh,
    materials: Mapping[str, Law],
    active: Mapping[str, ActiveStress],
    supports: Sequence[Fix | Symmetry],
    loads: Sequence[Traction | BodyForce],
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
    return System(
        body,
        sparsity,
        laws,
        tuple(_contraction(mesh, body, name, muscle, materials[name], shear[name]) for name, muscle in active.items()),
        held_nodes,
        dead_load(mesh, body, loads),
        shared,
        held_nodes.turned if np.any(held_nodes.turned >= 0) else held_nodes.turned[:0],
        blocked,
        sparsity.starts[:-1][fixed].astype(np.int64),
        equations(body, sparsity, field, shared) if field else None,
        _notes(body.element, {name: poisson_ratio(*moduli[name]) for name in materials if name not in parts}),
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
    for label, given in (("tension", np.asarray(muscle.tension)), ("a0", muscle.a0[0])):
        if given.ndim and given.shape != (len(elements),):
            raise ModelError(
                f"active[{name!r}].{label}: found {given.shape[0]} values, expected one for each of "
                f"{len(elements)} elements of the region"
            )
    tension[elements] = np.asarray(muscle.tension).reshape(-1, 1)
    a0[:, elements] = muscle.a0.reshape(3, -1, 1)
    rise = float(tension.max()) / (3.0 * shear)
    return Contraction(elements, tension, a0, rise, active_law(muscle, n, elements, law))

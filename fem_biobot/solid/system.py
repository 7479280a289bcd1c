"""The discrete equations of a solid model: what a Newton iteration evaluates, with everything constant made once.

Vectors of unknowns are (n, 3), node by node. Nodes held along directions that are not the global axes are solved in
axes of their own ("turned" nodes); `to_local` and `to_global` go between the two.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fem_biobot.errors import ModelError
from fem_biobot.material.active import ActiveLaw, ActiveStress, active_law
from fem_biobot.material.kernels import smallest_volume_ratio
from fem_biobot.material.law import Array, Law, add_law
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.solid import kernels
from fem_biobot.solid.held import Held, held
from fem_biobot.solid.loading import dead_load
from fem_biobot.solid.pattern import Pattern, pattern
from fem_biobot.solid.records import BodyForce, Fix, Symmetry, Traction
from fem_biobot.solid.sharing import Shares, run_parts, shares, split
from fem_biobot.solid.space import Element, Ints, Space, space

# entry of component (a, b), a <= b, in the packed upper triangle of a 6 by 6 matrix
PACKED_ENTRY = {(a, b): 6 * a - a * (a - 1) // 2 + b - a for a in range(6) for b in range(a, 6)}


class Points(NamedTuple):
    """What the laws say at every point: ``F`` (3, 3, e, q), packed ``S`` and ``D``, energy ``psi`` (e, q)."""

    F: Array
    S: Array
    D: Array
    psi: Array


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

    @property
    def n_dofs(self) -> int:
        """Unknowns, the held ones included."""
        return self.pattern.n_dofs

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

    def deformation_gradient(self, u: Array) -> Array:
        """``F`` at the quadrature points, (3, 3, e, q)."""
        F = np.empty((3, 3, *self.space.dV.shape))
        s = self.space

        def write(elements: Ints) -> None:
            kernels.deformation_gradient(elements, u, s.nodes, s.slopes, s.to_reference, F)

        run_parts(write, split(np.arange(s.nodes.shape[1])))
        return F

    def points(self, F: Array, tension: float, *, passive: bool = True, moduli: bool = True) -> Points:
        """Laws at the quadrature points; raises `InvertedError` where an element is inverted.

        Without `passive` the active tension alone; without `moduli` stress and energy only, with an empty ``D``.
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
        return Points(F, S, D, psi)

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

    def tangent(self, F: Array, S: Array, D: Array) -> Array:
        """Upper triangle of the tangent in local axes, held unknowns included."""
        s, p = self.space, self.pattern
        data = np.zeros(len(p.columns))

        def add(elements: Ints) -> None:
            kernels.tangent(
                elements, s.nodes, s.slopes, s.to_reference, s.dV, F, S, D, p.place, self.turned, self.held.axes, data
            )

        self.shares.run(add)
        return data

    def product(self, data: Array, v: Array) -> Array:
        """Matrix times vector, both in local axes."""
        y = np.empty(self.n_dofs)
        kernels.symmetric_product(self.pattern.starts, self.pattern.columns, data, np.ascontiguousarray(v).ravel(), y)
        return y.reshape(-1, 3)

    def block(self, data: Array) -> None:
        """Replace the rows and columns of held unknowns by those of a scaled identity, in place."""
        scale = float(np.mean(data[self.pattern.starts[:-1]]))
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
    laws = tuple((law, np.ascontiguousarray(mesh.regions[name], dtype=np.int64)) for name, law in materials.items())
    held_nodes = held(mesh, body, supports)
    sparsity = pattern(body.nodes, body.n_nodes)
    fixed = np.zeros(sparsity.n_dofs, dtype=bool)
    fixed[held_nodes.dofs] = True
    rows = np.repeat(np.arange(sparsity.n_dofs), np.diff(sparsity.starts))
    blocked = np.flatnonzero(fixed[rows] | fixed[sparsity.columns])
    return System(
        body,
        sparsity,
        laws,
        tuple(_contraction(mesh, body, name, muscle, materials[name]) for name, muscle in active.items()),
        held_nodes,
        dead_load(mesh, body, loads),
        shares(body.nodes, body.points),
        held_nodes.turned if np.any(held_nodes.turned >= 0) else held_nodes.turned[:0],
        blocked,
        sparsity.starts[:-1][fixed].astype(np.int64),
    )


def _contraction(mesh: BodyMesh, body: Space, name: str, muscle: ActiveStress, law: Law) -> Contraction:
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
    rise = float(tension.max()) / (3.0 * _shear_modulus(law, elements, body))
    return Contraction(elements, tension, a0, rise, active_law(muscle, n, elements, law))


def _shear_modulus(law: Law, elements: Ints, body: Space) -> float:
    """Mean passive shear modulus of a region in the reference body [kPa]."""
    shape = body.dV.shape
    F = np.zeros((3, 3, *shape))
    for i in range(3):
        F[i, i] = 1.0
    S, D, psi = np.zeros((6, *shape)), np.zeros((21, *shape)), np.zeros(shape)
    add_law(law, F, elements, S, D, psi)
    shear = [PACKED_ENTRY[a, a] for a in (3, 4, 5)]
    return float(np.mean(D[shear][:, elements]))

"""The discrete equations of a solid model: what a Newton iteration evaluates, with everything constant made once.

Displacements and forces are (n, 3), node by node. Nodes held along directions that are not the global axes are solved
in axes of their own ("turned" nodes); `to_local` and `to_global` go between the two. Vectors of all unknowns hold the
displacements node by node, then the pressures of the mixed form, scaled (see `solid.mixed`).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fem_biobot.material.active import ActiveLaw
from fem_biobot.material.force_velocity import Straining
from fem_biobot.material.kernels import extrapolated_stress, smallest_volume_ratio
from fem_biobot.material.law import Array, Law, add_law
from fem_biobot.material.muscle_tension import MuscleTension
from fem_biobot.solid import kernels
from fem_biobot.solid.held import Held
from fem_biobot.solid.linear import product
from fem_biobot.solid.mixed.equations import MixedEquations, VolumePoints
from fem_biobot.solid.moduli import PACKED_ENTRY
from fem_biobot.solid.pattern import Pattern
from fem_biobot.solid.records import Step, load_factor, tension_factor
from fem_biobot.solid.sharing import Shares, run_parts, split
from fem_biobot.solid.space import Ints, Space
from fem_biobot.solid.surfaces import Scatter, SurfaceTerm
from fem_biobot.solid.unsymmetric import kernels as unsymmetric


class Points(NamedTuple):
    """What the laws say at every point: ``F`` (3, 3, e, q), packed ``S`` and ``D``, energy ``psi`` (e, q).

    With a pressure field its stress, moduli and energy are in, and `volume` holds what else it needs. `odd` (15, e, q)
    is the skew part of the moduli, above the diagonal, where laws have one.
    """

    F: Array
    S: Array
    D: Array
    psi: Array
    volume: VolumePoints | None = None
    odd: Array | None = None


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
    region
        Its name, by which steps drive it.
    tension, a0
        Tension (e, q) [kPa] and fibres (3, e, q) over ALL elements.
    rise
        Largest tension over three times the region's passive shear modulus: the strain it would cause alone [1].
    law
        The tension's law at factor 1, over ALL elements.
    """

    elements: Ints
    region: str
    tension: Array
    a0: Array
    rise: float
    law: ActiveLaw

    def law_at(self, step: float | Step) -> ActiveLaw:
        """The tension's law at a step, or at a factor (and the instant 0)."""
        law = self.law
        if isinstance(law, MuscleTension) and isinstance(step, Step):
            law = law.at_time(step.time)
        return law.scaled(tension_factor(step, self.region))

    def rise_between(self, here: Step, there: Step) -> float:
        """Largest change of tension between two steps over three times the region's passive shear modulus [1]."""
        one, two = self.law_at(here), self.law_at(there)
        if not (isinstance(one, MuscleTension) and isinstance(two, MuscleTension)):
            return abs(there.tension_in(self.region) - here.tension_in(self.region)) * self.rise
        change = float(np.max(np.abs(sum(two.tensions()) - sum(one.tensions()))))
        return change * self.rise / float(self.tension.max()) if change else 0.0


@dataclass(frozen=True)
class System:
    """Discrete equations; made by `assemble_system`, immutable."""

    space: Space
    pattern: Pattern
    laws: tuple[tuple[Law, Ints], ...]
    contractions: tuple[Contraction, ...]
    held: Held
    dead_loads: tuple[tuple[str, Array], ...]
    shares: Shares
    turned: NDArray[np.int64]
    blocked: NDArray[np.int64]
    diagonal: NDArray[np.int64]
    mixed: MixedEquations | None = None
    notes: tuple[str, ...] = ()
    surfaces: tuple[tuple[SurfaceTerm, Scatter], ...] = ()
    symmetric_laws: bool = True
    symmetric_surfaces: bool = True

    @property
    def symmetric(self) -> bool:
        """Whether the matrix is; else it is kept as its symmetric and its skew part, (2, entries)."""
        return self.symmetric_laws and self.symmetric_surfaces

    @property
    def by_rate(self) -> bool:
        """Whether a muscle's tension depends on how fast it is stretched."""
        return any(isinstance(c.law, MuscleTension) and c.law.force_velocity is not None for c in self.contractions)

    @property
    def n_dofs(self) -> int:
        """Unknowns, the held ones included."""
        return self.pattern.n_dofs

    @property
    def n_pressures(self) -> int:
        """Pressure unknowns."""
        return self.pattern.n_pressures

    @cached_property
    def dead_load(self) -> Array:
        """Nodal forces of all dead loads at load factor 1, (n, 3) [mN]."""
        return sum((force for _, force in self.dead_loads), np.zeros((self.space.n_nodes, 3)))

    @cached_property
    def load_names(self) -> tuple[str, ...]:
        """Names by which steps drive loads and prescribed displacements."""
        names = (
            *(name for name, _ in self.dead_loads),
            *(t.name for t, _ in self.surfaces),
            *self.held.prescribed.names,
        )
        return tuple(dict.fromkeys(name for name in names if name))

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
        if points.odd is not None:
            unsymmetric.add_skew_stress(points.F, F, points.odd, S)
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
        self,
        F: Array,
        tension: float | Step,
        p: Array | None = None,
        *,
        passive: bool = True,
        moduli: bool = True,
        straining: Straining | None = None,
    ) -> Points:
        """Laws at the quadrature points; raises `InvertedError` where an element is inverted.

        `tension` is a step, or a factor on every muscle. With the pressures `p` (m,) [kPa] of the mixed form, by
        default zero. Without `passive` the active tension alone; without `moduli` stress and energy only, with an
        empty ``D``. `straining` says at what rate tension acts that depends on it; by default at rest.
        """
        J, element = smallest_volume_ratio(F)
        if not J > 0.0:
            raise InvertedError(J, element)
        shape = self.space.dV.shape
        rows = (21 if self.symmetric_laws else 36) if moduli else 0
        S, D, psi = np.zeros((6, *shape)), np.zeros((rows, *shape)), np.zeros(shape)
        if passive:
            for law, elements in self.laws:
                run_parts(lambda part, law=law: add_law(law, F, part, S, D, psi), split(elements))
        for c in self.contractions:
            if tension_factor(tension, c.region) != 0.0:
                law = c.law_at(tension)
                if straining is not None and isinstance(law, MuscleTension):
                    law = law.straining(straining)
                run_parts(lambda part, law=law: add_law(law, F, part, S, D, psi), split(c.elements))
        volume = odd = None
        if rows == 36:
            full, D, odd = D, np.empty((21, *shape)), np.empty((15, *shape))
            unsymmetric.parted_moduli(full, D, odd)
        if self.mixed is not None and passive:
            volume = self.mixed.add_points(F, np.zeros(self.n_pressures) if p is None else p, S, D, psi)
        return Points(F, S, D, psi, volume, odd)

    def loudest(self, residual: Array) -> int | None:
        """An element at the node with the largest residual, (dofs,) [mN]; none where all of it is zero."""
        n = self.n_dofs - self.n_pressures
        sizes = np.nan_to_num(np.linalg.norm(residual[:n].reshape(-1, 3), axis=1), nan=np.inf)
        node = int(np.argmax(sizes))
        return int(np.flatnonzero(np.any(self.space.nodes == node, axis=0))[0]) if sizes[node] > 0.0 else None

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

    def external_force(self, u: Array, load: float | Step) -> Array:
        """Force of all loads at a step or load factor, and of foundations, at the displacement `u`, (n, 3) [mN]."""
        force = np.zeros_like(u)
        for name, dead in self.dead_loads:
            force += load_factor(load, name) * dead
        for term, _ in self.surfaces:
            force += (load_factor(load, term.name) if term.by_load else 1.0) * term.force(u)
        return force

    def matrix(self, points: Points, S: Array, u: Array | None = None, load: float | Step = 1.0) -> Array:
        """Upper triangle of the whole matrix at `points`, with the stress `S` in its geometric part.

        Surface terms are evaluated at the displacement `u` (n, 3), by default none. Without symmetry (2, entries): the
        upper triangles of the symmetric and of the skew part.
        """
        data = self.tangent(points.F, S, points.D)
        if self.mixed is not None and points.volume is not None:
            self.mixed.add_matrix(self.space, self.pattern, points.F, points.volume, self.turned, self.held.axes, data)
        skew = np.zeros(0 if self.symmetric else len(data))
        for term, to in self.surfaces:
            even, odd = to.parts(term.blocks(np.zeros((self.space.n_nodes, 3)) if u is None else u))
            factor = load_factor(load, term.name) if term.by_load else 1.0
            data[to.places] += factor * even
            if skew.size:
                skew[to.places] += factor * odd
        if points.odd is not None:
            self._add_skew_tangent(points, skew)
        return data if self.symmetric else np.stack([data, skew])

    def _add_skew_tangent(self, points: Points, skew: Array) -> None:
        s, p = self.space, self.pattern
        assert points.odd is not None

        def add(elements: Ints) -> None:
            unsymmetric.skew_tangent(
                elements, s.nodes, s.slopes, s.to_reference, s.dV, points.F, points.odd, p.place, self.turned,
                self.held.axes, skew,
            )  # fmt: skip

        self.shares.run(add)

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
        return product(self.pattern, data, v)

    def block(self, data: Array) -> None:
        """Replace the rows and columns of held unknowns by those of a scaled identity, in place."""
        even = data if data.ndim == 1 else data[0]
        scale = float(np.mean(even[self.pattern.starts[: self.n_dofs - self.n_pressures]]))
        data[..., self.blocked] = 0.0
        even[self.diagonal] = scale

"""One equilibrium of a solid model, or an instant of its motion, and what can be asked of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from fem_biobot.errors import ModelError
from fem_biobot.material.force_velocity import Straining
from fem_biobot.material.law import Array
from fem_biobot.solid.dynamics.strain import green_lagrange, strain_change
from fem_biobot.solid.held import place_nodes
from fem_biobot.solid.interface.state import Touch
from fem_biobot.solid.records import Step, numbers
from fem_biobot.solid.space import Ints
from fem_biobot.solid.system import Points, System

if TYPE_CHECKING:
    from fem_biobot.solid.model import SolidModel


@dataclass(frozen=True)
class SolidState:
    """One equilibrium.

    Attributes
    ----------
    model
        What it is a state of.
    step
        Load and tension factors.
    u
        Displacement of the nodes, vertices first, (3, n) [mm].
    pressure
        Pressures of the mixed form, positive in tension, (m,) [kPa], zero if left out; see `pressure_points`.
    residual
        Norm of the residual over the force scale [1].
    newton_iterations, factorisations, cg_iterations
        Work from the state before to this one, halved steps included.
    velocity
        Of the nodes, (3, n) [mm/s], for tension that depends on the rate of the fibre's stretch; at rest by default.
    touch
        State of the sliding contact, where the model has one.
    """

    model: SolidModel
    step: Step
    u: Array
    residual: float = 0.0
    newton_iterations: int = 0
    factorisations: int = 0
    cg_iterations: int = 0
    pressure: Array | None = None
    velocity: Array | None = None
    touch: Touch | None = None

    @property
    def X(self) -> Array:
        """Reference positions of the nodes, vertices first, (3, n) [mm]."""
        return self.model.system.space.points

    @property
    def cells(self) -> Ints:
        """Nodes of each element in VTK's order for quadratic tetrahedra, (10, e)."""
        return self.model.system.space.nodes

    @property
    def pressure_points(self) -> Array:
        """Reference positions of the pressures, region by region, (3, m) [mm]; none but in the mixed form."""
        mixed = self.model.system.mixed
        return self.X[:, mixed.field.vertex] if mixed else np.zeros((3, 0))

    @cached_property
    def F(self) -> Array:
        """Deformation gradient at the quadrature points, (3, 3, e, q) [1]."""
        return self.model.system.deformation_gradient(np.ascontiguousarray(self.u.T))

    @cached_property
    def points(self) -> Points:
        """Stress and energy of passive laws and active tension together, at the quadrature points (no moduli)."""
        return self.model.system.points(self.F, self.step, self.pressure, moduli=False, straining=self.straining)

    @cached_property
    def straining(self) -> Straining | None:
        """How it is being strained at the quadrature points; none at rest, or where that does not matter."""
        system = self.model.system
        if self.velocity is None or not system.by_rate:
            return None
        dF = system.deformation_gradient(np.ascontiguousarray(self.velocity.T)) - np.eye(3)[:, :, None, None]
        return Straining(green_lagrange(self.F), strain_change(self.F, dF), 0.0)

    @cached_property
    def internal_force(self) -> Array:
        """Internal force at the nodes, (3, n) [mN]."""
        return self.model.system.internal_force(self.points)[0].T

    @cached_property
    def stretch(self) -> Array:
        """Fibre stretch at the quadrature points, (e, q) [1]; not a number where a region has no fibres."""
        out = np.full(self.model.system.space.dV.shape, np.nan)
        for c in self.model.system.contractions:
            a = np.einsum("ik...,k...->i...", self.F[:, :, c.elements], c.a0[:, c.elements])
            out[c.elements] = np.sqrt(np.einsum("i...,i...->...", a, a))
        return out

    @cached_property
    def energy(self) -> float:
        """Passive strain energy of the whole body [uJ]; the muscle's work is a separate number."""
        return float(np.sum(self.element_energy))

    @cached_property
    def element_energy(self) -> Array:
        """Passive strain energy of each element, (e,) [uJ]."""
        passive = self.model.system.points(self.F, 0.0, self.pressure, moduli=False)
        return np.sum(passive.psi * self.model.system.space.dV, axis=1)

    def reaction(self, where: str | tuple[float, float, float]) -> Array:
        """Force that the support at a named surface, landmark or vertex exerts on the body, (3,) [mN]."""
        model = self.model
        nodes = place_nodes(model.mesh, model.system.space, where)
        f_ext = model.system.external_force(np.ascontiguousarray(self.u.T), self.step).T
        return (self.internal_force - f_ext)[:, nodes].sum(axis=1)

    def reaction_moment(
        self, where: str | tuple[float, float, float], about: Sequence[float] = (0.0, 0.0, 0.0)
    ) -> Array:
        """Moment of that support's forces, where they act in the deformed body, about a fixed point [mm], (3,) [uJ]."""
        model = self.model
        nodes = place_nodes(model.mesh, model.system.space, where)
        centre = numbers(about, "about", "a position of three finite numbers")
        if centre.shape != (3,):
            raise ModelError(f"about: found {about!r}, expected a position of three finite numbers")
        f_ext = model.system.external_force(np.ascontiguousarray(self.u.T), self.step).T
        arm = (self.X + self.u)[:, nodes] - centre[:, None]
        return np.cross(arm, (self.internal_force - f_ext)[:, nodes], axis=0).sum(axis=1)

    def at(self, point: Sequence[float]) -> Array:
        """Displacement at a reference position, (3,) [mm]; refuses a position outside the body."""
        return self.u[:, :] @ interpolation(self.model.system, np.asarray(point, dtype=float))


def interpolation(system: System, X: Array) -> Array:
    """Weights of all nodes whose sum gives the field at reference position `X`, (n,)."""
    space = system.space
    corners = space.points[:, space.nodes[:4]]  # (3, 4, e)
    local = np.einsum("ijk,jk->ik", space.to_reference, X[:, None] - corners[:, 0])
    barycentric = np.concatenate([1.0 - local.sum(axis=0, keepdims=True), local])
    worst = barycentric.min(axis=0)
    element = int(np.argmax(worst))
    if worst[element] < -1e-6:
        raise ModelError(f"point {tuple(np.round(X, 6))} mm: found outside the body, expected a position inside")
    weights = np.zeros(space.n_nodes)
    xi = local[:, element].reshape(3, 1)
    shape = space.shape
    for b, node in enumerate(space.nodes[:, element]):
        weights[node] += float(np.ravel(shape.lbasis(xi, b)[0])[0])
    return weights

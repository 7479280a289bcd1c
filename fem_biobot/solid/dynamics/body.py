"""A solid model as a body in motion: its mass, weight, viscosity and drag beside its static equations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy import sparse

from fem_biobot.errors import ModelError
from fem_biobot.material.law import Array, is_symmetric
from fem_biobot.solid.dynamics.drag import DragTerm, SurfaceDrag, drag_term
from fem_biobot.solid.held import Held
from fem_biobot.solid.interface.joint import Joint
from fem_biobot.solid.linear import product
from fem_biobot.solid.mass import density_of, mass_matrix
from fem_biobot.solid.model import SolidModel
from fem_biobot.solid.prescribed import Prescribed
from fem_biobot.solid.records import numbers
from fem_biobot.solid.space import Ints
from fem_biobot.solid.surfaces import scatter
from fem_biobot.solid.system import System

GRAVITY = (0.0, 0.0, -9810.0)  # mm/s^2


@dataclass(frozen=True, eq=False)
class MovingBody:
    """What moves.

    Attributes
    ----------
    model
        The model.
    system
        Its equations, with its supports or without any.
    mass
        Upper triangle of the consistent mass matrix in local axes [kg].
    weight
        Nodal forces of gravity less buoyancy, (n, 3) [mN].
    viscosity
        Moduli ``damping_time D_rest`` by which strain rates make stress, (21, e, q) [kPa s]; None without damping.
    node_mass
        Mass that each node stands for, ``int rho N_a``, (n,) [kg].
    drag
        Of the medium on its surface; None without.
    joint
        Where parts slide on each other; None where all is bonded.
    """

    model: SolidModel
    system: System
    mass: Array
    weight: Array
    viscosity: Array | None
    node_mass: Array
    drag: DragTerm | None = None
    joint: Joint | None = None

    def momentum_of(self, v: Array) -> Array:
        """Mass matrix times velocities (n, 3), in global axes, (n, 3) [kg mm/s]."""
        s = self.system
        n = s.n_dofs - s.n_pressures
        moving = np.zeros(s.n_dofs)
        moving[:n] = s.to_local(v).ravel()
        return s.to_global(product(s.pattern, self.mass, moving)[:n].reshape(-1, 3))

    @cached_property
    def total_mass(self) -> float:
        """[kg]"""
        return float(self.node_mass.sum())

    @cached_property
    def largest(self) -> float:
        """Largest extent of the reference body [mm]."""
        return float(np.ptp(self.system.space.points, axis=1).max())


def moving_body(
    model: SolidModel,
    densities: Mapping[str, float],
    *,
    gravity: Sequence[float] = (0.0, 0.0, 0.0),
    medium_density: float = 0.0,
    damping_time: float = 0.0,
    free: bool = False,
    drag: SurfaceDrag | None = None,
) -> MovingBody:
    """Put a model in motion.

    Parameters
    ----------
    densities
        Mass per reference volume of every region [kg/mm^3].
    gravity
        Acceleration, (3,) [mm/s^2].
    medium_density
        Of a medium that buoys the body up by the weight of its reference volume [kg/mm^3].
    damping_time
        Kelvin-Voigt time [s]: the second Piola stress ``damping_time D_rest dE/dt`` adds to that of the laws, with
        the passive laws' moduli in the reference body (in the mixed form without those of its pressures, which change
        of volume meets). The same time means the same for rods: stress per rate of
        strain over stress per strain.
    free
        Let go of all supports but foundations.
    drag
        Of the medium; see `SurfaceDrag`. None by default.

    Raises
    ------
    ModelError
        A passive law without an energy, densities or numbers that do not fit, what a sliding contact refuses.
    """
    system = model.system
    if not all(is_symmetric(law) for law, _ in system.laws):
        raise ModelError("solid_dynamics: found a passive law without an energy, expected one for the book of energies")
    g = numbers(gravity, "gravity", "an acceleration of three finite numbers")
    if g.shape != (3,):
        raise ModelError(f"gravity: found {gravity!r}, expected an acceleration of three finite numbers")
    for key, value in (("medium_density", medium_density), ("damping_time", damping_time)):
        found = numbers(value, key, "a finite number of at least 0")
        if found.ndim or found < 0.0:
            raise ModelError(f"{key}: found {value!r}, expected a finite number of at least 0")
    system = released(system) if free else system
    rho = density_of(model.mesh, densities)
    body = system.space
    node_mass, node_volume = np.zeros(body.n_nodes), np.zeros(body.n_nodes)
    share = np.einsum("bq,eq->be", body.values, body.dV)
    np.add.at(node_volume, body.nodes, share)
    np.add.at(node_mass, body.nodes, share * rho)
    viscosity = None
    if damping_time > 0.0:
        rest = system.points(system.deformation_gradient(np.zeros((body.n_nodes, 3))), 0.0)
        viscosity = damping_time * rest.D
    weight = np.outer(node_mass - medium_density * node_volume, g)
    wetted = None if drag is None else drag_term(drag, model.mesh, system)
    mass = mass_matrix(system, model.mesh, densities)
    return MovingBody(model, system, mass, weight, viscosity, node_mass, wetted, _joint(model, system))


def holding(body: MovingBody, dofs: Ints) -> MovingBody:
    """The same body with unknowns held as drawn, numbered 3 node + axis, (k,); of one that is free until then."""
    system = body.system
    if system.held.dofs.size or system.surfaces or system.n_pressures:
        raise ModelError("holding: found a body with supports, foundations or pressures, expected one without")
    dofs, pattern = np.unique(dofs), system.pattern
    fixed = np.zeros(system.n_dofs, dtype=bool)
    fixed[dofs] = True
    rows = np.repeat(np.arange(system.n_dofs), np.diff(pattern.starts))
    still = Prescribed((), sparse.csr_matrix((len(dofs), 0)), sparse.csr_matrix((0, 0)), np.zeros((3, 0)), 1.0)
    held = replace(system.held, dofs=dofs, prescribed=still)
    blocked = np.flatnonzero(fixed[rows] | fixed[pattern.columns])
    system = replace(system, held=held, blocked=blocked, diagonal=pattern.starts[:-1][dofs])
    return replace(body, system=system, joint=_joint(body.model, system))


def _joint(model: SolidModel, system: System) -> Joint | None:
    return None if model.sliding is None else Joint(system, model.mesh, model.sliding)


def released(system: System) -> System:
    """The same equations with no unknown held; foundations and pressures stay."""
    n = system.space.n_nodes
    empty = np.zeros(0, dtype=np.int64)
    nothing = sparse.csr_matrix((0, 0))
    prescribed = Prescribed((), nothing, nothing, np.zeros((3, 0)), 1.0)
    held = Held(empty, prescribed, np.full(n, -1, dtype=np.int64), np.zeros((3, 3, 1)))
    surfaces = tuple((term, scatter(term.facets, system.pattern, held)) for term, _ in system.surfaces)
    return replace(system, held=held, turned=empty, blocked=empty, diagonal=empty, surfaces=surfaces)

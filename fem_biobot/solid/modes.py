"""Small free motions of a body about an equilibrium: natural frequencies and shapes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse.linalg import LinearOperator, eigsh

from fem_biobot.errors import ModelError
from fem_biobot.solid.direct import LinearSolver
from fem_biobot.solid.linear import NotPositiveDefiniteError, product
from fem_biobot.solid.mass import mass_matrix
from fem_biobot.solid.model import SolidState, direct_solver
from fem_biobot.solid.space import Array, Ints
from fem_biobot.solid.system import System

# largest residual of a state, of its force scale, about which modes make sense
_BALANCED = 1e-5
# the first shift, below zero, as a share of a smooth motion's squared frequency, and how it grows until the shifted
# matrix is positive definite: as far as needed where the equilibrium is unstable
_SHIFT, _GROWTH, _SHIFTS = 1e-3, 30.0, 8
# squared frequency, of that of the same motion, below which a motion is a rigid one
_RIGID = 1e-9


@dataclass(frozen=True, eq=False)
class SolidModes:
    """Undamped motions ``shape * cos(2 pi frequency t)`` about an equilibrium, slowest first.

    Attributes
    ----------
    state
        The equilibrium.
    frequencies
        (c,) [Hz]; 0 for rigid motions of a free body, not a number where the equilibrium is unstable.
    squares
        Squared angular frequencies, (c,) [1/s^2]; negative where the motion grows.
    shapes
        Displacement of the nodes, (c, 3, n) [mm], with ``shape . M shape = 1 kg mm^2``.
    """

    state: SolidState
    frequencies: Array
    squares: Array
    shapes: Array


def modes(state: SolidState, densities: Mapping[str, float], count: int = 6, *, free: bool = False) -> SolidModes:
    """Natural frequencies and shapes of a body about one of its equilibria.

    Parameters
    ----------
    state
        An equilibrium: a state of a solution, or the undeformed body without load.
    densities
        Mass per reference volume of every region [kg/mm^3].
    count
        Modes wanted.
    free
        Let go of all supports but foundations: a body that floats, whose first six motions are rigid.

    Raises
    ------
    ModelError
        Parts that slide on each other, a state out of balance, laws or loads without a potential, more modes than the
        body has.

    Notes
    -----
    ``K u = w^2 M u`` with the tangent at the state and the consistent mass matrix, by Lanczos' method on the inverse of
    ``K - shift M`` with a shift below all eigenvalues; its error falls with the fourth power of the element size in
    smooth problems, from above. Loads and tension are held as they are. Incompressible bodies keep their volume.
    """
    system, mesh = state.model.system, state.model.mesh
    if not isinstance(count, int | np.integer) or count < 1:
        raise ModelError(f"count: found {count!r}, expected at least 1")
    if state.model.sliding is not None:
        raise ModelError("modes: found parts that slide on each other, expected all parts bonded")
    if not system.symmetric:
        raise ModelError("modes: found a law or a pressure without a potential, expected all forces to have one")
    _refuse_unbalanced(state, free)
    M = mass_matrix(system, mesh, densities)
    K = _stiffness(state)
    held: Ints = np.zeros(0, dtype=np.int64) if free else system.held.dofs
    if not free:
        system.block(K)
        M[system.blocked] = 0.0
    n_moving = system.n_dofs - system.n_pressures - len(held)
    if count >= n_moving - system.n_pressures:
        raise ModelError(f"count: found {count}, expected less than the {n_moving - system.n_pressures} free motions")
    smooth = _smooth_square(system, K, M, held)
    shift, shifted, solver = _shifted(state, K, M, smooth)
    n = system.n_dofs

    def mass(x: Array) -> Array:
        return product(system.pattern, M, x)

    def inverse(b: Array) -> Array:
        return solver.solve(shifted, b, 1e-12)

    one: Any = LinearOperator((n, n), matvec=lambda x: product(system.pattern, K, x), dtype=float)  # type: ignore[call-arg]
    two: Any = LinearOperator((n, n), matvec=mass, dtype=float)  # type: ignore[call-arg]
    three: Any = LinearOperator((n, n), matvec=inverse, dtype=float)  # type: ignore[call-arg]
    start = inverse(mass(np.random.default_rng(1729).normal(size=n)))
    found: Any = eigsh(one, k=int(count), M=two, sigma=shift, OPinv=three, which="LM", v0=start)
    order = np.argsort(found[0])
    squares, vectors = found[0][order], found[1][:, order]
    shapes = np.empty((count, 3, system.space.n_nodes))
    for k in range(count):
        x = vectors[:, k] / np.sqrt(vectors[:, k] @ mass(vectors[:, k]))
        shapes[k] = system.parts(x)[0].T
    rigid = np.abs(squares) <= _RIGID * smooth
    unstable = ~rigid & (squares < 0.0)
    frequencies = np.sqrt(np.where(rigid | unstable, 0.0, squares)) / (2.0 * np.pi)
    return SolidModes(state, np.where(unstable, np.nan, frequencies), squares, shapes)


def _refuse_unbalanced(state: SolidState, free: bool) -> None:
    """Forces at the free unknowns must balance; those of supports too where these are let go."""
    system = state.model.system
    f_ext = system.external_force(np.ascontiguousarray(state.u.T), state.step)
    points = state.points
    force, magnitude = system.internal_force(points)
    r = system.residual(points, force, f_ext)
    if not free:
        r[system.held.dofs] = 0.0
    scale = max(float(np.linalg.norm(magnitude)), float(np.linalg.norm(f_ext)))
    found = float(np.linalg.norm(r))
    if found > max(_BALANCED * scale, 1e3 * system.rounding_force):
        what = "forces of the supports that are let go" if free else "forces"
        raise ModelError(f"modes: found {what} out of balance by {found / scale:.2g} of their size, expected balance")


def _stiffness(state: SolidState) -> Array:
    """Upper triangle of the tangent at a state."""
    system = state.model.system
    points = system.points(state.F, state.step, state.pressure)
    return system.matrix(points, points.S, np.ascontiguousarray(state.u.T), state.step)


def _smooth_square(system: System, K: Array, M: Array, held: Ints) -> float:
    """Rayleigh quotient of a smooth motion [1/s^2]: a scale of squared frequencies."""
    X = system.space.points.T
    size = np.ptp(X, axis=0).max()
    motion = np.zeros(system.n_dofs)
    motion[: X.size] = system.to_local(np.sin(np.pi * X[:, ::-1] / size)).ravel()
    motion[held] = 0.0
    return float(motion @ product(system.pattern, K, motion) / (motion @ product(system.pattern, M, motion)))


def _shifted(state: SolidState, K: Array, M: Array, smooth: float) -> tuple[float, Array, LinearSolver]:
    """A shift below all eigenvalues, ``K - shift M``, and the solver that holds its factor."""
    solver = direct_solver(state.model)
    shift = -_SHIFT * abs(smooth)
    for _ in range(_SHIFTS):
        shifted = K - shift * M
        try:
            solver.factor(shifted)
            return shift, shifted, solver
        except NotPositiveDefiniteError:
            shift *= _GROWTH
    raise ModelError("modes: found no shift that makes the stiffness positive definite, expected a body with stiffness")

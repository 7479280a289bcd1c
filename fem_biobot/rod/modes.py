"""Small free motions of an assembly about an equilibrium: natural frequencies and shapes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_matrix, csr_matrix
from scipy.sparse.linalg import LinearOperator, eigsh

from fem_biobot.errors import ModelError
from fem_biobot.rod.arrays import Assembly
from fem_biobot.rod.balance import Conditions, Forces, of_state, out_of_balance, tangent
from fem_biobot.rod.free import free_motions
from fem_biobot.rod.load_path import first_multipliers
from fem_biobot.rod.model import RodModel, RodState, refuse_touches
from fem_biobot.rod.newton import Counts, Problem
from fem_biobot.rod.sparse import Factors, Pattern, SingularError, negative_motions, pattern

Array = NDArray[np.float64]

# unknowns above which eigenvalues are found by Lanczos
_DENSE = 600
# largest force out of balance, of the largest force, about which modes make sense
_BALANCED = 1e-5
_SYMMETRIC = 1e-7
_SHIFTS = 5
# shift beyond which only parts without mass can be unstable, over the highest squared frequency of a node
_HIGHEST = 1e3


@dataclass(frozen=True, eq=False)
class Modes:
    """Undamped motions ``shape * cos(2 pi frequency t)`` about an equilibrium, slowest first.

    Attributes
    ----------
    state
        The equilibrium.
    frequencies
        (c,) [Hz]; 0 for rigid motions of a free model, not a number where the equilibrium is unstable.
    squares
        Squared angular frequencies (c,) [1/s^2], negative where the motion grows.
    shapes
        Displacement and spatial rotation of the nodes, (c, n, 6) [mm, rad], with the kinetic energy of unit mass:
        ``shape . M shape = 1 kg`` (mm^2).
    """

    state: RodState
    frequencies: Array
    squares: Array
    shapes: Array


def modes(model: RodModel, at: RodState | None = None, count: int = 6) -> Modes:
    """Natural frequencies and shapes about an equilibrium.

    Parameters
    ----------
    model
        What moves. Nodes without mass follow without inertia.
    at
        An equilibrium of it, with the drive, load factors and multipliers that hold there, as `statics` returns; by
        default the drawn state, which must be in equilibrium under the loads at factor 1.
    count
        Modes wanted; fewer are returned where the model has fewer.

    Returns
    -------
    Modes
        Slowest first: unstable ones, then rigid motions (exactly 0), then the others.

    Raises
    ------
    ModelError
        A state out of balance, loads without an energy, a part without mass that nothing holds.

    Notes
    -----
    The tangent by spatial turns is ``K - K^T = -[m]x`` for the moment `m` that acts on a node, so it is symmetric where
    nodes are in balance and every load has an energy; loads that follow, and moments of fixed axis, have none.
    Solved as ``M u = K u / w^2`` through the joints' constraints, so that mass may be singular. Masses are lumped;
    order in element length: `Discretisation`.
    """
    if not isinstance(count, int | np.integer) or count < 1:
        raise ModelError(f"count: found {count!r}, expected at least 1")
    refuse_touches("modes", model)
    if at is not None and at.model is not model:
        raise ModelError("at: found a state of another model, expected one of this model")
    state = _drawn(model) if at is None else at
    given, point = of_state(state)
    unknowns = pattern(given.assembly, model.system)
    forces = out_of_balance(model, given, point)
    _refuse_unbalanced(unknowns, given, forces)
    matrix = unknowns.matrix(*tangent(model, given, point, forces.s, forces.tension, forces.lengths))
    skew = abs(matrix - matrix.T)
    if skew.max() > _SYMMETRIC * abs(matrix).max():
        raise ModelError(
            "at: found loads that follow or moments of fixed axis, which have no energy, expected conservative loads"
        )
    matrix = (0.5 * (matrix + matrix.T)).tocsc()
    root, rank = _root_of_mass(given.assembly, point.Q, unknowns)
    if rank == 0:
        raise ModelError("model: found no mass that can move, expected some")
    rigid = len(free_motions(model, given, point, unknowns)[0])
    squares, vectors = _slowest(matrix, (root, rank), unknowns, min(count + rigid, rank), rigid)
    order = np.argsort(squares)
    squares, vectors = squares[order][:count], vectors[:, order][:, :count]
    zero = np.argsort(np.abs(squares))[:rigid]
    reference = np.abs(np.delete(squares, zero)).min(initial=np.inf)
    squares[zero[np.abs(squares[zero]) < 1e-4 * reference]] = 0.0
    shapes = np.array([unknowns.scatter(v)[0] for v in vectors.T]).reshape(len(squares), model.n_nodes, 6)
    with np.errstate(invalid="ignore"):
        frequencies = np.sqrt(squares) / (2.0 * np.pi)
    return Modes(state, frequencies, squares, shapes)


def _drawn(model: RodModel) -> RodState:
    state = model.drawn()
    joints = len(model.assembly.constraints.rows)
    given, point = of_state(state)
    # what joints must bear for the drawn state to be in balance
    problem = Problem(model, pattern(given.assembly, model.system), 0.0, 0, lambda kind, values: None, Counts())
    return replace(state, multiplier=first_multipliers(problem, given, point).reshape(joints, 6))


def _refuse_unbalanced(unknowns: Pattern, given: Conditions, forces: Forces) -> None:
    nodes, _ = unknowns.scatter(unknowns.gather(forces.force, np.zeros_like(forces.value)))
    left = float(np.abs(nodes / np.array([1.0, 1.0, 1.0, *[given.extent] * 3])).max(initial=0.0))
    if left > max(_BALANCED * forces.scale, forces.floor):
        raise ModelError(
            f"at: found {left:.3g} mN out of balance, expected an equilibrium (from `statics`) with its drive and loads"
        )


def _root_of_mass(assembly: Assembly, Q: Array, unknowns: Pattern) -> tuple[csr_matrix, int]:
    """A matrix B with ``B^T B`` the mass, (rank, size), and its rank; a row for each direction that has mass."""
    rows, columns, values = [], [], []
    count = 0
    for i, (mass, J) in enumerate(zip(assembly.inertia.mass, assembly.inertia.J, strict=True)):
        numbers = unknowns.index[i]
        if numbers[0] < 0:
            continue
        moments, axes = np.linalg.eigh(J)
        parts = [(mass, np.eye(6)[c]) for c in range(3)]
        parts += [(m, np.concatenate([np.zeros(3), a @ Q[i]])) for m, a in zip(moments, axes.T, strict=True)]
        for size, direction in parts:
            if size > (0.0 if size is mass else 1e-14 * max(moments.max(), 0.0)):
                rows += [count] * 6
                columns += numbers.tolist()
                values += (np.sqrt(size) * direction).tolist()
                count += 1
    return csr_matrix((values, (rows, columns)), shape=(count, unknowns.size)), count


def _slowest(
    matrix: csc_matrix, roots: tuple[csr_matrix, int], unknowns: Pattern, count: int, rigid: int
) -> tuple[Array, Array]:
    """Squared frequencies (c,) and normalised vectors (size, c), those nearest to zero or below it."""
    root, rank = roots
    mass = (root.T @ root).tocsc()
    shift = 0.0
    squares, vectors = np.zeros(0), np.zeros((unknowns.size, 0))
    if rigid or _negative(matrix, unknowns):
        weights = mass.diagonal()
        shift = 1e-6 * float(np.max(np.abs(matrix.diagonal()[weights > 0.0]) / weights[weights > 0.0], initial=0.0))
        shift = shift if shift > 0.0 else 1.0
    for _ in range(_SHIFTS):
        factors = _positive(matrix, mass, shift, unknowns)
        squares, vectors = _largest(factors[0], root, rank, count)
        squares = 1.0 / squares - factors[1]
        if shift == 0.0:
            break
        # a shift near the first square that is not zero loses the fewest digits
        wanted = float(np.sort(np.abs(squares))[min(rigid, len(squares) - 1)])
        if factors[1] < 30.0 * wanted or not wanted > 0.0:
            break
        shift = wanted
    return squares, vectors


def _negative(matrix: csc_matrix, unknowns: Pattern) -> bool:
    try:
        return negative_motions(matrix, unknowns.joint) > 0
    except SingularError:
        return True


def _positive(matrix: csc_matrix, mass: csc_matrix, shift: float, unknowns: Pattern) -> tuple[Factors, float]:
    """Factors of ``K + shift M`` with the shift raised until it is positive on what joints allow, and that shift."""
    weights = mass.diagonal()
    heavy = weights > 0.0
    stiffest = float(np.max(np.abs(matrix.diagonal()[heavy]) / weights[heavy], initial=1.0))
    while shift <= _HIGHEST * stiffest:
        shifted = (matrix + shift * mass).tocsc() if shift else matrix
        shifted.sort_indices()
        if not _negative(shifted, unknowns):
            try:
                return Factors(shifted, unknowns.joint), shift
            except SingularError:
                break
        shift = 10.0 * shift if shift else 1e-9 * stiffest
    raise ModelError("at: found a part without mass that nothing holds in place, expected mass or stiffness there")


def _largest(factors: Factors, root: csr_matrix, rank: int, count: int) -> tuple[Array, Array]:
    """Largest eigenvalues of ``B A^-1 B^T`` (c,), and ``A^-1 B^T y`` of unit mass (size, c)."""
    if rank <= _DENSE or count > rank // 4:
        answers = factors.solve(root.T.toarray())
        T = root @ answers
        values, y = np.linalg.eigh(0.5 * (T + T.T))
        values, y = values[::-1][:count], y[:, ::-1][:, :count]
    else:

        def applied(b: Array) -> Array:
            return root @ factors.solve(root.T @ b)

        operator = LinearOperator((rank, rank), matvec=applied, dtype=float)  # type: ignore[call-arg]
        begin = np.cos(1.7 * np.arange(rank) ** 1.1)
        found: Any = eigsh(operator, k=min(count + 2, rank - 1), which="LA", v0=begin)
        values, y = found
        values, y = values[::-1][:count], y[:, ::-1][:, :count]
    # joints leave fewer motions than masses
    real = values > 1e-14 * values[0]
    values, y = values[real], y[:, real]
    return values, factors.solve(root.T @ y) / values

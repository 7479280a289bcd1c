"""Values of held unknowns as functions of the step: displacements scale with their factor, rotations turn by it."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy import sparse

from fem_biobot.errors import ModelError
from fem_biobot.solid.records import Array, Rotate, Step, load_factor
from fem_biobot.solid.space import Ints

# gap between what two supports ask of a node, as a share of the body's size, that counts as rounding
_SAME = 1e-9
# shares of the way at which supports of one body are asked whether they agree, none of them special
_ASKED = (1.0, 0.37, 0.71)


@dataclass(frozen=True)
class Mover:
    """What one support asks along its rows.

    Attributes
    ----------
    name
        Name of the factor that drives it.
    rows
        Its rows among those of all supports, (k,).
    values
        Displacement at factor 1 along each, (k,) [mm]; of a rotation not used.
    rotation, X, directions
        A rotation, and the reference position and direction of each of its rows, (3, k).
    """

    name: str
    rows: Ints
    values: Array
    rotation: Rotate | None = None
    X: Array = field(default_factory=lambda: np.zeros((3, 0)))
    directions: Array = field(default_factory=lambda: np.zeros((3, 0)))

    def at(self, factor: float) -> Array:
        """Displacement along each row at a factor, (k,) [mm]."""
        if self.rotation is None:
            return factor * self.values
        return np.einsum("ik,ik->k", self.directions, self.rotation.displacement(self.X, factor))

    @property
    def moves(self) -> bool:
        """Whether it asks for any displacement at all."""
        return self.rotation is not None or bool(np.any(self.values))


@dataclass(frozen=True)
class Prescribed:
    """Values of all held unknowns.

    Attributes
    ----------
    movers
        What each support asks.
    combine
        From the rows of all supports to the held unknowns, (held, rows).
    contradiction
        What is left of the rows when these are given, (rows, rows); zero where supports agree.
    X
        Reference position of the node of each row, (3, rows) [mm].
    size
        Size of the body [mm].
    """

    movers: tuple[Mover, ...]
    combine: sparse.csr_matrix
    contradiction: sparse.csr_matrix
    X: Array
    size: float

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names by which prescribed displacements other than zero are driven."""
        return tuple(dict.fromkeys(m.name for m in self.movers if m.moves and m.name))

    @property
    def rotations(self) -> tuple[tuple[str, float], ...]:
        """Name and angle [rad] of every rotation."""
        return tuple((m.name, m.rotation.angle) for m in self.movers if m.rotation is not None)

    def at(self, step: float | Step) -> Array:
        """Displacement along each held unknown at a step, (held,) [mm]; refuses supports that contradict each other."""
        asked = np.zeros(self.X.shape[1])
        for mover in self.movers:
            asked[mover.rows] = mover.at(load_factor(step, mover.name))
        gap = np.abs(np.asarray(self.contradiction @ asked))
        if gap.size and gap.max() > _SAME * self.size:
            x, y, z = self.X[:, int(np.argmax(gap))]
            when = f", {step.told()}" if isinstance(step, Step) else ""
            raise ModelError(
                f"supports: found contradicting displacements at ({x:.4g}, {y:.4g}, {z:.4g}) mm{when}, "
                "expected one value"
            )
        return np.asarray(self.combine @ asked)

    def checked(self) -> Prescribed:
        """The same, refused where supports contradict each other on the way to load factor 1."""
        for factor in _ASKED:
            self.at(factor)
        return self

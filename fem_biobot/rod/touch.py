"""Parts that touch each other: the record of a round rod that stays outside another round part."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fem_biobot.errors import ModelError
from fem_biobot.rod.records import Place, Vector, _number, _set, vector


@dataclass(frozen=True)
class Touch:
    """Nodes of a rod stay outside the round surface about a chain of straight segments, and rub on it.

    Parameters
    ----------
    rod
        Name of the rod whose nodes touch: the softer or finer one of the two.
    against
        Name of the other rod, whose nodes are the chain; or the chain's places, two or more, on any rods or bodies.
    nodes
        Numbers of the nodes that touch; all by default.
    distance
        Between the axes where the surfaces meet [mm]; by default the sum of both radii, each the largest of its rod.
    friction
        Coulomb's coefficient between the surfaces [1].
    endless
        Whether the chain's first and last segment go on beyond its ends.
    along
        Direction of the world, (3,), in which the surface goes on: the chain is a wall. Distances count across it, and
        the wall is pushed at the level of its chain, wherever the node is.

    Notes
    -----
    A unilateral constraint of dynamics, not a penalty: surfaces do not interpenetrate at the nodes, however hard they
    are pressed. They touch on the line between the node and the nearest point of the chain, so that friction turns both
    parts. Between its nodes a rod may cut a corner of the chain: by less than ``l^2 / (8 d)`` for elements of length
    ``l`` at the distance ``d``. With `along`, the couple of the two forces at their two levels is left out. Sections
    keep their shape. Statics and modes do not know of touches and refuse a model that has any.
    """

    rod: str
    against: str | Sequence[Place]
    nodes: Sequence[int] | None = None
    distance: float | None = None
    friction: float = 0.0
    endless: bool = False
    along: Vector | None = None

    def __post_init__(self) -> None:
        if self.distance is not None:
            _number(f"touch of {self.rod}: distance", self.distance, 0.0, open_low=True)
        _number(f"touch of {self.rod}: friction", self.friction, 0.0)
        if self.along is not None and not np.linalg.norm(vector(f"touch of {self.rod}: along", self.along)) > 0.0:
            raise ModelError(f"touch of {self.rod}: along: found {self.along}, expected a direction")
        if not isinstance(self.against, str):
            if len(self.against) < 2:
                raise ModelError(f"touch of {self.rod}: against: found {len(self.against)} places, expected at least 2")
            _set(self, against=tuple(self.against))
        if self.nodes is not None:
            _set(self, nodes=tuple(self.nodes))

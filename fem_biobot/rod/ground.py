"""Where a ground touches an assembly: contact points.

The ground itself is `friction.ground.Ground`. Units: mm.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from fem_biobot.errors import ModelError
from fem_biobot.friction.ground import Ground
from fem_biobot.rod.records import Place, Vector, _number, _set, vector

__all__ = ["ContactPoints", "Ground"]


@dataclass(frozen=True, eq=False)
class ContactPoints:
    """Points of a part that the ground stops.

    Parameters
    ----------
    part
        Name of a body, or a place on a rod to whose node they are fixed.
    points
        As drawn, (c, 3) [mm].
    radius
        A round surface of this radius about each point [mm]: the part touches below it, and rolls.
    axis
        Direction in which the round surface extends: a cylinder; a sphere by default.
    acts_at
        As drawn, (3,) [mm]: the point of the part on which the ground's force acts and whose motion friction sees,
        though it is the points that the ground stops; by default they themselves. A device that leaves out the force's
        moment, and does work in turning.
    """

    part: str | Place
    points: Any
    radius: float = 0.0
    axis: Vector | None = None
    acts_at: Vector | None = None

    def __post_init__(self) -> None:
        points = np.atleast_2d(np.array(self.points, dtype=float))
        if points.ndim != 2 or points.shape[1] != 3 or not np.isfinite(points).all():
            raise ModelError(f"contact points: found shape {points.shape}, expected (c, 3) of finite numbers")
        _number("contact points: radius", self.radius, 0.0)
        if self.axis is not None and not np.linalg.norm(vector("contact points: axis", self.axis)) > 0.0:
            raise ModelError(f"contact points: found axis {self.axis}, expected a direction")
        if self.acts_at is not None:
            vector("contact points: acts_at", self.acts_at)
        _set(self, points=points)

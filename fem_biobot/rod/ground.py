"""Where a ground touches an assembly, and the ground: contact points and a plane with Coulomb friction.

Units: mm, s; friction coefficients are pure numbers.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from fem_biobot.errors import ModelError
from fem_biobot.rod.records import Array, Place, Vector, _number, _set, vector


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


@dataclass(frozen=True)
class Ground:
    """A plane that stops contact points, with set-valued Coulomb friction.

    Parameters
    ----------
    static_friction, kinetic_friction
        Coefficient of a point that sticks and of one that slips [1]; kinetic at most static.
    reverse_static_friction, reverse_kinetic_friction
        For slip against `forward` [1]; by default the same.
    height, normal
        A point of the plane is ``height * normal`` [mm]; the unit normal points to the side of the machine.
    forward
        First direction in the plane, (3,).
    velocity
        Velocity of the surface, (3,) [mm/s]: a belt.
    """

    static_friction: float = 0.42
    kinetic_friction: float | None = None
    reverse_static_friction: float | None = None
    reverse_kinetic_friction: float | None = None
    height: float = 0.0
    normal: Vector = (0.0, 0.0, 1.0)
    forward: Vector = (1.0, 0.0, 0.0)
    velocity: Vector = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        static = _number("ground: static_friction", self.static_friction, 0.0)
        kinetic = static if self.kinetic_friction is None else self.kinetic_friction
        back = static if self.reverse_static_friction is None else self.reverse_static_friction
        slide = min(kinetic, back) if self.reverse_kinetic_friction is None else self.reverse_kinetic_friction
        _set(self, kinetic_friction=kinetic, reverse_static_friction=back, reverse_kinetic_friction=slide)
        for key in ("kinetic_friction", "reverse_static_friction", "reverse_kinetic_friction"):
            _number(f"ground: {key}", getattr(self, key), 0.0)
        if kinetic > static or slide > back:
            raise ModelError(
                f"ground: kinetic_friction: found {max(kinetic, slide):g} above the static {min(static, back):g}, "
                "expected at most that"
            )
        if not np.isclose(np.linalg.norm(vector("ground: normal", self.normal)), 1.0, rtol=0.0, atol=1e-9):
            raise ModelError(f"ground: found normal {self.normal}, expected a unit vector")
        if np.linalg.norm(np.cross(self.normal, vector("ground: forward", self.forward))) < 1e-9:
            raise ModelError(
                f"ground: found forward {self.forward} along the normal, expected a direction in the plane"
            )

    @property
    def axes(self) -> Array:
        """Normal, forward direction in the plane, and the third, rows, (3, 3)."""
        n = np.array(self.normal, dtype=float)
        t = np.array(self.forward, dtype=float)
        t -= n * (n @ t)
        t /= np.linalg.norm(t)
        return np.array([n, t, np.cross(n, t)])

    @property
    def static_coefficients(self) -> Array:
        """Against slip along forward, against it, and to both sides, (4,) [1]."""
        back = self.reverse_static_friction
        return np.array([self.static_friction, back, self.static_friction, self.static_friction], dtype=float)

    @property
    def kinetic_coefficients(self) -> Array:
        """As `static_coefficients`, of a point that slips, (4,) [1]."""
        slide = self.kinetic_friction
        return np.array([slide, self.reverse_kinetic_friction, slide, slide], dtype=float)

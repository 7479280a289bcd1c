"""The ground that rods and solids walk on: a plane with Coulomb friction, of one description.

Units: mm, s; friction coefficients are pure numbers.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem_biobot.errors import ModelError

Array = NDArray[np.float64]
Vector = tuple[float, float, float]


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
        static = _coefficient("static_friction", self.static_friction)
        kinetic = static if self.kinetic_friction is None else self.kinetic_friction
        back = static if self.reverse_static_friction is None else self.reverse_static_friction
        slide = min(kinetic, back) if self.reverse_kinetic_friction is None else self.reverse_kinetic_friction
        given = {"kinetic_friction": kinetic, "reverse_static_friction": back, "reverse_kinetic_friction": slide}
        for key, value in given.items():
            _coefficient(key, value)
            object.__setattr__(self, key, value)
        if kinetic > static or slide > back:
            raise ModelError(
                f"ground: kinetic_friction: found {max(kinetic, slide):g} above the static {min(static, back):g}, "
                "expected at most that"
            )
        if not np.isclose(np.linalg.norm(_vector("normal", self.normal)), 1.0, rtol=0.0, atol=1e-9):
            raise ModelError(f"ground: found normal {self.normal}, expected a unit vector")
        if np.linalg.norm(np.cross(self.normal, _vector("forward", self.forward))) < 1e-9:
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


def _coefficient(key: str, value: Any) -> float:
    good = isinstance(value, int | float | np.floating | np.integer) and not isinstance(value, bool)
    if not good or not np.isfinite(value) or value < 0.0:
        raise ModelError(f"ground: {key}: found {value!r}, expected a finite number of at least 0")
    return float(value)


def _vector(key: str, value: Any) -> Array:
    try:
        found = np.array(value, dtype=float)
    except (TypeError, ValueError):
        found = np.array([])
    if found.shape != (3,) or not np.isfinite(found).all():
        raise ModelError(f"ground: {key}: found {value!r}, expected three finite numbers")
    return found

"""Drag against rest that knows no direction: the record."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from fem_biobot.errors import ModelError
from fem_biobot.rod.records import _number, _set


@dataclass(frozen=True)
class LinearDrag:
    """Force and moment against the motion of rods in the world, alike in all directions, among the loads of a model.

    Parameters
    ----------
    rods
        Names of the rods.
    force
        Per reference length and velocity [kPa s]: ``f = -force v``.
    moment
        Per reference length and angular velocity [mN s]: ``m = -moment omega``.

    Notes
    -----
    A numerical device (mass-proportional damping of a kind), no medium: rigid motion is damped, too. `Drag` is a
    medium's. Lumped at the nodes like mass.
    """

    rods: Sequence[str]
    force: float
    moment: float = 0.0

    def __post_init__(self) -> None:
        for key in ("force", "moment"):
            _number(f"linear drag: {key}", getattr(self, key), 0.0)
        if isinstance(self.rods, str) or not all(isinstance(name, str) for name in self.rods):
            raise ModelError(f"linear drag: rods: found {self.rods!r}, expected a sequence of names")
        _set(self, rods=tuple(self.rods))

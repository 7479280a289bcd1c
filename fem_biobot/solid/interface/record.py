"""How two parts of a body that are not bonded touch: the record that a model is given."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fem_biobot.errors import ModelError
from fem_biobot.mesh.unbonded import BEARING, BODY
from fem_biobot.solid.records import Vector, numbers


@dataclass(frozen=True)
class Sliding:
    """Unilateral contact of two surfaces with Coulomb friction, which may slide along each other without limit.

    Parameters
    ----------
    bearing, body
        Names of the surfaces: the one whose normals and multipliers carry the contact, best the stiffer one with the
        edges, and the one that lies against it.
    friction
        Kinetic coefficient, which is the static one too [1].
    axial_friction
        That against slip along `axis` [1]; by default the same in all directions.
    axis
        Along the bearing surface's generators; where the surface is normal to it, any direction in it is taken.

    Notes
    -----
    Traction is per reference area of the bearing surface, linear on its facets and independent on both sides of an
    edge sharper than 30 degrees. Gap and slip obey the law in the mean over each multiplier's share of the surface, so
    pressures do not oscillate; single points may overlap or gape within a facet, most at edges, and less the
    shorter facets are there.
    """

    bearing: str = BEARING
    body: str = BODY
    friction: float = 0.0
    axial_friction: float | None = None
    axis: Vector = (0.0, 0.0, 1.0)

    def __post_init__(self) -> None:
        for key in ("friction", "axial_friction"):
            value = getattr(self, key)
            if value is None and key == "axial_friction":
                continue
            if float(numbers(value, key, "a finite number of at least 0")) < 0.0:
                raise ModelError(f"{key}: found {value!r}, expected a finite number of at least 0")
        found = numbers(self.axis, "axis", "a direction of three finite numbers")
        if found.shape != (3,) or not np.linalg.norm(found) > 0.0:
            raise ModelError(f"axis: found {self.axis!r}, expected a direction of three finite numbers")

    @property
    def radii(self) -> tuple[float, float]:
        """Friction around the bearing body and along its axis [1]."""
        return float(self.friction), float(self.friction if self.axial_friction is None else self.axial_friction)

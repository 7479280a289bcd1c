"""How stimulated tension depends on how fast the fibre's length changes: Hill's hyperbola, and one for lengthening.

Off unless it is asked for. It acts where there is time; a state at rest has its isometric tension.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fem_biobot.errors import ModelError
from fem_biobot.material.law import Array

# lengthening over the fastest shortening beyond which the share grows no more
_CUT = 3.0


@dataclass(frozen=True)
class ForceVelocity:
    """Share ``g`` of the stimulated tension at a rate of fibre stretch.

    Parameters
    ----------
    fastest
        Unloaded shortening, in lengths of the reference body a second, above 0 [1/s].
    curvature
        Hill's ``a / F0 = b / v_max``, above 0 [1]; the smaller, the more curved.
    eccentric
        Bound of the share in lengthening, above 1 [1].

    Notes
    -----
    With ``y = rate / fastest``, in shortening the hyperbola of A. V. Hill (1938, Proc. R. Soc. Lond. B 126, 136),
    ``g = (1 + y) / (1 - y / curvature)`` and 0 from ``y = -1`` on; in lengthening
    ``g = 1 + (eccentric - 1) y / (y + c)``, ``c = (eccentric - 1) curvature / (1 + curvature)``, which leaves the other
    with the same slope (measured slopes change there by up to 6, Katz 1939, which is left out), cut off at ``y = 3``.

    The defaults of `curvature` (0.25, Hill's frogs) and `eccentric` (1.4) are those of D. G. Thelen (2003, J. Biomech.
    Eng. 125, 70) for native human muscle: assumptions for engineered tissue, for which no curve was at hand.
    """

    fastest: float
    curvature: float = 0.25
    eccentric: float = 1.4

    def __post_init__(self) -> None:
        for key, low in (("fastest", 0.0), ("curvature", 0.0), ("eccentric", 1.0)):
            value = getattr(self, key)
            good = isinstance(value, int | float | np.floating | np.integer) and not isinstance(value, bool)
            if not good or not np.isfinite(value) or not value > low:
                raise ModelError(f"force_velocity.{key}: found {value!r}, expected a number above {low:g}")

    @property
    def _c(self) -> float:
        return (self.eccentric - 1.0) * self.curvature / (1.0 + self.curvature)

    def __call__(self, rate: Array | float) -> Array:
        """Share of the isometric tension at a rate of stretch [1/s], (...) [1]."""
        y = np.clip(np.asarray(rate, dtype=float) / self.fastest, -1.0, _CUT)
        slow, fast = np.minimum(y, 0.0), np.maximum(y, 0.0)
        return (1.0 + slow) / (1.0 - slow / self.curvature) + (self.eccentric - 1.0) * fast / (fast + self._c)

    def slope(self, rate: Array | float) -> Array:
        """Its derivative by the rate, (...) [s]; 0 where nothing changes any more."""
        y = np.asarray(rate, dtype=float) / self.fastest
        slow, fast = np.clip(y, -1.0, 0.0), np.clip(y, 0.0, _CUT)
        shortening = (1.0 + 1.0 / self.curvature) / (1.0 - slow / self.curvature) ** 2
        lengthening = (self.eccentric - 1.0) * self._c / (fast + self._c) ** 2
        found = np.where(y > 0.0, lengthening, shortening) / self.fastest
        return np.where((y < -1.0) | (y > _CUT), 0.0, found)

    @property
    def plateau(self) -> float:
        """Largest share, that of all lengthening from three times `fastest` on [1]."""
        return float(self(_CUT * self.fastest))

    @property
    def strongest(self) -> float:
        """Rate at which shortening gives most power, negative [1/s]: ``(k - sqrt(k^2 + k)) fastest``."""
        k = self.curvature
        return self.fastest * (k - float(np.sqrt(k * k + k)))

    def rate_at(self, share: float) -> float:
        """Rate at which a load of this share of the isometric tension moves [1/s]: the inverse of the curve."""
        if not 0.0 <= share < self.plateau:
            raise ModelError(f"force_velocity: share: found {share!r}, expected from 0 to below {self.plateau:.4g}")
        if share <= 1.0:
            return -self.fastest * (1.0 - share) / (1.0 + share / self.curvature)
        return self.fastest * self._c * (share - 1.0) / (self.eccentric - share)


class Straining(NamedTuple):
    """How a body is strained over a step of time, or at an instant: what the rate of a fibre's stretch follows from.

    Attributes
    ----------
    strain
        Green-Lagrange strain at the beginning, packed as in `material.law.PAIRS`, shears doubled, (6, ...) [1].
    rate
        Its change over the step per time, (6, ...) [1/s].
    time
        Length of the step [s]; 0 for an instant.
    share
        How far into the step the strain lies at which laws are evaluated [1]: moduli are derivatives by that strain.
    """

    strain: Array
    rate: Array
    time: float
    share: float = 1.0

    def at(self, elements: np.ndarray) -> Straining:
        """Of these elements only, (k,)."""
        return self._replace(strain=self.strain[:, elements], rate=self.rate[:, elements])

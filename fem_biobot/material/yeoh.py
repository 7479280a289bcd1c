"""Yeoh's cubic."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fem_biobot.errors import ModelError
from fem_biobot.material.invariants import Scalars
from fem_biobot.material.isochoric import Isochoric, parameter
from fem_biobot.material.law import Array


@dataclass(frozen=True)
class Yeoh(Isochoric):
    """Yeoh, ``mu/2 x + c2 x^2 + c3 x^3 + bulk/4 (J^2 - 1 - 2 ln J)`` with ``x = J^(-2/3) I1 - 3``.

    Parameters
    ----------
    young, poisson
        Small-strain Young's modulus [kPa] and Poisson's ratio [1], at least 0 and at most 0.5.
    c2, c3
        Second and third coefficient [kPa]; without them the law is neo-Hooke. No values for gels are known well enough
        to be defaults. `c2` may be negative (softening before stiffening) while ``dW/dx`` stays positive.

    Notes
    -----
    Yeoh (1993). Refused where ``dW/dx`` is not positive at every x.
    """

    young: float
    poisson: float
    c2: float = parameter(0.0, "kPa", -np.inf)
    c3: float = parameter(0.0, "kPa")

    def __post_init__(self) -> None:
        super().__post_init__()
        # mu/2 + 2 c2 x + 3 c3 x^2 stays positive for x >= 0
        if self.c2 < 0.0 and not self.c2**2 < 1.5 * self.mu * self.c3:
            least = -np.sqrt(1.5 * self.mu * self.c3)
            raise ModelError(
                f"c2: found {self.c2:g} kPa, expected above {least:.4g} kPa, or the law gives way in stretch"
            )

    def isochoric(self, bar: dict[int, Array]) -> Scalars:
        """Energy and derivatives by the invariants without volume."""
        c1, c2, c3 = 0.5 * self.mu, self.c2, self.c3
        x = bar[1] - 3.0
        return Scalars(
            x * (c1 + x * (c2 + x * c3)),
            {1: c1 + x * (2.0 * c2 + 3.0 * c3 * x)},
            {(1, 1): 2.0 * c2 + 6.0 * c3 * x},
        )

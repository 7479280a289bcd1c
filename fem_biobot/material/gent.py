"""Gent's law of chains of limited length."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fem_biobot.material.invariants import Scalars
from fem_biobot.material.isochoric import Isochoric, parameter
from fem_biobot.material.law import Array, OutsideLawError


@dataclass(frozen=True)
class Gent(Isochoric):
    """Gent, ``-mu/2 Jm ln(1 - x / Jm) + bulk/4 (J^2 - 1 - 2 ln J)`` with ``x = J^(-2/3) I1 - 3``.

    Parameters
    ----------
    young, poisson
        Small-strain Young's modulus [kPa] and Poisson's ratio [1], at least 0 and at most 0.5.
    chain_limit
        ``Jm``, the x at which the chains are drawn out [1]. The default of 97.2 is what is quoted for Treloar's rubber
        (Horgan and Saccomandi 2006); densely linked gels have far less, to be measured.

    Notes
    -----
    Gent (1996). A point at or beyond the limit has no energy and is refused with `OutsideLawError`, on which the solver
    takes a smaller step.
    """

    young: float
    poisson: float
    chain_limit: float = parameter(97.2, "1", low_open=True)

    def isochoric(self, bar: dict[int, Array]) -> Scalars:
        """Energy and derivatives by the invariants without volume."""
        x, limit, half = bar[1] - 3.0, self.chain_limit, 0.5 * self.mu
        largest = float(np.max(x)) if x.size else 0.0
        if not largest < limit:
            raise OutsideLawError(
                f"Gent: found J^(-2/3) I1 - 3 = {largest:.4g}, expected below chain_limit ({limit:g})",
                int(np.argmax(x)),
            )
        left = 1.0 - x / limit
        return Scalars(-half * limit * np.log(left), {1: half / left}, {(1, 1): half / (limit * left**2)})

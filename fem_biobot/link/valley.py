"""What deflections without a force determine: one number out of tension and modulus, not both.

A gel that is twice as stiff under a tension nearly twice as large deflects as before. Only the tissue's own stiffness
and the bend of the curve tell the two apart, by less than most measurements. So the tension is found for one assumed
modulus after the other: along the valley of the misfit it goes as a power c of the modulus, and ``T / E^c`` is what the
data say, however little they say of either.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm
from scipy.stats import t as student

from fem_biobot.design import Design
from fem_biobot.errors import ModelError
from fem_biobot.link.inverse import CONFIDENCE, Deflections, Estimate, estimate
from fem_biobot.link.measured import Measured
from fem_biobot.link.observed import Array

# assumed moduli over the design's
FACTORS = (0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.1, 1.25, 1.4, 1.6, 1.8, 2.0)


@dataclass(frozen=True)
class Valley:
    """Tensions that fit, by the modulus that is assumed.

    Attributes
    ----------
    names
        Tensions that were sought; the numbers below are of the first.
    young, tension
        Assumed modulus of the gel and the tension found with it, (k,) [kPa].
    misfit
        Sum of the squares of what is left over the deviation of the best, (k,) [1].
    fits
        Whether a modulus is inside the interval of 95 % of the data, (k,).
    exponent
        Power c of the modulus with which the tension goes.
    value, low, high
        ``T / (E / E0)^c`` with the design's modulus E0: the tension that this one would have, [kPa], and its interval.
    """

    names: tuple[str, ...]
    young: Array
    tension: Array
    misfit: Array
    fits: NDArray[np.bool_]
    exponent: float
    value: float
    low: float
    high: float

    @property
    def span(self) -> tuple[float, float]:
        """Least and largest of the assumed moduli that fit [kPa]."""
        inside = self.young[self.fits]
        return float(inside.min()), float(inside.max())

    @property
    def open(self) -> tuple[bool, bool]:
        """Whether the interval of the modulus goes on below the least and above the largest that were assumed."""
        return bool(self.fits[0]), bool(self.fits[-1])


def valley(design: Design, data: Measured, table: Deflections, names: Sequence[str]) -> Valley:
    """Tensions found from deflections for one modulus after the other.

    Parameters
    ----------
    design, data, table
        As in `inverse.estimate`; data without a force.
    names
        Tensions that are sought.

    Raises
    ------
    ModelError
        Data with a force, the modulus among what is sought; fewer than three moduli with which a tension is found.
    """
    if data.force is not None or "stiffness" in names:
        raise ModelError("valley: found a force or the modulus sought, expected tensions from deflections alone")
    E0 = float(design.value("skeleton.material.young"))
    found: list[tuple[float, Estimate]] = []
    refused = ""
    for factor in FACTORS:
        try:
            one = design.with_values({"skeleton.material.young": factor * E0})
            found.append((factor * E0, estimate(one, data, table, names, draws=2)))
        except ModelError as reason:
            refused = str(reason)
    if len(found) < 3 or all(abs(E / E0 - 1.0) > 1e-9 for E, _ in found):
        raise ModelError(refused)
    young, tension = np.array([E for E, _ in found]), np.array([e.value[0] for _, e in found])
    freedom = len(data.value) - len(names)
    left = np.array([_squares(data, e) for _, e in found])
    if data.deviation is not None:
        allowed = left.min() + norm.ppf(0.5 + CONFIDENCE / 2) ** 2
    else:
        allowed = left.min() * (1.0 + student.ppf(0.5 + CONFIDENCE / 2, freedom) ** 2 / freedom)
        left, allowed = left / left.min() * freedom, allowed / left.min() * freedom
    fits = left <= allowed
    # by the moduli next to the design's where no three fit
    used = fits if fits.sum() >= 3 else np.abs(np.log(young / E0)) < 0.3
    exponent = float(np.polyfit(np.log(young[used]), np.log(tension[used]), 1)[0])
    at = next(e for E, e in found if abs(E / E0 - 1.0) <= 1e-9)
    ends = float(at.value[0]), float(at.low[0]), float(at.high[0])
    return Valley(tuple(names), young, tension, left, fits, exponent, *ends)


def _squares(data: Measured, found: Estimate) -> float:
    weight = np.ones_like(data.value) if data.deviation is None else data.deviation
    return float((((found.fitted - data.value) / weight) ** 2).sum())

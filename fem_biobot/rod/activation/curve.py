"""Factors on a muscle's active tension, by stretch or by rate of stretch, as tables that compiled code reads."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from fem_biobot.errors import ModelError

Array = NDArray[np.float64]
Function = Callable[[float], float]

# knots of a table
KNOTS = 1025


@dataclass(frozen=True, eq=False)
class MuscleCurve:
    """A factor on a muscle's active tension: of its stretch [1], or of its rate of stretch [1/s].

    Any function of one number does; it is sampled once, at 1025 equal distances, and read between them as cubics with
    its values and slopes. Outside of its limits it keeps its end values.

    Parameters
    ----------
    function
        Factor, finite and at least 0 (muscle pulls).
    low, high
        Limits of the table: stretches [1], or rates of stretch [1/s], negative in shortening.
    slope
        Derivative of `function`; by default that of the monotone interpolation of its samples (Fritsch and Carlson
        1980, PCHIP), which never leaves their range: a straight piece stays straight, a corner stays one.
    name
        For messages.

    Notes
    -----
    With `slope` the error is of fourth order in the spacing, 1e-8 for the curves below; without it, of second order
    beside a maximum, about 1e-6. The table is once continuously differentiable, enough for Newton's iteration and for
    the order two of time steps.
    """

    function: Function
    low: float
    high: float
    slope: Function | None = None
    name: str = "curve"
    table: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        what = f"muscle curve {self.name}"
        for key in ("low", "high"):
            _finite(f"{what}: {key}", getattr(self, key))
        if not self.high > self.low:
            raise ModelError(f"{what}: high: found {self.high:g}, expected a number above low ({self.low:g})")
        x = np.linspace(self.low, self.high, KNOTS)
        values = self._sampled(what, self.function, x)
        if values.min() < 0.0:
            at = x[int(values.argmin())]
            raise ModelError(f"{what}: found {values.min():.3g} at {at:.6g}, expected at least 0 (muscle pulls)")
        if self.slope is None:
            slopes = np.asarray(PchipInterpolator(x, values).derivative()(x), dtype=float)
        else:
            slopes = self._sampled(f"{what}: slope", self.slope, x)
        table = np.stack([values, slopes * self.spacing], axis=1)
        table.flags.writeable = False
        object.__setattr__(self, "table", table)

    @property
    def spacing(self) -> float:
        """Between knots."""
        return (self.high - self.low) / (KNOTS - 1)

    @staticmethod
    def _sampled(what: str, function: Function, x: Array) -> Array:
        try:
            found = np.array([float(function(float(value))) for value in x])
        except (TypeError, ValueError, ArithmeticError) as error:
            raise ModelError(f"{what}: {type(error).__name__}: {error}, expected a function of one number") from None
        if not np.isfinite(found).all():
            at = x[int((~np.isfinite(found)).argmax())]
            raise ModelError(f"{what}: found no finite number at {at:.6g}, expected one between low and high")
        return found

    @classmethod
    def gaussian(cls, optimum: float = 1.0, width: float = float(np.sqrt(0.45))) -> MuscleCurve:
        """Force-length factor ``exp(-((s / optimum - 1) / width)^2)`` of the stretch s.

        A smooth reading of the plateau and flanks of Gordon, Huxley and Julian (1966), as in muscle models of Hill's
        type; the default width is that of D. G. Thelen (2003, J. Biomech. Eng. 125, 70, ``gamma = 0.45``). An
        assumption for engineered tissue, whose sarcomere lengths are not known.
        """
        optimum, width = (_positive(f"gaussian: {k}", v) for k, v in (("optimum", optimum), ("width", width)))

        def factor(s: float) -> float:
            return float(np.exp(-(((s / optimum - 1.0) / width) ** 2)))

        def slope(s: float) -> float:
            return -2.0 * (s / optimum - 1.0) / (width**2 * optimum) * factor(s)

        return cls(factor, 0.0, optimum * (1.0 + 4.0 * width), slope, "gaussian")

    @classmethod
    def hill(cls, fastest: float, curvature: float = 0.25, eccentric: float = 1.4) -> MuscleCurve:
        """Force-velocity factor of the rate of stretch ``r`` [1/s].

        Parameters
        ----------
        fastest
            Unloaded shortening velocity, in rest lengths a second [1/s].
        curvature
            Hill's ``a / F0 = b / v_max`` [1].
        eccentric
            Bound of the factor in lengthening, above 1 [1].

        Notes
        -----
        With ``u = -r / fastest``: in shortening the hyperbola of A. V. Hill (1938), ``(1 - u) / (1 + u / curvature)``,
        and 0 beyond u = 1. In lengthening the hyperbola ``1 + (eccentric - 1) y / (y + c)``, ``y = -u``, that leaves
        the other with the same slope, ``c = (eccentric - 1) curvature / (1 + curvature)``; measured slopes change by a
        factor of up to 6 there (Katz 1939). It is cut off at y = 3.
        """
        fastest, k = _positive("hill: fastest", fastest), _positive("hill: curvature", curvature)
        if not _positive("hill: eccentric", eccentric) > 1.0:
            raise ModelError(f"muscle curve hill: eccentric: found {eccentric:g}, expected a number above 1")
        c = (eccentric - 1.0) * k / (1.0 + k)

        def factor(r: float) -> float:
            y = r / fastest
            return 1.0 + (eccentric - 1.0) * y / (y + c) if y > 0.0 else (1.0 + y) / (1.0 - y / k)

        def slope(r: float) -> float:
            y = r / fastest
            of_y = (eccentric - 1.0) * c / (y + c) ** 2 if y > 0.0 else (1.0 + 1.0 / k) / (1.0 - y / k) ** 2
            return of_y / fastest

        return cls(factor, -fastest, 3.0 * fastest, slope, "hill")


def _finite(what: str, value: Any) -> float:
    good = isinstance(value, int | float | np.floating | np.integer) and not isinstance(value, bool)
    if not good or not np.isfinite(value):
        raise ModelError(f"{what}: found {value!r}, expected a finite number")
    return float(value)


def _positive(what: str, value: Any) -> float:
    if not _finite(f"muscle curve {what}", value) > 0.0:
        raise ModelError(f"muscle curve {what}: found {value:g}, expected a number above 0")
    return float(value)

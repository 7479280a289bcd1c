"""Orientation of fibres from a histogram of directions: mean, spread, moments, structure tensor, quality of the fit.

A histogram gives the share of structure by direction in a picture, counter-clockwise from the picture's right, over
half a turn. `orientation_table` and `orientation_image` make histograms; this module knows neither files nor images.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from fem_biobot.errors import DesignError
from fem_biobot.material.dispersion import Dispersion, picture_spread

Array = NDArray[np.float64]

HALF_TURN = np.pi
# below this length of the mean double-angle vector (1 for parallel fibres, 0 for none preferred) there is no direction
LEAST_RESULTANT = 0.1
LEAST_BINS = 6
# the widest spread that a design takes [rad]
WIDEST = float(np.radians(51.5))
# shares that come rounded to four digits still sum to one within this
_SUM = 2e-3


@dataclass(frozen=True, eq=False)
class Histogram:
    """Shares of structure by direction.

    Parameters
    ----------
    name
        What it is of, for messages and tables.
    angles
        Direction of each bin, counter-clockwise from the picture's right, (k,) [rad]; ascending, equally spaced, half a
        turn from the first bin to the one that would follow the last (or to the last itself, which then is the first
        once more: older tables have it so).
    shares
        Share of each bin, (k,) [1]; they sum to one.

    Raises
    ------
    DesignError
        Too few bins, unequal spacing, another range than half a turn, shares that are negative, not finite or do not
        sum to one.
    """

    name: str
    angles: Array
    shares: Array

    def __post_init__(self) -> None:
        angles, shares = (np.array(v, dtype=float) for v in (self.angles, self.shares))
        if angles.ndim != 1 or angles.shape != shares.shape or len(angles) < LEAST_BINS:
            raise DesignError(
                f"{self.name}: found {angles.size} directions and {shares.size} shares, expected at least {LEAST_BINS} "
                "of each, as many of one as of the other"
            )
        for what, values in (("direction", angles), ("share", shares)):
            if not np.all(np.isfinite(values)):
                bad = int(np.flatnonzero(~np.isfinite(values))[0])
                raise DesignError(f"{self.name}: found {what} {values[bad]} in bin {bad + 1}, expected a finite number")
        if np.any(shares < 0.0):
            bad = int(np.argmin(shares))
            raise DesignError(f"{self.name}: found share {shares[bad]:g} in bin {bad + 1}, expected 0 or more")
        _check_range(self.name, angles)
        if abs(shares.sum() - 1.0) > _SUM:
            raise DesignError(f"{self.name}: found shares that sum to {shares.sum():.6g}, expected 1")
        for name, values in (("angles", angles), ("shares", shares / shares.sum())):
            values.setflags(write=False)
            object.__setattr__(self, name, values)

    @property
    def step(self) -> float:
        """Width of a bin [rad]."""
        return float(self.angles[1] - self.angles[0])

    @property
    def weights(self) -> Array:
        """Weight of each bin in means, (k,) [1]; sums to one. Where the last bin is the first again, half of each."""
        weights = self.shares.copy()
        if len(weights) * self.step > HALF_TURN + 0.5 * self.step:
            weights[[0, -1]] *= 0.5
        return weights / weights.sum()

    @property
    def resultant(self) -> complex:
        """Mean of ``exp(2 i angle)`` [1]; half its argument is the mean direction, its length 1 for parallel fibres."""
        return complex(self.weights @ np.exp(2j * self.angles))


@dataclass(frozen=True)
class Orientation:
    """What a histogram says of the fibres.

    Attributes
    ----------
    name
        Of the histogram.
    mean, width
        Centre and standard deviation of the Gaussian fitted to the peak [rad]: the plug-in's direction and dispersion.
        The centre is counter-clockwise from the picture's right, in (-90, 90] degrees.
    spread
        Standard deviation of the angles of that Gaussian cut at 90 degrees from its centre [rad], as a design has it:
        the width itself up to 25 degrees, 33.6 degrees for a width of 35.
    base, peak
        Height of the background and of the curve at its centre [1 per bin].
    background
        Share of the structure in the background [1].
    amount
        Share within one standard deviation of the centre, background included [1]; the plug-in's.
    goodness
        ``1 - (SSE / SSD) k / (k - 4)`` of the fit over the k bins [1], ImageJ's goodness.
    circular_mean, circular_spread
        Of the whole histogram: half the argument of the mean double-angle vector, and the standard deviation of the
        angle about it, background included [rad].
    theta
        Angle of the mean direction from the machine's lateral axis [rad], 0 to 180 degrees.
    chi
        Sum of the shares times ``|sin|`` of the angle from the lateral axis [1]: the first moment of the histogram
        itself, as Eq. 1 of the paper has it, misalignment of the mean included.
    second_moment
        The same with the sine squared [1]: what a continuum projects along the machine.
    structure
        Mean dyad in the machine's plane, ((xx, xy), (xy, yy)) [1].
    fit_chi, fit_second_moment
        Both moments about the mean direction of the distribution that a design with this spread has [1]: without the
        background, and without misalignment.
    """

    name: str
    mean: float
    width: float
    spread: float
    base: float
    peak: float
    background: float
    amount: float
    goodness: float
    circular_mean: float
    circular_spread: float
    theta: float
    chi: float
    second_moment: float
    structure: tuple[tuple[float, float], tuple[float, float]]
    fit_chi: float
    fit_second_moment: float


def fitted_curve(found: Orientation, angles: Array) -> Array:
    """The fitted Gaussian with its background at directions (...) [rad]; periodic over half a turn, [1 per bin]."""
    away = _wrapped(np.asarray(angles) - found.mean)
    return found.base + (found.peak - found.base) * np.exp(-0.5 * (away / found.width) ** 2)


def orientation(histogram: Histogram, axis: float = 0.0) -> Orientation:
    """Fit of a histogram's peak, and its moments.

    Parameters
    ----------
    histogram
        Directions and shares.
    axis
        Direction of the machine's long axis x in the picture, counter-clockwise from its right [rad].

    Raises
    ------
    DesignError
        No preferred direction, or a peak as wide as none.

    Notes
    -----
    ``y = a + (b - a) exp(-(x - c)^2 / (2 d^2))`` by least squares, the highest bin moved to the middle of the range so
    that a peak at its border is whole: the form and the treatment of the period of the Directionality plug-in. Begun
    from the plug-in's start and from the spread of all shares; the lower residual counts. The Gaussian is not repeated
    beyond a quarter turn from its centre.
    """
    resultant = histogram.resultant
    if abs(resultant) < LEAST_RESULTANT:
        raise DesignError(
            f"{histogram.name}: found no preferred direction (mean double-angle vector {abs(resultant):.3f} long), "
            f"expected at least {LEAST_RESULTANT:g}; no angle is given"
        )
    base, peak, centre, width, goodness = _fit(histogram)
    spread = picture_spread("planar", width)
    if not spread <= WIDEST or not peak > base:
        raise DesignError(
            f"{histogram.name}: found a peak {np.degrees(width):.4g} deg wide, flat within half a turn, expected a "
            "narrower one; no angle is given"
        )
    weights, angles = histogram.weights, histogram.angles
    mean = float(_wrapped(np.array(centre)))
    inside = np.abs(_wrapped(angles - mean)) <= width
    circular = 0.5 * float(np.angle(resultant))
    # from the machine's x axis, counter-clockwise; theta turns the other way, from its y axis
    from_x = angles - axis
    along, across = np.cos(from_x), np.sin(from_x)
    second = float(weights @ along**2)
    shear = float(weights @ (along * across))
    dispersion = Dispersion(spread)
    return Orientation(
        name=histogram.name,
        mean=mean,
        width=width,
        spread=spread,
        base=base,
        peak=peak,
        background=float(min(1.0, max(0.0, base) * len(angles))),
        amount=float(histogram.shares[inside].sum()),
        goodness=goodness,
        circular_mean=circular,
        circular_spread=float(np.sqrt(weights @ _wrapped(angles - circular) ** 2)),
        theta=float(np.mod(0.5 * np.pi - (mean - axis), np.pi)),
        chi=float(weights @ np.abs(along)),
        second_moment=second,
        structure=((second, shear), (shear, 1.0 - second)),
        fit_chi=dispersion.first_moment,
        fit_second_moment=dispersion.second_moment,
    )


def _wrapped(angle: Array) -> Array:
    """Angles brought into (-90, 90] degrees [rad]; directions have no sense."""
    return 0.5 * np.pi - np.mod(0.5 * np.pi - angle, np.pi)


def _fit(histogram: Histogram) -> tuple[float, float, float, float, float]:
    """Base, peak, centre [rad], standard deviation [rad] and goodness of the curve."""
    angles, shares = histogram.angles, histogram.shares
    top = float(angles[np.argmax(shares)])
    x, scale = _wrapped(angles - top), float(shares.max())

    def residual(p: Array) -> Array:
        return p[0] + (p[1] - p[0]) * np.exp(-0.5 * ((x - p[2]) / p[3]) ** 2) - shares / scale

    wide = float(np.sqrt(histogram.weights @ x**2))
    starts = ([shares.min() / scale, 1.0, 0.0, 2.0 * histogram.step], [shares.min() / scale, 1.0, 0.0, wide])
    fits = [least_squares(residual, start, x_scale=[1.0, 1.0, 0.1, 0.1], xtol=1e-13, ftol=1e-13) for start in starts]
    best = min(fits, key=lambda found: found.cost)
    base, peak, centre, width = (float(v) for v in best.x)
    left = float(2.0 * best.cost)
    about_mean = float(np.sum((shares / scale - np.mean(shares) / scale) ** 2))
    freedom = max(len(x) - 4, 1)
    return base * scale, peak * scale, top + centre, abs(width), 1.0 - left / about_mean * len(x) / freedom


def _check_range(name: str, angles: Array) -> None:
    steps = np.diff(angles)
    if np.any(steps <= 0.0):
        raise DesignError(f"{name}: found directions that do not ascend, expected them in ascending order")
    if np.ptp(steps) > 1e-3 * steps.mean():
        raise DesignError(
            f"{name}: found bins between {np.degrees(steps.min()):.5g} and {np.degrees(steps.max()):.5g} deg wide, "
            "expected equal ones"
        )
    covered = (float(steps.mean()) * len(angles), float(steps.mean()) * (len(angles) - 1))
    if min(abs(c - HALF_TURN) for c in covered) > 1e-3 * HALF_TURN:
        extent = f"from {np.degrees(angles[0]):.5g} to {np.degrees(angles[-1]):.5g} deg"
        hint = " (are they in radians?)" if abs(np.degrees(covered[0]) - np.pi) < 0.1 else ""
        raise DesignError(f"{name}: found directions {extent}{hint}, expected half a turn, such as -90 to 88 deg")
    if angles[0] < -np.pi - 1e-9 or angles[-1] > 2.0 * np.pi + 1e-9:
        raise DesignError(
            f"{name}: found directions from {np.degrees(angles[0]):.5g} to {np.degrees(angles[-1]):.5g} deg, expected "
            "them between -180 and 360 deg"
        )

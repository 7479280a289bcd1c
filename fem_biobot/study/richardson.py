"""What a quantity on several meshes says of its limit: extrapolated value, error bar, observed order, and a verdict.

Knows numbers alone. After Richardson (1911) and the grid convergence index of Roache (1994), for sizes of any ratio.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from fem_biobot.errors import ModelError

Array = NDArray[np.float64]
_TINY, _LEAST_ORDER, _MOST_ORDER = 1e-6, 0.25, 6.0
# safety on the error: where differences follow an order between these, and where they do not
_SAFE, _UNSURE = 1.25, 3.0
_ORDERS = (0.5, 4.5)
# over what was asked for: changes that do not shrink, but are no larger, are scatter as well as anything else
_SMALL = 2.0
# of the first to the last of three sizes, below which the scatter of unstructured meshes hides an order
_LEAST_RATIO = 1.5


class Verdict(StrEnum):
    """What a quantity does as the mesh gets finer.

    converged
        Its error bar is within what was asked for.
    converging
        It tends to a limit, and is not there yet.
    not_converging
        Its changes do not shrink, as those of the stress at a sharp corner.
    undecided
        The meshes do not tell: they are too much alike, or its changes are small and do not shrink.
    """

    converged = "converged"
    converging = "converging"
    not_converging = "not converging"
    undecided = "undecided"


@dataclass(frozen=True)
class Limit:
    """What is known of a quantity's limit.

    Attributes
    ----------
    value
        Extrapolated to no size; that of the finest mesh where nothing can be extrapolated.
    error
        Of the finest mesh's value, a bar on both sides, relative [1]; infinite where it does not converge.
    order
        Observed, of the last three meshes, whatever is allowed; not a number where their changes follow none.
    verdict
        See `Verdict`.
    size
        At which the error would be what was asked for, by the observed order; not a number where there is none.
    """

    value: float
    error: float
    order: float
    verdict: Verdict
    size: float


def limit(
    sizes: Sequence[float],
    values: Sequence[float],
    wanted: float,
    most: float = _ORDERS[1],
    ratio: float | None = None,
) -> Limit:
    """The limit of a quantity from its values on three meshes or more.

    Parameters
    ----------
    sizes
        Of the elements, falling (m,) [mm].
    values
        Of the quantity, (m,).
    wanted
        Relative error asked for [1].
    most
        Order that errors fall with once elements are small, by what is known of the body: a larger one is that of
        meshes which are too coarse still, and is not gone on with beyond the finest [1].
    ratio
        Of the last three meshes' sizes, the first to the last, where errors arise; that of `sizes` if None [1].

    Returns
    -------
    Limit
        From the last three meshes: ``(v1 - v2) / (v2 - v3) = (h1^p - h2^p) / (h2^p - h3^p)`` for the order p.

    Raises
    ------
    ModelError
        Fewer than three, sizes that do not fall, numbers that are none.

    Notes
    -----
    The bar is ``1.25 |v3 - v2| / ((h2 / h3)^p - 1)`` for an order between 0.5 and 4.5, p being the observed order or
    `most`, whichever is less; the value, too, is extrapolated with it. Where changes alternate or the
    order lies outside, p = 1 and three times that difference are taken. Changes that do not shrink with finer meshes,
    at equal ratios of size, do not converge; where all of them are within twice the error asked for, they may as well
    be the scatter of meshes: undecided, three times all of them being the bar. Of three sizes within a factor of 1.5
    no order is read.
    """
    h, v = np.asarray(sizes, dtype=float), np.asarray(values, dtype=float)
    if h.shape != v.shape or h.ndim != 1 or len(h) < 3:
        raise ModelError(f"convergence: found {len(h)} sizes and {len(v)} values, expected three of both or more")
    if not (np.isfinite(h).all() and np.isfinite(v).all()) or np.any(np.diff(h) >= 0.0) or h[-1] <= 0.0:
        raise ModelError(f"convergence: found sizes {h.tolist()}, expected finite ones that fall")
    if not wanted > 0.0:
        raise ModelError(f"convergence: found a wanted error of {wanted:g}, expected above 0")
    scale = max(abs(v[-1]), 1e-300)
    last = v[-1] - v[-2]
    if abs(last) <= 1e-12 * scale:
        return Limit(float(v[-1]), 0.0, math.nan, Verdict.converged, math.nan)
    apart = (h[-3] / h[-1] if ratio is None else ratio) >= _LEAST_RATIO
    order = _order(h[-3:], v[-3:]) if apart else None
    if order is not None and order < _LEAST_ORDER:
        spread = float(np.ptp(v[-3:])) / scale
        if spread <= _SMALL * wanted:
            return Limit(float(v[-1]), _UNSURE * spread, order, Verdict.undecided, math.nan)
        return Limit(float(v[-1]), math.inf, order, Verdict.not_converging, math.nan)
    regular = order is not None and _ORDERS[0] <= order <= _ORDERS[1]
    p = min(order, most) if regular and order is not None else min(1.0, most)
    step = last / ((h[-2] / h[-1]) ** p - 1.0)
    error = (_SAFE if regular else _UNSURE) * abs(step) / scale
    value = float(v[-1] + step) if regular else float(v[-1])
    verdict = Verdict.converged if error <= wanted else Verdict.converging if apart else Verdict.undecided
    shown = order if order is not None else math.nan
    return Limit(value, float(error), shown, verdict, float(h[-1] * (wanted / error) ** (1.0 / p)))


def observed_order(h: Array, v: Array, low: float = _TINY, high: float = _MOST_ORDER) -> float | None:
    """Order p for which ``v = limit + c h^p`` holds on three meshes; None where none between `low` and `high` does."""

    def mismatch(p: float) -> float:
        return (v[0] - v[1]) * (h[1] ** p - h[2] ** p) - (v[1] - v[2]) * (h[0] ** p - h[1] ** p)

    if mismatch(low) * mismatch(high) > 0.0:
        return None
    root: float = brentq(mismatch, low, high)  # type: ignore[assignment]  # a number unless more is asked for
    return root


def _order(h: Array, v: Array) -> float | None:
    """Observed order; None where changes alternate, zero where they do not shrink, the most where they vanish."""
    first, last = v[1] - v[0], v[2] - v[1]
    if first * last <= 0.0:
        return None
    order = observed_order(h, v)
    if order is not None:
        return order
    steady = np.log(h[0] / h[1]) / np.log(h[1] / h[2])  # ratio of the changes of a logarithm, the limit of order zero
    return 0.0 if first / last <= steady else _MOST_ORDER

"""What a quantity on several meshes says of its limit: value, bars of the limit and of the finest mesh, order, verdict.

Knows numbers alone. After Richardson (1911), the grid convergence index of Roache (1994) and, for four meshes or more,
least squares after Eca and Hoekstra (2014), for sizes of any ratio.
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
from fem_biobot.study.fits import LEAST, MOST, Law, admitted, fitted, hull, observed

Array = NDArray[np.float64]
_TINY, _MOST_ORDER = 1e-6, 6.0
# below which changes do not shrink
LEAST_ORDER = 0.25
# safety on the error (Roache 1994): where values follow an order that errors may have, and where they do not
_SAFE, _UNSURE = 1.25, 3.0
# over what was asked for: changes that do not shrink, but are no larger, are scatter as well as anything else
_SMALL = 2.0
# of the first to the last of the sizes, below which the scatter of unstructured meshes hides an order
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
        The meshes do not tell: they are too much alike, its changes are their scatter, or small and do not shrink.
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
    bar
        Of `value`, on both sides, relative to the finest mesh's [1]; infinite where it does not converge.
    error
        Of the finest mesh's value, a bar on both sides, relative [1]; infinite where it does not converge.
    order
        Observed, of all meshes, whatever is allowed; not a number where their changes follow none.
    verdict
        Of the finest mesh's value, see `Verdict`.
    size
        At which the error would be what was asked for, by the observed order; not a number where there is none.
    finest
        Value of the finest mesh.
    scatter
        Standard deviation of the values about the law that is nearest to them, relative [1]; not a number where three
        meshes do not tell it.
    laws
        Those with the lowest and the highest limit among which it was looked for; none where nothing is extrapolated.
    """

    value: float
    bar: float
    error: float
    order: float
    verdict: Verdict
    size: float
    finest: float
    scatter: float = math.nan
    laws: tuple[Law, ...] = ()

    @property
    def off(self) -> float:
        """How far the finest mesh's value is above `value`, relative to the finest's [1]."""
        return (self.finest - self.value) / max(abs(self.finest), 1e-300)


def limit(
    sizes: Sequence[float],
    values: Sequence[float],
    wanted: float,
    theory: float = math.inf,
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
    theory
        Order that errors fall with once elements are small, by what is known of the body [1]: a larger one that is
        observed is that of meshes which are too coarse still. None is known at infinity.
    ratio
        Of the meshes' sizes, the first to the last, where errors arise; that of `sizes` if None [1].

    Returns
    -------
    Limit
        From all meshes.

    Raises
    ------
    ModelError
        Fewer than three, sizes that do not fall, numbers that are none.

    Notes
    -----
    **The limit** lies among those of the laws ``limit + c h^p`` that values and theory admit (`fits.admitted`; of three
    meshes those of the observed order and of theory's). The value is in the middle of theirs. Its bar reaches to all of
    them, each with the 95 % interval that the values' scatter about it gives, and is no less than ``F - 1`` times what
    is extrapolated beyond the finest mesh. Of the finest mesh's own value the error is what is extrapolated, and that
    bar. F = 1.25 where the values follow an order that errors may have, of three meshes from 0.5 to 4.5, and 3 where
    they follow none or a larger one (Roache 1994, Eca and Hoekstra 2014).

    Three meshes that follow no such order are not extrapolated: then the bar is three times the first order's
    ``|v3 - v2| / (h2 / h3 - 1)``.

    **Not converging** are changes that do not shrink with finer meshes, at equal ratios of size: an observed order
    below 0.25, while all of them are more than twice the error asked for. Smaller ones may as well be the meshes'
    scatter: undecided, with a bar of three times all of them, or that of the laws where four meshes or more admit any.
    Of sizes within a factor of 1.5 no order is read.

    On constructed values with scatter (five sizes, 0.1 to 0.3 %) the bar of the limit holds it in 95 of 100 draws or
    more, also where a higher power adds to theory's. Not where powers of two signs nearly cancel, which no finite
    number of meshes shows.
    """
    h, v = np.asarray(sizes, dtype=float), np.asarray(values, dtype=float)
    if h.shape != v.shape or h.ndim != 1 or len(h) < 3:
        raise ModelError(f"convergence: found {len(h)} sizes and {len(v)} values, expected three of both or more")
    if not (np.isfinite(h).all() and np.isfinite(v).all()) or np.any(np.diff(h) >= 0.0) or h[-1] <= 0.0:
        raise ModelError(f"convergence: found sizes {h.tolist()}, expected finite ones that fall")
    if not wanted > 0.0:
        raise ModelError(f"convergence: found a wanted error of {wanted:g}, expected above 0")
    finest = float(v[-1])
    scale = max(abs(finest), 1e-300)
    if np.ptp(v) <= 1e-12 * scale:
        return Limit(finest, 0.0, 0.0, math.nan, Verdict.converged, math.nan, finest)
    apart = bool((h[0] / h[-1] if ratio is None else ratio) >= _LEAST_RATIO)
    order, scatter, others = _order(h, v) if apart else (None, math.nan, len(h) > 3)
    shrinks = order is None or order >= LEAST_ORDER
    whole = float(np.ptp(v))
    if not shrinks and whole > _SMALL * wanted * scale:
        return Limit(finest, math.inf, math.inf, float(order or 0.0), Verdict.not_converging, math.nan, finest)
    usual = order is not None and LEAST <= order <= MOST
    if len(h) == 3:
        laws = _of_three(h, v, theory, float(order or 0.0)) if usual else []
    else:
        # an order below the least is not believed where the values admit others, which stand in for it
        laws = admitted(h, v, theory) if shrinks or others else []
        usual = order is not None and (order >= LEAST or others) and order <= MOST
    if laws:
        value, reach = hull(laws)
        beyond = abs(value - finest)
        bar = max(reach, ((_SAFE if usual else _UNSURE) - 1.0) * beyond)
    else:
        value, beyond = finest, 0.0
        step = abs(finest - float(v[-2])) / ((h[-2] / h[-1]) ** min(1.0, theory) - 1.0)
        bar = _UNSURE * (step if shrinks else whole)
    error = float(beyond + bar) / scale
    followed = shrinks and (order is not None or len(h) == 3)
    if error <= wanted and (shrinks or laws):
        verdict = Verdict.converged
    else:
        verdict = Verdict.converging if apart and followed else Verdict.undecided
    size = math.nan
    if order is not None and shrinks:
        p = min(order if order <= MOST else 1.0, theory)
        size = float(h[-1] * (wanted / error) ** (1.0 / p))
    ends = sorted(laws, key=lambda law: law.limit)
    return Limit(
        value,
        bar / scale,
        error,
        math.nan if order is None else order,
        verdict,
        size,
        finest,
        scatter / scale,
        (ends[0], ends[-1]) if ends else (),
    )


def _of_three(h: Array, v: Array, theory: float, order: float) -> list[Law]:
    """Laws of three meshes: of the order that they show, and of theory's."""
    return [fitted(h, v, p, np.ones(3)) for p in ((order, theory) if theory < MOST else (order,))]


def observed_order(h: Array, v: Array, low: float = _TINY, high: float = _MOST_ORDER) -> float | None:
    """Order p for which ``v = limit + c h^p`` holds on three meshes; None where none between `low` and `high` does."""

    def mismatch(p: float) -> float:
        return (v[0] - v[1]) * (h[1] ** p - h[2] ** p) - (v[1] - v[2]) * (h[0] ** p - h[1] ** p)

    if mismatch(low) * mismatch(high) > 0.0:
        return None
    root: float = brentq(mismatch, low, high)  # type: ignore[assignment]  # a number unless more is asked for
    return root


def _order(h: Array, v: Array) -> tuple[float | None, float, bool]:
    """Observed order, none where there is none; scatter about its law, unknown of three; whether others may hold."""
    if len(h) == 3:
        return _exact_order(h, v), math.nan, False
    seen = observed(h, v)
    return (seen.order if seen.follows else None), seen.deviation, seen.shrinking


def _exact_order(h: Array, v: Array) -> float | None:
    """Order of three meshes; none where changes alternate, zero where they do not shrink, most where they vanish."""
    first, last = v[1] - v[0], v[2] - v[1]
    if first * last <= 0.0:
        return None
    order = observed_order(h, v)
    if order is not None:
        return order
    steady = np.log(h[0] / h[1]) / np.log(h[1] / h[2])  # ratio of the changes of a logarithm, the limit of order zero
    return 0.0 if first / last <= steady else _MOST_ORDER

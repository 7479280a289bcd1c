"""Laws of the mesh size fitted to a quantity's values, ``limit + c h^p``, and which orders p the values admit.

Knows numbers alone. After Eca and Hoekstra, J. Comput. Phys. 262 (2014): least squares over all meshes, once with equal
weights and once with weights that grow as the size falls, orders between 0.5 and what theory allows, and the standard
deviation of the fit as its scatter.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import fdtri, stdtrit

Array = NDArray[np.float64]

# orders that a law of converging values may have (the least one: Eca and Hoekstra 2014; the largest: quadratic elements
# in smooth bodies, and a half), and between which the observed one is looked for
LEAST, MOST = 0.5, 4.5
_LOWEST, _HIGHEST = -2.0, 6.0
# orders that are tried of a range at once, and laws that are drawn from a range of admitted ones
_TRIED, _LAWS = 81, 9
# share of the draws that a bar should hold
_SURE = 0.95


@dataclass(frozen=True)
class Law:
    """A law of the size.

    Attributes
    ----------
    order, limit, coefficient
        Of ``limit + coefficient h^order``.
    deviation
        Standard deviation of the values about it, of those degrees of freedom that its order leaves them.
    reach
        What scatter makes of the limit: half of its 95 % interval (Student's) at this order; zero where three meshes or
        fewer do not tell scatter from law.
    """

    order: float
    limit: float
    coefficient: float
    deviation: float
    reach: float

    def at(self, h: Array) -> Array:
        """Values at sizes."""
        return self.limit + self.coefficient * h**self.order


@dataclass(frozen=True)
class Observed:
    """The order that values show by themselves.

    Attributes
    ----------
    order
        Of the best fit between -2 and 6, of whichever weights leave the smaller deviation.
    deviation
        Standard deviation of the values about it.
    shrinking
        Whether they admit an order of 0.5 or more beside it, so that they may have a limit.
    follows
        Whether that is less than the mean change between neighbouring meshes, ``(max - min) / (m - 1)``; where it is
        not, the values are scatter and the order means nothing (Eca and Hoekstra 2014).
    """

    order: float
    deviation: float
    shrinking: bool
    follows: bool


def fitted(h: Array, v: Array, order: float, weights: Array) -> Law:
    """The law of one order by least squares of the weighted squares; the weights' mean is one."""
    n, unit = len(h), h[-1]
    root = np.sqrt(weights)
    A = np.stack([np.ones(n), (h / unit) ** order], axis=1) * root[:, None]
    x, *_ = np.linalg.lstsq(A, root * v, rcond=None)
    variance = float(np.sum((A @ x - root * v) ** 2)) / (n - 2)
    of_limit = float(np.linalg.inv(A.T @ A)[0, 0])
    reach = _student(n - 2) * math.sqrt(variance * of_limit) if n > 3 else 0.0
    return Law(order, float(x[0]), float(x[1] / unit**order), math.sqrt(variance), reach)


def observed(h: Array, v: Array) -> Observed:
    """The order that four values or more show by themselves."""
    found = []
    for weights in _weights(h):
        order, squares = _best(h, v, weights, _LOWEST, _HIGHEST)
        shrinking = _best(h, v, weights, LEAST, MOST)[1] <= squares * _more(len(h))
        found.append((math.sqrt(squares / (len(h) - 3)), order, shrinking))
    deviation, order, shrinking = min(found)
    return Observed(order, deviation, shrinking, deviation < float(np.ptp(v)) / (len(h) - 1))


def admitted(h: Array, v: Array, theory: float = math.inf) -> list[Law]:
    """Laws among which the limit has to be looked for.

    Parameters
    ----------
    h, v
        Sizes, falling, and values, (m,) each, m at least four.
    theory
        Lowest order of the errors' expansion, by what is known of the body; none is known beyond 4.5.

    Returns
    -------
    list of Law
        Of both weights, with orders over all that is admitted.

    Notes
    -----
    The values admit the orders p from 0.5 to 4.5 whose sum of squares is no more than ``1 + F(1, m - 3) / (m - 3)``
    times the least one, F at 95 % (the profile's confidence interval: Bates and Watts 1988, section 6.1). Theory
    narrows these: errors ``a h^theory + b h^q``, with a higher q and one sign, look like a single power between theory
    and q, so the limit lies between those of theory's order and of the highest one admitted. A lower order than
    theory's is the sign of terms of two signs: the observed one is gone down to if it is 0.5 or more (below that it
    is not believed, as by Eca and Hoekstra), and all that are admitted if theory's is not among them. Terms that
    nearly cancel, and scatter that hides it, are not seen.
    """
    found = []
    for weights in _weights(h):
        orders = np.linspace(LEAST, MOST, _TRIED)
        squares = _squares(h, v, orders, weights)
        best, least = _best(h, v, weights, LEAST, MOST)
        among = squares <= least * _more(len(h))
        low, high = min([best, *orders[among]]), max([best, *orders[among]])
        if theory < MOST:
            freely = _best(h, v, weights, _LOWEST, _HIGHEST)[0]
            down = min(freely, theory) if freely >= LEAST else theory
            low, high = (down, high) if theory <= high else (low, theory)
        found += [fitted(h, v, float(p), weights) for p in np.linspace(low, high, _LAWS if high > low else 1)]
    return found


def _weights(h: Array) -> tuple[Array, Array]:
    """Equal ones, and those that grow as the size falls; their mean is one."""
    return np.ones(len(h)), (1.0 / h) / np.mean(1.0 / h)


def _more(n: int) -> float:
    """Times the least sum of squares of `n` values, one order being free: what an order that they admit may have."""
    return 1.0 + float(fdtri(1, n - 3, _SURE)) / (n - 3)


def _student(freedom: int) -> float:
    return float(stdtrit(freedom, 0.5 + 0.5 * _SURE))


def _squares(h: Array, v: Array, orders: Array, weights: Array) -> Array:
    """Least sums of weighted squares of laws of orders (k,), (k,); that of order zero is the logarithm."""
    size, p = np.log(h / h[-1]), orders[:, None]
    still = np.abs(p) < 1e-9
    power = np.where(still, size, np.expm1(p * size) / np.where(still, 1.0, p))
    root = np.sqrt(weights)
    base, change = root / np.linalg.norm(root), root * power
    change = change - (change @ base)[:, None] * base
    change = change / np.linalg.norm(change, axis=1, keepdims=True)
    rest = np.broadcast_to(root * v, change.shape)
    # twice, so that what is left of values near each other is no rounding
    for _ in range(2):
        rest = rest - (rest @ base)[:, None] * base - np.sum(rest * change, axis=1, keepdims=True) * change
    return np.sum(rest**2, axis=1)


def _best(h: Array, v: Array, weights: Array, low: float, high: float) -> tuple[float, float]:
    """Order of the least sum of squares between two, and that sum."""
    found = low, math.inf
    while high - low > 1e-9:
        orders = np.linspace(low, high, _TRIED)
        squares = _squares(h, v, orders, weights)
        k = int(squares.argmin())
        if squares[k] < found[1]:
            found = float(orders[k]), float(squares[k])
        low, high = float(orders[max(k - 1, 0)]), float(orders[min(k + 1, _TRIED - 1)])
    return found


def hull(laws: Sequence[Law]) -> tuple[float, float]:
    """Middle of the limits of laws, and how far any of them reaches from it with its scatter."""
    limits = [law.limit for law in laws]
    middle = 0.5 * (min(limits) + max(limits))
    return middle, max(abs(law.limit - middle) + law.reach for law in laws)

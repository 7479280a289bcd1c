"""Two layers between z = 0, h and z = h, H whose deformation is homogeneous in each: ``F = I + c x e3``.

The total displacement of the top is given; the jump in ``c`` follows from ``P e3`` being continuous. Rank-one
compatible, so piecewise linear displacement is exact, in compression and shear together.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import root

from tests.oracles.laws import at_point

Array = NDArray[np.float64]


def traction(name: str, c: Array, moduli: tuple[float, float], tension: float, a0: Array) -> Array:
    """``P e3`` of a layer with active tension along a0, which is also the fibre of a law that has one."""
    F = np.eye(3) + np.outer(c, [0.0, 0.0, 1.0])
    a = F @ a0
    return at_point(name, F, *moduli, a0)[1][:, 2] + tension * a / np.linalg.norm(a) * a0[2]


def two_layers(
    name: str,
    heights: tuple[float, float],
    top: Array,
    moduli: Sequence[tuple[float, float]],
    tensions: tuple[float, float],
    a0: Array,
) -> tuple[Array, Array, Array]:
    """``c`` of the lower and the upper layer, and the common traction on z planes."""

    def upper(c: Array) -> Array:
        return (top - heights[0] * c) / heights[1]

    def jump(c: Array) -> Array:
        below = traction(name, c, moduli[0], tensions[0], a0)
        return below - traction(name, upper(c), moduli[1], tensions[1], a0)

    found = root(jump, top / sum(heights), tol=1e-14)
    assert np.abs(found.fun).max() < 1e-10 * max(moduli[0][0], moduli[1][0])
    return found.x, upper(found.x), traction(name, found.x, moduli[0], tensions[0], a0)

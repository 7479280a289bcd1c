"""Room for the contact kernels to work in, made once so that they allocate nothing."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class ContactScratch(NamedTuple):
    """Buffers of `solve_cones` for up to `c` contact points, ``n = 3 c``; contents are meaningless between calls."""

    W: Array  # (n, n) scaled operator
    J: Array  # (n, n) Newton matrix, then its factors
    radii: Array  # (c, 4) scaled friction
    bound: Array  # (c, 4) friction in force
    slope: Array  # (c, 5) derivative of the projection: A11, A12, A22, then with respect to the normal impulse
    diagonal: Array  # (n,) of the scaled operator
    scale: Array  # (n,) powers of two: p = scale p_scaled, w_scaled = scale w
    b: Array  # (n,) scaled
    p: Array  # (n,) scaled
    w: Array  # (n,) scaled
    F: Array  # (n,) scaled natural map
    best: Array  # (n,) scaled impulse of the smallest residual
    chain: Array  # (n,) scaled impulse where Gauss-Seidel goes on
    last: Array  # (n,) scaled impulse before the Newton step
    step: Array  # (n,)
    block: Array  # (3, 3)
    place: NDArray[np.int64]  # (n,) unknowns of the Newton system
    held: NDArray[np.int64]  # (c,) which friction a point has
    exchanged: NDArray[np.int64]  # (n,) rows exchanged by the factorisation


def scratch(c: int) -> ContactScratch:
    """Buffers for up to `c` contact points; kernels called with fewer use the front of them."""
    n = 3 * c
    return ContactScratch(
        W=np.zeros((n, n)),
        J=np.zeros((n, n)),
        radii=np.zeros((c, 4)),
        bound=np.zeros((c, 4)),
        slope=np.zeros((c, 5)),
        diagonal=np.zeros(n),
        scale=np.zeros(n),
        b=np.zeros(n),
        p=np.zeros(n),
        w=np.zeros(n),
        F=np.zeros(n),
        best=np.zeros(n),
        chain=np.zeros(n),
        last=np.zeros(n),
        step=np.zeros(n),
        block=np.zeros((3, 3)),
        place=np.zeros(n, dtype=np.int64),
        held=np.zeros(c, dtype=np.int64),
        exchanged=np.zeros(n, dtype=np.int64),
    )

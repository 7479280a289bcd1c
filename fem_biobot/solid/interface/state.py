"""State of a sliding contact at the end of a step, from which the next goes on."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

LIFTED, STICK, SLIP = 0, 1, 2


class Touch(NamedTuple):
    """State of a sliding contact.

    Attributes
    ----------
    traction
        Normal, around and along the axis, of each multiplier, per reference area, on the body, (c, 3) [kPa].
    state
        LIFTED, STICK or SLIP of each multiplier, (c,).
    gaps
        Mean gap and slips in the last step around each multiplier, (c, 3) [mm].
    facet, at
        Opposite facet of each quadrature point (-1 for none), and its local place and gap, (p,), (p, 3).
    """

    traction: Array
    state: Ints
    gaps: Array
    facet: Ints
    at: Array

"""The force-length curves that a design can name, as a rod's muscle reads them.

Written down here on their own: solid and rod share nothing but the design, or an error in one curve would be in both.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from fem_biobot.errors import ModelError
from fem_biobot.rod.activation.curve import MuscleCurve

# sarcomere length [um] and share at the corners of the frog fibre's polygon; its greatest force is about 2.125 um
_CORNERS = ((1.27, 0.0), (1.67, 0.84), (2.0, 1.0), (2.25, 1.0), (3.65, 0.0))
_FROG = tuple((length / 2.125, share) for length, share in _CORNERS)


def _blemker_2005(s: float) -> float:
    """``1 - 4 (s - 1)^2`` within 0.4 of the optimum, ``9 (|s - 1| - 0.6)^2`` from there to 0.6, nothing beyond."""
    away = abs(s - 1.0)
    if away >= 0.6:
        return 0.0
    return 1.0 - 4.0 * away * away if away <= 0.4 else 9.0 * (0.6 - away) ** 2


def _gordon_1966(s: float) -> float:
    stretches, shares = zip(*_FROG, strict=True)
    return float(np.interp(s, stretches, shares))


_NAMED: dict[str, Callable[[float], float]] = {"blemker_2005": _blemker_2005, "gordon_1966": _gordon_1966}


def force_length_curve(name: str, optimal_stretch: float = 1.0) -> MuscleCurve:
    """Curve of a design's `muscle.force_length` with its greatest force at `optimal_stretch` [1].

    Notes
    -----
    It scales the stimulated tension alone, as in the solid. Zero from 1.8 times the optimal stretch on.
    """
    if name not in _NAMED:
        raise ModelError(f"force_length: found {name!r}, expected one of {', '.join(_NAMED)}")
    curve = _NAMED[name]
    return MuscleCurve(lambda s: curve(s / optimal_stretch), 0.0, 1.8 * optimal_stretch, name=name)

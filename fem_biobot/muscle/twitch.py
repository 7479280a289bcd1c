"""The twitch of engineered muscle as it was measured, and what a train of twitches adds up to.

Data: shortening of C2C12 rings after single stimuli and in trains, from the raw data published with Drennan et al. 2025
(Sci. Adv., eadu8634), above rest, in frames 0.05 s apart whose times are nominal. The kernel is fitted to the single
twitches alone; the trains are there to be compared with.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import least_squares

from fem_biobot.errors import ModelError

Array = NDArray[np.float64]

FRAME = 0.05  # s
# time after the stimulus [s]: shortening [um] at 0.5, 1 and 2 Hz, where each twitch is over before the next
DRENNAN_TWITCH = {
    -0.05: (0.5, 0.0, -0.2),
    0.00: (49.2, 48.8, 43.6),
    0.05: (40.3, 48.0, 52.5),
    0.10: (10.8, 13.3, 14.2),
    0.15: (3.3, 4.1, 3.4),
    0.20: (1.7, 2.0, 1.1),
    0.25: (0.9, 1.2, 0.6),
    0.30: (0.3, 0.6, 0.4),
}
# stimuli a second: largest shortening of the train, steady largest, steady smallest, above rest [um]
DRENNAN_TRAINS = {
    0.5: (48.6, 39.8, -1.6),
    1.0: (50.5, 48.7, -0.3),
    2.0: (57.7, 53.7, 0.8),
    3.0: (64.1, 62.8, 3.1),
    4.0: (62.3, 61.9, 5.3),
    5.0: (60.8, 60.0, 1.0),
    8.0: (70.9, 70.3, 34.5),
    10.0: (81.8, 79.7, 45.9),
    12.0: (95.3, 94.1, 72.2),
    15.0: (105.4, 104.6, 94.8),
    20.0: (117.5, 117.3, 109.4),
}
# above this the kernel is no longer felt: its tail is below 1e-4 of the peak
_REACH = 20.0


@dataclass(frozen=True)
class Twitch:
    """Kernel ``k(t) = (t / n tau)^n exp(n - t / tau)`` of peak 1 at ``n tau`` after the stimulus.

    Attributes
    ----------
    order
        ``n`` [1].
    time
        ``tau`` [s].

    Notes
    -----
    Twitches are summed linearly, without potentiation, saturation or fatigue. Compared with trains of 0.5 to 20 Hz in
    the study of twitches.
    """

    order: float
    time: float

    def __post_init__(self) -> None:
        for name in ("order", "time"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0.0):
                raise ModelError(f"twitch: {name}: found {value:g}, expected above 0")

    @property
    def peak_time(self) -> float:
        """From the stimulus to the peak [s]."""
        return self.order * self.time

    @property
    def reach(self) -> float:
        """Time after which a stimulus is forgotten [s]."""
        return self.peak_time + _REACH * self.time

    @property
    def area(self) -> float:
        """Integral of the kernel [s]: the mean of a train is that times its rate."""
        n = self.order
        return self.time * math.exp(n - n * math.log(n) + math.lgamma(n + 1.0))

    def __call__(self, t: ArrayLike) -> Array:
        """Kernel at times after the stimulus, (...) [1]; zero before it."""
        s = np.maximum(np.asarray(t, dtype=float), 0.0) / self.peak_time
        with np.errstate(divide="ignore"):
            return np.where(s > 0.0, np.exp(self.order * (np.log(s) + 1.0 - s)), 0.0)

    def train(self, rate: float, t: ArrayLike) -> Array:
        """Steady sum of twitches at `rate` a second, (...) [1], at times after a stimulus [s]."""
        if not (math.isfinite(rate) and rate > 0.0):
            raise ModelError(f"twitch: rate: found {rate:g} Hz, expected above 0 Hz")
        since = np.mod(np.asarray(t, dtype=float), 1.0 / rate)
        back = np.arange(math.ceil(self.reach * rate) + 1) / rate
        return self(since[..., None] + back).sum(axis=-1)


@dataclass(frozen=True)
class TwitchFit:
    """A kernel fitted to single twitches.

    Attributes
    ----------
    twitch
        The kernel.
    peak
        Its size [um].
    delays
        Of the first frame after the stimulus, for each rate, (3,) [s].
    residual
        Root mean square of what is left [um].
    """

    twitch: Twitch
    peak: float
    delays: Array
    residual: float


def fit_twitch() -> TwitchFit:
    """Kernel fitted to the measured single twitches by least squares.

    Notes
    -----
    The frames are 0.05 s apart and the twitch lasts two of them, so when a frame falls after the stimulus matters and
    is not known: each of the three rates has its own delay, within a frame, found with the kernel. The peak lies
    between two frames, and is what the three rates with their different delays make of it.
    """
    times = np.array(sorted(DRENNAN_TWITCH))
    seen = np.array([DRENNAN_TWITCH[t] for t in times])

    def model(p: Array) -> Array:
        return p[0] * Twitch(p[1], p[2])(times[:, None] + p[None, 3:])

    begin, low, high = [60.0, 3.0, 0.02, 0.03, 0.03, 0.03], [0.0, 1.0, 0.003, 0.0, 0.0, 0.0], [400.0, 40.0, 0.2]
    found = least_squares(lambda p: (model(p) - seen).ravel(), begin, bounds=(low, [*high, FRAME, FRAME, FRAME]))
    peak, order, time = (float(v) for v in found.x[:3])
    return TwitchFit(Twitch(order, time), peak, found.x[3:], float(np.sqrt(np.mean(found.fun**2))))


# what `fit_twitch` finds
TWITCH = Twitch(3.910, 0.01734)
TWITCH_PEAK = 61.24  # um


def potentiation(frequency: float) -> float:
    """Size of a twitch at a rate over that at 2 Hz [1]: steady largest shortening up to 5 Hz, where twitches are apart.

    Linear in frequency between the measured rates; below 0.5 and above 5 Hz that of the nearest of them, since faster
    trains do not show the size of one twitch.
    """
    if not (math.isfinite(frequency) and frequency > 0.0):
        raise ModelError(f"frequency: found {frequency:g} Hz, expected above 0 Hz")
    rates = [rate for rate in DRENNAN_TRAINS if rate <= 5.0]
    sizes = [DRENNAN_TRAINS[rate][1] for rate in rates]
    return float(np.interp(frequency, rates, sizes)) / DRENNAN_TRAINS[2.0][1]

"""Strokes of a walk: what is counted and averaged the same way whatever walked, from samples alone.

Strokes are the periods of the drive, ``k / f`` to ``(k + 1) / f``; numbers are means over those that are left after the
first few, the transient. No mechanics: what moved, and how it is measured, is the affair of each model.
"""

from __future__ import annotations

import math
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fem_biobot.friction.ground import Ground

Array = NDArray[np.float64]
CAMERA_RATE = 6.0  # frames a second, the paper's


class Strokes:
    """Base of a walk, which has the frequency of the drive [Hz], the strokes to discard, and the samples."""

    if TYPE_CHECKING:
        frequency: float
        discarded: int

        @property
        def ground(self) -> Ground: ...
        @property
        def times(self) -> Array: ...
        @cached_property
        def position(self) -> Array: ...
        @cached_property
        def tip_closing(self) -> Array: ...
        @cached_property
        def sagitta(self) -> Array: ...
        def summary(self) -> dict[str, Any]: ...

    @cached_property
    def advance(self) -> Array:
        """Of the centre of mass since the start, along the ground's forward direction, (s,) [mm]."""
        return (self.position - self.position[0]) @ self.ground.axes[1]

    @cached_property
    def stroke_ends(self) -> Array:
        """Beginning of the first whole stroke, and the end of each, (k + 1,) [s]."""
        first = math.ceil(self.times[0] * self.frequency - 1e-6)
        last = math.floor(self.times[-1] * self.frequency + 1e-6)
        return np.arange(first, max(last, first) + 1) / self.frequency

    @property
    def strokes(self) -> int:
        """Whole strokes that were made."""
        return len(self.stroke_ends) - 1

    def _per_stroke(self, values: Array) -> Array:
        """Change of a quantity in each stroke, (k,)."""
        return np.diff(np.interp(self.stroke_ends, self.times, values))

    @cached_property
    def advances(self) -> Array:
        """Advance of the centre of mass in each stroke, (k,) [mm]; positive toward the long pillar."""
        return self._per_stroke(self.advance)

    @property
    def kept(self) -> slice:
        """Strokes that means are taken over; the last one if the transient is as long as the walk."""
        return slice(min(self.discarded, max(self.strokes - 1, 0)), self.strokes)

    @property
    def step_mm(self) -> float:
        """Mean advance per stroke."""
        return mean(self.advances[self.kept])

    @property
    def step_spread_mm(self) -> float:
        """Standard deviation of the advance over the strokes; not a number for fewer than two."""
        kept = self.advances[self.kept]
        return float(np.std(kept, ddof=1)) if len(kept) > 1 else math.nan

    @property
    def speed_mm_per_s(self) -> float:
        """Mean advance per time."""
        return self.step_mm * self.frequency

    @property
    def drift_mm(self) -> float:
        """Sideways advance per stroke, to the left."""
        side = (self.position - self.position[0]) @ self.ground.axes[2]
        return mean(self._per_stroke(side)[self.kept])

    def _swing(self, values: Array) -> Array:
        """Largest less smallest value in each stroke, (k,)."""
        found = []
        for begin, end in pairwise(self.stroke_ends):
            inside = (self.times >= begin - 1e-9) & (self.times <= end + 1e-9)
            found.append(np.ptp(values[inside]) if inside.any() else math.nan)
        return np.array(found)

    @property
    def stroke_mm(self) -> float:
        """Amplitude of the tip closing: largest less smallest in a stroke."""
        return mean(self._swing(self.tip_closing)[self.kept])

    @property
    def sagitta_stroke_mm(self) -> float:
        """Amplitude of the sagitta: largest less smallest in a stroke."""
        return mean(self._swing(self.sagitta)[self.kept])

    def camera(self, rate: float = CAMERA_RATE, phase: float = 0.0) -> tuple[Array, Array]:
        """Times [s] and tip closing [mm] in the frames of a camera, after the transient.

        `rate` in frames a second; the first frame is `phase` of a frame's time after the transient ends.
        """
        begin, end = self.stroke_ends[self.kept.start], self.stroke_ends[-1]
        frames = begin + (np.arange(math.floor((end - begin) * rate + 1e-9) + 1) + phase) / rate
        frames = frames[frames <= end + 1e-9]
        return frames, np.interp(frames, self.times, self.tip_closing)

    def camera_swing(self, rate: float = CAMERA_RATE, phase: float = 0.0) -> float:
        """Largest less smallest tip closing that a camera sees [mm]."""
        _, seen = self.camera(rate, phase)
        return float(np.ptp(seen)) if len(seen) else math.nan

    @property
    def camera_stroke_mm(self) -> float:
        """Stroke as 6 frames a second show it, the first at the beginning of a stroke."""
        return self.camera_swing()


def mean(values: Array) -> float:
    """Mean of what there is; not a number for nothing."""
    return float(np.mean(values)) if len(values) else math.nan


def plain(value: Any) -> Any:
    """For JSON: no numbers that are none."""
    if isinstance(value, dict):
        return {key: plain(inner) for key, inner in value.items()}
    if isinstance(value, list):
        return [plain(inner) for inner in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value

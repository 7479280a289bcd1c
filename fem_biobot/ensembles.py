"""Many walks from slightly different starts: how starts are drawn, how numbers scatter, and which gaits there are.

Walking with friction is sensitive: one trajectory proves nothing. Starts are the standing machine with small rigid
motions added, which depend on the seed and their number alone, so that two ensembles of the same seed are paired, start
by start, whatever walks. No mechanics: rods and solid each add the motion to their own standing machine.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from fem_biobot.errors import ModelError
from fem_biobot.strokes import Strokes, plain

Array = NDArray[np.float64]
Walked = TypeVar("Walked", bound=Strokes)

SEED = 20180417
# a gap between gaits is at least so many times their own spread, and this share of the largest step
_GAP, _FLOOR = 4.0, 0.02
_SHARE_LEVEL = 1.959963984540054  # of the normal distribution at 97.5 %


@dataclass(frozen=True)
class Nudge:
    """Largest perturbations of a start: rigid motions in the plane of walking, each even in both directions.

    Attributes
    ----------
    height
        From which it is dropped, upwards alone [mm].
    velocity
        Along the ground [mm/s].
    spin
        About the lateral axis [rad/s].
    """

    height: float = 0.02
    velocity: float = 2.0
    spin: float = 0.5

    def drawn(self, generator: np.random.Generator) -> tuple[Array, Array, Array]:
        """Lift [mm], velocity [mm/s] of the centre of mass and spin [rad/s] of a start, (3,) each.

        Three numbers are taken from the generator, whatever the model.
        """
        up, forward, turn = generator.uniform(-1.0, 1.0, 3)
        lift = np.array([0.0, 0.0, 0.5 * self.height * (1.0 + up)])
        return lift, np.array([self.velocity * forward, 0.0, 0.0]), np.array([0.0, self.spin * turn, 0.0])


def generator_of(seed: int, number: int) -> np.random.Generator:
    """Of one start of an ensemble."""
    return np.random.default_rng([seed, number])


def check_counts(who: str, **counts: int) -> None:
    """Refuse numbers of starts or threads below one with `ModelError`."""
    for name, count in counts.items():
        if isinstance(count, bool) or not isinstance(count, int) or count < 1:
            raise ModelError(f"{who}: {name}: found {count!r}, expected a whole number of at least 1")


@dataclass(frozen=True, eq=False)
class Gait:
    """Walks of an ensemble that do the same.

    Attributes
    ----------
    members
        Numbers of its starts.
    step_mm, spread_mm
        Mean and standard deviation over them of the mean advance per stroke.
    interval_mm
        95 % interval of the mean (Student); not numbers for one start.
    share, share_interval
        Share of the starts that found it, with its 95 % interval (Wilson) [1].
    """

    members: tuple[int, ...]
    step_mm: float
    spread_mm: float
    interval_mm: tuple[float, float]
    share: float
    share_interval: tuple[float, float]


@dataclass(frozen=True, eq=False)
class Ensemble(Generic[Walked]):
    """Walks from perturbed starts, and the gaits found among them, the most frequent first.

    `model` says what walked, rod or solid.
    """

    walks: tuple[Walked, ...]
    gaits: tuple[Gait, ...]
    seed: int
    model: str

    @classmethod
    def of(cls, walks: list[Walked], seed: int, model: str) -> Ensemble[Walked]:
        """Of walks in the order of their starts."""
        return cls(tuple(walks), gaits(np.array([each.step_mm for each in walks])), seed, model)

    def values(self, name: str) -> Array:
        """An attribute of every walk, such as ``"stroke_mm"``, (w,)."""
        return np.array([getattr(walk, name) for walk in self.walks], dtype=float)

    @property
    def step_mm(self) -> float:
        """Mean over the starts of the mean advance per stroke."""
        return float(self.values("step_mm").mean())

    @property
    def step_spread_mm(self) -> float:
        """Standard deviation of that over the starts."""
        values = self.values("step_mm")
        return float(values.std(ddof=1)) if len(values) > 1 else math.nan

    def summary(self) -> dict[str, Any]:
        """Means over the starts and the gaits; None for what is not a number."""
        given = [each.summary() for each in self.walks]
        means = ("step_mm", "speed_mm_per_s", "stroke_mm", "slip_fraction_1", "efficiency_1", "energy_error_1")
        found: dict[str, Any] = {name: _mean([each[name] for each in given]) for name in means}
        found |= {
            "model": self.model,
            "frequency_Hz": self.walks[0].frequency,
            "starts_1": len(self.walks),
            "seed": self.seed,
            "step_spread_mm": self.step_spread_mm,
            "steps_mm": self.values("step_mm").tolist(),
            "gaits": [
                {
                    "step_mm": gait.step_mm,
                    "spread_mm": gait.spread_mm,
                    "interval_mm": list(gait.interval_mm),
                    "share_1": gait.share,
                    "share_interval_1": list(gait.share_interval),
                }
                for gait in self.gaits
            ],
            "notes": list(dict.fromkeys(note for each in given for note in each["notes"])),
        }
        return plain(found)


def gaits(steps: Array) -> tuple[Gait, ...]:
    """Groups of mean advances per stroke (w,) [mm] that differ by more than they scatter, the most frequent first.

    Notes
    -----
    Sorted values are cut at their widest gap if it is at least four times the standard deviation on either side and 2 %
    of the largest value, and the parts likewise. One value alone can be a gait; walks that have not settled scatter
    and merge gaits, which makes this a lower bound of their number.
    """
    order = np.argsort(steps, kind="stable")
    scale = _FLOOR * float(np.abs(steps).max())
    found = [_gait(steps, part, len(steps)) for part in _parts(steps, order, scale)]
    return tuple(sorted(found, key=lambda gait: -gait.share))


def _parts(steps: Array, order: NDArray[np.int64], floor: float) -> list[NDArray[np.int64]]:
    if len(order) < 2:
        return [order]
    gaps = np.diff(steps[order])
    cut = int(gaps.argmax()) + 1
    low, high = order[:cut], order[cut:]
    spread = max(float(steps[low].std()), float(steps[high].std()))
    if gaps[cut - 1] <= max(_GAP * spread, floor):
        return [order]
    return [*_parts(steps, low, floor), *_parts(steps, high, floor)]


def _gait(steps: Array, members: NDArray[np.int64], total: int) -> Gait:
    values, n = steps[members], len(members)
    mean, spread = float(values.mean()), float(values.std(ddof=1)) if n > 1 else math.nan
    reach = float(stdtrit(n - 1, 0.975)) * spread / math.sqrt(n) if n > 1 else math.nan
    p, z = n / total, _SHARE_LEVEL
    middle = (p + z * z / (2 * total)) / (1 + z * z / total)
    half = z / (1 + z * z / total) * math.sqrt(p * (1 - p) / total + z * z / (4 * total * total))
    shares = (max(0.0, middle - half), min(1.0, middle + half))
    return Gait(tuple(int(k) for k in members), mean, spread, (mean - reach, mean + reach), p, shares)


def _mean(values: list[float | None]) -> float:
    """Mean over all walks; not a number where one has none."""
    return float(np.mean([math.nan if value is None else value for value in values]))

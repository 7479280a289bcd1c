"""Many walks from slightly different starts: how far numbers scatter, and whether gaits coexist.

Walking with friction is sensitive: one trajectory proves nothing. The starts are the standing machine with small rigid
motions added; they depend on the seed alone, so that two ensembles of the same seed are paired, start by start.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from fem_biobot.design import Design
from fem_biobot.errors import ModelError
from fem_biobot.rod.gait import Walk
from fem_biobot.rod.ground import Ground
from fem_biobot.rod.model import RodModel, RodState
from fem_biobot.rod.reduce import ground_of, reduce
from fem_biobot.rod.rest import Stance, stance
from fem_biobot.rod.walk import settings_of, walk

Array = NDArray[np.float64]

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
class Ensemble:
    """Walks from perturbed starts, and the gaits found among them, the most frequent first."""

    walks: tuple[Walk, ...]
    gaits: tuple[Gait, ...]
    seed: int

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
        means = ("step_mm", "speed_mm_per_s", "stroke_mm", "slip_fraction_1", "efficiency_1", "energy_error_1")
        found: dict[str, Any] = {name: _finite(float(self.values(name).mean())) for name in means}
        found |= {
            "model": "rod",
            "frequency_Hz": self.walks[0].frequency,
            "starts_1": len(self.walks),
            "seed": self.seed,
            "step_spread_mm": _finite(self.step_spread_mm),
            "steps_mm": self.values("step_mm").tolist(),
            "gaits": [
                {
                    "step_mm": gait.step_mm,
                    "spread_mm": _finite(gait.spread_mm),
                    "interval_mm": [_finite(end) for end in gait.interval_mm],
                    "share_1": gait.share,
                    "share_interval_1": list(gait.share_interval),
                }
                for gait in self.gaits
            ],
        }
        return found


def nudged(standing: Stance, nudge: Nudge, generator: np.random.Generator) -> RodState:
    """The standing machine with a rigid motion drawn from the generator: three numbers, whatever the model."""
    up, forward, turn = generator.uniform(-1.0, 1.0, 3)
    state = standing.state
    velocity, spin = np.array([nudge.velocity * forward, 0.0, 0.0]), np.array([0.0, nudge.spin * turn, 0.0])
    v = np.concatenate([velocity + np.cross(spin, state.x - state.centre_of_mass), np.tile(spin, (len(state.x), 1))], 1)
    lift = np.array([0.0, 0.0, 0.5 * nudge.height * (1.0 + up)])
    return RodState(state.model, state.x + lift, state.Q, v)


def walk_ensemble(
    machine: Design | RodModel,
    frequency: float | None = None,
    *,
    starts: int = 8,
    seed: int = 20180417,
    nudge: Nudge | None = None,
    ground: Ground | None = None,
    beam_elements: int = 16,
    plate_factor: str = "none",
    listener: Callable[[int, Walk], None] | None = None,
    threads: int = 1,
    **keywords: Any,
) -> Ensemble:
    """Walks of a machine from perturbed starts.

    Parameters
    ----------
    machine, frequency, ground, beam_elements, plate_factor
        As in `walk`.
    starts, seed
        Number of walks; the start of each follows from the seed and its number.
    nudge
        How far starts differ.
    listener
        Given the number and each walk, in the order of the numbers.
    threads
        Walks made side by side: the compiled steps hold no lock, and each motion is the same whatever runs beside it.
        An interrupt waits for those under way.
    keywords
        Of `walk`.

    Raises
    ------
    ModelError
        Fewer than one start or thread; what `walk` refuses.
    SolveError
        As `walk`.
    """
    for name, count in (("starts", starts), ("threads", threads)):
        if isinstance(count, bool) or not isinstance(count, int) or count < 1:
            raise ModelError(f"walk_ensemble: {name}: found {count!r}, expected a whole number of at least 1")
    model = machine
    if isinstance(machine, Design):
        model = reduce(machine, beam_elements=beam_elements, plate_factor=plate_factor)
        ground = ground or ground_of(machine)
        given = {
            "frequency": machine.drive.frequency,
            "duration": machine.drive.duration,
            "step": machine.numerics.step,
            "settings": settings_of(machine),
        }
        given |= {"amplitude": machine.drive.amplitude, "waveform": machine.drive}
        keywords = given | {name: value for name, value in keywords.items() if value is not None}
    assert isinstance(model, RodModel)
    keywords |= {} if frequency is None else {"frequency": frequency}
    ground = ground or Ground()
    standing = stance(model, ground)

    def one(number: int) -> Walk:
        start = nudged(standing, nudge or Nudge(), np.random.default_rng([seed, number]))
        return walk(model, ground=ground, start=start, rest=standing, **keywords)

    walks = []
    with ThreadPoolExecutor(threads) as pool:
        for number, found in enumerate(pool.map(one, range(starts)) if threads > 1 else map(one, range(starts))):
            walks.append(found)
            if listener is not None:
                listener(number, found)
    return Ensemble(tuple(walks), gaits(np.array([each.step_mm for each in walks])), seed)


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


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None

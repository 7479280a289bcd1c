"""What solid and rods are compared by: the same measures from the same points, whichever model they are taken from.

A model tells positions of points; everything else is computed here, once for both. Angles are in the plane of the
machine, x and z, and free of rigid motion.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from fem_biobot.design import Design

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
_ELEMENTS = 16  # stretches of beam between stations
_INSIDE = 0.45  # of the thickness, above and below the axis, where the turn of a section is read


@dataclass(frozen=True)
class Points:
    """Positions that measures are made of, drawn or deformed, in one model's own frame.

    Attributes
    ----------
    lower, upper
        Below and above the beam's axis at the stations, mid-width, (s, 3) [mm].
    tops
        On the beam's axis over the middles of the two pillars, (2, 3) [mm].
    soles
        Middles of the soles, (2, 3) [mm].
    """

    lower: Array
    upper: Array
    tops: Array
    soles: Array

    @property
    def axis(self) -> Array:
        """The beam's axis at the stations, (s, 3) [mm]."""
        return 0.5 * (self.lower + self.upper)

    @property
    def tilt(self) -> float:
        """Turn of the chord from x towards z [rad]."""
        chord = self.axis[-1] - self.axis[0]
        return float(np.arctan2(chord[2], chord[0]))

    @property
    def turns(self) -> Array:
        """Turn of the sections at the stations from x towards z, less the chord's, (s,) [rad]."""
        up = self.upper - self.lower
        return np.unwrap(np.arctan2(-up[:, 0], up[:, 2])) - self.tilt

    @property
    def pillar_turns(self) -> Array:
        """Turn of the two pillars inwards, less the chord's, (2,) [rad]."""
        down = self.soles - self.tops
        turned = np.arctan2(down[:, 0], -down[:, 2]) - self.tilt
        return np.asarray(turned * np.array([1.0, -1.0]), dtype=float)

    def level(self) -> Points:
        """The same with the chord along x and its middle at the origin."""
        middle, turn = 0.5 * (self.axis[0] + self.axis[-1]), rotation(-self.tilt)
        moved = [(p - middle) @ turn.T for p in (self.lower, self.upper, self.tops, self.soles)]
        return Points(*moved)


def rotation(angle: float) -> Array:
    """Matrix of a turn from x towards z, (3, 3)."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, c]])


def stations(design: Design) -> Array:
    """Positions along the span at which sections are read, from the short to the long pillar, (s,) [mm]."""
    return np.linspace(-design.span / 2, design.span / 2, _ELEMENTS + 1)


def drawn_points(design: Design) -> Points:
    """The points as drawn."""
    x, z = stations(design), design.beam_axis_height
    skeleton = design.value("skeleton")
    half = _INSIDE * skeleton.beam_thickness
    (a, short), (b, long) = design.pillars[0], design.pillars[-1]
    line = np.column_stack([x, np.zeros_like(x), np.full_like(x, z)])
    up = np.array([0.0, 0.0, half])
    return Points(
        line - up,
        line + up,
        np.array([[a, 0.0, z], [b, 0.0, z]]),
        np.array([[a, 0.0, z - short], [b, 0.0, z - long]]),
    )


@dataclass(frozen=True)
class Observed:
    """One state of one model.

    Attributes
    ----------
    tension
        Nominal tension of the tissue [kPa].
    numbers
        Measures by name, each with its unit as suffix.
    points
        The points, levelled.
    curvature
        Of the beam between the stations, less that as drawn, positive where it arches up, (s - 1,) [1/mm].
    roots
        What the short and the long pillar turn inwards beyond the sections at the ends of the span, (2,) [rad].
    """

    tension: float
    numbers: dict[str, float]
    points: Points
    curvature: Array
    roots: Array = field(default_factory=lambda: np.zeros(2))


def observed(design: Design, tension: float, points: Points, **numbers: float) -> Observed:
    """A state from its points and from what the model itself must tell: force, closing, sagitta, energy, stretch."""
    curvature = -np.diff(points.turns) / np.diff(stations(design))
    short, long = np.rad2deg(points.pillar_turns)
    own = {
        "pillar_rotation_deg": float(short + long) / 2.0,
        "rotation_short_deg": float(short),
        "rotation_long_deg": float(long),
        "curvature_1_per_mm": float(curvature[_ELEMENTS // 4 : -(_ELEMENTS // 4)].mean()),
    }
    roots = points.pillar_turns - points.turns[[0, -1]] * np.array([1.0, -1.0])
    return Observed(tension, {**numbers, **own}, points.level(), curvature, roots)


def parts_of_energy(skeleton: float, muscle: float) -> dict[str, float]:
    """Passive energy of both parts and their sum as measures [uJ]."""
    return {"strain_energy_uJ": skeleton + muscle, "energy_skeleton_uJ": skeleton, "energy_muscle_uJ": muscle}


def beyond(state: Observed, skeleton: float, muscle: float) -> Observed:
    """The same state, its energies told beyond some that both parts have anyway [uJ]."""
    n = state.numbers
    left = parts_of_energy(n["energy_skeleton_uJ"] - skeleton, n["energy_muscle_uJ"] - muscle)
    return replace(state, numbers={**n, **left, "energy_rings_uJ": skeleton + muscle})

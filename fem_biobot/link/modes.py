"""Natural motions of two models side by side: which belongs to which, and how far their frequencies differ."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from fem_biobot.design import Design

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Motions:
    """Frequencies (c,) [Hz], slowest first, and displacements at points seen in both models, (c, p, 3) [mm]."""

    frequencies: Array
    seen: Array


@dataclass(frozen=True)
class Pair:
    """A motion of the solid and the rods' most alike."""

    solid: float
    rods: float
    likeness: float
    kind: str


def seen_positions(design: Design) -> Array:
    """Reference positions at which motions are compared: corners of the soles, and points of the beam, (p, 3) [mm]."""
    s = design.value("skeleton")
    z = design.beam_axis_height
    half_x, half_y = s.pillar_length / 2, s.pillar_width / 2
    corners = [
        (x + dx, dy, z - height)
        for x, height in (design.pillars[0], design.pillars[-1])
        for dx in (-half_x, half_x)
        for dy in (-half_y, half_y)
    ]
    beam = [(x, 0.0, z) for x in np.linspace(-design.span / 2, design.span / 2, 5)]
    return np.array([*corners, *beam])


def likeness(a: Array, b: Array) -> Array:
    """Modal assurance criterion of shapes (c, p, 3) and (d, p, 3), (c, d): 1 where they are in proportion.

    Allemang and Brown (1982), ``(a . b)^2 / (a . a) (b . b)``.
    """
    A, B = a.reshape(len(a), -1), b.reshape(len(b), -1)
    return (A @ B.T) ** 2 / np.outer((A**2).sum(axis=1), (B**2).sum(axis=1))


def paired(solid: Motions, rods: Motions, count: int) -> list[Pair]:
    """The slowest motions of the solid, each with a motion of the rods, so that the likenesses add up to the most."""
    alike = likeness(solid.seen, rods.seen)
    found = dict(zip(*linear_sum_assignment(-alike), strict=True))
    return [
        Pair(
            float(solid.frequencies[i]),
            float(rods.frequencies[found[i]]),
            float(alike[i, found[i]]),
            kind(solid.seen[i]),
        )
        for i in range(min(count, len(solid.frequencies)))
        if i in found
    ]


def kind(shape: Array) -> str:
    """Whether points (p, 3), seen as in `seen_positions`, move in the plane of the machine or across it.

    Of a mirrored pair of corners, the mean along x and z is motion in the plane, their difference a turn out of it.
    """
    corners, beam = shape[:8].reshape(4, 2, 3), shape[8:]
    mean, half = corners.mean(axis=1), 0.5 * (corners[:, 1] - corners[:, 0])
    inside = (mean[:, (0, 2)] ** 2).sum() + (half[:, 1] ** 2).sum() + (beam[:, (0, 2)] ** 2).sum()
    across = (mean[:, 1] ** 2).sum() + (half[:, (0, 2)] ** 2).sum() + (beam[:, 1] ** 2).sum()
    return "in plane" if inside > across else "across"

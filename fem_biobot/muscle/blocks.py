"""Where a design's junctions are, bay by bay, and the direction of theta in them."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from fem_biobot.design import Design
from fem_biobot.errors import DesignError

Array = NDArray[np.float64]


def junction_direction(theta: float) -> Array:
    """Fibre direction in the junction, ``(sin theta, cos theta, 0)``, (3,) [1]; `theta` [rad] from the lateral axis."""
    return np.array([np.sin(theta), np.cos(theta), 0.0])


def junction_blocks(design: Design) -> list[tuple[float, float]]:
    """Extent in x of the junction block of each bay, or of the strip [mm]."""
    if design.kind == "strip":
        return [(-design.span / 2, design.span / 2)]
    half = design.value("skeleton.pillar_length") / 2
    centres = [x for x, _ in design.pillars]
    return [(a + half, b - half) for a, b in pairwise(centres)]


def bay_cores(design: Design) -> list[tuple[float, float]]:
    """Extent in x of the middle half of each junction block [mm], where the direction is that of theta exactly."""
    return [(low + 0.25 * (high - low), high - 0.25 * (high - low)) for low, high in junction_blocks(design)]


def in_junction(design: Design, X: Array, slack: float = 0.0) -> NDArray[np.bool_]:
    """Which positions (3, ...) [mm] lie in a junction block; for a ring layout, between the pillars of a strand.

    Positions up to `slack` [mm] beside the block count as in it.
    """
    muscle = design.muscle
    if muscle is None:
        raise DesignError(f"muscle: found none (kind {design.kind}), expected one for a fibre field")
    x = X[0]
    inside = np.zeros(x.shape, dtype=bool)
    for low, high in junction_blocks(design):
        inside |= (x > low) & (x < high)
    if muscle.layout == "ring" and design.kind == "bot":
        return inside
    across = np.abs(X[1]) < muscle.junction_width / 2 + slack
    return inside & across & (np.abs(X[2] - muscle.junction_height) < muscle.junction_thickness / 2 + slack)

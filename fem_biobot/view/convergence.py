"""Graph of quantities over the size of a mesh, with the laws that they follow and what these say of no size."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fem_biobot.view.graph import COLOURS, SOFT, legend, name_axes, paired, save, side_by_side

Array = NDArray[np.float64]

# between the bars of two quantities, and before the first, over the largest size
_APART = 0.02


@dataclass(frozen=True, eq=False)
class Curve:
    """A quantity on several meshes.

    Attributes
    ----------
    sizes, values
        Of the meshes, (m,) each.
    along, between
        Sizes from zero, (k,), and the two laws between which the quantity's lies there, (2, k); nothing without laws.
    bar
        Limit, and how far it may be off on both sides; none where there is no limit.
    """

    sizes: Array
    values: Array
    along: Array | None = None
    between: Array | None = None
    bar: tuple[float, float] | None = None


def laws_of_size(path: str | os.PathLike[str], curves: Mapping[str, Curve], *, x: str, y: str, title: str) -> None:
    """Points of every mesh, the law through them and the limit's bar at no size, beside each other at its left.

    Parameters
    ----------
    path
        PNG file.
    curves
        By name.
    x, y
        Names of the axes with their units.
    title
        Above the graph.

    Raises
    ------
    FileError
        Values that do not go with their sizes, or are not finite; the file cannot be written.
    """
    figure, (axes,) = side_by_side(1, (7.4, 4.6))
    largest = max(float(np.max(curve.sizes)) for curve in curves.values())
    axes.axvline(0.0, color=SOFT, linewidth=0.9)
    for number, (name, curve) in enumerate(curves.items()):
        colour = COLOURS[number % len(COLOURS)]
        xs, ys = paired(path, name, curve.sizes, curve.values)
        # what follows no law is joined, so that the eye sees what belongs together
        loose = curve.along is None or curve.between is None
        axes.plot(xs, ys, "o:" if loose else "o", color=colour, markersize=4.5, linewidth=1.0, label=name)
        if curve.along is not None and curve.between is not None:
            low, high = curve.between
            axes.fill_between(curve.along, low, high, color=colour, alpha=0.15, linewidth=0.0)
            axes.plot(curve.along, 0.5 * (low + high), "-", color=colour, linewidth=1.4)
        if curve.bar is not None:
            place = -_APART * largest * (number + 1.0)
            axes.errorbar([place], [curve.bar[0]], [curve.bar[1]], fmt="s", color=colour, markersize=3.5, capsize=3.0)
    axes.set_xlim(-_APART * largest * (len(curves) + 1.0), 1.03 * largest)
    name_axes(axes, x, y)
    legend(axes)
    save(figure, path, title)

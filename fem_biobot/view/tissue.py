"""Graphs of muscle as tissue: curves over time, thickness or consumption, with points measured beside them."""

from __future__ import annotations

import os
from collections.abc import Mapping

from numpy.typing import ArrayLike

from fem_biobot.view.plots import COLOURS, INK, SOFT, _figure, _label, _legend, _pair, _save


def lines(
    path: str | os.PathLike[str],
    curves: Mapping[str, tuple[ArrayLike, ArrayLike]],
    *,
    x: str,
    y: str,
    title: str,
    points: Mapping[str, tuple[ArrayLike, ArrayLike]] | None = None,
    levels: Mapping[str, float] | None = None,
    log: str = "",
) -> None:
    """Curves in one graph.

    Parameters
    ----------
    path
        PNG file.
    curves, points
        Name to places and values, (t,) each; points are drawn as marks, in the colour of the curve of their order.
    x, y
        Names of the axes with their units.
    title
        Above the graph.
    levels
        Name to a value drawn as a thin horizontal line.
    log
        Axes with a logarithmic scale: ``x``, ``y``, ``xy`` or none.

    Raises
    ------
    FileError
        Rows of different length or not finite; the file cannot be written.
    """
    figure, (axes,) = _figure(1, (6.6, 4.2))
    for number, (name, (places, values)) in enumerate(curves.items()):
        xs, ys = _pair(path, name, places, values)
        axes.plot(xs, ys, "-", color=COLOURS[number % len(COLOURS)], linewidth=1.6, label=name)
    for number, (name, (places, values)) in enumerate((points or {}).items()):
        xs, ys = _pair(path, name, places, values)
        colour = COLOURS[number % len(COLOURS)]
        axes.plot(xs, ys, "o", color=colour, markersize=5, markerfacecolor="white", label=name)
    for name, value in (levels or {}).items():
        axes.axhline(value, color=SOFT, linewidth=0.9, linestyle=":")
        axes.annotate(name, (0.99, value), (0, 3), xycoords=("axes fraction", "data"), textcoords="offset points",
                      fontsize=7.5, color=INK, ha="right")  # fmt: skip
    if "x" in log:
        axes.set_xscale("log")
    if "y" in log:
        axes.set_yscale("log")
    _label(axes, x, y)
    _legend(axes)
    _save(figure, path, title)

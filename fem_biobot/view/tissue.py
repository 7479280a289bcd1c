"""Graphs of muscle as tissue: curves over time, thickness or consumption, with points measured beside them."""

from __future__ import annotations

import os
from collections.abc import Mapping

from numpy.typing import ArrayLike

from fem_biobot.view.graph import COLOURS, INK, SOFT, legend, name_axes, paired, save, side_by_side


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
    figure, (axes,) = side_by_side(1, (6.6, 4.2))
    for number, (name, (places, values)) in enumerate(curves.items()):
        xs, ys = paired(path, name, places, values)
        axes.plot(xs, ys, "-", color=COLOURS[number % len(COLOURS)], linewidth=1.6, label=name)
    for number, (name, (places, values)) in enumerate((points or {}).items()):
        xs, ys = paired(path, name, places, values)
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
        axes.yaxis.set_major_formatter("{x:g}")
        axes.yaxis.set_minor_formatter("{x:g}")
        axes.tick_params(which="minor", labelsize=7)
    name_axes(axes, x, y)
    legend(axes)
    save(figure, path, title)


def cloud(
    path: str | os.PathLike[str],
    across: ArrayLike,
    up: ArrayLike,
    values: ArrayLike,
    *,
    x: str,
    y: str,
    value: str,
    below: float,
    title: str,
) -> None:
    """Values at points of a section, in colour; those below a threshold in red.

    Parameters
    ----------
    path
        PNG file.
    across, up
        Places of the points, (k,) each [mm].
    values
        At the points, (k,).
    x, y, value
        Names of the axes and of the colour bar with their units.
    below
        The threshold.
    title
        Above the graph.

    Raises
    ------
    FileError
        Rows of different length or not finite; the file cannot be written.
    """
    a, b = paired(path, "section", across, up)
    _, v = paired(path, "section", across, values)
    figure, (axes,) = side_by_side(1, (6.6, 4.2))
    shown = axes.scatter(a, b, c=v, s=7, cmap="viridis", vmin=0.0, linewidths=0)
    low = v < below
    axes.plot(a[low], b[low], ".", color="#c0392b", markersize=3)
    axes.set_aspect("equal", adjustable="datalim")
    bar = figure.colorbar(shown, ax=axes)
    bar.set_label(value, fontsize=9.5, color=INK)
    name_axes(axes, x, y)
    save(figure, path, title)

"""Pictures of many designs: numbers against parameters, and parallel coordinates."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib import colormaps
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from fem_biobot.errors import FileError
from fem_biobot.view.graph import COLOURS, GRID, INK, SOFT, save, side_by_side

Columns = Mapping[str, Sequence[object]]
_MOST = 4  # panels in a row or column


def against_each(
    path: str | os.PathLike[str], columns: Columns, parameters: Sequence[str], numbers: Sequence[str], *, title: str
) -> None:
    """A grid of small graphs: a row for each number, a column for each parameter, one mark a case.

    Parameters
    ----------
    path
        PNG file.
    columns
        Name to values, one a case; None where there is none, texts for parameters that are no numbers.
    parameters, numbers
        Names of the abscissas and of the ordinates; the first four of each are drawn.
    title
        Above the picture.

    Raises
    ------
    FileError
        Columns of different length; the file cannot be written.
    """
    _check(path, columns)
    xs, ys = parameters[:_MOST], numbers[:_MOST]
    figure = Figure(
        figsize=(1.2 + 2.6 * len(xs), 0.8 + 2.0 * len(ys)), dpi=150, facecolor="white", layout="constrained"
    )
    FigureCanvasAgg(figure)
    panels = np.atleast_2d(figure.subplots(len(ys), len(xs), squeeze=False))
    for row, y in enumerate(ys):
        up = _placed(columns[y])[0]
        for col, x in enumerate(xs):
            axes = panels[row, col]
            across, names = _placed(columns[x])
            axes.plot(across, up, "o", color=COLOURS[row % len(COLOURS)], markersize=4, alpha=0.75)
            axes.grid(color=GRID, linewidth=0.8)
            axes.spines[["top", "right"]].set_visible(False)
            axes.spines[["left", "bottom"]].set_color(SOFT)
            axes.tick_params(labelsize=7.5, colors=INK)
            if names:
                axes.set_xticks(range(len(names)), names, fontsize=7)
            if row == len(ys) - 1:
                axes.set_xlabel(x, fontsize=8, color=INK)
            if col == 0:
                axes.set_ylabel(y, fontsize=8, color=INK)
    save(figure, path, title)


def coordinates(
    path: str | os.PathLike[str], columns: Columns, parameters: Sequence[str], numbers: Sequence[str], *, title: str
) -> None:
    """Parallel coordinates: every case a line through its values, coloured by its first number.

    Parameters and refusals are those of `against_each`; cases without the first number are left out.
    """
    _check(path, columns)
    names = [*parameters[: 2 * _MOST], *numbers[:_MOST]]
    figure, (axes,) = side_by_side(1, (1.5 + 1.3 * len(names), 4.0))
    axes.grid(visible=False)
    colour = _scaled(_placed(columns[numbers[0]])[0])
    heights = np.array([_scaled(_placed(columns[name])[0]) for name in names])
    for case in np.flatnonzero(np.isfinite(colour)):
        axes.plot(heights[:, case], "-", color=colormaps["viridis"](colour[case]), linewidth=1.1, alpha=0.8)
    for place, name in enumerate(names):
        axes.axvline(place, color=SOFT, linewidth=0.8)
        values, texts = _placed(columns[name])
        ends = (texts[0], texts[-1]) if texts else tuple(f"{v:.3g}" for v in (np.nanmin(values), np.nanmax(values)))
        for height, text, side in ((-0.03, ends[0], "top"), (1.03, ends[1], "bottom")):
            axes.annotate(text, (place, height), ha="center", va=side, fontsize=7.5, color=INK)
    axes.set_xticks(range(len(names)), [name.replace(".", ".\n").replace(" [", "\n[") for name in names], fontsize=7.5)
    axes.set_yticks([])
    axes.set_ylim(-0.12, 1.12)
    axes.spines[["left", "bottom"]].set_visible(False)
    save(figure, path, title)


def _check(path: str | os.PathLike[str], columns: Columns) -> None:
    if len({len(values) for values in columns.values()}) != 1:
        counts = ", ".join(f"{len(values)} of {name}" for name, values in columns.items())
        raise FileError(f"{path}: found {counts or 'no columns'}, expected columns of one length")


def _placed(values: Sequence[object]) -> tuple[NDArray[np.float64], list[str]]:
    """Values as numbers, NaN for None; texts as their place in the list of different texts, which comes with it."""
    if any(isinstance(v, str) for v in values):
        names = list(dict.fromkeys(str(v) for v in values))
        return np.array([names.index(str(v)) for v in values], dtype=float), names
    return np.array([np.nan if v is None else float(str(v)) for v in values]), []


def _scaled(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """From 0 at the least to 1 at the largest; the middle where all are one."""
    low, high = np.nanmin(values), np.nanmax(values)
    return (values - low) / (high - low) if high > low else np.where(np.isfinite(values), 0.5, np.nan)

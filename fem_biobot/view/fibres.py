"""Pictures of fibres: glyphs and streamlines in the outline of the tissue, histograms of directions with their fit."""

from __future__ import annotations

import os
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from fem_biobot.view.graph import COLOURS, INK, SOFT, legend, name_axes, paired, save, side_by_side
from fem_biobot.view.scene import Layer, Panel, Picture
from fem_biobot.view.surface import feature_edges
from fem_biobot.vtk import boundary_surface

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

GLYPH, LINE, OUTLINE, FAINT = "#a3180f", "#1f5f99", "#2b3137", "#a9b3bc"


def fibre_picture(
    points: Array,
    cells: Ints,
    muscle: Ints,
    *,
    middles: Array,
    directions: Array,
    length: float,
    lines: Sequence[Array],
    title: str,
    name: str = "fibres",
) -> Picture:
    """A picture of a fibre field: from above and from the side, glyphs and streamlines in the body's outline.

    Parameters
    ----------
    points, cells
        Vertices (3, n) [mm] and tetrahedra (4, e) of the body.
    muscle
        Its elements of muscle.
    middles, directions
        Where glyphs stand, (3, k) [mm], and their unit directions, (3, k).
    length
        Of a glyph [mm].
    lines
        Streamlines, (3, t) each [mm].
    title, name
        Title of the picture and name of its file.
    """
    ends = np.stack([middles - 0.5 * length * directions, middles + 0.5 * length * directions], axis=2).reshape(3, -1)
    glyphs = Layer(ends, edges=np.arange(ends.shape[1]).reshape(-1, 2).T, edge_colour=GLYPH, edge_width=1.3)
    tissue = _outline(points, cells[:, muscle], OUTLINE, 1.5)
    body = _outline(points, cells, FAINT, 1.0)
    flow = []
    if lines:
        joined = np.concatenate(lines, axis=1)
        last = np.cumsum([line.shape[1] for line in lines]) - 1
        first = np.setdiff1d(np.arange(joined.shape[1]), last)
        flow = [Layer(joined, edges=np.stack([first, first + 1]), edge_colour=LINE, edge_width=1.2)]
    return Picture(
        name,
        title,
        [
            Panel([tissue, glyphs], "plan", "directions, from above"),
            Panel([tissue, *flow], "plan", "streamlines, from above"),
            Panel([body, tissue, *flow], "iso", "streamlines in the body"),
        ],
        legend=[("direction of an element", GLYPH), *([("along the fibres", LINE)] if lines else [])],
    )


def _outline(points: Array, cells: Ints, colour: str, width: float) -> Layer:
    triangles = boundary_surface(cells)
    return Layer(points, edges=feature_edges(points, triangles), edge_colour=colour, edge_width=width)


def histogram_plot(
    path: str | os.PathLike[str],
    histograms: Sequence[tuple[str, Array, Array, Array | None]],
    *,
    title: str = "Directions of fibres",
) -> None:
    """Histograms of directions, each with its fitted curve.

    Parameters
    ----------
    path
        PNG file.
    histograms
        Name, directions [deg], shares [1] and the curve at the same directions [1] or None, of each.
    title
        Above the graph.

    Raises
    ------
    FileError
        Rows of different length or not finite; the file cannot be written.
    """
    figure, (axes,) = side_by_side(1, (6.6, 4.2))
    for number, (name, degrees, shares, curve) in enumerate(histograms):
        colour = COLOURS[number % len(COLOURS)]
        xs, ys = paired(path, name, degrees, shares)
        width = float(xs[1] - xs[0]) if len(xs) > 1 else 1.0
        if len(histograms) == 1:
            axes.bar(xs, ys, 0.9 * width, color=SOFT, alpha=0.5, linewidth=0.0, label=name)
        else:
            axes.plot(xs, ys, ".", color=colour, markersize=3.5, label=name)
        if curve is not None:
            x_fit, y_fit = paired(path, f"{name}, fit", degrees, curve)
            axes.plot(x_fit, y_fit, "-", color=INK if len(histograms) == 1 else colour, linewidth=1.4,
                      label=f"{name}, fit" if len(histograms) == 1 else None)  # fmt: skip
    name_axes(
        axes, "direction, counter-clockwise from the picture's right [deg]", "share of the structure in a bin [1]"
    )
    axes.set_ylim(bottom=0.0)
    legend(axes)
    save(figure, path, title)

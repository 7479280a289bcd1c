"""Rendered images put together: title, captions, colour bar, legend, scale bar and axes, drawn by matplotlib."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from fem_biobot.files import replacing
from fem_biobot.view.layout import BAR, FOOTER, HEADER, MARGIN, Frame, Layout
from fem_biobot.view.scene import Bar, Picture, colour_map

DPI = 160
INK, SOFT, FRAME = "#1f2429", "#667079", "#b9c0c6"


def compose(
    path: str | os.PathLike[str], picture: Picture, layout: Layout, images: Sequence[NDArray[np.uint8]]
) -> None:
    """Write a picture from the images of its frames, (height, width, 3) each; whole or not at all."""
    figure = Figure(figsize=(layout.width / DPI, layout.height / DPI), dpi=DPI, facecolor="white")
    FigureCanvasAgg(figure)
    for frame, image in zip(layout.frames, images, strict=True):
        _place(figure, layout, frame, image)
    figure.text(MARGIN / layout.width, 1.0 - 20 / layout.height, picture.title, color=INK, fontsize=13, va="top")
    if picture.bar is not None:
        _bar(figure, layout, picture.bar)
    if picture.legend:
        handles = [Patch(facecolor=colour, label=label) for label, colour in picture.legend]
        figure.legend(
            handles=handles, loc="lower right", ncols=len(handles), frameon=False, fontsize=9, labelcolor=INK,
            bbox_to_anchor=(1.0 - MARGIN / layout.width, 8 / layout.height), borderaxespad=0.0,
        )  # fmt: skip
    _ruler(figure, layout)
    with replacing(path) as temporary:
        figure.savefig(temporary, dpi=DPI, metadata={"Software": None})


def _place(figure: Figure, layout: Layout, frame: Frame, image: NDArray[np.uint8]) -> None:
    """Put an image at its place, one image pixel on one pixel, and its caption above it."""
    wide, tall = frame.view.pixels
    corner = (frame.left / layout.width, frame.bottom / layout.height)
    axes = figure.add_axes((*corner, wide / layout.width, tall / layout.height))
    axes.imshow(image, extent=frame.view.window, interpolation="nearest", aspect="auto")
    axes.set_xticks([])
    axes.set_yticks([])
    for spine in axes.spines.values():
        spine.set_visible(frame.is_inset)
        spine.set_color(FRAME)
        spine.set_linewidth(0.8)
    if not frame.caption:
        return
    caption = frame.caption
    if frame.is_inset:
        caption += f" (x{layout.mm_per_pixel * tall / (2.0 * frame.view.half_height):.1f})"
    size = 8.5 if frame.is_inset else 9.5
    y = corner[1] + (tall + 5) / layout.height
    figure.text(corner[0] + 4 / layout.width, y, caption, color=INK, fontsize=size, va="bottom")


def _bar(figure: Figure, layout: Layout, bar: Bar) -> None:
    """The colour bar at the right, its label and its note."""
    tall = min(0.62 * (layout.height - HEADER - FOOTER), 460.0)
    bottom = FOOTER + (layout.height - HEADER - FOOTER - tall) / 2.0
    left = layout.width - BAR + 42
    axes = figure.add_axes((left / layout.width, bottom / layout.height, 20 / layout.width, tall / layout.height))
    mappable = ScalarMappable(Normalize(*bar.limits), colour_map(bar.colours))
    drawn = figure.colorbar(
        mappable, cax=axes, extend=bar.extend, extendfrac=0.035, ticks=MaxNLocator(6, steps=[1, 2, 2.5, 5, 10])
    )  # fmt: skip
    drawn.outline.set_linewidth(0.5)  # pyright: ignore[reportCallIssue, reportAttributeAccessIssue]
    axes.tick_params(labelsize=9, colors=INK, width=0.6, length=3)
    axes.set_ylabel(bar.label, fontsize=9.5, color=INK, labelpad=6)
    axes.yaxis.set_label_position("left")
    if bar.note:
        x = (layout.width - MARGIN) / layout.width
        figure.text(x, 22 / layout.height, bar.note, color=SOFT, fontsize=7.5, ha="right", va="bottom")


def _ruler(figure: Figure, layout: Layout) -> None:
    """A round length and the directions of the axes, at the lower left; both hold for every main panel."""
    aim = 0.12 * layout.width * layout.mm_per_pixel
    decade = 10.0 ** np.floor(np.log10(aim))
    length = decade * max(step for step in (1.0, 2.0, 5.0) if step * decade <= aim)
    axes = figure.add_axes((0.0, 0.0, 0.6, FOOTER / layout.height), zorder=4)
    axes.set_axis_off()
    axes.set_xlim(0.0, 0.6 * layout.width)
    axes.set_ylim(0.0, FOOTER)
    axes.patch.set_visible(False)
    cameras = {frame.view.axes.tobytes(): frame.view.axes for frame in layout.frames if not frame.is_inset}
    x = MARGIN + 14.0
    for directions in cameras.values():
        _triad(axes, x + 4.0, directions)
        x += 78.0
    end = x + length / layout.mm_per_pixel
    axes.plot([x, x, x, end, end, end], [25, 33, 29, 29, 33, 25], color=INK, linewidth=1.1, solid_capstyle="butt")
    axes.text(end + 8.0, 29.0, f"{length:g} mm", fontsize=8.5, color=INK, va="center")


def _triad(axes: Axes, x: float, directions: NDArray[Any]) -> None:
    """The three coordinate directions as seen by a camera; one that points at the viewer is left out."""
    for name, vector in zip("xyz", directions[:2].T, strict=True):
        if np.hypot(*vector) < 0.05:
            continue
        dx, dy = 30.0 * vector
        axes.annotate(
            "", (x + dx, 20.0 + dy), (x, 20.0),
            arrowprops={"arrowstyle": "-|>", "color": SOFT, "lw": 0.9, "mutation_scale": 6, "shrinkA": 0, "shrinkB": 0},
        )  # fmt: skip
        axes.text(x + 1.32 * dx, 20.0 + 1.32 * dy, name, fontsize=7.5, color=SOFT, ha="center", va="center")

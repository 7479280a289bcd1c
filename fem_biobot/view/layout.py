"""Where the panels of a picture stand and what each shows: one scale for all of them, insets beside them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fem_biobot.view.scene import Inset, Layer, Panel, Picture, View, camera_axes

Array = NDArray[np.float64]

HEADER, FOOTER, BAR, CAPTION = 74, 66, 190, 34  # pixels
GAP, MARGIN = 14, 26
MAX_HEIGHT = 1200
_PADDING = 1.06
_LEAST_WITH_BAR = 380  # pixels, so that the bar's label fits beside it
_INSET = 0.28  # of the picture's width


@dataclass(frozen=True)
class Frame:
    """A view and its place: left and bottom corner in pixels of the picture."""

    view: View
    left: int
    bottom: int
    caption: str = ""
    is_inset: bool = False


@dataclass(frozen=True)
class Layout:
    """Size of a picture in pixels and its frames, main ones first in order, each followed by its inset."""

    width: int
    height: int
    frames: tuple[Frame, ...]
    mm_per_pixel: float


def used_points(layer: Layer) -> Array:
    """Positions that the layer draws, (3, n)."""
    used = np.unique(np.concatenate([layer.triangles.ravel(), layer.edges.ravel()]))
    return layer.points[:, used]


def lay_out(picture: Picture, *, width: int = 1600) -> Layout:
    """Arrange a picture's panels in the grid that shows them largest, and fit the size to what they hold."""
    boxes = [_extent(panel) for panel in picture.panels]  # low and high corner in the picture plane [mm]
    size = np.max([high - low for low, high in boxes], axis=0) * _PADDING + 1e-9
    captions = CAPTION if any(panel.caption for panel in picture.panels) else 0
    side = int(_INSET * width) if any(panel.inset for panel in picture.panels) else 0
    beside = side + GAP if side else 0
    around = 2 * MARGIN + (BAR if picture.bar else 0)
    room_x, room_y = width - around, MAX_HEIGHT - HEADER - FOOTER
    best: tuple[float, int, int] | None = None
    count = len(picture.panels)
    for rows in range(1, count + 1):
        columns = -(-count // rows)
        scale = max(
            size[0] / ((room_x - GAP * (columns - 1)) / columns - beside),
            size[1] / ((room_y - GAP * (rows - 1)) / rows - captions),
        )
        if scale > 0.0 and (best is None or scale < best[0]):
            best = (scale, rows, columns)
    assert best is not None  # a picture has a panel
    scale, rows, columns = best
    wide = max(int(size[0] / scale), (int(0.6 * width) - around) // columns - beside)
    tall = max(int(size[1] / scale), side, _LEAST_WITH_BAR // rows if picture.bar else 60)
    width = around + columns * (wide + beside) + GAP * (columns - 1)
    height = HEADER + FOOTER + rows * (tall + captions) + GAP * (rows - 1)
    frames: list[Frame] = []
    for number, panel in enumerate(picture.panels):
        row, column = divmod(number, columns)
        left = MARGIN + column * (wide + beside + GAP)
        bottom = height - HEADER - (row + 1) * (tall + captions) - row * GAP
        low, high = boxes[number]
        a, b = (float(v) for v in (low + high) / 2.0)
        view = View(panel.layers, camera_axes(panel.camera), (a, b), scale * tall / 2.0, (wide, tall), picture.bar)
        frames.append(Frame(view, left, bottom, panel.caption))
        if panel.inset is not None:
            frames.append(_inset(frames[-1], panel.inset, side))
    return Layout(width, height, tuple(frames), scale)


def _extent(panel: Panel) -> tuple[Array, Array]:
    """Low and high corner, (2,), of what a panel shows in the picture plane [mm]."""
    axes = camera_axes(panel.camera)
    flat = np.hstack([axes[:2] @ used_points(layer) for layer in panel.layers])
    return flat.min(axis=1), flat.max(axis=1)


def _inset(frame: Frame, inset: Inset, side: int) -> Frame:
    """The zoomed square to the right of a frame, at its upper edge."""
    axes = camera_axes(inset.camera)
    a, b = (float(v) for v in axes[:2] @ np.array(inset.centre))
    view = View(inset.layers, axes, (a, b), inset.reach, (side, side), frame.view.bar)
    wide, tall = frame.view.pixels
    return Frame(view, frame.left + wide + GAP, frame.bottom + (tall - side) // 2, inset.label, is_inset=True)

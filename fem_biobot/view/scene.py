"""What a picture shows, as plain frozen records, and where the camera stands.

Pictures use parallel projection only, so a length in the picture plane is a length in mm and both renderers (VTK's and
the built-in one) agree to the pixel. Knows arrays, not designs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.colors import Colormap, ListedColormap
from numpy.typing import NDArray

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

NO_TRIANGLES: Ints = np.zeros((3, 0), dtype=np.int64)
NO_EDGES: Ints = np.zeros((2, 0), dtype=np.int64)

# direction from the body to the camera; x is to the right, and z up in all but the plan, where y is
CAMERAS: dict[str, tuple[float, float, float]] = {
    "front": (0.0, -1.0, 0.0),
    "iso": (0.50, -1.0, 0.36),
    "iso_below": (0.50, -1.0, -0.50),
    "iso_below_left": (-0.50, -1.0, -0.50),
    # from above, a hair off the vertical so that x stays to the right
    "plan": (0.0, -1e-6, 1.0),
}


@dataclass(frozen=True)
class Bar:
    """A colour bar.

    Attributes
    ----------
    label
        What is coloured, with its unit in brackets.
    limits
        Values at the two ends of the colours.
    colours
        Name of a matplotlib colour map, or ``"stress"`` (`colour_map`).
    note
        Said under the bar, such as where the colours stop; empty for none.
    extend
        ``"neither"``, ``"min"``, ``"max"`` or ``"both"``: ends beyond which values exist.
    """

    label: str
    limits: tuple[float, float]
    colours: str = "viridis"
    note: str = ""
    extend: str = "neither"


@dataclass(frozen=True)
class Layer:
    """A triangulated surface, or lines, in one colour or coloured by a point scalar.

    Attributes
    ----------
    points
        Positions as drawn, (3, n) [mm].
    triangles
        Node numbers, (3, f), counter-clockwise from outside; may be empty.
    values
        Scalar at the nodes for the picture's bar, (n,); None for one colour.
    colour
        Colour of the surface where `values` is None.
    opacity
        1 is opaque; a layer below 1 shows its front side only.
    lit
        False for flat colour without shading.
    edges
        Node pairs drawn as lines, (2, s).
    edge_colour, edge_width
        Their colour and width [pixels of the finished picture].
    """

    points: Array
    triangles: Ints = field(default_factory=lambda: NO_TRIANGLES)
    values: NDArray[Any] | None = None
    colour: str = "#b9c4cf"
    opacity: float = 1.0
    lit: bool = True
    edges: Ints = field(default_factory=lambda: NO_EDGES)
    edge_colour: str = "#30363d"
    edge_width: float = 1.0


@dataclass(frozen=True)
class Inset:
    """A zoomed view beside a panel, of its own layers by its own camera.

    Around `centre`, (3,) [mm], reaching `reach` [mm] from it to each side.
    """

    layers: Sequence[Layer]
    centre: tuple[float, float, float]
    reach: float
    label: str = ""
    camera: str = "iso_below"


@dataclass(frozen=True)
class Panel:
    """One view of some layers, with a caption of its own; `camera` is a key of `CAMERAS`."""

    layers: Sequence[Layer]
    camera: str = "iso"
    caption: str = ""
    inset: Inset | None = None


@dataclass(frozen=True)
class Picture:
    """A file ``<name>.png``: a title, panels that share one scale, one colour bar, a legend of plain colours."""

    name: str
    title: str
    panels: Sequence[Panel]
    bar: Bar | None = None
    legend: Sequence[tuple[str, str]] = ()


@dataclass(frozen=True)
class View:
    """One image to render: layers, camera axes, window in the picture plane, size.

    Attributes
    ----------
    axes
        Rows right, up, and toward the viewer, (3, 3) [1].
    centre
        Middle of the window along right and up [mm].
    half_height
        Half the window's height [mm].
    pixels
        Width and height of the image.
    """

    layers: Sequence[Layer]
    axes: Array
    centre: tuple[float, float]
    half_height: float
    pixels: tuple[int, int]
    bar: Bar | None = None

    @property
    def window(self) -> tuple[float, float, float, float]:
        """Left, right, bottom and top of the image in the picture plane [mm]."""
        a, b = self.centre
        half_width = self.half_height * self.pixels[0] / self.pixels[1]
        return (a - half_width, a + half_width, b - self.half_height, b + self.half_height)


def colour_map(name: str) -> Colormap:
    """A colour map by name: matplotlib's, or ``"stress"``.

    ``"stress"`` is matplotlib's perceptually uniform magma from light (none) to dark, without its black end, in which
    shading would be lost.
    """
    if name == "stress":
        return ListedColormap(np.asarray(colormaps["magma_r"](np.linspace(0.02, 0.80, 256))), name="stress")
    return colormaps[name]


def camera_axes(camera: str) -> Array:
    """Right, up and toward-the-viewer unit vectors of a camera preset as rows, (3, 3) [1]."""
    back = np.array(CAMERAS[camera]) / np.linalg.norm(CAMERAS[camera])
    right = np.cross([0.0, 0.0, 1.0], back)
    right /= np.linalg.norm(right)
    return np.array([right, np.cross(back, right), back])

"""The built-in renderer: a depth buffer in numpy, for machines where VTK cannot draw.

Draws a `View` as VTK would, with the same camera, lights and colours; slower, and of several translucent surfaces
behind each other it shows the first. Needs no graphics library of any kind.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.colors import to_rgb
from numpy.typing import NDArray

from fem_biobot.view.scene import Bar, Layer, View, colour_map
from fem_biobot.view.surface import corner_normals

Array = NDArray[np.float64]

# camera lights as (right, up, toward the viewer) and strength; render_child.py uses the same numbers
LIGHTS = (((-0.45, 0.70, 0.65), 0.42), ((0.50, 0.10, 0.60), 0.22))
AMBIENT = 0.55
SUPERSAMPLING = 2
_PAIRS = 3_000_000  # triangle-pixel pairs looked at in one go, which bounds the memory


class _Buffer:
    """Nearest triangle of each pixel: its depth (larger is nearer), number and two barycentric coordinates."""

    def __init__(self, size: int) -> None:
        self.depth = np.full(size, -np.inf)
        self.triangle = np.full(size, -1, dtype=np.int64)
        self.weight = np.zeros((2, size))


def render(view: View) -> NDArray[np.uint8]:
    """Draw a view on white.

    Returns
    -------
    NDArray
        Red, green, blue, (height, width, 3), rows from the top.
    """
    width, height = (SUPERSAMPLING * p for p in view.pixels)
    image = np.ones((width * height, 3))
    depth = np.full(width * height, -np.inf)
    for layer in sorted(view.layers, key=lambda item: item.opacity < 1.0):
        if layer.triangles.shape[1]:
            _draw_surface(view, layer, image, depth, (width, height))
    for layer in view.layers:
        if layer.edges.shape[1]:
            _draw_edges(view, layer, image, depth, (width, height))
    s = SUPERSAMPLING
    small = image.reshape(height // s, s, width // s, s, 3).mean(axis=(1, 3))
    return (255.0 * np.clip(small, 0.0, 1.0) + 0.5).astype(np.uint8)


def _pixel_positions(view: View, points: Array, size: tuple[int, int]) -> Array:
    """Column, row from the top and nearness of points, (3, n)."""
    right, up, near = view.axes @ points
    left, _, _, top = view.window
    scale = size[1] / (2.0 * view.half_height)
    return np.array([(right - left) * scale - 0.5, (top - up) * scale - 0.5, near * scale])


def _draw_surface(view: View, layer: Layer, image: Array, depth: Array, size: tuple[int, int]) -> None:
    """Blend the layer's nearest triangles into the image; opaque ones enter the depth buffer."""
    corner = _pixel_positions(view, layer.points, size)[:, layer.triangles]  # (3, corner, f)
    buffer = _Buffer(depth.size)
    _scan(corner, buffer, size, front_only=layer.opacity < 1.0)
    pixels = np.flatnonzero((buffer.triangle >= 0) & (buffer.depth > depth))
    triangle = buffer.triangle[pixels]
    b, c = buffer.weight[:, pixels]
    weights = np.array([1.0 - b - c, b, c])  # (corner, pixel)
    colour = _surface_colour(layer, view.bar, triangle, weights)
    if layer.lit:
        normals = view.axes @ corner_normals(layer.points, layer.triangles).reshape(3, -1)
        normal = (normals.reshape(3, 3, -1)[:, :, triangle] * weights).sum(axis=1)
        colour = np.clip(colour * _brightness(normal)[:, None], 0.0, 1.0)
    image[pixels] += layer.opacity * (colour - image[pixels])
    if layer.opacity >= 1.0:
        depth[pixels] = buffer.depth[pixels]


def _surface_colour(layer: Layer, bar: Bar | None, triangle: NDArray[Any], weights: Array) -> Array:
    """Colour before shading, (pixel, 3): the scalar is interpolated first and coloured after."""
    if layer.values is None or bar is None:
        return np.tile(to_rgb(layer.colour), (triangle.size, 1))
    value = (np.asarray(layer.values, dtype=float)[layer.triangles[:, triangle]] * weights).sum(axis=0)
    low, high = bar.limits
    return np.asarray(colour_map(bar.colours)(np.clip((value - low) / (high - low), 0.0, 1.0)))[:, :3]


def _brightness(normal: Array) -> Array:
    """Light that a matt surface sends to the viewer, (pixel,); normals are turned to the viewer."""
    normal = normal * np.where(normal[2] < 0.0, -1.0, 1.0) / np.maximum(np.linalg.norm(normal, axis=0), 1e-12)
    total = np.full(normal.shape[1], AMBIENT)
    for direction, strength in LIGHTS:
        unit = np.array(direction) / np.linalg.norm(direction)
        total += strength * np.maximum(unit @ normal, 0.0)
    return total


def _scan(corner: Array, buffer: _Buffer, size: tuple[int, int], *, front_only: bool) -> None:
    """Enter all triangles, (3, corner, f) in pixels, into the buffer."""
    width, height = size
    x, y, _ = corner
    area = (x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0])
    low_x = np.clip(np.ceil(x.min(axis=0)), 0, width).astype(np.int64)
    low_y = np.clip(np.ceil(y.min(axis=0)), 0, height).astype(np.int64)
    wide = np.clip(np.floor(x.max(axis=0)) + 1, 0, width).astype(np.int64) - low_x
    tall = np.clip(np.floor(y.max(axis=0)) + 1, 0, height).astype(np.int64) - low_y
    # rows run downward, so counter-clockwise triangles have negative area
    use = np.flatnonzero((wide > 0) & (tall > 0) & ((area < 0.0) if front_only else (area != 0.0)))
    pairs = np.cumsum(wide[use] * tall[use])
    for part in np.split(use, np.searchsorted(pairs, np.arange(_PAIRS, pairs[-1], _PAIRS)) if use.size else []):
        count = wide[part] * tall[part]
        t = np.repeat(part, count)
        k = np.arange(t.size) - np.repeat(np.cumsum(count) - count, count)
        px, py = low_x[t] + k % wide[t], low_y[t] + k // wide[t]
        dx, dy = px - x[0, t], py - y[0, t]
        b = (dx * (y[2, t] - y[0, t]) - dy * (x[2, t] - x[0, t])) / area[t]
        c = (dy * (x[1, t] - x[0, t]) - dx * (y[1, t] - y[0, t])) / area[t]
        inside = (b >= -1e-9) & (c >= -1e-9) & (b + c <= 1.0 + 1e-9)
        t, b, c, pixel = t[inside], b[inside], c[inside], (py * width + px)[inside]
        z = corner[2][:, t]
        near = z[0] + b * (z[1] - z[0]) + c * (z[2] - z[0])
        np.maximum.at(buffer.depth, pixel, near)
        first = near >= buffer.depth[pixel]
        buffer.triangle[pixel[first]] = t[first]
        buffer.weight[:, pixel[first]] = b[first], c[first]


def _draw_edges(view: View, layer: Layer, image: Array, depth: Array, size: tuple[int, int]) -> None:
    """Stamp the layer's lines where no surface stands in front of them."""
    width, height = size
    a, b = _pixel_positions(view, layer.points, size)[:, layer.edges].transpose(1, 0, 2)
    steps = np.maximum(np.ceil(1.5 * np.abs(b - a)[:2].max(axis=0)), 1.0).astype(np.int64) + 1
    segment = np.repeat(np.arange(steps.size), steps)
    k = np.arange(segment.size) - np.repeat(np.cumsum(steps) - steps, steps)
    x, y, near = a[:, segment] + (b - a)[:, segment] * (k / (steps[segment] - 1.0))
    near = near + 0.004 * height  # lines lie on surfaces and on their outer edge
    reach = 0.5 * layer.edge_width * SUPERSAMPLING
    span = np.arange(-np.ceil(reach), np.ceil(reach) + 1)
    column, row = np.rint(x).astype(np.int64), np.rint(y).astype(np.int64)
    within = (column >= 0) & (column < width) & (row >= 0) & (row < height)
    within[within] &= near[within] >= depth[row[within] * width + column[within]]
    x, y, column, row = x[within], y[within], column[within], row[within]
    cover = np.zeros(depth.size, dtype=bool)
    for i in span.astype(np.int64):
        for j in span.astype(np.int64):
            u, v = column + i, row + j
            hit = (np.hypot(u - x, v - y) <= reach + 0.25) & (u >= 0) & (u < width) & (v >= 0) & (v < height)
            cover[v[hit] * width + u[hit]] = True
    image[cover] += layer.opacity * (np.array(to_rgb(layer.edge_colour)) - image[cover])

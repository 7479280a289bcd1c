"""Tetrahedra cut by a plane: the section and its moments, the volume beyond it, and where surfaces cross it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True)
class Section:
    """A body cut across at a height.

    Attributes
    ----------
    area
        Of the section [mm^2].
    second_moments
        About its own axes along x and along y [mm^4].
    low, high
        Its ends along x and y, (2,) each [mm].
    """

    area: float
    second_moments: tuple[float, float]
    low: Array
    high: Array


def section(points: Array, cells: Ints, z: float) -> Section | None:
    """Section of tetrahedra at a height; none where there is nothing.

    Parameters
    ----------
    points
        Vertices, (3, n) [mm].
    cells
        Tetrahedra, (4, e).
    z
        Height [mm], of no vertex or of some: a facet that lies in it counts once, as that of the elements above.
    """
    above = points[2] >= z
    cut = cells[:, above[cells].any(axis=0) & ~above[cells].all(axis=0)]
    if not cut.size:
        return None
    areas, moments, ends = [], [], []
    for count in (1, 2, 3):
        some = cut[:, above[cut].sum(axis=0) == count]
        order = np.argsort(~above[some], axis=0, kind="stable")
        some = np.take_along_axis(some, order, axis=0)
        up, down = range(count), range(count, 4)
        corners = np.array([_between(points, some[a], some[b], z) for a in up for b in down])  # (corner, 2, e)
        # two above and two below are cut in a quadrangle, whose corners go round as 0, 1, 3, 2
        for a, b, c in ((0, 1, 2), (1, 3, 2))[: len(corners) - 2]:
            p, q, r = corners[a], corners[b], corners[c]
            area = 0.5 * np.abs((q - p)[0] * (r - p)[1] - (q - p)[1] * (r - p)[0])
            areas.append(area)
            # a quadratic is integrated by the middles of the sides
            middles = np.array([p + q, q + r, r + p]) / 2.0
            moments.append(np.array([middles.mean(axis=0) * area, (middles**2).mean(axis=0) * area]))
        ends.append(corners)
    area = float(sum(each.sum() for each in areas))
    first, second = (np.sum([each[k].sum(axis=-1) for each in moments], axis=0) for k in (0, 1))
    about = second - first**2 / area
    every = np.concatenate([corners.transpose(1, 0, 2).reshape(2, -1) for corners in ends], axis=1)
    return Section(area, (float(about[1]), float(about[0])), every.min(axis=1), every.max(axis=1))


def _between(points: Array, one: Ints, other: Ints, z: float) -> Array:
    """Where edges cross a height, (2, e)."""
    a, b = points[:, one], points[:, other]
    share = (z - b[2]) / (a[2] - b[2])
    return (b + share * (a - b))[:2]


def volume_above(points: Array, cells: Ints, z: float) -> float:
    """Volume of what of tetrahedra lies above a height [mm^3].

    Exact: a corner above is a tetrahedron of its own, two are a wedge of three, in shares of the edges that are cut.

    Parameters
    ----------
    points
        Vertices, (3, n) [mm].
    cells
        Tetrahedra, (4, e).
    z
        Height [mm].
    """
    above = points[2] > z
    order = np.argsort(~above[cells], axis=0, kind="stable")
    cells = np.take_along_axis(cells, order, axis=0)
    count = above[cells].sum(axis=0)
    a, b, c, d = points[:, cells].transpose(1, 0, 2)
    volume = np.abs(np.sum(np.cross(b - a, c - a, axis=0) * (d - a), axis=0)) / 6.0
    share = (count == 4).astype(np.float64)
    corner, wedge, most = (count == k for k in (1, 2, 3))

    def cut(some: NDArray[np.bool_], up: Array, down: Array) -> Array:
        """Of edges, from their upper ends to where they are cut."""
        return (up[2, some] - z) / (up[2, some] - down[2, some])

    share[corner] = cut(corner, a, b) * cut(corner, a, c) * cut(corner, a, d)
    share[most] = 1.0 - (1.0 - cut(most, a, d)) * (1.0 - cut(most, b, d)) * (1.0 - cut(most, c, d))
    ac, ad, bc, bd = (cut(wedge, up, down) for up in (a, b) for down in (c, d))
    share[wedge] = ac * ad + bc * (1.0 - ac) * ad + (1.0 - ad) * bc * bd
    return float(share @ volume)


def lines(points: Array, corners: Ints, z: float) -> Array:
    """Where triangles, (3, f), cross a height: both ends along x and y of lines, (2, 2, k): end, axis, line [mm]."""
    above = points[2] >= z
    count = above[corners].sum(axis=0)
    found = []
    for up in (1, 2):
        some = corners[:, count == up]
        # the corner on a side of its own comes first
        order = np.argsort(above[some] if up == 2 else ~above[some], axis=0, kind="stable")
        some = np.take_along_axis(some, order, axis=0)
        found.append(np.array([_between(points, some[0], some[k], z) for k in (1, 2)]))
    return np.concatenate(found, axis=2)


def distances(lines: Array, places: Array) -> Array:
    """Of places, (2, n), from the nearest of lines in the plane, (2, 2, k): end, axis, line [mm]."""
    start, way = lines[0], lines[1] - lines[0]
    length = np.maximum(np.sum(way**2, axis=0), 1e-300)
    found = np.empty(places.shape[1])
    for n, place in enumerate(places.T):
        share = np.clip(np.sum((place[:, None] - start) * way, axis=0) / length, 0.0, 1.0)
        found[n] = np.linalg.norm(place[:, None] - start - share * way, axis=0).min()
    return found

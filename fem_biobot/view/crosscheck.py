"""Pictures of two models side by side: their measures over tension, differences beside expected bands, both shapes."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.collections import PolyCollection
from numpy.typing import ArrayLike, NDArray

from fem_biobot.view.graph import COLOURS, INK, SOFT, legend, name_axes, paired, save, side_by_side

Array = NDArray[np.float64]


def both_over(
    path: str | os.PathLike[str],
    tension: ArrayLike,
    panels: Mapping[str, Mapping[str, ArrayLike]],
    *,
    x: str,
    title: str,
) -> None:
    """One panel a quantity, one curve a model.

    Parameters
    ----------
    path
        PNG file.
    tension
        Abscissa of all curves, (t,).
    panels
        Name of the quantity with its unit to name of the model to values, (t,).
    x, title
        Name of the abscissa with its unit, and what stands above.

    Raises
    ------
    FileError
        Rows of different length or not finite; the file cannot be written.
    """
    figure, axes = side_by_side(len(panels), (3.3 * len(panels), 3.4))
    for each, (name, curves) in zip(axes, panels.items(), strict=True):
        for number, (model, values) in enumerate(curves.items()):
            xs, ys = paired(path, f"{name}, {model}", tension, values)
            each.plot(xs, ys, "-o", color=COLOURS[number], linewidth=1.6, markersize=3.6, label=model)
        name_axes(each, x, name)
    legend(axes[0])
    save(figure, path, title)


def bent_beam(
    path: str | os.PathLike[str],
    x: ArrayLike,
    curvature: Mapping[str, ArrayLike],
    roots: Mapping[str, tuple[float, float]],
    *,
    title: str,
) -> None:
    """Curvature along a beam, and beside it by how much its two roots yield, one colour a model.

    Parameters
    ----------
    path
        PNG file.
    x
        Along the span, (m,) [mm].
    curvature
        Name of the model to the beam's curvature there, without its roots, (m,) [1/mm].
    roots
        Name of the model to the turn of the short and the long pillar beyond the beam's ends [deg].
    title
        What stands above.

    Raises
    ------
    FileError
        As `both_over`.
    """
    figure, (along, ends) = side_by_side(2, (9.2, 3.4))
    for number, (model, values) in enumerate(curvature.items()):
        xs, ys = paired(path, f"curvature, {model}", x, values)
        along.plot(xs, ys, "-o", color=COLOURS[number], linewidth=1.6, markersize=3.6, label=model)
        _, turns = paired(path, f"roots, {model}", (0.0, 1.0), roots[model])
        places = np.arange(2) + 0.22 * (number - 0.5 * (len(curvature) - 1))
        ends.bar(places, turns, 0.2, color=COLOURS[number], label=model)
    name_axes(along, "along the span [mm]", "curvature of the beam [1/mm]")
    name_axes(ends, "", "yield of the root [deg]")
    ends.set_xticks([0, 1], ["short pillar", "long pillar"])
    ends.axhline(0.0, color=SOFT, linewidth=0.8)
    legend(along)
    save(figure, path, title)


def differences(
    path: str | os.PathLike[str],
    tension: ArrayLike,
    found: Mapping[str, ArrayLike],
    expected: Mapping[str, ArrayLike],
    *,
    title: str,
) -> None:
    """Relative differences over tension, one panel a quantity, each with the band in which it was expected.

    `found` has a row (t,) for each quantity [1], `expected` the band of some of them, (t, 2) [1], or nothing.

    Raises
    ------
    FileError
        As `both_over`.
    """
    names = list(found)
    figure, axes = side_by_side(len(names), (2.3 * len(names), 3.4))
    for each, name in zip(axes, names, strict=True):
        xs, ys = paired(path, name, tension, found[name])
        band = np.asarray(expected.get(name, ()), dtype=float).reshape(-1, 2)
        if len(band) == len(xs):
            each.fill_between(xs, *(100.0 * band.T), color=SOFT, alpha=0.25, linewidth=0)
        each.axhline(0.0, color=SOFT, linewidth=0.8)
        each.plot(xs, 100.0 * ys, "-o", color=COLOURS[0], linewidth=1.6, markersize=3.6)
        each.set_title(name, fontsize=8.5, color=INK)
        name_axes(each, "tension [kPa]", "")
    axes[0].set_ylabel("solid over rods, less 1 [%]", fontsize=9.5, color=INK)
    save(figure, path, title)


def overlaid(
    path: str | os.PathLike[str],
    solid: Mapping[str, Array],
    rods: Mapping[str, Sequence[Array]],
    *,
    title: str,
) -> None:
    """Both models from the side: the solid's surface in grey, the rods as lines, one panel a state.

    Parameters
    ----------
    path
        PNG file.
    solid
        Name of a state to the triangles of the surface in x and z, (f, 3, 2) [mm].
    rods
        Name of the same state to polylines, (p, 2) [mm] each.
    title
        Above the panels.

    Raises
    ------
    FileError
        The file cannot be written.
    """
    figure, axes = side_by_side(len(solid), (4.2 * len(solid), 3.2))
    for each, (name, triangles) in zip(axes, solid.items(), strict=True):
        each.add_collection(PolyCollection(list(triangles), facecolors="0.75", edgecolors="none"))
        for number, line in enumerate(rods.get(name, ())):
            each.plot(line[:, 0], line[:, 1], "-", color=COLOURS[1], linewidth=1.4, label="" if number else "rods")
        each.autoscale_view()
        each.set_aspect("equal")
        each.set_title(name, fontsize=8.5, color=INK)
        name_axes(each, "x [mm]", "z [mm]")
        legend(each)
    save(figure, path, title)


def fitted(
    path: str | os.PathLike[str],
    x: ArrayLike,
    measured: ArrayLike,
    deviation: ArrayLike,
    curves: Mapping[str, ArrayLike],
    *,
    y: str,
    title: str,
) -> None:
    """Measured values with their deviation over the drive, and fits.

    `x`, `measured`, `deviation` and each of the `curves` are rows (r,); `y` names the ordinate with its unit.

    Raises
    ------
    FileError
        As `both_over`.
    """
    figure, (axes,) = side_by_side(1, (5.2, 3.6))
    xs, ys = paired(path, y, x, measured)
    order = np.argsort(xs)
    axes.errorbar(
        xs, ys, yerr=np.asarray(deviation), fmt="o", color=INK, markersize=3.6, linewidth=1.0, label="measured"
    )
    for number, (name, values) in enumerate(curves.items()):
        _, fit = paired(path, name, x, values)
        axes.plot(xs[order], fit[order], "-", color=COLOURS[number], linewidth=1.6, label=name)
    name_axes(axes, "drive [1]", y)
    legend(axes)
    save(figure, path, title)

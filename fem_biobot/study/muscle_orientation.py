"""Orientation of fibres measured in a file, for a design: what the histograms say, and what the design takes of it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from fem_biobot.design import Design
from fem_biobot.muscle.orientation import Histogram, Orientation, fitted_curve, orientation
from fem_biobot.muscle.orientation_file import histograms_of_file
from fem_biobot.study.finding import Finding
from fem_biobot.tables import Table
from fem_biobot.view.fibres import histogram_plot


def orientation_finding(design: Design, file: Path, figures: Path) -> Finding:
    """Orientation of every histogram in a file, seen from the design's axis."""
    muscle = design.muscle
    assert muscle is not None
    axis = muscle.orientation_axis
    histograms = histograms_of_file(file)
    found = [orientation(histogram, axis) for histogram in histograms]
    picture = figures / "orientation.png"
    draw(picture, histograms, found, file.name)
    rows = [
        {"image": h.name, "direction_deg": d, "share_1": s, "fit_1": f}
        for h, o in zip(histograms, found, strict=True)
        for d, s, f in zip(
            np.degrees(h.angles).tolist(), h.shares.tolist(), fitted_curve(o, h.angles).tolist(), strict=True
        )
    ]
    numbers: dict[str, Any] = {
        "file": file.name,
        "axis_deg": float(np.degrees(axis)),
        "images": [numbers_of(o) for o in found],
    }
    remark = (
        f'muscle.orientation = "{file.name}" gives the design theta {np.degrees(found[0].theta):.2f} deg and spread '
        f"{np.degrees(found[0].spread):.2f} deg"
        if len(found) == 1
        else f'muscle.orientation = "{file.name}" and muscle.orientation_image choose one of them for a design'
    )
    return Finding(
        numbers,
        tables_of(found),
        {"orientation": [_flat(n) for n in numbers["images"]], "histograms": rows},
        [(picture, "Shares of the structure by direction, and the fit of the peak over its background.")],
        remarks=[remark],
    )


def draw(path: Path, histograms: Sequence[Histogram], found: Sequence[Orientation], title: str) -> None:
    """Histograms with their fits."""
    histogram_plot(
        path,
        [
            (h.name, np.degrees(h.angles), h.shares, fitted_curve(o, h.angles))
            for h, o in zip(histograms, found, strict=True)
        ],
        title=f"Directions in {title}",
    )


def numbers_of(found: Orientation) -> dict[str, Any]:
    """An orientation for summaries, with units."""

    def deg(value: float) -> float:
        return float(np.degrees(value))

    return {
        "image": found.name,
        "mean_deg": deg(found.mean),
        "width_deg": deg(found.width),
        "spread_deg": deg(found.spread),
        "theta_deg": deg(found.theta),
        "background_1": found.background,
        "amount_1": found.amount,
        "goodness_1": found.goodness,
        "circular_mean_deg": deg(found.circular_mean),
        "circular_spread_deg": deg(found.circular_spread),
        "chi_1": found.chi,
        "second_moment_1": found.second_moment,
        "structure_1": [list(row) for row in found.structure],
        "fit_chi_1": found.fit_chi,
        "fit_second_moment_1": found.fit_second_moment,
    }


def tables_of(found: Sequence[Orientation]) -> list[Table]:
    """What was found, an image a column."""
    words = {
        "mean_deg": "direction of the peak, from the picture's right [deg]",
        "width_deg": "dispersion of the fit [deg]",
        "spread_deg": "spread for a design [deg]",
        "theta_deg": "theta for a design [deg]",
        "background_1": "share in the background",
        "amount_1": "amount within one dispersion",
        "goodness_1": "goodness of the fit",
        "circular_mean_deg": "circular mean of all [deg]",
        "circular_spread_deg": "spread of all about it [deg]",
        "chi_1": "chi, mean |sin theta| of all",
        "second_moment_1": "mean sin^2 theta of all",
        "fit_chi_1": "mean |cos| about the mean, of the fit",
        "fit_second_moment_1": "mean cos^2 about the mean, of the fit",
    }
    columns = [numbers_of(o) for o in found]
    rows = [(text, *(column[key] for column in columns)) for key, text in words.items()]
    structure = [
        (f"structure tensor {a}{b}", *(o.structure["xy".index(a)]["xy".index(b)] for o in found))
        for a, b in ("xx", "xy", "yy")
    ]
    return [Table("Orientation", ("", *(o.name for o in found)), (*rows, *structure))]


def _flat(numbers: dict[str, Any]) -> dict[str, Any]:
    (xx, xy), (_, yy) = numbers["structure_1"]
    rest = {key: value for key, value in numbers.items() if key != "structure_1"}
    return {**rest, "structure_xx_1": xx, "structure_xy_1": xy, "structure_yy_1": yy}

"""Fibres of a design's muscle on a mesh: numbers, pictures, and the field as VTK."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from fem_biobot.design import Design
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.muscle.fibre_numbers import fibre_numbers
from fem_biobot.muscle.fibres import fibre_field
from fem_biobot.muscle.streamlines import streamlines
from fem_biobot.study.finding import Finding
from fem_biobot.study.tissue_views import fibres_view
from fem_biobot.tables import Table
from fem_biobot.view.fibres import fibre_picture
from fem_biobot.view.pictures import draw_pictures
from fem_biobot.view.scene import Picture
from fem_biobot.vtk import write_vtu

Array = np.ndarray

# how many glyphs and lines a picture bears
_GLYPHS, _LINES = 1500, 140
WORDS = {
    "fibres": "field",
    "theta_deg": "theta [deg]",
    "spread_deg": "spread [deg]",
    "elements_1": "elements of muscle",
    "along_middle_1": "tension along x in the middle, first moment",
    "along_middle_second_1": "tension along x in the middle, second moment",
    "along_whole_second_1": "tension along x in all of the muscle, second moment",
    "turn_mean_deg": "turn between neighbours, root of the mean square [deg]",
    "turn_largest_deg": "turn between neighbours, largest [deg]",
    "from_piecewise_mean_deg": "from the piecewise field, root of the mean square [deg]",
    "from_piecewise_share_1": "share of the muscle more than 10 deg from it",
}


def fibres_finding(design: Design, mesh: BodyMesh, figures: Path, *, vtk: Path | None = None) -> Finding:
    """Fibres of a design on a mesh.

    Parameters
    ----------
    design, mesh
        What is examined.
    figures
        Folder of the pictures.
    vtk
        File for the field; none if left out.
    """
    a0 = fibre_field(design, mesh)
    numbers = fibre_numbers(design, mesh, a0)
    if vtk is not None:
        write_fibres(vtk, mesh, a0)
    drawn = draw_pictures([picture_of(design, mesh, a0)], figures)
    X = mesh.points[:, mesh.cells[:, mesh.regions["muscle"]]].mean(axis=1)
    rows = [
        {"x_mm": x, "y_mm": y, "z_mm": z, "a_x": a, "a_y": b, "a_z": c}
        for x, y, z, a, b, c in np.concatenate([X, a0]).T.tolist()
    ]
    return Finding(
        numbers,
        [Table("Fibres", ("", ""), tuple((text, numbers[key]) for key, text in WORDS.items() if key in numbers))],
        {"fibres": rows},
        [(drawn.files[0], "Fibres: directions of elements, and lines along them.")],
        [drawn.note] if drawn.note else [],
        ["tables/fibres.csv reads back as muscle.fibres"],
        [fibres_view(mesh, a0)],
    )


def write_fibres(path: Path, mesh: BodyMesh, a0: Array) -> None:
    """The body with its fibre directions, zero outside of the muscle, as `.vtu`."""
    everywhere = np.zeros((3, mesh.n_elements))
    everywhere[:, mesh.regions["muscle"]] = a0
    write_vtu(
        path, mesh.points, mesh.cells, cell_data={"fibre_direction_1": everywhere}, region=mesh.region_of()
    )  # fmt: skip


def picture_of(design: Design, mesh: BodyMesh, a0: Array) -> Picture:
    """The picture of a fibre field."""
    elements = mesh.regions["muscle"]
    X = mesh.points[:, mesh.cells[:, elements]].mean(axis=1)
    size = (6.0 * np.sqrt(2.0) * mesh.volumes[elements]) ** (1.0 / 3.0)
    # by place and not by number, so that another numbering gives the same picture
    order = np.lexsort(np.round(X / np.median(size)))
    glyphs = order[:: max(1, len(order) // _GLYPHS)]
    seeds = order[:: max(1, len(order) // _LINES)]
    step = 0.3 * float(np.median(size))
    lines = streamlines(X, a0, size, seeds, length=0.5 * float(np.ptp(X[0])), step=step)
    return fibre_picture(
        mesh.points,
        mesh.cells,
        elements,
        middles=X[:, glyphs],
        directions=a0[:, glyphs],
        length=float(np.median(size)),
        lines=lines,
        title=f"{design.name}: fibres of the muscle",
    )

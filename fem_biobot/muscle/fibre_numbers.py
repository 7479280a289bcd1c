"""A field of fibres in numbers: where it points, how smoothly it turns, and how it differs from the piecewise one."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem_biobot.design import Design
from fem_biobot.material.dispersion import Dispersion
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.mesh.facets import facets
from fem_biobot.muscle.blocks import in_junction, junction_blocks
from fem_biobot.muscle.fibres import piecewise_fibres

Array = NDArray[np.float64]


def neighbour_angles(mesh: BodyMesh, a0: Array, region: str = "muscle") -> tuple[Array, Array]:
    """Angle between the fibres of neighbouring elements, (f,) [rad], and the area of the face between, (f,) [mm^2]."""
    cells = mesh.cells[:, mesh.regions[region]]
    found = facets(cells)
    inner = found.elements[1] >= 0
    corners = mesh.points[:, found.triples[:, inner]]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0], axis=0)
    first, second = found.elements[:, inner]
    return between(a0[:, first], a0[:, second]), 0.5 * np.linalg.norm(normal, axis=0)


def between(a: Array, b: Array) -> Array:
    """Angle between directions without sense, (3, e) each, (e,) [rad]."""
    # of the cross product, which is exact where directions agree
    cross, dot = np.linalg.norm(np.cross(a, b, axis=0), axis=0), np.abs(np.einsum("ie,ie->e", a, b))
    return np.arctan2(cross, dot)


def fibre_numbers(design: Design, mesh: BodyMesh, a0: Array) -> dict[str, Any]:
    """Numbers of a design's fibre field `a0` (3, e), means by volume, for summaries.

    Notes
    -----
    ``along_middle_1`` and ``along_middle_second_1`` are the share of the fibre's tension along x in the middle fifth of
    the junctions, first and second moment, misalignment and spread together: ``sin(theta)`` and ``sin(theta)^2`` for
    parallel fibres.
    """
    muscle = design.muscle
    assert muscle is not None
    elements = mesh.regions["muscle"]
    volume = mesh.volumes[elements]
    X = mesh.points[:, mesh.cells[:, elements]].mean(axis=1)
    middle = np.zeros(len(elements), dtype=bool)
    for low, high in junction_blocks(design):
        middle |= in_junction(design, X) & (np.abs(X[0] - 0.5 * (low + high)) <= 0.1 * (high - low))
    angle, area = neighbour_angles(mesh, a0)
    structure, first = _spread(design, a0)

    def mean(values: Array, where: NDArray[np.bool_]) -> float:
        return float(values[where] @ volume[where] / volume[where].sum()) if where.any() else float("nan")

    everywhere = np.ones_like(middle)
    numbers: dict[str, Any] = {
        "fibres": muscle.fibres if muscle.fibres in ("smooth", "piecewise") else "file",
        "theta_deg": float(np.degrees(muscle.theta)),
        "spread_deg": float(np.degrees(muscle.spread)),
        "elements_1": len(elements),
        "along_middle_1": mean(first, middle),
        "along_middle_second_1": mean(structure[0, 0], middle),
        "along_whole_second_1": mean(structure[0, 0], everywhere),
        "turn_mean_deg": float(np.degrees(np.sqrt(angle**2 @ area / area.sum()))),
        "turn_largest_deg": float(np.degrees(angle.max())),
    }
    if design.kind in ("bot", "strip"):
        apart = between(a0, piecewise_fibres(design, mesh))
        numbers["from_piecewise_mean_deg"] = float(np.degrees(np.sqrt(mean(apart**2, everywhere))))
        numbers["from_piecewise_share_1"] = mean((apart > np.radians(10.0)).astype(float), everywhere)
    return {k: v for k, v in numbers.items() if not (isinstance(v, float) and np.isnan(v))}


def _spread(design: Design, a0: Array) -> tuple[Array, Array]:
    """Structure tensor (3, 3, e), and mean of the absolute x component of the dispersed directions (e,)."""
    muscle = design.muscle
    assert muscle is not None
    if not muscle.spread:
        return np.einsum("ie,ke->ike", a0, a0), np.abs(a0[0])
    dispersion = Dispersion(muscle.spread, muscle.spread_kind)
    n, weights = dispersion.directions(a0)
    return dispersion.structure(a0), np.einsum("ke,k->e", np.abs(n[0]), weights)

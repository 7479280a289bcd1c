"""Fibre directions from Laplace problems on tagged meshes: strip, sector and ring against closed forms, refusals."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from fem_biobot.errors import MeshError
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.mesh.facets import facets
from fem_biobot.muscle.directions import fibres_around, fibres_between, unit
from fem_biobot.muscle.laplace import Region
from tests.helpers import box_mesh, rotation, slope, unchanged

Array = NDArray[np.float64]
INNER, OUTER, HEIGHT = 1.3, 2.4, 0.8  # mm


def with_surfaces(mesh: BodyMesh, names: dict[str, Callable[[Array], Array]]) -> BodyMesh:
    """The mesh with boundary triangles named whose three corners satisfy a condition on the position."""
    found = facets(mesh.cells)
    triangles = found.triples[:, found.boundary]
    on = {name: np.all(where(mesh.points[:, triangles]), axis=0) for name, where in names.items()}
    return replace(mesh, surfaces={name: triangles[:, chosen] for name, chosen in on.items()})


def sector(n: int, angle: float = 2.0) -> BodyMesh:
    """Annular sector from 0 to `angle` [rad], inner vertices off their grid, ends `begin` and `finish`, its walls."""
    box = box_mesh((2 * n, n, n), shift=0.15, seed=19)
    phi, r, z = angle * box.points[0], INNER + (OUTER - INNER) * box.points[1], HEIGHT * box.points[2]
    # x to y is counter-clockwise; the map turns the box's x and y about, so cells change their sense
    mesh = BodyMesh(np.stack([r * np.cos(phi), r * np.sin(phi), z]), box.cells[[1, 0, 2, 3]], dict(box.regions))
    return with_surfaces(
        mesh,
        {
            "begin": lambda X: np.abs(X[1]) < 1e-9,
            "finish": lambda X: np.abs(np.arctan2(X[1], X[0]) - angle) < 1e-9,
            "inner": lambda X: np.abs(np.hypot(X[0], X[1]) - INNER) < 1e-9,
            "outer": lambda X: np.abs(np.hypot(X[0], X[1]) - OUTER) < 1e-9,
        },
    )


def ring(n: int) -> BodyMesh:
    """Whole ring: a sector of a full turn whose ends are one."""
    whole = sector(n, 2.0 * np.pi)
    key = np.round(whole.points / 1e-7).astype(np.int64)
    _, first, number = np.unique(key, axis=1, return_index=True, return_inverse=True)
    number = number.reshape(-1)
    mesh = BodyMesh(whole.points[:, first], number[whole.cells], dict(whole.regions))
    return with_surfaces(
        mesh,
        {
            "inner": lambda X: np.abs(np.hypot(X[0], X[1]) - INNER) < 1e-9,
            "outer": lambda X: np.abs(np.hypot(X[0], X[1]) - OUTER) < 1e-9,
        },
    )


def tangential_error(mesh: BodyMesh, a0: Array) -> float:
    """Root of the volume mean of the squared angle to the circle's tangent [rad]."""
    X = mesh.points[:, mesh.cells].mean(axis=1)
    tangent = np.stack([-X[1], X[0], np.zeros(X.shape[1])]) / np.hypot(X[0], X[1])
    away = np.arccos(np.clip(np.abs(np.einsum("ie,ie->e", a0, tangent)), 0.0, 1.0))
    return float(np.sqrt(away**2 @ mesh.volumes / mesh.volumes.sum()))


def test_a_straight_strip_has_its_axis_exactly() -> None:
    """In a block turned anyhow, on a distorted mesh, every element's fibre is the axis from end to end.

    Catches: a gradient with the wrong transpose, a flux through the side walls.
    """
    box = box_mesh((6, 3, 2), (5.0, 2.0, 0.7), seed=23)
    Q = rotation(5)
    mesh = with_surfaces(box, {"left": lambda X: X[0] < 1e-9, "right": lambda X: X[0] > 5.0 - 1e-9})
    mesh = replace(mesh, points=Q @ mesh.points)
    with unchanged(mesh.points, mesh.cells):
        a0 = fibres_between(mesh, "left", "right")
    np.testing.assert_allclose(a0, np.repeat(Q[:, :1], a0.shape[1], axis=1), rtol=0.0, atol=1e-12)
    # the potential itself is the share of the way
    tissue = Region.of(mesh, "muscle")
    fixed = np.flatnonzero((np.abs(box.points[0]) < 1e-9) | (box.points[0] > 5.0 - 1e-9))
    u = tissue.harmonic(fixed, box.points[0, fixed] / 5.0)
    np.testing.assert_allclose(u, box.points[0] / 5.0, rtol=0.0, atol=1e-13)


def test_a_sector_between_its_ends_tends_to_the_tangent() -> None:
    """The potential of an annular sector is its angle: the fibre is tangential, up to the size of the elements.

    Catches: directions across the walls, a potential pinned at the walls, an order lost at the curved walls.
    """
    sizes, errors = [], []
    for n in (3, 6, 12):
        mesh = sector(n)
        sizes.append(1.0 / n)
        errors.append(tangential_error(mesh, fibres_between(mesh, ["begin"], ["finish"])))
    assert slope(sizes, errors) == pytest.approx(1.4, abs=0.15)
    # a third of an element's own curvature, the elements being 0.08 of the radius long
    assert errors[-1] < np.radians(0.6)


def test_a_ring_between_its_walls_tends_to_the_tangent_without_a_cut() -> None:
    """The potential of a ring is the logarithm of the radius; fibres are tangential, counter-clockwise all the way.

    Catches: a direction that turns back somewhere, the axis taken the other way, a jump at a seam.
    """
    sizes, errors = [], []
    for n in (3, 6, 12):
        mesh = ring(n)
        a0 = fibres_around(mesh, "inner", "outer", axis=(0.0, 0.0, 3.0))
        X = mesh.points[:, mesh.cells].mean(axis=1)
        assert np.all(X[0] * a0[1] - X[1] * a0[0] > 0.0)
        sizes.append(1.0 / n)
        errors.append(tangential_error(mesh, a0))
    assert slope(sizes, errors) == pytest.approx(1.3, abs=0.15)
    assert errors[-1] < np.radians(1.1)


def test_the_field_does_not_depend_on_the_numbering() -> None:
    """Vertices and elements in another order give the same directions at the same places, of unit length to rounding.

    Catches: a choice by the first vertex of an element, a region's elements out of order.
    """
    mesh = sector(4)
    draw = np.random.default_rng(31)
    vertex, element = draw.permutation(mesh.n_vertices), draw.permutation(mesh.n_elements)
    back = np.argsort(vertex)
    other = BodyMesh(
        mesh.points[:, vertex],
        back[mesh.cells[[1, 2, 0, 3]][:, element]],
        mesh.regions,
        {name: back[triangles] for name, triangles in mesh.surfaces.items()},
    )
    for field in (lambda m: fibres_between(m, "begin", "finish"), lambda m: fibres_around(m, "inner", "outer")):
        first, second = field(mesh), field(other)
        np.testing.assert_allclose(second, first[:, element], rtol=0.0, atol=1e-11)
        np.testing.assert_allclose(np.linalg.norm(first, axis=0), 1.0, rtol=0.0, atol=4e-16)


def test_fibres_run_through_the_named_region_only() -> None:
    """Of two layers only the one named has fibres, and what lies in the other does not matter.

    Catches: the whole body taken for the tissue, elements of the wrong region.
    """
    box = box_mesh((4, 2, 4), layers=(0.5, 1.0), names=("gel", "tissue"), seed=29)
    mesh = with_surfaces(box, {"left": lambda X: X[0] < 1e-9, "right": lambda X: X[0] > 1.0 - 1e-9})
    a0 = fibres_between(mesh, "left", "right", region="tissue")
    assert a0.shape == (3, len(mesh.regions["tissue"]))
    np.testing.assert_allclose(a0, np.repeat(np.eye(3)[:, :1], a0.shape[1], axis=1), rtol=0.0, atol=1e-12)


def test_ends_that_lead_nowhere_are_refused() -> None:
    """Missing names, surfaces off the tissue, ends that touch, tissue that no end reaches, equal ends, a bad axis.

    Catches: a singular matrix, NaN directions.
    """
    box = box_mesh((4, 2, 4), layers=(0.25, 1.0), names=("gel", "muscle"), seed=29)
    mesh = with_surfaces(
        box,
        {
            "left": lambda X: X[0] < 1e-9,
            "right": lambda X: X[0] > 1.0 - 1e-9,
            "front": lambda X: X[1] < 1e-9,
            "floor": lambda X: X[2] < 1e-9,
        },
    )
    with pytest.raises(MeshError, match=r"lid: found no such surface in the mesh \(left, right, front, floor\)"):
        fibres_between(mesh, "left", "lid")
    with pytest.raises(MeshError, match="muskel: found no such region"):
        fibres_between(mesh, "left", "right", region="muskel")
    with pytest.raises(MeshError, match="floor: found no vertex of this surface on the tissue"):
        fibres_between(mesh, "floor", "right")
    with pytest.raises(MeshError, match=r"left, front and right: found \d+ vertices on both"):
        fibres_between(mesh, "left", ["front", "right"])
    with pytest.raises(MeshError, match="found no name, expected at least one"):
        fibres_between(mesh, [], "right")
    with pytest.raises(MeshError, match=r"axis: found \[0.0, 0.0, 0.0\], expected three numbers"):
        fibres_around(mesh, "left", "right", axis=(0.0, 0.0, 0.0))
    # fibres "around" x between walls across x have no direction
    with pytest.raises(MeshError, match="elements without a fibre direction"):
        unit(np.array([[1.0, 0.0], [0.0, 0.0], [0.0, 0.0]]))
    two = BodyMesh(
        np.hstack([mesh.points, mesh.points + 5.0]),
        np.hstack([mesh.cells, mesh.cells + mesh.n_vertices]),
        {"muscle": np.arange(2 * mesh.n_elements)},
        dict(mesh.surfaces),
    )
    with pytest.raises(MeshError, match="found 1 of 2 parts of the tissue that no given value reaches"):
        fibres_between(two, "left", "right")

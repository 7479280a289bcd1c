"""Smooth fibre directions of bots: exact in the middle of a bay, along the walls, without a jump between."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from fem_biobot.config import load_design
from fem_biobot.design import Design
from fem_biobot.errors import MeshError
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.mesh.committed import committed_mesh
from fem_biobot.mesh.facets import facets
from fem_biobot.mesh.geometry import GmshMissing, build_mesh
from fem_biobot.muscle.fibres import fibre_field, junction_direction
from fem_biobot.muscle.laplace import Region
from tests.helpers import unchanged

Array = NDArray[np.float64]


@cache
def case(name: str, *overrides: str, size: float = 2.0) -> tuple[Design, BodyMesh, Array, Array]:
    """Design, mesh, fibres and centroids of the muscle; not to be changed."""
    design = load_design(name, ["muscle.fibres=smooth", *overrides])
    mesh = committed_mesh(design, size)
    assert mesh is not None
    with unchanged(mesh.points, mesh.cells):
        fibres = fibre_field(design, mesh)
    return design, mesh, fibres, mesh.points[:, mesh.cells[:, mesh.regions["muscle"]]].mean(axis=1)


@pytest.mark.parametrize("name", ["junction_bot", "ring_bot"])
@pytest.mark.parametrize("theta", [90.0, 67.0, 130.0])
def test_theta_holds_exactly_in_the_middle_half_of_the_bay(name: str, theta: float) -> None:
    """All elements of the junction or the strands within a quarter of the bay from its middle have theta to the bit.

    The middle fifth, where stretch and stress of the fibres are measured, lies within.

    Catches: a field that is nearly at theta, the other sense of turning, in the middle or beyond, a strand left out.
    """
    design, mesh, fibres, X = case(name, f"muscle.theta={theta} deg")
    middle = np.abs(X[0]) <= 0.25 * design.span
    assert middle.sum() > 20
    expected = junction_direction(design.value("muscle.theta"))
    np.testing.assert_array_equal(fibres[:, middle], np.repeat(expected[:, None], middle.sum(), axis=1))
    # beyond, up to a thickness from the mouths, the flow is still nearly along x and theta turns it the same way
    near = (np.abs(X[0]) > 0.25 * design.span) & (np.abs(X[0]) < 0.35 * design.span)
    assert near.sum() > 10
    assert np.abs(expected @ fibres[:, near]).min() > np.cos(np.radians(20.0))
    corners = mesh.points[0][mesh.cells[:, mesh.regions["muscle"]]]
    assert middle[np.abs(corners).min(axis=0) <= 0.1 * design.span].all()
    np.testing.assert_allclose(np.linalg.norm(fibres, axis=0), 1.0, rtol=0.0, atol=4e-16)
    assert not fibres[2].any()


@pytest.mark.parametrize("theta", ["90 deg", "67 deg"])
def test_rings_follow_their_pillars_whatever_theta(theta: str) -> None:
    """Beside a pillar fibres run along x, behind it along y, far from corners; the turn of theta ends at the mouth.

    Catches: theta applied to the rings, fibres that leave through the walls.
    """
    _, _, fibres, X = case("junction_bot", f"muscle.theta={theta}", size=0.9)
    beside = (np.abs(np.abs(X[0]) - 5.25) < 1.0) & (np.abs(X[1]) > 3.5)
    behind = (np.abs(X[0]) > 7.0) & (np.abs(X[1]) < 2.7)
    front = (np.abs(X[0]) < 3.5) & (np.abs(X[1]) > 2.0) & (np.abs(X[1]) < 2.7)
    for part, axis in ((beside, 0), (behind, 1), (front, 1)):
        assert part.sum() > 20
        # one ring's thickness from a corner the flow has straightened to exp(-pi)
        assert np.degrees(np.arccos(np.abs(fibres[axis, part]).min())) < 5.0


def jumps(mesh: BodyMesh, fibres: Array) -> tuple[Array, Array, Array]:
    """Angle between the fibres of neighbours [deg], (f,), area [mm^2] and middle (3, f) of the face between them."""
    tissue = Region.of(mesh, "muscle")
    found = facets(tissue.cells)
    inner = found.elements[1] >= 0
    corners = tissue.points[:, found.triples[:, inner]]
    area = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0], axis=0), axis=0)
    a, b = fibres[:, found.elements[0, inner]], fibres[:, found.elements[1, inner]]
    return np.degrees(np.arccos(np.clip(np.abs(np.einsum("if,if->f", a, b)), 0.0, 1.0))), area, corners.mean(axis=1)


def test_the_field_turns_smoothly_from_ring_to_junction() -> None:
    """Where a ring meets the junction neighbours differ by less and less on finer meshes; piecewise by 90 degrees.

    The line about which the field turns by half a turn, in the plane y = 0, is left out.

    Catches: a jump between ring and junction, a field that follows one of them up to the border.
    """
    rms = []
    for size in (2.0, 0.9, 0.55):
        _, mesh, fibres, _ = case("junction_bot", size=size)
        angle, area, X = jumps(mesh, fibres)
        mouth = (np.abs(np.abs(X[0]) - 3.2) < 0.5) & (np.abs(X[1]) < 1.5) & (np.abs(X[1]) > 0.3)
        rms.append(float(np.sqrt(angle[mouth] ** 2 @ area[mouth] / area[mouth].sum())))
        assert angle[mouth].max() < 45.0
    # elements there are 0.29, 0.2 and 0.15 mm long: in proportion, by a half
    assert rms[0] < 8.0
    assert rms[2] < 0.65 * rms[0]
    piecewise = fibre_field(load_design("junction_bot", ["muscle.fibres=piecewise"]), mesh)
    assert jumps(mesh, piecewise)[0][mouth].max() > 89.0


def test_the_field_depends_on_neither_numbering_nor_named_surfaces() -> None:
    """The same body, its vertices and elements in another order and no surface named, has the same fibres.

    Catches: surfaces of one generator relied on, a sense of direction that follows the numbering.
    """
    design, mesh, fibres, _ = case("junction_bot", "muscle.theta=67 deg")
    draw = np.random.default_rng(37)
    vertex, element = draw.permutation(mesh.n_vertices), draw.permutation(mesh.n_elements)
    place = np.argsort(element)
    other = BodyMesh(
        mesh.points[:, vertex],
        np.argsort(vertex)[mesh.cells[[2, 0, 1, 3]][:, element]],
        {name: place[elements] for name, elements in mesh.regions.items()},
    )
    np.testing.assert_allclose(fibre_field(design, other), fibres, rtol=0.0, atol=1e-9)


def test_a_loop_turns_about_its_ends_without_a_jump() -> None:
    """Layout ring: along x in the strands, along y at the ends, tangential between; no two neighbours at right angles.

    Catches: the loop cut open, flow through the pillars.
    """
    _, mesh, fibres, X = case("ring_bot", size=0.5)
    strand = (np.abs(X[0]) < 2.2) & (np.abs(X[1]) > 1.3)
    end = (np.abs(X[1]) < 0.6) & (np.abs(X[0]) > 3.0)
    assert strand.sum() > 50
    assert end.sum() > 10
    assert np.abs(fibres[0, strand]).min() > np.cos(np.radians(6.0))
    assert np.abs(fibres[1, end]).min() > np.cos(np.radians(6.0))
    assert jumps(mesh, fibres)[0].max() < 75.0
    # counter-clockwise about the middle or clockwise: at a corner the fibre goes across the corner, never out of it
    corner = (np.abs(X[0]) > 3.1) & (np.abs(X[1]) > 1.4)
    out = np.sign(X[:2, corner]) / np.sqrt(2.0)
    assert np.abs(np.einsum("ie,ie->e", out, fibres[:2, corner])).max() < np.sin(np.radians(40.0))


def test_every_bay_has_its_middle_and_every_pillar_its_ways_around() -> None:
    """Three pillars: both junctions at theta in their middles, and the flow passes the middle pillar on both sides.

    Catches: one bay only, a middle pillar around which fibres stop.
    """
    design = load_design(
        "junction_bot",
        ["skeleton.pillar_count=3", "skeleton.pillar_length=2 mm", "muscle.theta=75 deg", "muscle.fibres=smooth"],
    )
    try:
        mesh = build_mesh(design, 2.0)
    except GmshMissing as missing:
        pytest.skip(f"Gmsh cannot start: {missing}")
    fibres = fibre_field(design, mesh)
    X = mesh.points[:, mesh.cells[:, mesh.regions["muscle"]]].mean(axis=1)
    # centres at -6, 0, 6: bays from -5 to -1 and from 1 to 5
    for middle in (-3.0, 3.0):
        core = np.abs(X[0] - middle) <= 1.0
        assert core.sum() > 10
        expected = junction_direction(np.radians(75.0))[:, None]
        np.testing.assert_array_equal(fibres[:, core], np.repeat(expected, core.sum(), axis=1))
    for side in (-1.0, 1.0):
        passing = (np.abs(X[0]) < 0.7) & (side * X[1] > 3.5)
        assert passing.sum() > 5
        # the pillar's corners are one coarse element away
        assert np.abs(fibres[0, passing]).min() > np.cos(np.radians(20.0))


def test_a_mesh_without_tissue_behind_a_pillar_is_refused() -> None:
    """The elements behind the last pillar taken out: the flow has nowhere to end.

    Catches: a singular problem, a field that runs out of the other side.
    """
    design, mesh, _, X = case("junction_bot")
    muscle = mesh.regions["muscle"]
    cut = muscle[X[0] > 6.9]
    moved = replace(mesh, regions={**mesh.regions, "muscle": np.setdiff1d(muscle, cut)})
    with pytest.raises(MeshError, match="no vertex of the tissue behind the last pillar"):
        fibre_field(design, moved)

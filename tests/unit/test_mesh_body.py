"""The mesh record, its measures, and the checks that keep a solver from a mesh it could not trust."""

from __future__ import annotations

import math
import pickle
from typing import Any

import numpy as np
import pytest

from fem_biobot.errors import MeshError
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.mesh.checks import check_volumes
from fem_biobot.mesh.facets import facets, row_keys
from fem_biobot.mesh.naming import interface, oriented, require
from fem_biobot.mesh.quality import quality, radius_ratio
from tests.helpers import box_mesh, generator, rotation, unchanged


@pytest.fixture(scope="module")
def box() -> BodyMesh:
    return box_mesh(2, (1.1, 0.9, 1.3), layers=(0.5, 1.0), names=("skeleton", "muscle"))


def parts(mesh: BodyMesh, **changes: Any) -> BodyMesh:
    """The mesh with other parts, unchecked."""
    return BodyMesh(
        **{
            "points": mesh.points,
            "cells": mesh.cells,
            "regions": mesh.regions,
            "surfaces": mesh.surfaces,
            "landmarks": mesh.landmarks,
            **changes,
        }
    )


def refusal(mesh: BodyMesh) -> str:
    """Message with which a mesh is refused; one line by assertion."""
    with pytest.raises(MeshError) as caught:
        mesh.checked()
    assert "\n" not in str(caught.value)
    return str(caught.value)


def changed(array: np.ndarray, index: Any, value: Any) -> np.ndarray:
    """Copy with one entry set."""
    copy = array.copy()
    copy[index] = value
    return copy


def torn(mesh: BodyMesh) -> tuple[np.ndarray, np.ndarray]:
    """Points and cells of the mesh with a second set of vertices for the muscle, at the same places."""
    cells = mesh.cells.copy()
    cells[:, mesh.regions["muscle"]] += mesh.n_vertices
    points = np.concatenate([mesh.points, mesh.points], axis=1)
    used = np.unique(cells)
    return points[:, used], np.searchsorted(used, cells)


# --- the record -------------------------------------------------------------------------------------------------------


def test_arrays_cannot_be_written_and_inputs_are_copied() -> None:
    """The mesh is data: neither its arrays nor its maps change, also not through the arrays it was made from.

    Catches: arrays taken over without a copy, or left writeable.
    """
    points = np.eye(3, 4, 1)
    mesh = BodyMesh(points, np.arange(4)[:, None], {"muscle": np.array([0])})
    points[0, 0] = 9.0
    assert mesh.points[0, 0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        mesh.points[0, 0] = 1.0
    with pytest.raises(ValueError, match="read-only"):
        mesh.regions["muscle"][0] = 1
    with pytest.raises(TypeError):
        mesh.regions["other"] = np.array([0])  # type: ignore[index]


def test_measures_of_a_box(box: BodyMesh) -> None:
    """Volumes, box, and the vertices of a region are those of the box 1.1 x 0.9 x 1.3 with a layer to half height.

    Catches: the factor 1/6, regions swapped, extent in place of corners.
    """
    half = 1.1 * 0.9 * 1.3 / 2
    assert box.region_volumes() == pytest.approx({"skeleton": half, "muscle": half}, rel=1e-13)
    low, high = box.bounding_box()
    assert np.array_equal(low, [0, 0, 0])
    assert np.array_equal(high, [1.1, 0.9, 1.3])
    assert np.array_equal(box.region_of()[box.regions["muscle"]], np.ones(box.regions["muscle"].size))
    assert box.points[2, box.region_vertices("muscle")].min() == pytest.approx(0.65)


def test_unknowns_count_vertices_and_edges(box: BodyMesh) -> None:
    """A box of n^3 cells in six tetrahedra each has (2n+1)^3 vertices and edges together.

    Catches: edges counted once per element, facets counted instead.
    """
    assert box.n_unknowns == 3 * 5**3


def test_a_mesh_survives_pickling(box: BodyMesh) -> None:
    """A mesh can be sent to another process.

    Catches: maps that cannot be pickled.
    """
    twin = pickle.loads(pickle.dumps(box))
    assert np.array_equal(twin.points, box.points)
    assert list(twin.surfaces) == list(box.surfaces)


def test_radius_ratio_of_known_tetrahedra() -> None:
    """One for the regular tetrahedron; for the corner of a cube 3 r/R with r = (3 - sqrt 3)/6 and R = sqrt(3)/2.

    Catches: a missing factor 3, circumradius from the wrong edge products, lost sign.
    """
    regular = np.array([[1, 1, -1, -1], [1, -1, 1, -1], [1, -1, -1, 1]], dtype=float)
    corner = np.array([[0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]], dtype=float)
    cell = np.arange(4)[:, None]
    turned = rotation() @ regular * 0.37
    assert radius_ratio(turned, cell[[0, 1, 2, 3]])[0] == pytest.approx(-radius_ratio(turned, cell[[1, 0, 2, 3]])[0])
    assert abs(radius_ratio(turned, cell)[0]) == pytest.approx(1.0, rel=1e-12)
    expected = 3 * (3 - math.sqrt(3)) / 6 / (math.sqrt(3) / 2)
    assert radius_ratio(corner, cell)[0] == pytest.approx(expected, rel=1e-12)


def test_quality_finds_the_worst_element(box: BodyMesh) -> None:
    """Flattening one element makes it the worst, and it counts in the share below a tenth.

    Catches: mean and minimum swapped, share as a count.
    """
    points = np.array([[0, 1, 0, 0.3, 0], [0, 0, 1, 0.3, 0], [0, 0, 0, 0.01, -1.0]])
    cells = np.array([[0, 0], [1, 2], [2, 1], [3, 4]])
    found = quality(points, cells)
    assert found.worst == 0
    assert found.minimum < 0.02 < 0.7 < 2 * found.mean
    assert found.share_below_tenth == 0.5
    assert found.longest_edge == pytest.approx(math.sqrt(2))
    assert found.shortest_edge == pytest.approx(math.hypot(0.3, 0.3, 0.01))


def test_mean_edge_of_one_tetrahedron() -> None:
    """Three edges of length one and three of root two.

    Catches: edges of each element counted instead of different edges, vertices instead of edges.
    """
    points = np.array([[0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]], dtype=float)
    mesh = BodyMesh(points, np.arange(4)[:, None], {"muscle": np.array([0])})
    assert mesh.h_mean == pytest.approx((1 + math.sqrt(2)) / 2)


# --- facets and surfaces ----------------------------------------------------------------------------------------------


def test_boundary_facets_close_and_look_outward(box: BodyMesh) -> None:
    """The flux of the position vector through the outward boundary is three times the volume.

    Catches: a face of the reference tetrahedron numbered inward.
    """
    table = facets(box.cells)
    a, b, c = (box.points[:, row] for row in table.triples[:, table.boundary])
    flux = ((a + b + c) / 3 * np.cross(b - a, c - a, axis=0) / 2).sum()
    assert flux == pytest.approx(3 * 1.1 * 0.9 * 1.3, rel=1e-12)
    # Euler: each element has four facets, inner ones are shared
    assert 2 * table.triples.shape[1] - table.boundary.size == 4 * box.n_elements


def test_interface_looks_from_skeleton_to_muscle(box: BodyMesh) -> None:
    """The interface of the two layers is the plane between them, with its normal up, whichever region comes first.

    Catches: facets of one region taken, orientation left to chance.
    """
    swapped = parts(box, regions={"muscle": box.regions["skeleton"], "skeleton": box.regions["muscle"]})
    for mesh, up in ((box, 1.0), (swapped, -1.0)):
        found = interface(facets(mesh.cells), mesh.region_of(), list(mesh.regions))
        a, b, c = (mesh.points[:, row] for row in found)
        area = np.cross(b - a, c - a, axis=0).sum(axis=1) / 2
        assert area == pytest.approx([0, 0, up * 1.1 * 0.9], abs=1e-12)


def test_surfaces_of_a_file_are_turned_outward(box: BodyMesh) -> None:
    """Triangles that a file numbers from behind look out of the body afterwards; those inside a region stay.

    Catches: orientation of the file trusted, sections turned.
    """
    table = facets(box.cells)
    names, region_of = list(box.regions), box.region_of()
    pair = region_of[table.elements]
    inside = table.triples[::-1, (table.elements[1] >= 0) & (pair[0] == pair[1])]
    between = interface(table, region_of, names)
    given = {"z1": box.surfaces["z1"][::-1], "inside": inside, "between": between[::-1]}
    with unchanged(*given.values()):
        found = oriented(given, table, region_of, names)
    assert np.array_equal(found["inside"], inside)
    for name, reference in (("z1", box.surfaces["z1"]), ("between", between)):
        a, b, c = (box.points[:, row] for row in found[name])
        assert (np.cross(b - a, c - a, axis=0)[2] > 0).all(), name
        assert set(map(frozenset, found[name].T.tolist())) == set(map(frozenset, reference.T.tolist()))


def test_row_keys_agree_with_and_without_packing() -> None:
    """Keys tell sets of vertices apart in any order, also where they cannot be packed into one integer.

    Catches: overflow of the packed key, order of the vertices kept.
    """
    rows = generator().integers(0, 6, (3, 200))
    packed, counted = row_keys(rows, 6), row_keys(rows, 2**40)
    same = np.array([[sorted(a) == sorted(b) for a in rows.T.tolist()] for b in rows.T.tolist()])
    assert np.array_equal(packed[:, None] == packed, same)
    assert np.array_equal(counted[:, None] == counted, same)


def test_a_missing_part_of_a_design_is_named() -> None:
    """What a design promises and the mesh lacks is listed.

    Catches: missing parts passed over in silence.
    """
    with pytest.raises(MeshError, match="no surface foot_long, tip"):
        require("surface", {"foot_long": 0, "clamp": 0, "tip": 0}, {"clamp": 0})


# --- checks -----------------------------------------------------------------------------------------------------------


def test_a_sound_mesh_passes_unchanged(box: BodyMesh) -> None:
    """Checking neither refuses a sound mesh nor touches its arrays.

    Catches: a check that is too strict, or works in place.
    """
    with unchanged(box.points, box.cells):
        assert box.checked() is box


def test_an_inverted_element_is_named(box: BodyMesh) -> None:
    """One element numbered the wrong way round is refused with its index, region and centroid.

    Catches: absolute volumes taken, the sign convention reversed.
    """
    e = int(box.regions["muscle"][3])
    message = refusal(parts(box, cells=changed(box.cells, (slice(None), e), box.cells[[1, 0, 2, 3], e])))
    centre = box.points[:, box.cells[:, e]].mean(axis=1)
    assert (
        f"element {e} in region muscle at ({centre[0]:.4g}, {centre[1]:.4g}, {centre[2]:.4g}) mm is inverted" in message
    )


def test_a_mesh_numbered_backwards_throughout_is_refused(box: BodyMesh) -> None:
    """Consistently left-handed elements are refused, not turned.

    Catches: orientation judged relative to the first element.
    """
    assert f"{box.n_elements} of {box.n_elements}" in refusal(parts(box, cells=box.cells[[1, 0, 2, 3]]))


def test_a_flat_element_is_refused() -> None:
    """Four vertices in a plane are refused at any size, a thin but solid element is not.

    Catches: an absolute threshold, a missing one.
    """
    for scale in (1e-3, 1.0, 1e3):
        points = scale * np.array([[0, 1, 0, 0.3], [0, 0, 1, 0.3], [0, 0, 0, 1e-3]])
        mesh = BodyMesh(points, np.arange(4)[:, None], {"muscle": np.array([0])})
        mesh.checked()
        assert "flat" in refusal(parts(mesh, points=points * np.array([[1], [1], [1e-12]])))


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e200])
def test_impossible_coordinates_are_refused(box: BodyMesh, value: float) -> None:
    """A coordinate that is no place is refused with its vertex.

    Catches: comparisons that NaN slips through.
    """
    assert "vertex 5" in refusal(parts(box, points=changed(box.points, (1, 5), value)))


def test_regions_must_cover_and_be_disjoint(box: BodyMesh) -> None:
    """No region, an empty one, one out of range, a shared element, a doubled one and a lost one are each refused.

    Catches: any of the six checks dropped.
    """
    gel, tissue = box.regions["skeleton"], box.regions["muscle"]
    e = box.n_elements
    assert "no region" in refusal(parts(box, regions={}))
    assert "muscle is empty" in refusal(parts(box, regions={"skeleton": np.arange(e), "muscle": tissue[:0]}))
    assert "but there are" in refusal(parts(box, regions={"skeleton": gel, "muscle": tissue + e}))
    shared = refusal(parts(box, regions={"skeleton": gel, "muscle": np.append(tissue, gel[2])}))
    assert f"muscle holds an element twice or shares it with another region: element {gel[2]}" in shared
    assert "twice" in refusal(parts(box, regions={"skeleton": gel, "muscle": np.append(tissue, tissue[0])}))
    assert f"first is element {tissue[0]}" in refusal(parts(box, regions={"skeleton": gel, "muscle": tissue[1:]}))


def test_shapes_and_indices_are_checked(box: BodyMesh) -> None:
    """Arrays of the wrong shape, no elements, and vertices that do not exist are refused.

    Catches: index errors from numpy reaching the user.
    """
    assert "points must" in refusal(parts(box, points=box.points.T))
    assert "cells must" in refusal(parts(box, cells=box.cells[:, :0]))
    assert "cells name the vertices" in refusal(parts(box, cells=changed(box.cells, (0, 0), box.n_vertices)))
    assert "surface z1 must" in refusal(parts(box, surfaces={"z1": box.surfaces["z1"].T}))
    assert "surface z1 names" in refusal(parts(box, surfaces={"z1": box.surfaces["z1"] + 99}))


def test_orphans_are_refused(box: BodyMesh) -> None:
    """A vertex without an element, and a landmark on none, are refused.

    Catches: singular stiffness found by the solver only.
    """
    extra = np.concatenate([box.points, [[9.0], [9.0], [9.0]]], axis=1)
    assert f"first is vertex {box.n_vertices}" in refusal(parts(box, points=extra))
    assert "landmark far" in refusal(parts(box, points=extra, landmarks={"far": box.n_vertices}))
    assert "landmark out" in refusal(parts(box, landmarks={"out": -1}))


def test_doubled_elements_are_refused(box: BodyMesh) -> None:
    """An element that is there twice is refused.

    Catches: stiffness counted twice.
    """
    cells = np.concatenate([box.cells, box.cells[[1, 2, 0, 3], :1]], axis=1)
    regions = {"muscle": np.arange(cells.shape[1])}
    assert "1 elements have the same four vertices" in refusal(parts(box, cells=cells, regions=regions))


def test_crowded_facets_are_refused() -> None:
    """Three elements at one facet overlap and are refused.

    Catches: the third element of a facet lost silently.
    """
    points = np.array([[0, 1, 0, 0, 0.1, 0.2], [0, 0, 1, 0, 0.1, 0.3], [0, 0, 0, 1, 2, -1.0]])
    cells = np.array([[0, 1, 2, 3], [0, 1, 2, 4], [0, 2, 1, 5]]).T
    mesh = BodyMesh(points, cells, {"muscle": np.arange(3)})
    assert "1 facets belong to more than two elements" in refusal(mesh)


def test_parts_that_touch_without_sharing_vertices_are_refused(box: BodyMesh) -> None:
    """Skeleton and muscle with their own vertices at the same places are refused, with the way to merge them.

    Catches: a body that falls apart under load, tolerance of exact equality only.
    """
    points, cells = torn(box)
    nudge = 1e-9 * generator().normal(size=points.shape)
    for found in (points, points + nudge):
        message = refusal(parts(box, points=found, cells=cells, surfaces={}, landmarks={}))
        assert "18 vertices coincide" in message  # nine of each part
        assert "Coherence" in message


def test_parts_with_different_triangulations_of_their_contact_are_refused() -> None:
    """Two boxes that touch face to face, one of them meshed finer, are refused although no vertices coincide.

    Catches: conformity judged by coincident vertices only.
    """
    below = box_mesh(2, (1.0, 1.0, 0.5))
    above = box_mesh(3, (0.83, 0.79, 0.4))
    points = np.concatenate([below.points, above.points + np.array([[0.07], [0.11], [0.5]])], axis=1)
    cells = np.concatenate([below.cells, above.cells + below.n_vertices], axis=1)
    regions = {"skeleton": np.arange(below.n_elements), "muscle": np.arange(below.n_elements, cells.shape[1])}
    message = refusal(BodyMesh(points, cells, regions))
    # all 18 of the upper box lie on the lower one, and the centres of the 8 below are covered as well
    assert "26 boundary facets lie on others" in message
    assert "muscle, skeleton" in message


def test_swapped_diagonals_are_refused() -> None:
    """Two parts with common vertices, whose contact is split along different diagonals, are refused.

    Catches: hanging vertices looked for, overlapping facets not.
    """
    # a square, cut along one diagonal for the apex above and along the other for the apex below
    points = np.array([[0, 1, 1, 0, 0.5, 0.5], [0, 0, 1, 1, 0.4, 0.6], [0, 0, 0, 0, 1, -1.0]])
    cells = np.array([[0, 1, 2, 4], [0, 2, 3, 4], [0, 3, 1, 5], [1, 3, 2, 5]]).T
    mesh = BodyMesh(points, cells, {"skeleton": np.array([0, 1]), "muscle": np.array([2, 3])})
    assert "do not share their facets" in refusal(mesh)


def test_separate_pieces_are_refused(box: BodyMesh) -> None:
    """Two pieces apart, or held together by one vertex, are refused with their sizes.

    Catches: connection through a vertex taken for a joint.
    """
    points = np.array([[0, 1, 0, 0, -1, 0, 0], [0, 0, 1, 0, 0, -1, 0], [0, 0, 0, 1, 0, 0, -1.0]])
    cells = np.array([[0, 1, 2, 3], [0, 5, 4, 6]]).T
    mesh = BodyMesh(points, cells, {"muscle": np.arange(2)})
    assert "2 pieces that share no facet, of 1, 1 elements" in refusal(mesh)


def test_surface_triangles_must_be_facets(box: BodyMesh) -> None:
    """A triangle of three vertices that is no side of any element is refused.

    Catches: loads integrated over triangles that the body does not have.
    """
    strange = np.array([[box.landmarks["corner_000"]], [box.landmarks["corner_011"]], [box.landmarks["corner_110"]]])
    assert "surface cut has 1 triangles" in refusal(parts(box, surfaces={"cut": strange}))


def test_volumes_are_compared_with_the_design() -> None:
    """Wrong regions and wrong volumes are refused, a deviation within the slack is not, a wrong unit is named.

    Catches: slack ignored or applied to all regions, one side of the comparison only.
    """
    expected = {"skeleton": 200.0, "muscle": 30.0}
    check_volumes({"skeleton": 200.0 + 1e-8, "muscle": 30.0}, expected, {})
    check_volumes({"skeleton": 200.4, "muscle": 30.0}, expected, {"skeleton": 0.5})
    for found in ({"skeleton": 200.4, "muscle": 30.0}, {"skeleton": 199.6, "muscle": 30.0}):
        with pytest.raises(MeshError, match="region skeleton"):
            check_volumes(found, expected, {})
    with pytest.raises(MeshError, match="region muscle"):
        check_volumes({"skeleton": 200.0, "muscle": 30.4}, expected, {"skeleton": 0.5})
    with pytest.raises(MeshError, match=r"seems to be in m$"):
        check_volumes({"skeleton": 2e-7, "muscle": 3e-8}, expected, {})
    with pytest.raises(MeshError, match="has the regions muscle: found no skeleton, expected "):
        check_volumes({"muscle": 30.0}, expected, {})

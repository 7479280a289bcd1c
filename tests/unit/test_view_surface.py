"""Edges and normals of drawn surfaces, and the camera."""

from __future__ import annotations

import numpy as np
import pytest

from fem_biobot.view.scene import CAMERAS, camera_axes, colour_map
from fem_biobot.view.surface import corner_normals, feature_edges

CORNERS = np.array([[x, y, z] for x in (0.0, 2.0) for y in (0.0, 1.0) for z in (0.0, 1.5)]).T
# outward quadrilaterals of the box, node number = 4 x + 2 y + z
QUADS = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
BOX = np.array([t for a, b, c, d in QUADS for t in ((a, b, c), (a, c, d))]).T


def test_a_box_has_twelve_edges_and_no_diagonals() -> None:
    """Catches: diagonals of plane faces kept, edges counted from both sides, the angle taken in degrees."""
    edges = feature_edges(CORNERS, BOX)
    assert edges.shape == (2, 12)
    lengths = np.linalg.norm(CORNERS[:, edges[0]] - CORNERS[:, edges[1]], axis=0)
    assert np.sort(lengths) == pytest.approx([1.0] * 4 + [1.5] * 4 + [2.0] * 4)


def test_an_open_end_and_a_border_between_groups_are_edges() -> None:
    """Catches: open borders dropped, groups ignored."""
    assert feature_edges(CORNERS, BOX[:, :2]).shape == (2, 4)
    assert feature_edges(CORNERS, BOX[:, :2], group=np.array([0, 1])).shape == (2, 5)


def test_doubled_nodes_count_as_one() -> None:
    """Catches: neighbours missed across doubled nodes, which would draw every such edge as an open end."""
    points = np.hstack([CORNERS, CORNERS])
    triangles = BOX.copy()
    triangles[:, 1] += 8  # the second half of the first face stands on doubles
    node_map = np.tile(np.arange(8), 2)
    edges = feature_edges(points, triangles, node_map=node_map)
    assert edges.shape == (2, 12)
    assert feature_edges(points, triangles).shape[1] > 12


def test_normals_are_flat_on_a_box_and_round_on_a_tube() -> None:
    """Catches: smoothing across sharp edges, no smoothing at all, normals turned inward."""
    normals = corner_normals(CORNERS, BOX)
    face = normals[:, 0]
    assert np.allclose(normals, face[:, None, :], atol=1e-14)
    outward = (face * (CORNERS[:, BOX].mean(axis=1) - np.array([[1.0], [0.5], [0.75]]))).sum(axis=0)
    assert (outward > 0.3).all()
    count = 40
    angle = 2.0 * np.pi * np.arange(count) / count
    ring = np.array([np.cos(angle), np.sin(angle)])
    tube = np.hstack([np.vstack([ring, np.zeros(count)]), np.vstack([ring, np.ones(count)])])
    i, j = np.arange(count), (np.arange(count) + 1) % count
    wall = np.hstack([np.array([i, j, j + count]), np.array([i, j + count, i + count])])
    radial = tube[:, wall] * np.array([1.0, 1.0, 0.0])[:, None, None]
    cosine = (corner_normals(tube, wall) * radial).sum(axis=0)
    assert cosine.min() > 0.998  # unsmoothed, a corner is off by half a facet: cos(4.5 degrees) = 0.9969


def test_cameras_show_x_to_the_right_and_z_up() -> None:
    """Catches: a mirrored picture, the front view from behind, the plan from below."""
    for name in CAMERAS:
        axes = camera_axes(name)
        assert np.allclose(axes @ axes.T, np.eye(3), atol=1e-14)
        assert np.linalg.det(axes) == pytest.approx(1.0)
        assert axes[0, 0] > 0.8
        # from above, y is up in the picture
        assert axes[1, 1 if name == "plan" else 2] > 0.8
    assert np.allclose(camera_axes("front"), [[1, 0, 0], [0, 0, 1], [0, -1, 0]])
    assert camera_axes("iso")[2, 2] > 0.0 > camera_axes("iso_below")[2, 2]
    assert camera_axes("plan")[2, 2] > 0.99


@pytest.mark.parametrize("name", ["stress", "viridis", "plasma"])
def test_colours_grow_in_lightness_one_way(name: str) -> None:
    """Catches: a colour map that is not readable in grey or without colour vision."""
    rgb = np.asarray(colour_map(name)(np.linspace(0.0, 1.0, 50)))[:, :3]
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    luminance = linear @ [0.2126, 0.7152, 0.0722]
    steps = np.diff(luminance)
    assert (steps > 0.0).all() or (steps < 0.0).all()

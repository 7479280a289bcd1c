"""How deep points lie below a surface of facets."""

from __future__ import annotations

import numpy as np
import pytest

from fem_biobot.solid.interface.depth import distances
from tests.helpers import generator


def test_depth_is_that_of_the_nearest_side() -> None:
    """Below an edge where two faces meet at a right angle, each of two facets: the nearer face's, whichever found it;
    beyond the surface's rim, the rim's; a reach shorter than all is kept.

    Catches: the distance to a facet's plane beyond it, to its middle, along the normal of one face only.
    """
    x = np.array([[0, 0, 0], [0, 2, 0], [0, 0, 2], [0, 2, 2], [-2, 0, 0], [-2, 0, 2]], dtype=float)
    # x = 0 and y = 0, of a body at x < 0 < y
    nodes = np.array([[0, 1, 2], [1, 3, 2], [0, 2, 4], [2, 5, 4]]).T
    points = np.array([[-0.3, 0.1, 0.7], [-0.2, 1.4, 1.1], [-0.05, 0.6, -0.12], [-0.4, 0.9, 1.0]])
    found = distances(points, np.array([9.0, 9.0, 9.0, 0.25]), x, nodes)
    np.testing.assert_allclose(found, [0.1, 0.2, 0.13, 0.25], rtol=1e-14)


def test_curved_facets_count_with_their_middles() -> None:
    """A facet whose sides' middles lie out of its corners' plane is met there, as four triangles.

    Catches: facets of six nodes taken as flat.
    """
    x = np.array([[0, 0, 0], [2, 0, 0], [0, 2, 0], [1, 0, 0.3], [1, 1, 0.3], [0, 1, 0.3]], dtype=float)
    nodes = np.arange(6)[:, None]
    inner = np.array([[0.6, 0.6, -0.2]])
    assert distances(inner, np.array([9.0]), x, nodes)[0] == pytest.approx(0.5, rel=1e-14)


def test_many_facets_of_all_sizes_are_searched() -> None:
    """Points within a random surface: as by trying all facets one by one.

    Catches: facets too far away by their middles though not by their corners.
    """
    draw = generator(3)
    at = draw.uniform(-3.0, 3.0, (40, 3))
    shape = draw.normal(size=(3, 40, 3)) * np.exp(draw.uniform(-3.0, 1.0, 40))[None, :, None]
    x = (at + shape).transpose(1, 0, 2).reshape(-1, 3)
    nodes = np.arange(120).reshape(40, 3).T
    points = draw.uniform(-2.0, 2.0, (15, 3))
    weights = draw.dirichlet((0.4, 0.4, 0.4), 20000)
    tried = np.array(
        [np.linalg.norm(weights @ x[nodes].transpose(1, 0, 2)[k] - p, axis=1).min() for p in points for k in range(40)]
    )
    tried = tried.reshape(15, 40).min(axis=1)
    found = distances(points, np.full(15, 50.0), x, nodes)
    assert np.all(found <= tried + 1e-12)
    np.testing.assert_allclose(found, tried, atol=0.03)

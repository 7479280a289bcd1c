"""Detection of a body that runs into itself."""

from __future__ import annotations

import numpy as np

from fem_biobot.mesh.body import BodyMesh
from fem_biobot.solid.touching import interpenetration, touching_parts
from tests.helpers import box_mesh, unchanged

LOWER = box_mesh(2, (1.0, 1.0, 1.0), names=("muscle",))


def _two_boxes(gap: float) -> BodyMesh:
    """Two separate boxes, one above the other and moved aside by a third of a cell."""
    upper = LOWER.points + np.array([[0.17], [0.13], [1.0 + gap]])
    n = LOWER.n_vertices
    cells = np.concatenate([LOWER.cells, LOWER.cells + n], axis=1)
    regions = {"muscle": np.arange(LOWER.n_elements), "skeleton": np.arange(LOWER.n_elements) + LOWER.n_elements}
    return BodyMesh(np.concatenate([LOWER.points, upper], axis=1), cells, regions)


def _down(mesh: BodyMesh, by: float) -> np.ndarray:
    """The upper box lowered."""
    u = np.zeros_like(mesh.points)
    u[2, LOWER.n_vertices :] = -by
    return u


def test_bodies_apart_do_not_touch() -> None:
    """A body at rest, deformed without contact, or moved as a whole does not touch itself.

    Catches: vertices found in elements of which they are a corner, or in their neighbours.
    """
    mesh = _two_boxes(0.2)
    for u in (0 * mesh.points, _down(mesh, 0.19), 0.2 * np.sin(mesh.points[::-1])):
        with unchanged(mesh.points, u):
            vertices, elements = interpenetration(mesh, u)
        assert vertices.size == elements.size == 0
        assert touching_parts(mesh, u) == ""


def test_vertices_inside_the_other_body_are_found() -> None:
    """Lowered into the other box, exactly the vertices that are inside it are found, with an element of it.

    Catches: neighbouring elements only; vertices outside their element by a sign.
    """
    mesh = _two_boxes(0.2)
    u = _down(mesh, 0.3)
    x = mesh.points + u
    vertices, elements = interpenetration(mesh, u)
    upper = np.arange(LOWER.n_vertices, mesh.n_vertices)
    inside = upper[np.all((x[:, upper] > 0.0) & (x[:, upper] < 1.0), axis=0)]
    below = np.arange(LOWER.n_vertices)
    top = LOWER.points[:, below] + 0.0
    low, high = np.array([0.17, 0.13, 0.9]), np.array([1.17, 1.13, 1.9])
    other = below[np.all((top > low[:, None]) & (top < high[:, None]), axis=0)]
    np.testing.assert_array_equal(np.unique(vertices), np.sort(np.concatenate([other, inside])))
    assert np.all((vertices < LOWER.n_vertices) == (elements >= LOWER.n_elements))


def test_the_event_names_the_parts_and_the_place() -> None:
    """Which regions touch, how many vertices, and where in the undeformed body.

    Catches: the region of the wrong partner; positions after the deformation.
    """
    mesh = _two_boxes(0.2)
    text = touching_parts(mesh, _down(mesh, 0.3))
    count = np.unique(interpenetration(mesh, _down(mesh, 0.3))[0]).size
    assert text.startswith("muscle against skeleton at ")
    assert f" {count} vertices near x = " in text
    assert text.endswith("of the undeformed body")

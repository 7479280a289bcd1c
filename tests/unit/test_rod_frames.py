"""Frames along drawn rods: tangents of arcs, normals without twist."""

from __future__ import annotations

import numpy as np
import pytest

from fem_biobot.errors import ModelError
from fem_biobot.rod.frames import node_frames, tangents
from tests.helpers import rotation
from tests.rods import arc, straight


def test_tangents_of_an_arc_are_exact() -> None:
    """At its ends too, with elements of unequal length, anywhere in space.

    Catches: chords taken for tangents at the ends, weights of the two chords exchanged.
    """
    angle = np.array([0.0, 0.2, 0.5, 0.6, 1.1])
    points = 3.0 * np.stack([np.sin(angle), 1 - np.cos(angle), 0 * angle], axis=1)
    expected = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    R = rotation(3)
    np.testing.assert_allclose(tangents(points @ R.T), expected @ R.T, rtol=0.0, atol=1e-15 * 8)


def test_frames_are_rotations_that_follow_the_rod() -> None:
    """Orthonormal, right-handed, the third along the tangent, the first as asked for.

    Catches: columns for rows, a left-handed frame, a normal that is not made perpendicular.
    """
    points = arc(6, 2.0, 1.5) + np.linspace(0.0, 1.0, 7)[:, None] * np.array([0.0, 0.0, 1.0])
    frames = node_frames(points, np.array([0.3, 1.0, 0.4]))
    np.testing.assert_allclose(np.einsum("nij,nkj->nik", frames, frames), np.tile(np.eye(3), (7, 1, 1)), atol=1e-14)
    np.testing.assert_allclose(np.linalg.det(frames), 1.0, rtol=1e-14)
    np.testing.assert_allclose(frames[:, 2], tangents(points), rtol=0.0, atol=1e-14)
    asked = np.array([0.3, 1.0, 0.4])
    assert frames[0, 0] @ asked > 0.0
    assert abs(np.linalg.det([frames[0, 0], frames[0, 2], asked])) < 1e-14


def test_the_normal_is_carried_without_twist() -> None:
    """In a plane a normal across the plane stays so; along a straight rod nothing turns.

    Catches: a normal that turns with the curve's own, one reflection instead of two.
    """
    frames = node_frames(arc(9, 2.0, 4.0), np.array([0.0, 0.0, 1.0]))
    np.testing.assert_allclose(frames[:, 0], np.tile([0.0, 0.0, 1.0], (10, 1)), atol=1e-14)
    frames = node_frames(straight(4, 2.0, (1.0, 2.0, 3.0)), None)
    np.testing.assert_allclose(frames, np.tile(frames[0], (5, 1, 1)), atol=1e-15)


def test_a_rod_that_turns_back_has_frames() -> None:
    """Two opposite chords have no circle; the frames are rotations all the same.

    Catches: a division by zero.
    """
    frames = node_frames(np.array([[0.0, 0, 0], [1.0, 0, 0], [0.0, 0, 0]]), None)
    np.testing.assert_allclose(np.linalg.det(frames), 1.0, rtol=1e-12)


def test_a_normal_along_the_rod_is_refused() -> None:
    """It says nothing.

    Catches: a division of zero by zero.
    """
    with pytest.raises(ModelError, match="normal: found a direction along the rod"):
        node_frames(straight(3), np.array([2.0, 0.0, 0.0]))

"""Meshes graded for the tips' closing: finer where it is decided, coarser where it is not, the same body."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fem_biobot.config import load_design
from fem_biobot.design import Design
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.mesh.geometry import build_mesh
from fem_biobot.mesh.layout import layout
from fem_biobot.mesh.store import stored_file
from fem_biobot.solid.from_design import tension_step
from fem_biobot.solid.measures import Measurer
from fem_biobot.solid.model import SolidModel, solve

pytestmark = pytest.mark.usefixtures("gmsh")


def both(preset: str) -> tuple[Design, Design]:
    return load_design(preset), load_design(preset, ["mesh.grading = closing"])


def edge_at(mesh: BodyMesh, place: tuple[float, float, float], reach: float) -> float:
    """Mean length of the edges whose middles lie within a distance of a place or its mirror image [mm]."""
    a, b = mesh.points[:, mesh.edges[0]], mesh.points[:, mesh.edges[1]]
    middle = (a + b) / 2.0
    middle[0] = np.abs(middle[0])
    near = np.linalg.norm(middle - np.array(place)[:, None], axis=0) < reach
    assert near.sum() > 3, place
    return float(np.linalg.norm(b - a, axis=0)[near].mean())


def test_elements_are_small_where_the_closing_is_decided() -> None:
    """At 1.26 mm: about the edge by which a junction enters a ring and in the ring's leg beside it, at the corners and
    in the span; not in the junction's middle. The body, its names and volumes stay.

    Catches: zones about the pillar's face instead of the ring's, of one side only, a junction that is refined too, a
    grading that nothing reads.
    """
    even, closing = both("junction_bot")
    plain, graded = build_mesh(even, 1.26), build_mesh(closing, 1.26)
    assert graded.region_volumes() == pytest.approx(dict(layout(closing).volumes), rel=1e-9)
    assert (set(graded.surfaces), set(graded.landmarks)) == (set(plain.surfaces), set(plain.landmarks))
    finer = {
        (3.0, 0.0, 1.6): 0.3,
        (3.0, 1.1, 1.4): 0.3,
        (3.25, 1.5, 1.0): 0.5,
        (3.5, 2.0, 3.16): 0.4,
        (0.0, 0.0, 3.5): 1.5,
    }
    for place, reach in finer.items():
        assert edge_at(graded, place, reach) < 0.85 * edge_at(plain, place, reach), place
    assert edge_at(graded, (0.0, 0.0, 1.4), 1.0) > 1.15 * edge_at(plain, (0.0, 0.0, 1.4), 1.0)
    # both ends alike
    for sign in (-1.0, 1.0):
        x = sign * graded.points[0] - 3.0
        assert np.count_nonzero((np.abs(x) < 0.3) & (np.abs(graded.points[2] - 1.6) < 0.3)) > 100
    assert graded.n_unknowns < 1.7 * plain.n_unknowns


def test_a_loop_has_no_entries_and_a_strip_is_even(tmp_path: Path) -> None:
    """Catches: rings looked for that have no junction, a strip that fails, a store that takes one mesh for another."""
    even, closing = both("ring_bot")
    assert build_mesh(closing, 1.0).n_elements > build_mesh(even, 1.0).n_elements
    assert stored_file(even, tmp_path) != stored_file(closing, tmp_path)
    even, closing = both("strip")
    np.testing.assert_array_equal(build_mesh(even, 0.8).points, build_mesh(closing, 0.8).points)


@pytest.mark.slow
def test_graded_meshes_are_nearer_to_the_limit_with_fewer_unknowns() -> None:
    """At full drive closing rises to its limit with finer meshes; 58 215 graded unknowns beat 61 617 even ones.

    Found: 3.6938 mm and 3.6830 mm; the force, which falls to its limit, 4.4034 and 4.4051 mN.

    Catches: refinement where it does not matter.
    """
    found = []
    for design, size in zip(both("junction_bot"), (0.9, 1.26), strict=True):
        model = SolidModel.from_design(design, build_mesh(design, size))
        state = solve(model, [tension_step(design, design.tension(1.0))]).last
        measured = Measurer(design, model).measures(state)
        found.append(
            (model.n_dofs, float(measured["tip_closing_mm"] or 0.0), float(measured["muscle_force_mN"] or 0.0))
        )
    (n_even, even, force), (n_graded, graded, graded_force) = found
    assert n_graded < n_even
    assert graded > even + 0.005
    assert graded_force < force

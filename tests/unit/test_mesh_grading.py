"""Meshes graded for the tips' closing: finer where it is decided, coarser where it is not, the same body."""

from __future__ import annotations

import math
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fem_biobot.config import load_design
from fem_biobot.design import Design
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.mesh.foreign import export_part, import_mesh
from fem_biobot.mesh.geometry import build_mesh, remeshed
from fem_biobot.mesh.layout import ALONG_EDGES, EDGE_SHARE, Layout, layout, shortened
from fem_biobot.mesh.sizes import SizeField
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


def along_edge(mesh: BodyMesh, x: float, y: float, z: tuple[float, float]) -> float:
    """Mean length of the edges that lie on a vertical line between two heights [mm]."""
    a, b = mesh.points[:, mesh.edges[0]], mesh.points[:, mesh.edges[1]]
    on = np.ones(a.shape[1], dtype=bool)
    for end in (a, b):
        on &= (
            (np.abs(end[0] - x) < 1e-9) & (np.abs(end[1] - y) < 1e-9) & (end[2] > z[0] - 1e-9) & (end[2] < z[1] + 1e-9)
        )
    assert on.any(), (x, y)
    return float(np.abs(b[2] - a[2])[on].mean())


def test_elements_are_small_where_the_closing_is_decided() -> None:
    """At 1.4 mm: about the edge by which a junction enters a ring and in the ring's leg beside it, at the corners and
    in the span; not in the junction's middle. The body, its names and volumes stay.

    Catches: zones about the pillar's face instead of the ring's, of one side only, a junction that is refined too, a
    grading that nothing reads.
    """
    even, closing = both("junction_bot")
    plain, graded = build_mesh(even, 1.4), build_mesh(closing, 1.4)
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


@pytest.mark.parametrize("preset", ["junction_bot", "ring_bot"])
def test_elements_are_small_along_the_edges_that_rings_wrap_around(preset: str, tmp_path: Path) -> None:
    """On all vertical edges of the pillars, as high as the rings, elements are a fifth of those elsewhere in the
    ring, give or take a third; away from there, and in even meshes, they are as they were. At most half more
    unknowns on the junction bot; a store keeps both meshes apart.

    Catches: edges of one pillar or one side only, zones below the rings, one mesh taken for the other.
    """
    even = load_design(preset)
    fine_edges = even.with_values({"mesh.grading": "edges"})
    h = even.mesh.size
    plain, fine = build_mesh(even, h), build_mesh(fine_edges, h)
    plan, muscle, skeleton = layout(fine_edges), even.muscle, even.skeleton
    assert muscle is not None
    assert skeleton is not None
    size = EDGE_SHARE * float(muscle.ring_thickness or 0.0) * h / skeleton.beam_thickness
    assert (plan.grading, layout(even).grading) == ("edges", "even")
    z = plan.holes[0].low[2], plan.holes[0].high[2]
    for pillar in plan.pillars:
        for x, y in product((pillar.low[0], pillar.high[0]), (pillar.low[1], pillar.high[1])):
            before, after = (along_edge(mesh, x, y, (z[0], z[1])) for mesh in (plain, fine))
            assert after == pytest.approx(size, rel=1.0 / 3.0), (x, y)
            assert after < 0.5 * before, (x, y)
    beam = (0.0, 0.0, even.beam_axis_height)
    assert edge_at(fine, beam, 1.5 * h) > 0.9 * edge_at(plain, beam, 1.5 * h)
    if preset == "junction_bot":
        assert fine.n_unknowns < 1.5 * plain.n_unknowns
    assert stored_file(even, tmp_path) != stored_file(fine_edges, tmp_path)


def test_a_loop_has_no_entries_and_a_strip_is_even(tmp_path: Path) -> None:
    """Catches: rings looked for that have no junction, a strip that fails, a store that takes one mesh for another."""
    even, closing = both("ring_bot")
    assert build_mesh(closing, 1.0).n_elements > build_mesh(even, 1.0).n_elements
    assert stored_file(even, tmp_path) != stored_file(closing, tmp_path)
    even, closing = both("strip")
    np.testing.assert_array_equal(build_mesh(even, 0.8).points, build_mesh(closing, 0.8).points)


def test_elements_for_the_closing_are_longer_along_y() -> None:
    """Edges of a graded mesh extend along y half again as far as along x and z, those of an even one as far.

    Over the beam's span and its pillars, away from the layers that the thin muscle and the rings prescribe: the root
    mean squares of the components of all edges, of which meshing for a metric has equal ones, to a tenth.

    Catches: a body that is meshed shortened and not lengthened again, lengthened along the machine, by the square.
    """
    for design, longer in zip(both("junction_bot"), (1.0, ALONG_EDGES), strict=True):
        mesh = build_mesh(design, 1.4)
        cells = mesh.cells[:, mesh.regions["skeleton"]]
        a, b = mesh.points[:, cells[0]], mesh.points[:, cells[1]]
        x, y, z = np.sqrt(np.mean((b - a) ** 2, axis=1))
        assert y / math.sqrt(x * z) == pytest.approx(longer, rel=0.1)


def test_a_given_skeleton_is_meshed_as_it_is(tmp_path: Path) -> None:
    """Catches: the design's muscle drawn shortened about a skeleton that is not, a body lengthened that was not."""
    design = both("junction_bot")[1]
    export_part(design, tmp_path / "skeleton.step")
    mesh = import_mesh(design, tmp_path / "skeleton.step", size=4.0)
    assert mesh.region_volumes() == pytest.approx(dict(layout(design).volumes), rel=1e-9)
    for name, place in design.landmarks().items():
        assert mesh.points[:, mesh.landmarks[name]] == pytest.approx(place, abs=1e-9), name


def test_a_shortened_layout_is_the_same_body_along_x_and_z() -> None:
    """Catches: a part left as it was, a factor that multiplies, volumes that stay."""
    plan = layout(load_design("junction_bot", ["skeleton.fillet_radius = 0.3 mm"]))
    less = shortened(plan, 2.0)
    boxes = [(plan.beam, less.beam)]
    boxes += [(a, b) for name in ("pillars", "muscle", "holes", "thin") for a, b in paired(plan, less, name)]
    for whole, half in boxes:
        assert whole is not None
        assert half is not None
        assert half.volume == pytest.approx(whole.volume / 2.0, rel=1e-15)
        assert (half.low[0], half.high[2]) == (whole.low[0], whole.high[2])
        assert half.high[1] == whole.high[1] / 2.0
    for (a, b, sign), (c, d, other) in paired(plan, less, "corner_lines"):
        assert (c, d, other) == ((a[0], a[1] / 2.0, a[2]), (b[0], b[1] / 2.0, b[2]), sign)
    assert dict(less.volumes) == {name: volume / 2.0 for name, volume in plan.volumes.items()}
    assert less.landmarks["corner_short"][0::2] == plan.landmarks["corner_short"][0::2]


def paired(plan: Layout, less: Layout, name: str) -> list[tuple[Any, Any]]:
    return list(zip(getattr(plan, name), getattr(less, name), strict=True))


def test_given_sizes_keep_their_number_on_a_shortened_body() -> None:
    """Catches: sizes of the body as it is, which a shortened one would follow with fewer elements."""
    design = both("junction_bot")[1]
    mesh = build_mesh(design, 3.0)
    sizes = SizeField(np.asarray(mesh.points), np.asarray(mesh.cells), np.full(mesh.n_vertices, 0.9))
    assert sizes.shortened(1.7).n_elements == pytest.approx(sizes.n_elements, rel=1e-12)
    # what Gmsh makes of them, whose elements are smaller than regular ones of the edge asked for, is as much in both
    graded, even = remeshed(design, sizes), remeshed(both("junction_bot")[0], sizes)
    assert graded.n_elements == pytest.approx(even.n_elements, rel=0.2)
    assert graded.region_volumes() == pytest.approx(dict(layout(design).volumes), rel=1e-9)


@pytest.mark.slow
def test_graded_meshes_are_nearer_to_the_limit_with_fewer_unknowns() -> None:
    """At full drive closing rises to its limit with finer meshes; 51 762 graded unknowns beat 61 617 even ones.

    Found: 3.6960 mm and 3.6830 mm; the force, which falls to its limit, 4.3965 and 4.4051 mN.

    Catches: refinement where it does not matter.
    """
    found = []
    for design, size in zip(both("junction_bot"), (0.9, 1.4), strict=True):
        model = SolidModel.from_design(design, build_mesh(design, size))
        state = solve(model, [tension_step(design, design.tension(1.0))]).last
        measured = Measurer(design, model).measures(state)
        found.append(
            (model.n_dofs, float(measured["tip_closing_mm"] or 0.0), float(measured["muscle_force_mN"] or 0.0))
        )
    (n_even, even, force), (n_graded, graded, graded_force) = found
    assert n_graded < 0.9 * n_even
    assert graded > even + 0.01
    assert graded_force < force - 0.005

"""The bodies that studies show in 3D: closed forms, fibres, oxygen, designs found, cases of a sweep."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fem_biobot.config import load_design
from fem_biobot.errors import FileError
from fem_biobot.mesh.committed import committed_mesh
from fem_biobot.muscle.fibres import fibre_field
from fem_biobot.muscle.oxygenation import oxygenation
from fem_biobot.study.bow import bow
from fem_biobot.study.bow_view import bow_view
from fem_biobot.study.run import run
from fem_biobot.study.search_models import Model, seen
from fem_biobot.study.sweep_file import Case, Task
from fem_biobot.study.sweep_views import solved_view, sweep_views
from fem_biobot.study.tissue_views import fibres_view, oxygen_view
from fem_biobot.view.interactive import Moving, Piece, figure, pieces_of
from fem_biobot.view.report import views_of, write_report
from fem_biobot.vtk import read_vtu, write_vtu


def volumes(view: Moving, state: int) -> np.ndarray:
    """Enclosed by the surfaces of each part, (parts,) [mm^3]."""
    x = view.points[state][:, view.triangles]
    each = np.einsum("if,if->f", x[:, 0], np.cross(x[:, 1], x[:, 2], axis=0)) / 6.0
    return np.bincount(view.part[view.triangles[0]], each, len(view.parts))


@pytest.mark.parametrize("name", ["junction_bot", "ring_bot"])
def test_the_bow_is_drawn_as_it_is_computed(name: str) -> None:
    """Soles and the beam's rise lie where `bow` says; at rest the skeleton has its volume, bent nearly the same.

    The rise is that of the beam's axis, halfway between its faces. Bending an arc about its axis keeps volume; what is
    strung between pillars does not.

    Catches: pillars turned the other way, an arc about the wrong height, a closing that is not that of the row.
    """
    # on pillars of one height it stands as drawn
    design = load_design(name)
    high = design.value("skeleton.long_pillar_height")
    design = design.with_values({"skeleton.short_pillar_height": high})
    view = bow_view(design)
    assert view.labels[0] == "at rest"
    skeleton = view.part == 0
    rest = view.points[0]
    assert volumes(view, 0)[0] == pytest.approx(
        sum(v for k, v in _volumes(design).items() if k == "skeleton"), rel=1e-9
    )
    for state, drive in ((1, 0.0), (2, design.drive.amplitude)):
        found, x = bow(design, drive), view.points[state]
        assert volumes(view, state)[0] == pytest.approx(volumes(view, 0)[0], rel=2e-3)
        soles = []
        for centre, height in design.pillars:
            low = design.beam_axis_height - height
            own = (
                skeleton
                & (np.abs(rest[2] - low) < 1e-9)
                & (np.abs(rest[0] - centre) < design.value("skeleton.pillar_length") / 2 + 1e-9)
            )
            soles.append(x[:, own].mean(axis=1))
        apart = np.linalg.norm(soles[1] - soles[0])
        drawn = np.hypot(design.pillars[1][0] - design.pillars[0][0], design.pillars[1][1] - design.pillars[0][1])
        ends, middle = (
            [_axis(design, rest, x, at) for at in places] for places in ((-design.bay / 2, design.bay / 2), (0.0,))
        )
        chord = ends[1] - ends[0]
        arm = middle[0] - ends[0]
        along = chord / np.linalg.norm(chord)
        assert np.linalg.norm(arm - (arm @ along) * along) == pytest.approx(found.sagitta, rel=1e-6)
        # tip closing is counted along the chord
        gap = (soles[1] - soles[0]) @ along
        assert (design.pillars[1][0] - design.pillars[0][0]) - gap == pytest.approx(found.closing, rel=1e-6), (
            apart - drawn
        )


def _volumes(design: Any) -> dict[str, float]:
    from fem_biobot.mesh.layout import layout

    return dict(layout(design).volumes)


def _axis(design: Any, rest: np.ndarray, x: np.ndarray, at: float) -> np.ndarray:
    """Where the beam's axis at a drawn place is: halfway between the points of its faces there."""
    half = design.value("skeleton.beam_thickness") / 2
    found = []
    for z in (design.beam_axis_height - half, design.beam_axis_height + half):
        level = np.flatnonzero((np.abs(rest[2] - z) < 1e-9) & (np.abs(rest[1]) > 0.0))
        order = level[np.argsort(rest[0, level])]
        found.append([np.interp(at, rest[0, order], x[k, order]) for k in (0, 2)])
    (a, b), (c, d) = found
    return np.array([(a + c) / 2, 0.0, (b + d) / 2])


def test_fibres_lie_on_the_faces_of_the_muscle_and_colour_it() -> None:
    """In the junction they run along x (theta of 90 deg), in the long sides of a ring across the machine.

    Catches: directions of other elements, lines inside of the tissue, gel coloured, an angle from another axis.
    """
    design = load_design("junction_bot")
    mesh = committed_mesh(design, 2.0)
    assert mesh is not None
    view = fibres_view(mesh, fibre_field(design, mesh))
    angle = view.fields[0].values
    x, part = view.points[0], view.part
    names = list(view.parts)
    assert np.isnan(angle[part != names.index("muscle")]).all()
    middle = (np.abs(x[0]) < 2.0) & (part == names.index("muscle"))
    assert middle.any()
    np.testing.assert_allclose(angle[middle], 0.0, atol=1e-4)
    ends = x[:, part == names.index("directions")].reshape(3, -1, 2)
    line = ends[:, :, 1] - ends[:, :, 0]
    centre = ends.mean(axis=2)
    outer = (np.abs(centre[0]) > 7.3) & (np.abs(centre[1]) < 3.0)
    assert outer.sum() > 10
    assert np.all(np.abs(line[0, outer]) < 0.2 * np.linalg.norm(line[:, outer], axis=0))
    # on the faces: within a hundredth of an element of the tissue's box
    assert np.abs(centre[0]).max() == pytest.approx(7.5, abs=0.05)


def test_oxygen_is_shown_in_halves_that_close() -> None:
    """Both halves have half of the tissue's volume; their values are between nothing and the supply.

    Catches: faces of one half missing where it is cut, values of other points.
    """
    design = load_design("junction_bot")
    mesh = committed_mesh(design, 2.0)
    assert mesh is not None
    found = oxygenation(design, mesh)
    view = oxygen_view(found)
    whole = float(found.field.basis.dx[found.tissue].sum())
    assert volumes(view, 0).sum() == pytest.approx(whole, rel=1e-9)
    assert volumes(view, 0)[0] == pytest.approx(0.5 * whole, rel=1e-6)
    oxygen, alive = (field.values for field in view.fields)
    shown = np.unique(view.triangles)
    corners = found.field.at(view.points[0][:, shown[::50]])
    np.testing.assert_allclose(oxygen[shown[::50]], corners, atol=2e-3 * found.field.law.supply)
    assert 0.0 <= alive.min() <= alive.max() <= 1.0


def test_the_design_found_stands_in_its_states() -> None:
    """Catches: the states of another design, a machine that hangs in the air or lies on its side."""
    design = load_design("junction_bot", ["skeleton.beam_thickness = 0.8 mm", "skeleton.short_pillar_height = 3.4 mm"])
    view = seen(design, Model.rod)
    assert list(view.labels) == ["at rest", "9.09 kPa", "10.4 kPa"]
    for x in view.points:
        half = x[0] < 0.5 * (x[0].min() + x[0].max())
        assert x[2].min() == pytest.approx(0.0, abs=1e-6)
        assert x[2, half].min() == pytest.approx(x[2, ~half].min(), abs=1e-6)
    widths = [np.ptp(x[0]) for x in view.points]
    assert widths[0] > widths[1] > widths[2]
    assert np.ptp(view.points[0][2]) == pytest.approx(3.4 + 0.4, abs=1e-6)


def test_a_solve_is_shown_from_its_files(tmp_path: Path) -> None:
    """A strip that is solved is read back: at rest it has its volume, stimulated its displacement.

    Catches: states in another order, displacement left out, a file of another kind taken.
    """
    design = load_design("strip", ["mesh.size = 0.8 mm"])
    summary = run(design, tmp_path / "strip", complete=False)
    view = solved_view(tmp_path / "strip", "as_moulded", stands=False)
    assert list(view.labels) == ["rest", "passive", "peak"]
    assert list(view.parts) == ["muscle"]
    assert volumes(view, 0)[0] == pytest.approx(summary["mesh"]["volume_muscle_mm3"], rel=1e-9)
    assert np.abs(view.points[2] - view.points[0]).max() > 0.01
    (stress,) = [field for field in view.fields if "von Mises" in field.label]
    assert stress.values[0].max() == pytest.approx(0.0, abs=1e-9)
    shutil.copy(tmp_path / "strip" / "design.toml", next((tmp_path / "strip").glob("solid_*_peak.vtu")))
    with pytest.raises(FileError, match=r"peak\.vtu: cannot be read"):
        solved_view(tmp_path / "strip", "as_moulded", stands=False)
    points, cells, _, _ = read_vtu(next((tmp_path / "strip").glob("solid_*_rest.vtu")))
    write_vtu(next((tmp_path / "strip").glob("solid_*_peak.vtu")), points, cells)
    with pytest.raises(FileError, match="found no displacement_mm"):
        solved_view(tmp_path / "strip", "as_moulded", stands=False)
    with pytest.raises(FileError, match=r"found no solid_\*\.vtu"):
        solved_view(tmp_path, "as_moulded", stands=False)


def test_extreme_cases_are_shown_and_others_are_told(tmp_path: Path) -> None:
    """Of three cross-checks the largest and the smallest, from their reports; one without a report is a note.

    Catches: the first rows taken for the extremes, a missing file that ends a sweep, a title of another case.
    """
    design = load_design("junction_bot")
    cases = tuple(Case(number, {}, design, "", f"key{number}") for number in (1, 2, 3))

    class Plan:
        task = Task.crosscheck

    plan: Any = Plan()
    plan.cases = cases
    view = bow_view(design)
    for case in cases[:2]:
        (tmp_path / case.key).mkdir()
        write_report(tmp_path / case.key / "report.html", {}, [], [], [], views=[view])
    rows = [{"case": n, "stroke_mm": s} for n, s in ((1, 0.3), (2, 0.5), (3, 0.1))]
    found, notes = sweep_views(plan, rows, "stroke_mm", "stroke [mm]", tmp_path)
    assert [view.title for view in found] == ["Case 2: largest stroke, 0.5 mm"]
    assert len(notes) == 1
    assert "case 3: not shown in 3D" in notes[0]
    alone, _ = sweep_views(plan, rows[:1], "stroke_mm", "stroke [mm]", tmp_path)
    assert [view.title for view in alone] == ["Case 1: only stroke, 0.3 mm"]
    assert sweep_views(plan, [], "stroke_mm", "stroke [mm]", tmp_path) == ([], [])


def test_views_of_a_report_go_into_another(tmp_path: Path) -> None:
    """Catches: data cut at a sign inside of them, views that come out changed, an unreadable page taken for none."""
    view = bow_view(load_design("ring_bot"))
    write_report(tmp_path / "a.html", {}, [], [], [], views=[view, view])
    pieces = views_of(tmp_path / "a.html")
    assert [figure(piece) for piece in pieces] == [figure(view)] * 2
    assert pieces_of("<figure><h2>a picture</h2></figure>") == []
    assert all(isinstance(piece, Piece) for piece in pieces)
    with pytest.raises(FileError, match=r"b\.html"):
        views_of(tmp_path / "b.html")
    (tmp_path / "c.html").write_bytes(b"\xff\xfe\xff")
    with pytest.raises(FileError, match="found no text"):
        views_of(tmp_path / "c.html")

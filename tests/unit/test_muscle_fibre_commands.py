"""`fem-biobot muscle fibres` and `muscle orientation`: what they write, print and refuse; pictures of fibres."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import meshio
import numpy as np
import pytest
from numpy.typing import NDArray

from fem_biobot.config import digest, load_design
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.mesh.committed import committed_mesh
from fem_biobot.muscle.fibre_numbers import between, fibre_numbers, neighbour_angles
from fem_biobot.muscle.fibres import fibre_field
from fem_biobot.muscle.streamlines import streamlines
from fem_biobot.study.muscle_fibres import picture_of
from fem_biobot.study.muscle_findings import muscle_findings
from fem_biobot.view.fibres import histogram_plot
from fem_biobot.view.report import views_of
from tests.command import call, listing
from tests.helpers import box_mesh

Array = NDArray[np.float64]


@pytest.fixture(autouse=True)
def built_in_renderer(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FEM_BIOBOT_RENDERER", "matplotlib")


def table(path: Path, *peaks: tuple[str, float, float]) -> Path:
    """A plug-in's table of Gaussian peaks: name, centre and width [deg]."""
    degrees = -90.0 + 2.0 * np.arange(90)
    columns = []
    for _, mean, width in peaks:
        curve = np.exp(-0.5 * (((degrees - mean + 90.0) % 180.0 - 90.0) / width) ** 2)
        columns.append(0.8 * curve / curve.sum() + 0.2 / 90)
    rows = [",".join(f"{v:.9f}" for v in row) for row in zip(degrees, *columns, strict=True)]
    path.write_text("\n".join([",".join(["Direction (°)", *(p[0] for p in peaks)]), *rows, ""]), encoding="utf-8")
    return path


def test_fibres_writes_pictures_the_field_and_its_numbers(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """The `.vtu` holds the field of the design on its mesh, the CSV reads back as that field, JSON stands alone.

    Catches: another field drawn than solved with, directions on the gel, a CSV that the key does not take.
    """
    out = tmp_path / "f"
    said = call(
        capsys, "muscle", "fibres", "strip", "--set", "muscle.theta=70 deg", "--size", "2", "--out", out, "--json"
    )
    assert said.code == 0
    numbers = json.loads(said.out)["fibres"]
    assert numbers["along_middle_1"] == pytest.approx(np.sin(np.radians(70.0)), rel=1e-12)
    assert numbers["along_middle_second_1"] == pytest.approx(np.sin(np.radians(70.0)) ** 2, rel=1e-12)
    assert numbers["turn_largest_deg"] == pytest.approx(0.0, abs=1e-6)
    assert {"fibres.vtu", "figures/fibres.png", "tables/fibres.csv", "report.html"} <= set(listing(out))
    assert [view.title for view in views_of(out / "report.html")] == ["Fibres of the muscle"]
    written = meshio.read(out / "fibres.vtu")
    field = written.cell_data["fibre_direction_1"][0]
    np.testing.assert_allclose(field, np.tile([np.sin(np.radians(70)), np.cos(np.radians(70)), 0], (len(field), 1)))
    (tmp_path / "again.toml").write_text('base = "strip"\n[muscle]\nfibres = "f/tables/fibres.csv"\n')
    design = load_design(tmp_path / "again.toml")
    cells = written.cells_dict["tetra"].T
    mesh = BodyMesh(written.points.T, cells, {"muscle": np.arange(cells.shape[1])})
    assert np.degrees(between(fibre_field(design, mesh), field.T)).max() < 1e-5


def test_orientation_prints_what_the_table_says(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """Two images, each with its mean, width and theta; the same as a design takes by name.

    Catches: one image left out, the axis of the design forgotten, another theta than the design's, a result that needs
    files from elsewhere.
    """
    file = table(tmp_path / "h.csv", ("a.tif", 80.0, 15.0), ("b.tif", 60.0, 20.0))
    axis = "muscle.orientation_axis=70 deg"
    sets = ["--set", f"muscle.orientation={file}", "--set", "muscle.orientation_image=b.tif", "--set", axis]
    out = tmp_path / "o"
    said = call(capsys, "muscle", "orientation", "junction_bot", file, *sets, "--out", out, "--json")
    assert said.code == 0
    images = json.loads(said.out)["orientation"]["images"]
    assert [(i["image"], round(i["mean_deg"], 2), round(i["width_deg"], 2)) for i in images] == [
        ("a.tif", 80.0, 15.0),
        ("b.tif", 60.0, 20.0),
    ]
    # 60 in the picture is 10 clockwise from the axis at 70, which is 100 from the lateral axis
    assert images[1]["theta_deg"] == pytest.approx(100.0, abs=1e-3)
    design = load_design("junction_bot", [s for s in sets if s != "--set"])
    assert np.degrees(design.value("muscle.theta")) == pytest.approx(images[1]["theta_deg"], rel=1e-12)
    assert images[0]["background_1"] == pytest.approx(0.2, abs=1e-6)
    rows = list(csv.DictReader((out / "tables" / "orientation.csv").open(encoding="utf-8")))
    assert float(rows[1]["chi_1"]) == pytest.approx(images[1]["chi_1"])
    assert {"figures/orientation.png", "tables/histograms.csv"} <= set(listing(out))
    # the folder reruns by itself: the table lies in it, and the original may go
    before = digest(design)
    file.rename(tmp_path / "moved.csv")
    assert digest(load_design(out / "design.toml")) == before
    (tmp_path / "moved.csv").rename(file)
    text = call(capsys, "muscle", "orientation", "junction_bot", file, *sets, "--out", out)
    assert "a.tif" in text.out
    assert "muscle.orientation_image choose one of them" in text.out


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("Direction (°),a\n" + "".join(f"{d},0.02\n" for d in range(-90, 90, 2)), "found shares that sum to 1.8"),
        ("Direction (°),a\n" + "".join(f"{d},0.05\n" for d in range(0, 20)), "found directions from 0 to 19 deg"),
        ("Direction (°),a\n" + "".join(f"{d},nan\n" for d in range(-90, 90, 2)), "found share nan in bin 1"),
        ("Direction (°),a\n" + "".join(f"{d},{1 / 90:.9f}\n" for d in range(-90, 90, 2)), "no preferred direction"),
    ],
)
def test_bad_tables_end_in_one_line(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, content: str, words: str
) -> None:
    """What is no histogram, or has no direction, is refused with exit code 2 and gives no angle.

    Catches: a traceback, a result folder that looks whole.
    """
    (tmp_path / "h.csv").write_text(content, encoding="utf-8")
    said = call(capsys, "muscle", "orientation", "strip", tmp_path / "h.csv", "--out", tmp_path / "o")
    assert (said.code, len(said.err.splitlines())) == (2, 1)
    assert words in said.complaint
    missing = call(capsys, "muscle", "orientation", "strip", tmp_path / "none.csv", "--out", tmp_path / "o")
    assert (missing.code, "none.csv: cannot be read" in missing.complaint) == (2, True)


def test_a_run_tells_of_fibres_and_of_the_orientation_that_the_design_names(tmp_path: Path) -> None:
    """What a run takes into its report: numbers of the field, and the table with its fit where a design has one.

    Catches: a measured orientation of which the report says nothing.
    """
    design = load_design("strip", [f"muscle.orientation={table(tmp_path / 'h.csv', ('a.tif', 5.0, 15.0))}"])
    mesh = committed_mesh(design, 2.0)
    assert mesh is not None
    found = muscle_findings(design, mesh, tmp_path)
    assert list(found.numbers) == ["drive", "fibres", "orientation"]
    assert found.numbers["fibres"]["theta_deg"] == pytest.approx(85.0, abs=1e-3)
    assert found.numbers["orientation"]["images"][0]["theta_deg"] == pytest.approx(85.0, abs=1e-3)
    assert {path.name for path, _ in found.figures} == {"drive.png", "fibres.png", "orientation.png"}
    assert (tmp_path / "tables" / "histograms.csv").is_file()


def test_a_mesh_file_and_a_size_do_not_go_together(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """As for other commands.

    Catches: a size that is ignored in silence.
    """
    said = call(capsys, "muscle", "fibres", "strip", "--size", "1", "--mesh", tmp_path / "a.msh")
    assert (said.code, "--size: found together with --mesh" in said.complaint) == (2, True)


def test_streamlines_keep_to_a_circle() -> None:
    """In a ring of elements with tangential directions of mixed sense a line comes round on its radius.

    The midpoint rule errs by (step / radius)^2 / 24 of a turn in direction a step; here the mean of neighbours on the
    inner side counts as well.

    Catches: a line that turns back where the sense changes, first-order steps that spiral out.
    """
    box = box_mesh((60, 6, 2), shift=0.0)
    phi, r = 2.0 * np.pi * box.points[0], 1.5 + 0.6 * box.points[1]
    middles = np.stack([r * np.cos(phi), r * np.sin(phi), 0.2 * box.points[2]])[:, box.cells].mean(axis=1)
    tangent = np.stack([-middles[1], middles[0], 0 * middles[0]]) / np.hypot(middles[0], middles[1])
    tangent *= np.random.default_rng(7).choice([-1.0, 1.0], tangent.shape[1])
    seed = int(np.argmin(np.abs(np.hypot(middles[0], middles[1]) - 1.8) + np.abs(middles[1])))
    lines = streamlines(middles, tangent, np.full(tangent.shape[1], 0.2), np.array([seed]), length=5.0, step=0.05)
    assert len(lines) == 1
    radius = np.hypot(lines[0][0], lines[0][1])
    assert np.ptp(radius) < 0.06
    assert lines[0].shape[1] == 201
    np.testing.assert_allclose(np.linalg.norm(np.diff(lines[0], axis=1), axis=0), 0.05, rtol=0.01)


def test_streamlines_end_where_the_tissue_does() -> None:
    """Along a block of constant fibres lines run from face to face and no further.

    Catches: lines that go on outside.
    """
    mesh = box_mesh((8, 3, 3), (4.0, 1.0, 1.0))
    middles = mesh.points[:, mesh.cells].mean(axis=1)
    a0 = np.repeat(np.eye(3)[:, :1], middles.shape[1], axis=1)
    lines = streamlines(middles, a0, np.full(a0.shape[1], 0.4), np.array([5, 40]), length=9.0, step=0.1)
    assert len(lines) == 2
    for line in lines:
        assert -0.35 < line[0].min() < 0.25
        assert 3.75 < line[0].max() < 4.35
        assert np.ptp(line[1]) < 1e-12


def test_numbers_of_a_field_with_spread_are_those_of_its_moments() -> None:
    """Along the machine with a spread of 15 degrees the middle pulls with 0.9663 and 0.9360 (facts/dispersion.csv).

    Catches: the spread left out, first and second moment exchanged.
    """
    design = load_design("junction_bot", ["muscle.spread=15 deg", "muscle.fibres=smooth"])
    mesh = committed_mesh(design, 2.0)
    assert mesh is not None
    numbers = fibre_numbers(design, mesh, fibre_field(design, mesh))
    assert f"{numbers['along_middle_1']:.4f}" == "0.9663"
    assert f"{numbers['along_middle_second_1']:.4f}" == "0.9360"
    assert 0.1 < numbers["from_piecewise_share_1"] < 0.4


def test_angles_between_neighbours_are_those_between_layers() -> None:
    """Two layers at 30 degrees to each other: faces between them turn by 30 degrees, all others not at all.

    Catches: the sense of a fibre counted, faces of the boundary counted.
    """
    mesh = box_mesh((3, 3, 4), layers=(0.5, 1.0), names=("low", "high"))
    whole = type(mesh)(mesh.points, mesh.cells, {"muscle": np.arange(mesh.n_elements)})
    angle = np.zeros(mesh.n_elements)
    angle[mesh.regions["high"]] = np.radians(210.0)
    a0 = np.stack([np.cos(angle), np.sin(angle), 0 * angle])
    found, area = neighbour_angles(whole, a0)
    turned = found > 1e-6
    np.testing.assert_allclose(np.degrees(found[turned]), 30.0, rtol=1e-12)
    assert area[turned].sum() == pytest.approx(1.0, rel=1e-12)  # the section of the unit cube


def test_the_picture_has_glyphs_and_lines_within_the_body() -> None:
    """Every panel shows the outline; glyphs are as long as elements and as many as pictures bear.

    Catches: an empty picture, lines outside of the machine.
    """
    design = load_design("junction_bot", ["muscle.fibres=smooth"])
    mesh = committed_mesh(design, 2.0)
    assert mesh is not None
    picture = picture_of(design, mesh, fibre_field(design, mesh))
    glyphs = picture.panels[0].layers[1]
    assert 700 < glyphs.edges.shape[1] < 3000
    flow = picture.panels[1].layers[1]
    assert flow.edges.shape[1] > 1000
    low, high = mesh.bounding_box()
    assert np.all(flow.points > low[:, None] - 0.5)
    assert np.all(flow.points < high[:, None] + 0.5)
    pieces = np.linalg.norm(flow.points[:, flow.edges[0]] - flow.points[:, flow.edges[1]], axis=0)
    assert pieces.max() < 1.5 * np.median(pieces)  # no line joined to the next


def test_histograms_without_a_fit_can_be_drawn(tmp_path: Path) -> None:
    """One with a curve, and several of which one has none.

    Catches: a plot that needs every fit.
    """
    x, y = np.linspace(-90.0, 88.0, 90), np.full(90, 1 / 90)
    histogram_plot(tmp_path / "one.png", [("a", x, y, y)])
    histogram_plot(tmp_path / "two.png", [("a", x, y, y), ("b", x, y, None)])
    assert (tmp_path / "one.png").stat().st_size > 5000
    assert (tmp_path / "two.png").stat().st_size > 5000

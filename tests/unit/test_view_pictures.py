"""Pictures come out right, with VTK or without, and a renderer that crashes takes nothing with it."""

from __future__ import annotations

import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from matplotlib.image import imread

from fem_biobot.errors import DesignError, FileError
from fem_biobot.view import pictures, raster
from fem_biobot.view.layout import lay_out
from fem_biobot.view.pictures import VARIABLE, renderer_status
from fem_biobot.view.scene import Bar, Inset, Layer, Panel, Picture, View, camera_axes

SQUARE = np.array([[0, 0], [1, 2], [2, 3]])
WIDTH = 420  # pixels: small, for speed
SEGFAULT = "import os, signal; os.kill(os.getpid(), signal.SIGSEGV)"


def draw_pictures(which: list[Picture], folder: Path, **options: object) -> pictures.Drawn:
    return pictures.draw_pictures(which, folder, width=WIDTH, **options)


def upright(x0: float, x1: float, z0: float, z1: float, y: float = 0.0) -> np.ndarray:
    """Corners of a rectangle that faces the front camera, counter-clockwise as it sees them."""
    return np.array([[x0, x1, x1, x0], [y] * 4, [z0, z0, z1, z1]])


def front(layers: list[Layer], bar: Bar | None = None) -> View:
    """The window from (0, 0) to (4, 2) mm at 25 pixels per millimetre."""
    return View(layers, camera_axes("front"), (2.0, 1.0), 1.0, (100, 50), bar)


def hill(count: int = 24) -> tuple[np.ndarray, np.ndarray]:
    """A curved, finely triangulated surface above the plane, seen from above."""
    a, b = np.meshgrid(np.linspace(-2.0, 2.0, count), np.linspace(-1.0, 1.0, count))
    points = np.array([a.ravel(), b.ravel(), np.exp(-(a**2) - b**2).ravel()])
    i = (np.arange(count - 1)[:, None] * count + np.arange(count - 1)).ravel()
    return points, np.hstack([[i, i + 1, i + count + 1], [i, i + count + 1, i + count]])


def picture(name: str = "hill", **changes: object) -> Picture:
    points, triangles = hill()
    edge = np.flatnonzero(points[1] == -1.0)
    body = Layer(points, triangles, values=points[2], edges=np.array([edge[:-1], edge[1:]]), edge_width=2.0)
    floor = np.array([[-2.5, 2.5, 2.5, -2.5], [-1.5, -1.5, 1.5, 1.5], [-0.3] * 4])
    ground = Layer(floor, SQUARE, colour="#d0d8df", lit=False)
    cover = Layer(upright(-2.2, -0.5, 0.0, 1.2, y=-1.2), SQUARE, colour="#c8473c", opacity=0.5)
    panel = Panel([ground, body, cover], "iso", "a caption")
    return replace(Picture(name, "A hill", [panel], Bar("height [mm]", (0.0, 1.0))), **changes)


@pytest.fixture
def child(monkeypatch: pytest.MonkeyPatch) -> object:
    """Replaces the program that draws by a line of Python; forgets what earlier children did."""
    monkeypatch.setattr(pictures, "_known_failure", None)
    monkeypatch.delenv(VARIABLE, raising=False)
    monkeypatch.delenv("DISPLAY", raising=False)
    return lambda code: monkeypatch.setattr(pictures, "_CHILD", (sys.executable, "-c", code))


def test_a_square_covers_its_pixels_in_its_colour() -> None:
    """Catches: rows from the bottom, x and z swapped, half-pixel shifts, shading of unlit layers."""
    image = raster.render(front([Layer(upright(1.0, 2.0, 0.4, 1.6), SQUARE, colour="#204060", lit=False)]))
    assert image.shape == (50, 100, 3)
    covered = (image == [0x20, 0x40, 0x60]).all(axis=2)
    rows, columns = np.nonzero(covered)
    # top at z = 1.6: (2 - 1.6) * 25 = row 10; left at x = 1: column 25
    assert (rows.min(), rows.max(), columns.min(), columns.max()) == (10, 39, 25, 49)
    assert covered.sum() == 30 * 25
    assert (image[~covered] == 255).all()


@pytest.mark.parametrize("order", [1, -1])
def test_what_is_nearer_hides_what_is_farther(order: int) -> None:
    """Catches: painting in the order given, depth with the wrong sign."""
    far = Layer(upright(0.0, 4.0, 0.0, 2.0, y=1.0), SQUARE, colour="#ff0000", lit=False)
    near = Layer(upright(1.0, 2.0, 0.0, 2.0, y=-1.0), SQUARE, colour="#00ff00", lit=False)
    image = raster.render(front([far, near][::order]))
    assert tuple(image[25, 37]) == (0, 255, 0)
    assert tuple(image[25, 75]) == (255, 0, 0)


def test_a_translucent_layer_lets_through_what_is_behind_and_only_that() -> None:
    """Catches: opacity squared or ignored, translucent layers hiding or covering wrongly, back sides drawn."""
    back = Layer(upright(0.0, 4.0, 0.0, 2.0, y=1.0), SQUARE, colour="#000000", lit=False)
    veil = Layer(upright(1.0, 2.0, 0.0, 2.0), SQUARE, colour="#ffffff", opacity=0.25, lit=False)
    hidden = Layer(upright(2.0, 3.0, 0.0, 2.0, y=2.0), SQUARE, colour="#ffffff", opacity=0.25, lit=False)
    turned = Layer(upright(3.0, 4.0, 0.0, 2.0), SQUARE[::-1], colour="#ffffff", opacity=0.25, lit=False)
    image = raster.render(front([veil, hidden, turned, back]))
    assert tuple(image[25, [12, 37, 62, 87], 0]) == (0, 64, 0, 0)


def test_values_are_coloured_by_the_bar_and_stop_at_its_ends() -> None:
    """Catches: limits ignored, colours wrapped beyond the limits, colours mixed in place of values."""
    layer = Layer(upright(0.0, 4.0, 0.0, 2.0), SQUARE, values=np.array([-2.0, 6.0, 6.0, -2.0]), lit=False)
    image = raster.render(front([layer], Bar("x [1]", (0.0, 4.0), "viridis")))
    for column, share in ((5, 0.0), (50, 0.505), (95, 1.0)):  # value at column c: -2 + 8 (c + 0.5) / 100
        expected = 255.0 * np.asarray(pictures.colour_map("viridis")(share))[:3]
        assert image[25, column] == pytest.approx(expected, abs=3)


def test_lines_show_before_surfaces_and_hide_behind_them() -> None:
    """Catches: hidden lines drawn through the body, lines lost on the surface they lie on or behind a veil."""
    wall = Layer(upright(0.0, 2.0, 0.0, 2.0), SQUARE, colour="#ffffff", lit=False)
    ends = np.array([[0.2, 3.8, 0.2, 3.8], [1.0, 1.0, 0.0, 0.0], [0.5, 0.5, 1.5, 1.5]])
    lines = Layer(ends, edges=np.array([[0, 2], [1, 3]]), edge_colour="#000000", edge_width=3.0)
    veil = Layer(upright(2.0, 4.0, 0.0, 2.0), SQUARE, colour="#ffffff", opacity=0.5, lit=False)
    image = raster.render(front([wall, veil, lines]))[:, :, 0]
    assert image[37, 25] == 255  # z = 0.5, behind the wall
    assert image[37, 75] == 0  # z = 0.5, beside it, behind the veil
    assert image[12, 25] == 0  # z = 1.5, on it


def test_faces_toward_the_light_are_brighter_and_none_is_black() -> None:
    """Catches: no shading, lights from below."""
    bright = raster._brightness(np.array([[0.0, 0.0, 0.0], [1.0, -1.0, 0.0], [0.2, 0.2, 1.0]]))
    assert bright[0] > bright[1] + 0.2
    assert bright.min() > 0.5
    assert bright.max() < 1.2


def test_panels_share_one_scale_and_everything_is_in_the_window() -> None:
    """Catches: panels scaled one by one, content cut off, panels over each other."""
    small = Layer(upright(0.0, 1.0, 0.0, 0.3), SQUARE)
    large = Layer(upright(-3.0, 4.0, 0.0, 2.0), SQUARE)
    layout = lay_out(Picture("p", "", [Panel([layer], "front") for layer in (small, large, small)]))
    scales = {f.view.half_height / f.view.pixels[1] for f in layout.frames}
    assert max(scales) == pytest.approx(min(scales))
    assert layout.mm_per_pixel == pytest.approx(2.0 * max(scales))
    left, right, bottom, top = layout.frames[1].view.window
    assert left < -3.0 < 4.0 < right
    assert bottom < 0.0 < 2.0 < top
    strip = Layer(upright(0.0, 1.0, 0.0, 0.1), SQUARE)
    flat = lay_out(Picture("q", "", [Panel([strip], "front")], Bar("x", (0.0, 1.0))))  # taller than its content
    view = flat.frames[0].view
    assert view.half_height > 0.1
    assert flat.mm_per_pixel == pytest.approx(2.0 * view.half_height / view.pixels[1])
    assert view.window[0] < 0.0 < 1.0 < view.window[1]
    boxes = [(f.left, f.bottom, f.left + f.view.pixels[0], f.bottom + f.view.pixels[1]) for f in layout.frames]
    for i, a in enumerate(boxes):
        assert 0 <= a[0] < a[2] <= layout.width
        assert 0 <= a[1] < a[3] <= layout.height
        assert not any(a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3] for b in boxes[i + 1 :])


def test_an_inset_looks_at_its_centre_and_stands_beside_its_panel() -> None:
    """Catches: the inset centred in body coordinates, drawn over the panel."""
    layer = Layer(upright(-3.0, 4.0, 0.0, 2.0), SQUARE)
    inset = Inset([layer], (3.0, 0.0, 1.5), 0.25, "near", "front")
    main, zoom = lay_out(Picture("p", "", [Panel([layer], "front", inset=inset)])).frames
    assert zoom.view.window == pytest.approx((2.75, 3.25, 1.25, 1.75))
    assert zoom.left >= main.left + main.view.pixels[0]


def test_a_picture_is_a_readable_png_and_the_same_each_time(tmp_path: Path) -> None:
    """Catches: a time stamp in the file, temporary files left, a picture of another size than laid out."""
    files = [draw_pictures([picture(name)], tmp_path, renderer="matplotlib").files[0] for name in ("a", "b")]
    assert files == [tmp_path / "a.png", tmp_path / "b.png"]
    assert files[0].read_bytes() == files[1].read_bytes()
    layout = lay_out(picture(), width=WIDTH)
    assert imread(files[0]).shape[:2] == (layout.height, layout.width)
    assert sorted(tmp_path.iterdir()) == files


def test_the_builtin_renderer_when_asked_for_starts_no_child(
    tmp_path: Path, child: object, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Catches: the environment variable read after VTK was tried."""
    child(f"open({str(tmp_path / 'ran')!r}, 'w')")
    monkeypatch.setenv(VARIABLE, "matplotlib")
    drawn = draw_pictures([picture()], tmp_path)
    assert (drawn.renderer, drawn.note) == ("matplotlib", "")
    assert renderer_status()[0] == "matplotlib"
    assert [p.name for p in tmp_path.iterdir()] == ["hill.png"]


def test_a_child_killed_by_a_segmentation_fault_leaves_whole_pictures_and_a_note(
    tmp_path: Path, child: object, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Catches: the crash taking this process along, no fallback, a silent fallback, noise on the terminal."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "tmp"))
    (tmp_path / "tmp").mkdir()
    (tmp_path / "out").mkdir()
    child("import sys; sys.stderr.write('chatter\\n'); sys.stderr.flush(); " + SEGFAULT)
    drawn = draw_pictures([picture("a"), picture("b")], tmp_path / "out")
    assert drawn.renderer == "matplotlib"
    assert drawn.note.startswith("pictures drawn by matplotlib: off-screen rendering failed (child ended by signal 11")
    if sys.platform.startswith("linux"):
        assert "`apt-get install -y libosmesa6` (or libegl1)" in drawn.note
    assert [p.name for p in drawn.files] == ["a.png", "b.png"]
    assert all(imread(file).std() > 0.02 for file in drawn.files)
    assert list((tmp_path / "tmp").iterdir()) == []
    assert capfd.readouterr() == ("", "")


def test_a_failure_is_remembered_and_the_child_not_asked_again(tmp_path: Path, child: object) -> None:
    """Catches: every picture of a run waiting for VTK to fail once more."""
    child(f"open({str(tmp_path / 'runs')!r}, 'a').write('x'); raise SystemExit(3)")
    first = draw_pictures([picture("a")], tmp_path)
    second = draw_pictures([picture("b")], tmp_path)
    assert "child ended with code 3" in first.note
    assert second.note == first.note
    assert renderer_status() == ("matplotlib", first.note)
    assert (tmp_path / "runs").read_text() == "x"


def test_vtk_is_tried_without_the_display_first_and_with_it_after(
    tmp_path: Path, child: object, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Catches: VTK complaining about an X server that is not there; a desktop that can draw only through its server."""
    monkeypatch.setenv("DISPLAY", ":93")
    log = str(tmp_path / "log")
    child(f"import os; open({log!r}, 'a').write(os.environ.get('DISPLAY', 'none') + ' '); raise SystemExit(1)")
    assert renderer_status()[0] == "matplotlib"
    assert Path(log).read_text() == "none :93 "


BLANK = """
import json, sys, pathlib, numpy as np
job = pathlib.Path(sys.argv[1])
for view in json.loads(np.load(job)["spec"].item())["views"]:
    w, h = view["pixels"]
    np.save(job.with_name(view["file"]), np.full((h // 2, w // 2, 3), 255, np.uint8))
"""


@pytest.mark.parametrize(
    ("code", "word"),
    [
        ("pass", "no picture came back"),
        (BLANK, "no picture came back"),
        (
            "import sys; sys.stderr.write('chatter\\nlibGL.so.1: cannot open\\n'); sys.exit(1)",
            "libGL.so.1: cannot open",
        ),
        ("import no_such_module_at_all", "pip install pyvista"),
        ("import time; time.sleep(60)", "no answer within 0.5 s"),
    ],
)
def test_other_ways_to_fail_are_told_in_the_note(
    tmp_path: Path, child: object, capfd: pytest.CaptureFixture[str], code: str, word: str
) -> None:
    """Catches: an empty picture taken for a good one, a child waited for without end, its chatter on the terminal."""
    child(code)
    drawn = draw_pictures([picture()], tmp_path, timeout=0.5 if "sleep" in code else 60.0)
    assert drawn.renderer == "matplotlib"
    assert word in drawn.note
    assert imread(drawn.files[0]).std() > 0.02
    assert capfd.readouterr() == ("", "")


def test_vtk_when_insisted_on_is_an_error_where_it_cannot_draw(tmp_path: Path, child: object) -> None:
    """Catches: a forced renderer replaced all the same."""
    child(SEGFAULT)
    with pytest.raises(FileError, match=r"pyvista.*signal 11"):
        draw_pictures([picture()], tmp_path, renderer="pyvista")
    assert list(tmp_path.iterdir()) == []


def test_an_unknown_renderer_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Catches: a misspelt choice taken for auto."""
    monkeypatch.setenv(VARIABLE, "povray")
    with pytest.raises(DesignError, match=r"FEM_BIOBOT_RENDERER = 'povray'.*matplotlib"):
        draw_pictures([picture()], tmp_path)


def test_no_room_for_the_job_is_one_line_that_names_the_folder(
    tmp_path: Path, child: object, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Catches: an operating-system error passing through as a traceback."""
    child("pass")
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "missing"))
    with pytest.raises(FileError, match=r"missing: cannot prepare the pictures"):
        draw_pictures([picture()], tmp_path)


def test_vtk_and_the_builtin_renderer_draw_the_same_picture(
    child: object, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Catches: cameras, lights, colours, normals or translucency that differ; VTK's chatter on the terminal."""
    monkeypatch.setenv("DISPLAY", ":93")  # no such server
    view = lay_out(picture(), width=500).frames[0].view
    if renderer_status()[0] != "pyvista":
        pytest.skip("VTK cannot draw off-screen here")
    ours = raster.render(view).astype(float)
    (vtk,) = pictures._render_in_child([view], 60.0)
    assert vtk.shape == ours.shape
    apart = np.abs(vtk - ours).max(axis=2)
    # anti-aliased edges and lines differ by a pixel; faces must not
    assert np.median(apart) <= 2.0
    assert np.mean(apart > 12.0) < 0.04
    red = np.abs(vtk - 255.0 * np.array(to_rgb("#c8473c"))).max(axis=2)
    assert red.min() > 20.0  # the veil is half transparent
    assert capfd.readouterr() == ("", "")

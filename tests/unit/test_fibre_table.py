"""Fibre directions from tables and pictures: places, angles, vectors, the sense that means nothing, refusals."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from fem_biobot.config import load_design
from fem_biobot.errors import FileError
from fem_biobot.mesh.committed import committed_mesh
from fem_biobot.muscle.fibre_table import fibres_from_file
from fem_biobot.muscle.fibres import fibre_field

Array = NDArray[np.float64]
BOX = np.array([-4.0, -2.0, 0.0]), np.array([4.0, 2.0, 0.5])


def places(n: int = 400, seed: int = 53) -> Array:
    low, high = BOX
    return low[:, None] + (high - low)[:, None] * np.random.default_rng(seed).uniform(0.02, 0.98, (3, n))


def grid() -> tuple[Array, Array]:
    x, y = np.meshgrid(np.linspace(-4.0, 4.0, 17), np.linspace(-2.0, 2.0, 9))
    return x.ravel(), y.ravel()


def theta_at(X: Array) -> Array:
    """A smooth field of angles from the lateral axis [rad] that passes through 0 and 180 degrees."""
    return np.radians(20.0 * X[0] + 5.0 * X[1])


def write(path: Path, header: str, rows: Array) -> Path:
    lines = [",".join(f"{v:.12g}" for v in row) for row in rows.T]
    path.write_text("\n".join([header, *lines, ""]))
    return path


def away(a0: Array, theta: Array) -> Array:
    """Angle to the direction of theta [deg]."""
    wanted = np.stack([np.sin(theta), np.cos(theta), 0 * theta])
    return np.degrees(np.arccos(np.clip(np.abs(np.einsum("ie,ie->e", a0, wanted)), 0.0, 1.0)))


def test_angles_of_a_table_are_those_of_theta(tmp_path: Path) -> None:
    """A field given as theta on a grid comes back between its points, whatever half turns are written.

    The grid turns by 10 degrees from point to point, of which linear interpolation of dyads misses 0.1 degree.

    Catches: theta from x, angles averaged across 180 degrees, dyads of vectors with a sense.
    """
    x, y = grid()
    theta = theta_at(np.stack([x, y]))
    half_turns = 180.0 * np.random.default_rng(5).integers(-1, 2, x.size)
    degrees = np.clip(np.degrees(theta) + half_turns, -359.0, 359.0 - 0 * x)
    keep = np.abs(degrees - np.degrees(theta) - half_turns) < 1e-9
    path = write(tmp_path / "f.csv", "x_mm,y_mm,theta_deg", np.stack([x, y, degrees])[:, keep])
    X = places()
    a0 = fibres_from_file(path, X, BOX)
    assert away(a0, theta_at(X)).max() < 0.5
    np.testing.assert_allclose(np.linalg.norm(a0, axis=0), 1.0, rtol=0.0, atol=4e-16)
    assert not a0[2].any()


def test_vectors_in_space_keep_their_direction_and_not_their_length(tmp_path: Path) -> None:
    """Points with z and vectors of any length and sense: a constant oblique direction comes back exactly.

    Catches: z left out, lengths as weights, opposite senses that cancel.
    """
    draw = np.random.default_rng(61)
    points = places(300, seed=67) * 1.05
    a = np.array([0.6, 0.0, 0.8])
    vectors = a[:, None] * draw.uniform(0.1, 3.0, 300) * draw.choice([-1.0, 1.0], 300)
    path = write(tmp_path / "f.csv", "a_x,a_y,a_z,x_mm,y_mm,z_mm", np.vstack([vectors, points]))
    a0 = fibres_from_file(path, places(), BOX)
    np.testing.assert_allclose(np.abs(a @ a0), 1.0, rtol=0.0, atol=1e-12)


def test_a_picture_of_angles_covers_the_muscle(tmp_path: Path) -> None:
    """Pixel (0, 0) is at the muscle's left and far side (y up); angles run counter-clockwise from x; NaN says nothing.

    Catches: a picture upside down, theta for the angle from x, a hole filled with zero.
    """
    rows, columns = 40, 80
    y = 2.0 - 4.0 * (np.arange(rows) + 0.5) / rows
    x = -4.0 + 8.0 * (np.arange(columns) + 0.5) / columns
    from_x = 30.0 + 5.0 * x[None, :] + 8.0 * y[:, None]
    from_x[10:14, 20:24] = np.nan
    path = tmp_path / "angles.tif"
    Image.fromarray(from_x.astype(np.float32)).save(path)
    X = places()
    a0 = fibres_from_file(path, X, BOX)
    theta = np.radians(90.0 - (30.0 + 5.0 * X[0] + 8.0 * X[1]))
    found = away(a0, theta)
    # exact between pixels but for their own rounding; in the hole up to two pixels of 0.1 mm and 9.4 deg/mm
    assert np.median(found) < 1e-4
    assert found.max() < 2.0


def test_a_design_takes_its_fibres_from_a_file_beside_it(tmp_path: Path) -> None:
    """``muscle.fibres = "f.csv"`` in a file of another folder gives the field of the table, of a strip as of a bot.

    Catches: the path taken from the current folder, a table read and not used.
    """
    x, y = np.meshgrid(np.linspace(-8.0, 8.0, 33), np.linspace(-4.5, 4.5, 19))
    theta = np.radians(70.0 + 3.0 * x)
    write(tmp_path / "f.csv", "x_mm,y_mm,theta_deg", np.stack([x.ravel(), y.ravel(), np.degrees(theta).ravel()]))
    for base in ("strip", "junction_bot"):
        (tmp_path / "d.toml").write_text(f'base = "{base}"\n[muscle]\nfibres = "f.csv"\n')
        design = load_design(tmp_path / "d.toml")
        mesh = committed_mesh(design, 2.0)
        assert mesh is not None
        X = mesh.points[:, mesh.cells[:, mesh.regions["muscle"]]].mean(axis=1)
        assert away(fibre_field(design, mesh), np.radians(70.0 + 3.0 * X[0])).max() < 0.1


GRID = np.stack([*grid(), np.full(153, 80.0)])


@pytest.mark.parametrize(
    ("header", "rows", "words"),
    [
        ("x_mm,y_mm,angle", GRID, r"found columns x_mm, y_mm, angle, expected .*missing: theta_deg"),
        ("x_mm,theta_deg,z", GRID, "missing: y_mm"),
        ("x_mm,y_mm,theta_deg", np.where(np.arange(153) == 7, np.nan, GRID), "line 9: found x_mm 'nan'"),
        ("x_mm,y_mm,theta_deg", GRID * np.array([[1.0], [1.0], [10.0]]), "found the angle 800 deg"),
        ("x_mm,y_mm,theta_deg", GRID * np.array([[1.0], [0.0], [1.0]]), "found 153 points on one line"),
        (
            "x_mm,y_mm,theta_deg",
            GRID * np.array([[0.4], [1.0], [1.0]]),
            r"found tissue at \(.* mm from the nearest point, expected points all over the muscle",
        ),
        ("x_mm,y_mm,a_x", GRID, "missing: a_y, a_z"),
    ],
)
def test_what_is_no_table_of_fibres_is_refused(tmp_path: Path, header: str, rows: Array, words: str) -> None:
    """Columns, numbers, angles and places that will not do are named.

    Catches: fibres made up where the table says nothing.
    """
    with pytest.raises(FileError, match=f"f.csv.*{words}"):
        fibres_from_file(write(tmp_path / "f.csv", header, rows), places(), BOX)


def test_files_that_cannot_be_read_are_refused(tmp_path: Path) -> None:
    """Missing, empty, not text, too large; vectors of no length; pictures without angles or of other numbers.

    Catches: an error of the operating system or of a library that reaches the user.
    """
    X = places(5)
    with pytest.raises(FileError, match=r"none.csv: cannot be read"):
        fibres_from_file(tmp_path / "none.csv", X, BOX)
    (tmp_path / "empty.csv").write_text("\n")
    with pytest.raises(FileError, match=r"empty.csv: found nothing"):
        fibres_from_file(tmp_path / "empty.csv", X, BOX)
    (tmp_path / "odd.csv").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(FileError, match=r"odd.csv: found bytes that are no text"):
        fibres_from_file(tmp_path / "odd.csv", X, BOX)
    with (tmp_path / "huge.csv").open("wb") as file:
        file.truncate(50_000_001)
    with pytest.raises(FileError, match=r"huge.csv: found 50000001 bytes"):
        fibres_from_file(tmp_path / "huge.csv", X, BOX)
    x, y = grid()
    flat = np.stack([x, y, x * 0 + 1.0, 0 * x, 0 * x])
    flat[2, 4] = 0.0
    path = write(tmp_path / "v.csv", "x_mm,y_mm,a_x,a_y,a_z", flat)
    with pytest.raises(FileError, match=r"v.csv, line 6: found a vector of no length"):
        fibres_from_file(path, X, BOX)
    for values, words in (
        (np.full((9, 9), np.nan), "found no angle"),
        (np.linspace(0.0, 255.0, 81).reshape(9, 9), "found numbers from 0 to 255, expected angles in degrees"),
        (np.full((9, 9), 1e4), "found the angle 10000 deg"),
        (np.full((1, 9), 10.0), "expected two rows and two columns"),
    ):
        Image.fromarray(values.astype(np.float32)).save(tmp_path / "a.tif")
        with pytest.raises(FileError, match=f"a.tif: {words}|a.tif: .*{words}"):
            fibres_from_file(tmp_path / "a.tif", X, BOX)

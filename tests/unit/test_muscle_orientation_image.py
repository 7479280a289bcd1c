"""Directions in pictures: drawn fibres of known mean and spread, files of several kinds, pictures without fibres."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image
from scipy.special import ndtri

from fem_biobot.errors import DesignError, FileError
from fem_biobot.muscle.orientation import orientation
from fem_biobot.muscle.orientation_image import image_histogram, read_image

Array = NDArray[np.float64]
SIZE, LENGTH, WIDTH = 300, 60.0, 2.0  # pixels


def drawn_fibres(mean: float, spread: float, count: int = 170, noise: float = 0.1) -> Array:
    """Opaque fibres whose angles are the quantiles of a normal distribution [deg], over noise, row 0 at the top."""
    draw = np.random.default_rng(1879)
    angles = np.radians(mean + spread * ndtri((np.arange(count) + 0.5) / count))
    draw.shuffle(angles)
    row, column = np.mgrid[0:SIZE, 0:SIZE].astype(float)
    picture = np.zeros((SIZE, SIZE))
    for angle in angles:
        x, y = column - draw.uniform(-10, SIZE + 10), draw.uniform(-10, SIZE + 10) - row
        along, across = np.cos(angle) * x + np.sin(angle) * y, np.cos(angle) * y - np.sin(angle) * x
        fibre = np.exp(-0.5 * (across / WIDTH) ** 2 - 0.5 * (along / (0.5 * LENGTH)) ** 4)
        picture = np.maximum(picture, fibre)
    return picture + noise * draw.normal(size=picture.shape)


@pytest.mark.parametrize(("mean", "spread"), [(20.0, 5.0), (-75.0, 15.0), (88.0, 25.0)])
def test_mean_and_spread_of_drawn_fibres_are_found(mean: float, spread: float) -> None:
    """Fibres drawn with known angles, crossing each other and over noise.

    The mean of 170 angles, of which each counts by what is seen of it, is good to spread / sqrt(170 / 2); ends,
    crossings and the window change the spread by up to an eighth and a degree.

    Catches: a mirrored picture (rows counted downwards), the gradient's direction for the fibre's, half angles.
    """
    found = orientation(image_histogram(drawn_fibres(mean, spread)))
    away = (np.degrees(found.mean) - mean + 90.0) % 180.0 - 90.0
    assert abs(away) < 2.5 * spread / np.sqrt(85.0)
    assert np.degrees(found.width) == pytest.approx(spread, abs=1.0 + spread / 8.0)
    assert found.goodness > 0.9


def test_a_grating_has_one_direction() -> None:
    """Straight stripes at 30 degrees up to the right: one bin, and its neighbours by the pixels.

    Catches: a histogram smeared by the window, bins off by half.
    """
    row, column = np.mgrid[0:120, 0:160].astype(float)
    angle = np.radians(30.0)
    stripes = np.sin(0.35 * (np.cos(angle) * -row - np.sin(angle) * column))
    histogram = image_histogram(stripes)
    assert np.degrees(histogram.angles[np.argmax(histogram.shares)]) == pytest.approx(30.0, abs=1e-9)
    assert histogram.shares.max() > 0.95


@pytest.mark.parametrize(("suffix", "kind"), [("png", "L"), ("tif", "I;16"), ("png", "RGBA"), ("tif", "P")])
def test_pictures_of_several_kinds_give_the_same(tmp_path: Path, suffix: str, kind: str) -> None:
    """8 and 16 bits, colour with transparency, palette: the direction is that of the numbers themselves.

    Catches: the transparent channel taken for brightness, palette numbers for brightness, 16 bits cut to 8.
    """
    picture = drawn_fibres(35.0, 8.0, 60, noise=0.0)
    grey = np.round(255 * picture / picture.max()).astype(np.uint8)
    if kind == "I;16":
        image = Image.fromarray((257 * grey.astype(np.uint16)).astype(np.uint16))
    elif kind == "RGBA":
        # opaque on the left only: brightness must not follow it
        alpha = np.where(np.arange(SIZE) < SIZE / 2, 255, 0).astype(np.uint8)[None, :].repeat(SIZE, axis=0)
        image = Image.fromarray(np.dstack([grey, grey, grey, alpha]))
    else:
        image = Image.fromarray(grey).convert(kind)
    path = tmp_path / f"fibres.{suffix}"
    image.save(path)
    found = read_image(path)
    assert found.shape == (SIZE, SIZE)
    a, b = image_histogram(found).shares, image_histogram(grey.astype(float)).shares
    np.testing.assert_allclose(a, b, rtol=0.0, atol=1e-6)


def test_a_picture_without_structure_gives_no_angle() -> None:
    """One brightness all over, and noise without fibres, say so.

    Catches: an angle read out of noise.
    """
    with pytest.raises(DesignError, match=r"image: found no structure.*no angle is given"):
        image_histogram(np.full((80, 90), 7.0))
    noise = np.random.default_rng(1879).normal(size=(300, 300))
    with pytest.raises(DesignError, match=r"image: found no preferred direction.*no angle is given"):
        orientation(image_histogram(noise))


def test_what_is_no_picture_is_refused(tmp_path: Path) -> None:
    """Too small, not finite, no picture at all, cut short, missing.

    Catches: an error of the library that reaches the user.
    """
    with pytest.raises(DesignError, match=r"20 x 50 pixels, expected at least 32 x 32"):
        image_histogram(np.zeros((20, 50)))
    with pytest.raises(DesignError, match="pixels that are not finite"):
        image_histogram(np.where(np.eye(40) > 0, np.nan, 1.0))
    (tmp_path / "text.png").write_text("no picture")
    with pytest.raises(FileError, match=r"text.png: found no picture, expected a TIFF or PNG file"):
        read_image(tmp_path / "text.png")
    Image.fromarray(np.eye(64, dtype=np.uint8)).save(tmp_path / "whole.png")
    (tmp_path / "cut.png").write_bytes((tmp_path / "whole.png").read_bytes()[:60])
    with pytest.raises(FileError, match=r"cut.png: cannot be read"):
        read_image(tmp_path / "cut.png")
    with pytest.raises(FileError, match=r"none.png: cannot be read \(No such file"):
        read_image(tmp_path / "none.png")
    Image.new("1", (20_000, 4_001)).save(tmp_path / "huge.png")
    with pytest.raises(FileError, match=r"20000 x 4001 pixels, expected at most"):
        read_image(tmp_path / "huge.png")

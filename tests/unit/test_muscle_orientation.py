"""Orientation of fibres from histograms: the fit of the peak, moments, tables of the plug-in, and what is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from fem_biobot.errors import DesignError, FileError
from fem_biobot.material.dispersion import picture_spread
from fem_biobot.muscle.orientation import Histogram, fitted_curve, orientation
from fem_biobot.muscle.orientation_file import histograms_of_file, orientation_of_file
from fem_biobot.muscle.orientation_table import read_histograms

Array = NDArray[np.float64]


def peak(mean: float, width: float, background: float, degrees: Array) -> Array:
    """Shares of a Gaussian about `mean` over a flat background; angles in degrees."""
    away = (degrees - mean + 90.0) % 180.0 - 90.0
    curve = np.exp(-0.5 * (away / width) ** 2)
    return (1.0 - background) * curve / curve.sum() + background / len(degrees)


def bins(start: float = -90.0, n: int = 90) -> Array:
    return start + 180.0 / n * np.arange(n)


@pytest.mark.parametrize("start", [-90.0, 0.0, 37.0])
@pytest.mark.parametrize(("mean", "width", "background"), [(-40.0, 15.0, 0.3), (88.0, 20.0, 0.1), (23.0, 7.0, 0.0)])
def test_a_gaussian_over_a_background_is_found(start: float, mean: float, width: float, background: float) -> None:
    """Centre, width and background come back wherever the histogram begins, at the border of its range too.

    Catches: a peak cut at the border, the background taken into the width, degrees for radians.
    """
    degrees = bins(start)
    found = orientation(Histogram("h", np.radians(degrees), peak(mean, width, background, degrees)))
    # bins near a quarter turn from the peak are put on the side of the highest bin, which is up to half a bin off the
    # centre: with a width of 20 degrees the curve has exp(-4.45^2 / 2) = 5e-5 of its height there
    np.testing.assert_allclose(np.degrees([found.mean, found.width]), (mean, width), rtol=0.0, atol=1e-3)
    assert found.spread == pytest.approx(picture_spread("planar", np.radians(width)), rel=1e-4)
    # the curve's tails at a quarter turn from the centre are not background
    assert found.background == pytest.approx(background, abs=1e-4)
    assert found.goodness == pytest.approx(1.0, abs=1e-6)
    expected = peak(mean, width, background, degrees)
    np.testing.assert_allclose(fitted_curve(found, np.radians(degrees)), expected, rtol=0.0, atol=1e-4 * expected.max())
    # one standard deviation holds 68 % of the peak and its part of the background, up to two bins at its ends
    assert found.amount == pytest.approx(0.6827 * (1 - background) + background * width / 90.0, abs=2.0 * 0.06)


def test_a_wide_peak_gives_the_spread_of_the_cut_distribution() -> None:
    """A width of 45 degrees is a standard deviation of 39.58 degrees within half a turn (facts/dispersion.csv).

    Catches: the fitted width handed to a design, whose spread is that of the angles themselves.
    """
    degrees = bins(n=1800)
    found = orientation(Histogram("h", np.radians(degrees), peak(10.0, 45.0, 0.0, degrees)))
    assert np.degrees(found.width) == pytest.approx(45.0, abs=1e-4)
    assert f"{np.degrees(found.spread):.2f}" == "39.58"
    assert np.degrees(found.circular_spread) == pytest.approx(39.58, abs=0.01)
    assert f"{found.fit_chi:.4f}" == "0.7827"


def test_theta_and_moments_are_seen_from_the_lateral_axis() -> None:
    """Two sharp directions with shares 3/4 and 1/4, the machine's axis 20 degrees up in the picture.

    By hand: angles from the machine's axis are 10 and 35 degrees, so theta of them 80 and 55 degrees.

    Catches: theta from x, the axis added instead of taken off, sine for its square, a mirrored picture.
    """
    degrees = bins(n=180)
    shares = np.zeros(180)
    shares[degrees == 30.0], shares[degrees == 55.0] = 0.75, 0.25
    found = orientation(Histogram("h", np.radians(degrees), shares), np.radians(20.0))
    theta, w = np.radians([80.0, 55.0]), np.array([0.75, 0.25])
    assert found.chi == pytest.approx(w @ np.sin(theta), rel=1e-12)
    assert found.second_moment == pytest.approx(w @ np.sin(theta) ** 2, rel=1e-12)
    assert np.degrees(found.theta) == pytest.approx(80.0, abs=0.5)  # the fit sits on the higher of the two bins
    direction = np.array([np.sin(theta), np.cos(theta)])
    np.testing.assert_allclose(found.structure, np.einsum("k,ik,jk->ij", w, direction, direction), rtol=1e-12)
    # by hand: half the argument of 0.75 exp(60i) + 0.25 exp(110i)
    assert found.circular_mean == pytest.approx(0.5 * np.angle(w @ np.exp(2j * np.radians([30.0, 55.0]))), rel=1e-12)


def test_a_table_whose_last_bin_is_the_first_counts_it_once() -> None:
    """Bins from -90 to 90 degrees inclusive: the direction that stands twice weighs as the others.

    Catches: vertical fibres counted double, which shifts the moments.
    """
    twice, once = np.linspace(-90.0, 90.0, 91), bins()
    shares = peak(90.0, 12.0, 0.1, once)
    a = orientation(Histogram("h", np.radians(twice), np.r_[shares, shares[0]] / (1.0 + shares[0])))
    b = orientation(Histogram("h", np.radians(once), shares))
    assert a.second_moment == pytest.approx(b.second_moment, rel=1e-10)
    assert a.chi == pytest.approx(b.chi, rel=1e-10)


# as ImageJ saves what the plug-in shows: row numbers, the degree sign, two images with their fits
HEADER = " ,Direction (°),day 15.tif,day 15.tif-fit,day 5.tif,day 5.tif-fit"


def plugin_table(path: Path, separator: str = ",", encoding: str = "utf-8") -> Path:
    degrees = bins()
    first, second = peak(85.0, 15.0, 0.2, degrees), peak(60.0, 28.0, 0.4, degrees)
    rows = [
        f"{k + 1},{d:.9f},{a:.9f},0.1,{b:.9f},0.1"
        for k, (d, a, b) in enumerate(zip(degrees, first, second, strict=True))
    ]
    path.write_bytes("\n".join([HEADER, *rows, ""]).replace(",", separator).encode(encoding))
    return path


@pytest.mark.parametrize(("separator", "encoding"), [(",", "utf-8"), ("\t", "latin-1"), (";", "utf-8-sig")])
def test_the_plugins_table_gives_one_histogram_an_image(tmp_path: Path, separator: str, encoding: str) -> None:
    """Every image's own column is read, the columns of fits and of row numbers are not.

    Catches: a fit read as an image, row numbers read as directions, a degree sign of another encoding refused.
    """
    path = plugin_table(tmp_path / "histograms.csv", separator, encoding)
    found = [orientation(h) for h in read_histograms(path)]
    assert [o.name for o in found] == ["day 15.tif", "day 5.tif"]
    np.testing.assert_allclose(np.degrees([o.mean for o in found]), (85.0, 60.0), atol=1e-3)
    np.testing.assert_allclose(np.degrees([o.width for o in found]), (15.0, 28.0), atol=1e-3)
    assert [h.name for h in histograms_of_file(path, "day 5.tif")] == ["day 5.tif"]


@pytest.mark.parametrize("header", ["", "angle,count\n"])
def test_two_plain_columns_may_hold_counts(tmp_path: Path, header: str) -> None:
    """Whole numbers in a plain table are counts; the image is named after the file.

    Catches: counts refused because they do not sum to one.
    """
    path = tmp_path / "fibres.csv"
    counts = np.round(1e5 * peak(-20.0, 10.0, 0.1, bins()))
    path.write_text(header + "".join(f"{d},{int(c)}\n" for d, c in zip(bins(), counts, strict=True)))
    found = orientation_of_file(path)
    assert found.name == "fibres"
    np.testing.assert_allclose(np.degrees([found.mean, found.width]), (-20.0, 10.0), atol=1e-2)


GOOD = peak(10.0, 12.0, 0.1, bins())


@pytest.mark.parametrize(
    ("degrees", "shares", "words"),
    [
        (bins(), 0.9 * GOOD, "shares that sum to 0.9, expected 1"),
        (bins(), np.where(np.arange(90) == 3, np.nan, GOOD), "share nan in bin 4, expected a finite number"),
        (bins(), np.where(np.arange(90) == 3, -0.1, GOOD), "share -0.1 in bin 4, expected 0 or more"),
        (np.where(np.arange(90) == 5, np.inf, bins()), GOOD, "direction inf in bin 6"),
        (2.0 * bins(), GOOD, "from -180 to 176 deg, expected half a turn"),
        (np.radians(bins()), GOOD, "are they in radians"),
        (bins()[::-1], GOOD, "do not ascend"),
        (bins() + 0.5 * (np.arange(90) == 7), GOOD, "bins between 1.5 and 2.5 deg wide, expected equal ones"),
        (bins() + 300.0, GOOD, "from 210 to 388 deg, expected them between -180 and 360 deg"),
        (bins()[:5], GOOD[:5], "5 directions and 5 shares, expected at least 6"),
    ],
)  # fmt: skip
def test_what_is_no_histogram_is_refused(degrees: Array, shares: Array, words: str) -> None:
    """Each defect is named with what was found and expected.

    Catches: a wrong table that yields an angle.
    """
    with pytest.raises(DesignError, match=f"h: found .*{words}"):
        Histogram("h", np.radians(degrees), shares)


def test_no_preferred_direction_gives_no_angle() -> None:
    """A flat histogram, and two equal peaks at right angles, are refused; so is a peak as wide as half a turn.

    Catches: the highest of noise taken for the direction of fibres.
    """
    for shares in (np.full(90, 1 / 90), 0.5 * peak(10.0, 12.0, 0.0, bins()) + 0.5 * peak(-80.0, 12.0, 0.0, bins())):
        with pytest.raises(DesignError, match=r"no preferred direction.*no angle is given"):
            orientation(Histogram("h", np.radians(bins()), shares))
    # highest away from the middle of a broad step: the least squares curve is wider than half a turn
    step = np.where(np.abs(bins()) < 60.0, 1.3, 1.0) + 1e-3 * np.abs(bins() / 90.0)
    with pytest.raises(DesignError, match="no angle is given"):
        orientation(Histogram("h", np.radians(bins()), step / step.sum()))


def test_a_peak_that_is_flat_within_half_a_turn_is_refused() -> None:
    """A parabola over the whole half turn, down to zero at its ends, fits a curve with no width of its own.

    Catches: a spread handed on that no design takes.
    """
    shares = 1.0 - 0.9 * (bins() / 90.0) ** 2
    with pytest.raises(DesignError, match=r"flat within half a turn.*no angle is given"):
        orientation(Histogram("h", np.radians(bins()), shares / shares.sum()))


@pytest.mark.parametrize(
    ("text", "error", "words"),
    [
        ("", FileError, "found no table"),
        ("Direction (°),a.tif\n", FileError, "a header alone"),
        ("x,y,z\n1,2,3\n", FileError, r"no column Direction \(°\) among x, y, z"),
        ("1,2,3\n4,5,6\n", FileError, "3 columns without a header, expected two"),
        ("n,Direction (°)\n1,2\n", FileError, "directions alone"),
        ("Direction (°),a,a\n1,2,3\n", FileError, "two columns of the same name"),
        ("Direction (°),a\n1,2\n3\n", FileError, "line 3: found 1 columns, expected 2"),
        ("Direction (°),a\n1,two\n", FileError, "line 2: found 'two', expected a number"),
        ("Direction (°),a\n1,\0\n", FileError, "bytes that are no text"),
    ],
)
def test_what_is_no_table_is_refused(tmp_path: Path, text: str, error: type, words: str) -> None:
    """Each defect of the file is named with its line.

    Catches: a wrong column read in silence.
    """
    path = tmp_path / "table.csv"
    path.write_bytes(text.encode())
    with pytest.raises(error, match=rf"table.csv.*{words}"):
        read_histograms(path)


def test_a_table_that_cannot_be_read_or_is_too_large_is_refused(tmp_path: Path) -> None:
    """No such file, and a file of many megabytes.

    Catches: an operating-system error that reaches the user.
    """
    with pytest.raises(FileError, match=r"none.csv: cannot be read"):
        read_histograms(tmp_path / "none.csv")
    with (tmp_path / "huge.csv").open("wb") as file:
        file.truncate(5_000_001)
    with pytest.raises(FileError, match="found 5000001 bytes"):
        read_histograms(tmp_path / "huge.csv")


def test_one_of_several_images_has_to_be_chosen(tmp_path: Path) -> None:
    """A table of two images names them, and one that it does not have.

    Catches: the first image taken in silence.
    """
    path = plugin_table(tmp_path / "t.csv")
    with pytest.raises(DesignError, match=r"2 images \(day 15.tif, day 5.tif\).*orientation_image"):
        orientation_of_file(path)
    with pytest.raises(DesignError, match=r"no image other, expected one of: day 15.tif, day 5.tif"):
        histograms_of_file(path, "other")
    with pytest.raises(DesignError, match=r"image day 5.tif asked of a picture, expected none"):
        orientation_of_file(tmp_path / "fibres.TIF", image="day 5.tif")

"""Orientation from a file, whichever kind it is: a table of directions, or a picture of fibres."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from fem_biobot.errors import DesignError
from fem_biobot.muscle.orientation import Histogram, Orientation, orientation
from fem_biobot.muscle.orientation_image import image_histogram, read_image
from fem_biobot.muscle.orientation_table import read_histograms

PICTURES = (".png", ".tif", ".tiff")


def histograms_of_file(path: str | Path, image: str = "") -> list[Histogram]:
    """Histograms of a table, or of a picture, which has one.

    Parameters
    ----------
    path
        A picture by its suffix (`PICTURES`), or a table.
    image
        The only histogram wanted of a table with several.

    Raises
    ------
    FileError, DesignError
        As of the readers; no image of that name.
    """
    if Path(path).suffix.lower() in PICTURES:
        if image:
            raise DesignError(f"{Path(path).name}: found image {image} asked of a picture, expected none")
        return [image_histogram(read_image(path), Path(path).name)]
    found = read_histograms(path)
    if not image:
        return found
    chosen = [histogram for histogram in found if histogram.name == image]
    if not chosen:
        raise DesignError(f"{Path(path).name}: found no image {image}, expected one of: {_names(found)}")
    return chosen


def orientation_of_file(path: str | Path, *, image: str = "", axis: float = 0.0) -> Orientation:
    """Orientation of the one histogram of a file, or of the one chosen.

    Parameters
    ----------
    path, image
        As of `histograms_of_file`.
    axis
        Direction of the machine's x axis in the picture [rad]; see `orientation`.

    Raises
    ------
    FileError, DesignError
        As of `histograms_of_file` and `orientation`; several images and none chosen.
    """
    found = histograms_of_file(path, image)
    if len(found) > 1:
        raise DesignError(
            f"{Path(path).name}: found {len(found)} images ({_names(found)}), expected one of them to be chosen "
            "(muscle.orientation_image)"
        )
    return orientation(found[0], axis)


def _names(found: Sequence[Histogram]) -> str:
    return ", ".join(histogram.name for histogram in found)

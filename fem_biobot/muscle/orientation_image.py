"""Histogram of directions of a microscope picture, from the structure tensor of its brightness.

Pillow reads TIFF and PNG, 8 and 16 bits; two Gaussian derivatives and three Gaussian means of scipy make the tensor. A
library of image analysis would add a dependency for these few calls.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, gaussian_filter1d

from fem_biobot.errors import DesignError, FileError
from fem_biobot.muscle.orientation import HALF_TURN, Histogram

Array = NDArray[np.float64]

BINS = 90
# standard deviations of the derivative and of the window over which directions are averaged [pixels]
SCALE, WINDOW = 1.5, 2.0
# a picture smaller than this has no room for the window and the derivative's reach at its borders [pixels]
_LEAST_SIDE = 32
_MOST_PIXELS = 80_000_000
# brightness that varies by less than this share of its range of values is flat
_LEAST_CONTRAST = 1e-6


def read_image(path: str | Path) -> Array:
    """Brightness of a picture, (rows, columns) [1]; colours are averaged, the first page of several is taken.

    Raises
    ------
    FileError
        The file cannot be read as a picture, or has more pixels than fit.
    """
    from PIL import Image, UnidentifiedImageError

    where = Path(path).name
    try:
        with Image.open(path) as image:
            if image.width * image.height > _MOST_PIXELS:
                raise FileError(
                    f"{where}: found {image.width} x {image.height} pixels, expected at most {_MOST_PIXELS:.0e}"
                )
            if image.mode == "P":
                image = image.convert("RGB")
            values = np.asarray(image, dtype=float)
            transparent = image.mode in ("LA", "RGBA", "PA")
    except UnidentifiedImageError:
        raise FileError(f"{where}: found no picture, expected a TIFF or PNG file") from None
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
        # what Pillow raises over files that are cut short or broken
        reason = getattr(error, "strerror", None) or " ".join(str(error).split())
        raise FileError(f"{where}: cannot be read ({reason}), expected a TIFF or PNG file") from None
    if values.ndim == 3:
        values = values[..., : values.shape[2] - (1 if transparent else 0)].mean(axis=2)
    return values


def image_histogram(
    brightness: Array, name: str = "image", *, scale: float = SCALE, window: float = WINDOW, bins: int = BINS
) -> Histogram:
    """Shares of structure by direction of a picture.

    Parameters
    ----------
    brightness
        (rows, columns) [1], row 0 at the top; at least 32 pixels each way.
    name
        For messages.
    scale, window
        Standard deviation of the Gaussian derivative, and of the mean over neighbours [pixels]. The scale should be
        about half of a fibre's width.
    bins
        Number of bins over half a turn.

    Raises
    ------
    DesignError
        Too small, not finite, or without any structure.

    Notes
    -----
    The structure tensor is the windowed mean of the gradient's dyad; its weak axis is the local direction. Each pixel
    counts with the difference of the tensor's eigenvalues: strong, parallel structure much, noise and crossings little.
    The borders, where the filters look beyond the picture, are left out. Crossing fibres within a window are averaged,
    so a spread found in a dense picture is low by what crosses.
    """
    brightness = np.asarray(brightness, dtype=float)
    if brightness.ndim != 2 or min(brightness.shape) < _LEAST_SIDE:
        raise DesignError(
            f"{name}: found a picture of {' x '.join(map(str, brightness.shape))} pixels, expected at least "
            f"{_LEAST_SIDE} x {_LEAST_SIDE}"
        )
    if not np.all(np.isfinite(brightness)):
        raise DesignError(f"{name}: found pixels that are not finite, expected numbers")
    flat = float(np.ptp(brightness)) <= _LEAST_CONTRAST * max(1.0, float(np.abs(brightness).max()))
    if flat:
        raise DesignError(f"{name}: found no structure (one brightness all over), expected fibres; no angle is given")
    right = gaussian_filter1d(gaussian_filter1d(brightness, scale, axis=0), scale, axis=1, order=1)
    up = -gaussian_filter1d(gaussian_filter1d(brightness, scale, axis=1), scale, axis=0, order=1)
    xx, yy, xy = (gaussian_filter(product, window) for product in (right * right, up * up, right * up))
    edge = int(np.ceil(3.0 * (scale + window)))
    inner = np.s_[edge:-edge, edge:-edge] if min(brightness.shape) > 2 * edge + 8 else np.s_[:, :]
    xx, yy, xy = xx[inner], yy[inner], xy[inner]
    weight = np.hypot(xx - yy, 2.0 * xy)
    along = 0.5 * np.arctan2(2.0 * xy, xx - yy) + 0.5 * np.pi
    step = HALF_TURN / bins
    # bins centred on -90, -90 + step, ... degrees
    number = np.mod(np.rint((along + 0.5 * np.pi) / step).astype(np.int64), bins)
    shares = np.bincount(number.ravel(), weight.ravel(), minlength=bins)
    angles = np.asarray(-0.5 * np.pi + step * np.arange(bins), dtype=np.float64)
    return Histogram(name, angles, shares / shares.sum())

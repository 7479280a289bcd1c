"""Fibre directions from a file: a table of points with angles or vectors, or a picture whose numbers are angles.

A table has a header and the columns ``x_mm``, ``y_mm`` and perhaps ``z_mm``, and either ``theta_deg`` (from the lateral
axis, as in a design) or ``a_x``, ``a_y``, ``a_z``. A picture is a TIFF of 32-bit numbers, angles in degrees
counter-clockwise from its right, as programs of image analysis export orientation maps; it covers the muscle's extent
in x (to the right) and y (up), and NaN is where it says nothing.
"""

from __future__ import annotations

import csv
import io
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from fem_biobot.errors import FileError
from fem_biobot.muscle.directions import unit

Array = NDArray[np.float64]

PICTURES = (".tif", ".tiff")
_LARGEST = 50_000_000
_PLACES = ("x_mm", "y_mm", "z_mm")
_VECTOR = ("a_x", "a_y", "a_z")
_ANGLE = "theta_deg"
# tissue may lie from the nearest point by this many of the points' mean distances
_BEYOND = 3.0
# points that count at a position, in a plane and in space
_NEAREST = {2: 8, 3: 14}


def fibres_from_file(path: str | Path, X: Array, box: tuple[Array, Array]) -> Array:
    """Unit directions at positions from a table or a picture.

    Parameters
    ----------
    path
        The file; a picture by its suffix (`PICTURES`).
    X
        Positions, (3, k) [mm].
    box
        Lowest and highest corner of the muscle, (3,) each [mm], which a picture covers.

    Returns
    -------
    Array
        (3, k) [1]; the sense means nothing.

    Raises
    ------
    FileError
        The file cannot be read or is none of these; numbers that are none, angles outside -360 to 360 degrees,
        vectors of no length, points on one line; tissue further from every point than three of their distances.

    Notes
    -----
    Dyads ``a x a`` are interpolated, since the sense of a direction means nothing: by a linear fit to the nearest
    points of a table, which weighs them by nearness and goes through them; between the four nearest pixels of a picture
    that say something, or from the nearest that does. The direction is the dyad's main one.
    """
    path = Path(path)
    if path.suffix.lower() in PICTURES:
        return _main(_from_picture(path, X, box))
    points, directions = _table(path)
    return _main(_from_points(path.name, points, directions, X[: len(points)]))


def _table(path: Path) -> tuple[Array, Array]:
    """Points (2 or 3, n) [mm] and unit directions (3, n) of a table."""
    where = path.name
    rows = [row for row in csv.reader(io.StringIO(_text(path))) if any(cell.strip() for cell in row)]
    if not rows:
        raise FileError(f"{where}: found nothing, expected a table of points and fibre directions")
    header = [cell.strip() for cell in rows[0]]
    places = _PLACES if "z_mm" in header else _PLACES[:2]
    values = _VECTOR if "a_x" in header else (_ANGLE,)
    missing = [name for name in (*places, *values) if name not in header]
    if missing:
        raise FileError(
            f"{where}: found columns {', '.join(header)}, expected {', '.join(_PLACES[:2])}, perhaps z_mm, and "
            f"{_ANGLE} or {', '.join(_VECTOR)} (missing: {', '.join(missing)})"
        )
    columns = {name: header.index(name) for name in (*places, *values)}
    data = np.empty((len(columns), len(rows) - 1))
    for k, row in enumerate(rows[1:]):
        for j, (name, column) in enumerate(columns.items()):
            data[j, k] = _number(f"{where}, line {k + 2}", name, row[column] if column < len(row) else "")
    points, given = data[: len(places)], data[len(places) :]
    if values == (_ANGLE,):
        _check_angles(where, given[0])
        theta = np.radians(given[0])
        return points, np.stack([np.sin(theta), np.cos(theta), np.zeros_like(theta)])
    length = np.linalg.norm(given, axis=0)
    if np.any(length <= 0.0):
        raise FileError(
            f"{where}, line {int(np.argmin(length)) + 2}: found a vector of no length, expected a direction"
        )
    return points, unit(given / length)


def _from_picture(path: Path, X: Array, box: tuple[Array, Array]) -> Array:
    """Dyads at positions, (3, 3, k), between the pixels of a picture of angles."""
    from fem_biobot.muscle.orientation_image import read_image

    where = path.name
    angles = read_image(path)
    if min(angles.shape) < 2:
        raise FileError(f"{where}: found {angles.shape} pixels, expected two rows and two columns or more")
    said = np.isfinite(angles)
    if not said.any():
        raise FileError(f"{where}: found no angle, expected a picture of angles in degrees")
    _check_angles(where, angles[said])
    if np.ptp(angles[said]) > 180.0 + 1e-6:
        raise FileError(
            f"{where}: found numbers from {angles[said].min():.4g} to {angles[said].max():.4g}, expected angles in "
            "degrees within half a turn"
        )
    low, high = box
    shape = np.array(angles.shape)
    share = np.stack([(high[1] - X[1]) / (high[1] - low[1]), (X[0] - low[0]) / (high[0] - low[0])])
    place = np.clip(share * shape[:, None] - 0.5, 0.0, shape[:, None] - 1.0)  # row and column, in pixels
    first = np.minimum(place.astype(np.int64), shape[:, None] - 2)
    rest = place - first
    dyads, total = np.zeros((3, 3, X.shape[1])), np.zeros(X.shape[1])
    for down, right in ((0, 0), (0, 1), (1, 0), (1, 1)):
        row, column = first[0] + down, first[1] + right
        weight = np.abs(1.0 - down - rest[0]) * np.abs(1.0 - right - rest[1]) * said[row, column]
        dyads += weight * _dyad(np.where(said, angles, 0.0)[row, column])
        total += weight
    silent = total <= 0.0
    if silent.any():
        places = np.argwhere(said)
        row, column = places[KDTree(places).query(place[:, silent].T)[1]].T
        dyads[:, :, silent] = _dyad(angles[row, column])
    return dyads


def _dyad(degrees: Array) -> Array:
    angle = np.radians(degrees)
    a = np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)])
    return np.einsum("ie,ke->ike", a, a)


def _from_points(where: str, points: Array, directions: Array, X: Array) -> Array:
    """Dyads at positions, (3, 3, k), between the points of a table."""
    dimension, count = points.shape
    extent = np.ptp(points, axis=1)
    centred = (points - points.mean(axis=1, keepdims=True)) / np.where(extent > 0.0, extent, 1.0)[:, None]
    if count <= dimension or np.linalg.eigvalsh(centred @ centred.T)[0] < 1e-9 * count:
        kind = "line" if dimension == 2 else "plane"
        raise FileError(f"{where}: found {count} points on one {kind}, expected them spread over the muscle")
    spacing = float(np.prod(extent) / count) ** (1.0 / dimension)
    distance, near = KDTree(points.T).query(X.T, k=min(_NEAREST[dimension], count))
    far = int(np.argmax(distance[:, 0]))
    if distance[far, 0] > _BEYOND * spacing:
        at = ", ".join(f"{v:.4g}" for v in X[:, far])
        raise FileError(
            f"{where}: found tissue at ({at}) mm, {distance[far, 0]:.3g} mm from the nearest point, expected points "
            f"all over the muscle (they are {spacing:.3g} mm apart)"
        )
    reach = 1.1 * distance[:, -1:]
    share = distance / reach
    weight = (1.0 - share**2) ** 2 / (share**2 + 1e-12)
    weight /= weight.sum(axis=1, keepdims=True)
    # linear least squares about each position; where the neighbours leave a slope open it stays zero
    arm = (points[:, near] - X[:, :, None]) / reach
    basis = np.concatenate([np.ones((1, *near.shape)), arm])
    normal = np.einsum("akn,bkn,kn->kab", basis, basis, weight)
    normal[:, range(1, dimension + 1), range(1, dimension + 1)] += 1e-9
    dyads = np.einsum("in,jn->ijn", directions, directions)[:, :, near]
    first = np.zeros((len(normal), dimension + 1, 1))
    first[:, 0] = 1.0
    row = np.linalg.solve(normal, first)[:, :, 0]
    return np.einsum("ka,akn,kn,ijkn->ijk", row, basis, weight, dyads)


def _main(dyads: Array) -> Array:
    """Main direction of each mean dyad, (3, k)."""
    if not dyads[2].any():
        # fibres in the plane stay in it to the last bit
        angle = 0.5 * np.arctan2(2.0 * dyads[0, 1], dyads[0, 0] - dyads[1, 1])
        return unit(np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)]))
    # squared again and again, only the largest eigenvalue is left; 2^40 times it, relative to the others
    power = dyads / np.einsum("iie->e", dyads)
    for _ in range(40):
        power = np.einsum("ike,kje->ije", power, power)
        power /= np.einsum("iie->e", power)
    column = np.argmax(np.einsum("iie->ie", power), axis=0)
    return unit(power[:, column, np.arange(power.shape[2])])


def _check_angles(where: str, degrees: Array) -> None:
    if np.any(np.abs(degrees) > 360.0):
        worst = float(degrees[np.argmax(np.abs(degrees))])
        raise FileError(f"{where}: found the angle {worst:g} deg, expected it between -360 and 360 deg")


def _text(path: Path) -> str:
    try:
        if path.stat().st_size > _LARGEST:
            raise FileError(f"{path.name}: found {path.stat().st_size} bytes, expected a table of at most {_LARGEST}")
        return path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise FileError(f"{path}: cannot be read ({error.strerror}), expected a table of fibre directions") from None
    except UnicodeDecodeError:
        raise FileError(f"{path.name}: found bytes that are no text, expected a table of fibre directions") from None


def _number(where: str, name: str, cell: str) -> float:
    try:
        value = float(cell)
    except ValueError:
        value = np.nan
    if not np.isfinite(value):
        raise FileError(f"{where}: found {name} {cell.strip()!r}, expected a finite number")
    return value

"""Reading of histograms of directions: the table that the ImageJ plug-in Directionality exports, and plain two columns.

The plug-in's table has the column ``Direction (°)`` and, for every image, a column with its name and one named
``<image>-fit`` (Tinevez, Directionality 2.x); ImageJ saves it separated by commas or tabs, with or without a first
column of row numbers. A plain file has two columns, direction in degrees and share or count, with or without a header.
"""

from __future__ import annotations

import csv
import io
import math
from pathlib import Path

import numpy as np

from fem_biobot.errors import FileError
from fem_biobot.muscle.orientation import Histogram

_LARGEST = 5_000_000
_FIT = "-fit"


def read_histograms(path: str | Path) -> list[Histogram]:
    """Histograms of a table, one for each image in it.

    Parameters
    ----------
    path
        A text file separated by commas, semicolons or tabs.

    Raises
    ------
    FileError
        The file cannot be read, is no table, or has no column of directions; a cell is not a number.
    DesignError
        A histogram that is none: see `Histogram`.
    """
    where = Path(path).name
    rows = _rows(Path(path))
    header = [cell.strip() for cell in rows[0]] if not _numbers(rows[0]) else []
    body = rows[1:] if header else rows
    if not body:
        raise FileError(f"{where}: found a header alone, expected rows of directions and shares")
    width = len(header or body[0])
    direction, shares = _columns(where, header, width)
    table = np.empty((len(body), width))
    for number, row in enumerate(body, start=2 if header else 1):
        if len(row) != width:
            raise FileError(f"{where}, line {number}: found {len(row)} columns, expected {width}")
        for column, cell in enumerate(row):
            wanted = column == direction or column in shares
            table[number - (2 if header else 1), column] = _number(where, number, cell) if wanted else math.nan
    angles = np.radians(table[:, direction])
    found = []
    for column, name in shares.items():
        values = table[:, column]
        # only a plain table may hold counts; the plug-in's shares sum to one
        counts = not header or not header[direction].lower().startswith("direction")
        if counts and np.all(np.isfinite(values)) and np.all(values == np.round(values)) and values.sum() > 1.5:
            values = values / values.sum()
        found.append(Histogram(name, angles, values))
    return found


def _rows(path: Path) -> list[list[str]]:
    where = path.name
    try:
        if path.stat().st_size > _LARGEST:
            raise FileError(f"{where}: found {path.stat().st_size} bytes, expected a table of at most {_LARGEST}")
        data = path.read_bytes()
    except OSError as error:
        raise FileError(f"{path}: cannot be read ({error.strerror}), expected a table of directions") from None
    if b"\0" in data:
        raise FileError(f"{where}: found bytes that are no text, expected a table of directions")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        # ImageJ writes in the encoding of its machine; only the degree sign differs
        text = data.decode("latin-1")
    separator = max("\t;,", key=text.split("\n", 1)[0].count)
    rows = [row for row in csv.reader(io.StringIO(text), delimiter=separator) if any(cell.strip() for cell in row)]
    if not rows or len(rows[0]) < 2:
        raise FileError(f"{where}: found no table, expected columns of directions [deg] and shares")
    return rows


def _columns(where: str, header: list[str], width: int) -> tuple[int, dict[int, str]]:
    """Which column holds the directions, and which the shares, by the name of their image."""
    stem = Path(where).stem
    if not header:
        if width != 2:
            raise FileError(f"{where}: found {width} columns without a header, expected two: direction [deg] and share")
        return 0, {1: stem}
    direction = next((k for k, name in enumerate(header) if name.lower().startswith("direction")), None)
    if direction is None:
        if width != 2:
            raise FileError(
                f"{where}: found no column Direction (°) among {', '.join(header)}, expected the plug-in's table or "
                "two columns"
            )
        return 0, {1: stem}
    # the column before the directions is ImageJ's row number
    named = {k: name for k, name in enumerate(header) if k > direction and name}
    names = set(named.values())
    shares = {
        k: name
        for k, name in named.items()
        if not (name.endswith(_FIT) and name.removesuffix(_FIT) in names)
    }  # fmt: skip
    if not shares:
        raise FileError(f"{where}: found directions alone, expected a column of shares for each image")
    if len(set(shares.values())) < len(shares):
        raise FileError(f"{where}: found two columns of the same name, expected one for each image")
    return direction, shares


def _numbers(row: list[str]) -> bool:
    try:
        [float(cell) for cell in row]
    except ValueError:
        return False
    return True


def _number(where: str, line: int, cell: str) -> float:
    try:
        return float(cell)
    except ValueError:
        raise FileError(f"{where}, line {line}: found {cell.strip()!r}, expected a number") from None

"""A person's own measurements of a machine's deflection, from a CSV file with units in its header.

A column is named by a quantity and its unit, ``closing [mm]`` or ``closing_mm``: ``drive`` (share of the active
tension) or ``time`` (which the design's waveform turns into a drive), one of ``closing``, ``sagitta`` and ``stroke``
(closing beyond that at no drive), and perhaps ``deviation``, one standard deviation of it, and ``force``, that through
the muscle by a gauge of its own, with ``forcedeviation``. Decimal points; commas, semicolons or tabs between columns.
"""

from __future__ import annotations

import csv
import io
import math
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fem_biobot.design import Design
from fem_biobot.errors import DesignError, FileError
from fem_biobot.link.observed import Array
from fem_biobot.muscle.waveforms import drive_function
from fem_biobot.units import parse_quantity

QUANTITIES = ("closing", "sagitta", "stroke")
_UNITS = {
    "drive": "1",
    "time": "s",
    "deviation": "mm",
    "force": "mN",
    "forcedeviation": "mN",
    **dict.fromkeys(QUANTITIES, "mm"),
}
_NAME = re.compile(r"\s*([a-z]+)\s*(?:\[(.*)\]|\((.*)\)|_(.+))?\s*")
_LARGEST = 5_000_000
_EXPECTED = (
    "drive [1] or time [s], one of closing [mm], sagitta [mm] and stroke [mm], perhaps deviation [mm], force [mN], "
    "forcedeviation [mN]"
)


@dataclass(frozen=True)
class Measured:
    """Deflections of a machine at drives.

    Attributes
    ----------
    drive
        Share of the active tension, (r,) [1].
    quantity
        ``closing``, ``sagitta`` or ``stroke``.
    value
        (r,) [mm]
    deviation
        One standard deviation of each, (r,) [mm]; None where none was given.
    force, force_deviation
        Of the muscle, (r,) [mN]; None where none was given.
    """

    drive: Array
    quantity: str
    value: Array
    deviation: Array | None = None
    force: Array | None = None
    force_deviation: Array | None = None


def read_measured(path: str | Path, design: Design) -> Measured:
    """Measurements of a file.

    Raises
    ------
    FileError
        The file cannot be read, lacks a column or has one that is not known; a cell that is no finite number; a
        deviation that is not positive, a drive below 0.
    """
    where, rows = Path(path).name, _rows(Path(path))
    columns: dict[str, tuple[int, str]] = {}
    for number, cell in enumerate(rows[0]):
        match = _NAME.fullmatch(cell.lower() if "[" not in cell and "(" not in cell else cell)
        name = match[1] if match else ""
        if match is None or name not in _UNITS:
            raise FileError(f"{where}: found a column {cell.strip()!r}, expected {_EXPECTED}")
        if name in columns:
            raise FileError(f"{where}: found two columns of {name}, expected one")
        unit = next((u for u in match.groups()[1:] if u is not None), "")
        columns[name] = (number, "" if unit == "1" else unit.strip())
        _number(where, 1, f"column {name}", "1", columns[name][1], _UNITS[name])
    told = [name for name in QUANTITIES if name in columns]
    at = [name for name in ("drive", "time") if name in columns]
    if len(told) != 1 or len(at) != 1:
        raise FileError(f"{where}: found columns {', '.join(columns)}, expected {_EXPECTED}")
    table: dict[str, list[float]] = {name: [] for name in columns}
    for line, row in enumerate(rows[1:], start=2):
        if len(row) != len(rows[0]):
            raise FileError(f"{where}, line {line}: found {len(row)} columns, expected {len(rows[0])}")
        for name, (number, unit) in columns.items():
            table[name].append(_number(where, line, name, row[number], unit, _UNITS[name]))
    values = {name: np.array(column) for name, column in table.items()}
    if not len(rows) > 1:
        raise FileError(f"{where}: found a header alone, expected rows of measurements")
    deviations = {"deviation", "forcedeviation"} & set(values)
    if (deviations and len(deviations) != 1 + ("force" in values)) or deviations == {"forcedeviation"}:
        both = f"a deviation of {told[0]}, with force one of force too, and none else"
        raise FileError(f"{where}: found columns {', '.join(columns)}, expected {both}")
    drive = values["drive"] if "drive" in values else _drives(design, values["time"])
    for name, bad, expected in (
        ("deviation", values.get("deviation", np.ones(1)) <= 0.0, "above 0 mm"),
        ("forcedeviation", values.get("forcedeviation", np.ones(1)) <= 0.0, "above 0 mN"),
        ("drive", drive < 0.0, "of at least 0"),
    ):
        if bad.any():
            raise FileError(
                f"{where}, line {int(bad.argmax()) + 2}: found a {name} that is none, expected one {expected}"
            )
    pairs = values.get("deviation"), values.get("force"), values.get("forcedeviation")
    return Measured(drive, told[0], values[told[0]], *pairs)


def _drives(design: Design, times: Array) -> Array:
    waveform = drive_function(design.drive)
    return np.array([float(waveform(float(t))) for t in times])


def _rows(path: Path) -> list[list[str]]:
    try:
        if path.stat().st_size > _LARGEST:
            raise FileError(f"{path.name}: found {path.stat().st_size} bytes, expected a table of at most {_LARGEST}")
        text = path.read_bytes().decode("utf-8-sig")
    except OSError as error:
        raise FileError(f"{path}: cannot be read ({error.strerror}), expected a table of measurements") from None
    except UnicodeDecodeError:
        raise FileError(f"{path.name}: found bytes that are no text, expected a table of measurements") from None
    separator = max(",;\t", key=text.split("\n", 1)[0].count)
    rows = [row for row in csv.reader(io.StringIO(text), delimiter=separator) if any(cell.strip() for cell in row)]
    if not rows:
        raise FileError(f"{path.name}: found nothing, expected {_EXPECTED}")
    return rows


def _number(where: str, line: int, name: str, cell: str, unit: str, coherent: str) -> float:
    try:
        found = parse_quantity(f"{cell.strip()} {unit}".strip(), coherent, name)
    except DesignError as error:
        raise FileError(f"{where}, line {line}, {error}") from None
    assert math.isfinite(found)
    return found

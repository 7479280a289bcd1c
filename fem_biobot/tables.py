"""Small tables as data and as aligned text; a terminal may draw the same data more handsomely.

Imports nothing of the package, and nothing that is slow to import.
"""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass

GAP = "  "


@dataclass(frozen=True)
class Table:
    """Rows of text or numbers under a title; numbers stand right-aligned, None is a dash."""

    title: str
    header: tuple[str, ...]
    rows: tuple[tuple[object, ...], ...]

    def cells(self) -> list[list[str]]:
        """Texts of all rows, each as long as the header."""
        return [[cell(value) for value in row] for row in self.rows]

    def numeric(self) -> list[bool]:
        """Which columns hold numbers only."""
        columns = list(zip(*self.rows, strict=True)) if self.rows else [()] * len(self.header)
        return [
            any(value is not None for value in column) and all(value is None or is_number(value) for value in column)
            for column in columns
        ]


def is_number(value: object) -> bool:
    """Whether a value is shown as a number."""
    return isinstance(value, int | float) and not isinstance(value, bool)


def cell(value: object) -> str:
    """Text of a value: four significant digits, whole numbers whole, a dash for nothing."""
    if value is None:
        return "-"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.4g}"
    return str(value)


def plain(table: Table, width: int = 0) -> str:
    """The table as aligned text without a trailing blank.

    Parameters
    ----------
    table
        What to write.
    width
        Longest line; the last column is wrapped to keep it. 0 for no limit.
    """
    body = [list(table.header), *table.cells()] if any(table.header) else table.cells()
    right = table.numeric()
    widths = [max(len(row[i]) for row in body) for i in range(len(table.header))] if body else []
    before = sum(w + len(GAP) for w in widths[:-1])
    last = width - before if width and width - before >= 20 else 0
    lines = [table.title] if table.title else []
    for row in body:
        texts = [_aligned(text, w, r) for text, w, r in zip(row, widths, right, strict=True)]
        pieces = textwrap.wrap(row[-1], last, break_on_hyphens=False) if last else []
        if len(pieces) > 1:
            texts[-1] = pieces[0]
        lines.append((GAP + GAP.join(texts)).rstrip() if table.title else GAP.join(texts).rstrip())
        indent = " " * (before + (len(GAP) if table.title else 0))
        lines += [indent + piece for piece in pieces[1:]]
    return "\n".join(lines)


def stacked(tables: Sequence[Table], width: int = 0) -> str:
    """Several tables with a blank line between them."""
    return "\n\n".join(plain(table, width) for table in tables)


def _aligned(text: str, width: int, right: bool) -> str:
    return text.rjust(width) if right else text.ljust(width)

"""The one-page report of a run: HTML with everything inside, fit to be mailed or printed.

A page without interactive views has no scripts.
"""

from __future__ import annotations

import base64
import html
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from fem_biobot.errors import FileError
from fem_biobot.files import file_error, write_text
from fem_biobot.view import interactive
from fem_biobot.view.interactive import Moving, Piece

Table = tuple[str, Sequence[str], Sequence[Sequence[object]]]

_TYPES = {
    ".gif": "image/gif", ".png": "image/png", ".jpg": "image/jpeg", ".jpeg": "image/jpeg", ".svg": "image/svg+xml",
}  # fmt: skip
_UNITS = {
    "mm": "mm", "mN": "mN", "kPa": "kPa", "uJ": "µJ", "s": "s", "1": "", "Hz": "Hz", "rad": "rad", "deg": "°",
    "mm2": "mm²", "mm3": "mm³", "mm4": "mm⁴",
}  # fmt: skip
# columns above which a table is printed smaller, and smaller still
_MANY, _MOST = 8, 13
_STYLE = """
body { font: 15px/1.5 system-ui, "Segoe UI", "DejaVu Sans", sans-serif; color: #1f2429; background: #fff;
  max-width: 60rem; margin: 2rem auto; padding: 0 1.2rem; }
h1 { font-size: 1.6rem; margin: 0 0 .2rem; } h2 { font-size: 1.15rem; margin: 2.2rem 0 .6rem; }
.digest { color: #667079; margin: 0 0 1.4rem; font-family: ui-monospace, "DejaVu Sans Mono", monospace; }
.notes { border-left: 4px solid #e69f00; background: #fdf6e7; padding: .6rem 1rem; margin: 1rem 0; }
.notes p { margin: .25rem 0; }
figure { margin: 1.4rem 0; } img { max-width: 100%; height: auto; border: 1px solid #e3e7ea; }
figcaption { color: #4a535b; font-size: .92rem; }
.wide { overflow-x: auto; } table { border-collapse: collapse; font-size: .92rem; }
th, td { padding: .28rem .8rem .28rem 0; border-bottom: 1px solid #e3e7ea; text-align: left; vertical-align: top; }
th { border-bottom: 2px solid #b9c0c6; font-weight: 600; }
.number { text-align: right; font-variant-numeric: tabular-nums; } td.number { white-space: nowrap; }
footer { margin-top: 3rem; border-top: 1px solid #b9c0c6; color: #667079; font-size: .85rem; }
@page { margin: 15mm 14mm; }
@media print { body { margin: 0; padding: 0; max-width: none; font-size: 11px; } figure, tr { break-inside: avoid; }
  h2, thead { break-after: avoid; } thead { display: table-header-group; } .wide { overflow: visible; }
  img { max-height: 16cm; } th, td { padding-right: .5rem; overflow-wrap: break-word; } p { orphans: 3; widows: 3; }
  h1 { font-size: 20px; } h2 { font-size: 14px; margin-top: 1.4rem; } figcaption { font-size: 10px; }
  table { font-size: 10px; } table.many { font-size: 8px; } table.many th, table.many td { padding-right: .3rem; }
  table.most { font-size: 6.5px; } table.most th, table.most td { padding-right: .2rem; } }
""".strip()


def write_report(
    path: str | os.PathLike[str],
    summary: Mapping[str, Any],
    figures: Sequence[tuple[str | os.PathLike[str], str]],
    tables: Sequence[Table],
    notes: Sequence[str],
    *,
    views: Sequence[Moving | Piece] = (),
    appendix: Sequence[Table] = (),
    title: str = "Report of a run",
) -> None:
    """Write the report.

    Parameters
    ----------
    path
        The `.html` file; whole or not at all.
    summary
        The run's summary; ``mesh`` and ``timings_s`` become tables, ``design_digest`` and ``versions`` the provenance.
        Each may be missing.
    figures
        Image file and caption, in order; the images go into the page.
    tables
        Title, header and rows, in order. Numbers stand right-aligned with four digits, None as a dash; a header that is
        a key with a unit (``tip_closing_mm``) is spelt out (``tip closing [mm]``).
    notes
        What the reader must know first, such as what was used instead of what.
    views
        Interactive views, before the tables.
    appendix
        Tables after the figures.

    Raises
    ------
    FileError
        An image is missing or of no known kind, a row does not fit its header, a view's arrays do not fit, or the file
        cannot be written.
    """
    parts = [f"<h1>{_text(title)}</h1>"]
    if summary.get("design_digest"):
        parts.append(f'<p class="digest">design {_text(summary["design_digest"])}</p>')
    if notes:
        parts.append('<div class="notes">' + "".join(f"<p>{_text(note)}</p>" for note in notes) + "</div>")
    parts += [interactive.figure(view) for view in views]
    parts += [_table(path, *table) for table in tables]
    parts += [_figure(Path(file), caption) for file, caption in figures]
    for key, name in (("mesh", "Mesh"), ("timings_s", "Timings [s]")):
        rows = _flat(summary.get(key))
        if rows:
            parts.append(_table(path, name, ("quantity", "value"), rows))
    parts += [_table(path, *table) for table in appendix]
    parts.append(_footer(summary))
    if views:
        parts.append(f"<script>{interactive.script()}</script>")
    page = "\n".join(
        [
            "<!DOCTYPE html>",
            '<html lang="en">',
            '<head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">',
            f"<title>{_text(title)}</title>",
            f"<style>{_STYLE}{interactive.style() if views else ''}</style></head>",
            "<body>",
            *parts,
            "</body>",
            "</html>",
            "",
        ]
    )
    write_text(path, page)


def views_of(path: str | os.PathLike[str]) -> list[Piece]:
    """The interactive views of a report that was written before, for another page.

    Raises
    ------
    FileError
        It cannot be read.
    """
    try:
        return interactive.pieces_of(Path(path).read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        if isinstance(error, OSError):
            raise file_error(error, path, doing="read") from None
        raise FileError(f"{path}: found no text, expected a report") from None


def heading(key: str) -> str:
    """A key with its unit at the end as words: ``tip_closing_mm`` becomes ``tip closing [mm]``; other text stays."""
    if " " in key or "_" not in key:
        return key
    words, _, unit = key.rpartition("_")
    if unit not in _UNITS:
        return key.replace("_", " ")
    return words.replace("_", " ") + (f" [{_UNITS[unit]}]" if _UNITS[unit] else "")


def _text(value: object) -> str:
    return html.escape(str(value), quote=True)


def _cell(value: object) -> str:
    """A table cell: numbers right-aligned, a dash for nothing."""
    if value is None:
        return '<td class="number">–</td>'
    if isinstance(value, bool):
        return f"<td>{'yes' if value else 'no'}</td>"
    if isinstance(value, int):
        return f'<td class="number">{value}</td>'
    try:
        number = float(value) if hasattr(value, "__float__") else None  # pyright: ignore[reportArgumentType]
    except (TypeError, ValueError):
        number = None
    if number is None:
        return f"<td>{_text(value)}</td>"
    return f'<td class="number">{number:.4g}</td>'.replace("-", "−")


def _table(path: str | os.PathLike[str], title: str, header: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    for row in rows:
        if len(row) != len(header):
            raise FileError(f"{path}: table {title!r}: a row has {len(row)} cells, expected {len(header)}")
    numeric = [bool(rows) and all('class="number"' in _cell(row[i]) for row in rows) for i in range(len(header))]
    head = "".join(
        f'<th class="number">{_text(heading(name))}</th>' if right else f"<th>{_text(heading(name))}</th>"
        for name, right in zip(header, numeric, strict=True)
    )
    size = ' class="most"' if len(header) > _MOST else ' class="many"' if len(header) > _MANY else ""
    body = "\n".join("<tr>" + "".join(_cell(value) for value in row) + "</tr>" for row in rows)
    return (
        f'<h2>{_text(title)}</h2>\n<div class="wide"><table{size}>\n<thead><tr>{head}</tr></thead>\n'
        f"<tbody>\n{body}\n</tbody>\n</table></div>"
    )


def _figure(file: Path, caption: str) -> str:
    kind = _TYPES.get(file.suffix.lower())
    if kind is None:
        raise FileError(f"{file}: not an image that a report can hold, expected {', '.join(_TYPES)}")
    try:
        data = base64.b64encode(file.read_bytes()).decode("ascii")
    except OSError as error:
        raise file_error(error, file, doing="read") from error
    return (
        f'<figure><img src="data:{kind};base64,{data}" alt="{_text(caption)}">'
        f"<figcaption>{_text(caption)}</figcaption></figure>"
    )


def _flat(value: object, path: tuple[str, ...] = ()) -> list[tuple[str, object]]:
    """Leaves of nested mappings, named by their path; a list is one cell."""
    if isinstance(value, Mapping):
        return [leaf for key, inner in value.items() for leaf in _flat(inner, (*path, str(key)))]
    if value is None:
        return []
    if isinstance(value, (list, tuple)):
        value = ", ".join(str(item) for item in value)
    return [(", ".join(heading(key) for key in path), value)]


def _footer(summary: Mapping[str, Any]) -> str:
    """What made the page: the design's digest and the versions of the programs."""
    versions = summary.get("versions") or {}
    listed = ", ".join(f"{_text(name)} {_text(version)}" for name, version in versions.items())
    digest = _text(summary.get("design_digest") or "not stated")
    made = f"<p>Versions: {listed}.</p>" if listed else ""
    return f"<footer><p>Design digest: {digest}.</p>{made}</footer>"

"""Where a result comes from: the design key by key with its sources, and how the program stands to known answers.

The verification itself is a command of its own; what it found last, and by which code, travels with the package.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

from fem_biobot.config import PRESETS, load_design, presets, to_toml
from fem_biobot.design import Design, keys
from fem_biobot.tables import Table

STATUS = Path(__file__).with_name("verified.json")
# what is computed with; pictures, commands and studies change no number of a case
_COMPUTING = ("friction", "link", "material", "mesh", "muscle", "rod", "solid")
_COMPUTING_ALONE = ("ensembles.py", "equations.py", "strokes.py")
_VERDICTS = {"passed": "pass", "failed": "fail", "shown": "shown"}
_LINE = re.compile(r"(\w+)\s*=\s*(\"[^\"]*\"|[^#\"]+?)\s*(?:#\s*(.*))?$")


def design_table(design: Design) -> Table:
    """Every key of a design with its value and where that comes from.

    A source is the preset's own remark, where the design has the preset's name and value; else whether the value is the
    key's default or was given.
    """
    known = load_design(design.name) if design.name in presets() else None
    remarks = _remarks(design.name) if known is not None else {}
    rows: list[tuple[object, ...]] = []
    for name, text in _values(to_toml(design)).items():
        if name in ("name", "description"):
            continue
        value = design.value(name)
        if known is not None and name in remarks and known.value(name) == value:
            source = remarks[name] or "preset"
        elif keys()[name].field.default == value:
            source = "default of the program"
        else:
            source = "given" if known is None else "given, not the preset's"
        rows.append((name, text, source))
    return Table("Design, every key with its source", ("key", "value", "source"), tuple(rows))


def verification_table() -> Table:
    """What `fem-biobot verify` found last, case by case, and whether by the code that runs now."""
    status = json.loads(STATUS.read_text(encoding="utf-8"))
    rows = tuple((c["case"], c["title"], c["passed"], c["failed"], c["shown"]) for c in status["cases"])
    passed, failed = (sum(case[key] for case in status["cases"]) for key in ("passed", "failed"))
    by = "this very code" if status["code"] == code_digest() else "earlier code, computing parts have changed since"
    return Table(
        f"Verification: {passed} known answers met, {failed} not, by {by}",
        ("case", "what", "rows that pass", "rows that fail", "rows shown only"),
        rows,
    )


def appendix(design: Design) -> list[tuple[str, Sequence[str], Sequence[Sequence[object]]]]:
    """What ends every report: the design with its sources, and the status of the verification."""
    return [(t.title, t.header, t.rows) for t in (design_table(design), verification_table())]


@cache
def code_digest() -> str:
    """Sixteen hexadecimal characters that name the source of everything that computes."""
    found = hashlib.sha256()
    package = Path(__file__).parent.parent
    files = [file for folder in _COMPUTING for file in sorted((package / folder).rglob("*.py"))]
    for file in [*files, *(package / name for name in _COMPUTING_ALONE)]:
        found.update(file.relative_to(package).as_posix().encode() + b"\0")
        found.update(file.read_bytes().replace(b"\r\n", b"\n") + b"\0")
    return found.hexdigest()[:16]


def status_of(cases: list[Mapping[str, Any]], versions: Mapping[str, str]) -> dict[str, Any]:
    """What is kept of a verification: counts by case, the code and the packages; see `verified.json`."""
    verdicts = [(case, [row["verdict"] for row in case["rows"]]) for case in cases]
    return {
        "code": code_digest(),
        "versions": dict(versions),
        "cases": [
            {
                "case": case["case"],
                "title": case["title"],
                **{word: found.count(verdict) for word, verdict in _VERDICTS.items()},
            }
            for case, found in verdicts
        ],
    }


def _remarks(preset: str) -> dict[str, str]:
    """Remarks behind the values of a preset's file, by full key."""
    return {name: remark for name, (_, remark) in _parsed((PRESETS / f"{preset}.toml").read_text("utf-8")).items()}


def _values(text: str) -> dict[str, str]:
    """Values of a design file's keys as they are written, without quotation marks."""
    return {name: value.strip('"') for name, (value, _) in _parsed(text).items()}


def _parsed(text: str) -> dict[str, tuple[str, str]]:
    """Value and remark of every line ``key = value  # remark`` by full key."""
    section, found = "", {}
    for line in text.splitlines():
        if line.startswith("["):
            section = line.strip("[] ") + "."
        elif match := _LINE.match(line):
            name, value, remark = match.groups()
            found[section + name] = (value.strip(), remark or "")
    return found

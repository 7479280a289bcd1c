"""Files that a design names: where they lie, whether they can be read, what stands for them in a digest."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from fem_biobot.design import Design
from fem_biobot.design_kinds import FILE_KEYS
from fem_biobot.errors import FileError
from fem_biobot.units import one_line

Table = dict[str, Any]


def named_files(design: Design) -> dict[str, Path]:
    """Files that a design names, by key."""
    found = {name: design.value(name) for name in FILE_KEYS}
    return {name: Path(text) for name, text in found.items() if text is not None and text not in FILE_KEYS[name]}


def content_of(path: Path) -> str:
    """What stands for a file in a digest.

    Raises
    ------
    FileError
        It cannot be read.
    """
    try:
        return "sha256 " + hashlib.sha256(path.read_bytes()).hexdigest()
    except (OSError, ValueError) as error:  # the latter of a name that no file can have
        why = getattr(error, "strerror", None) or error
        raise FileError(f"{one_line(str(path))}: cannot be read ({why}), expected a file") from None


def named_in(table: Table) -> dict[str, tuple[Table, str]]:
    """Files that a table names, by key: the section that names them, and what it says."""
    found: dict[str, tuple[Table, str]] = {}
    for key, words in FILE_KEYS.items():
        *sections, name = key.split(".")
        inside: object = table
        for section in sections:
            inside = inside.get(section) if isinstance(inside, dict) else None
        text = inside.get(name) if isinstance(inside, dict) else None
        if isinstance(inside, dict) and isinstance(text, str) and text and text not in words:
            found[key] = (inside, text)
    return found


def must_be_readable(named: Mapping[str, Path]) -> None:
    """Files that keys name are there; the line says which words a key takes instead."""
    for key, path in named.items():
        try:
            content_of(path)
        except FileError as error:
            words = [word for word in FILE_KEYS[key] if word]
            choice = f" or one of: {', '.join(words)}" if words else ""
            raise FileError(f"{key}: {error}{choice}") from None


def place_files(table: Table, folder: Path) -> None:
    """Names of files in a table made absolute, in place; they are beside the file that names them."""
    for key, (inside, text) in named_in(table).items():
        inside[key.rpartition(".")[2]] = str((folder / text).absolute())

"""Design files: the one reader and the one writer of TOML, the digests that name results, the schema for editors."""

from __future__ import annotations

import copy
import difflib
import hashlib
import json
import math
import re
import tomllib
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from fem_biobot.design import Design, Key, first_key, keys, section_type, sections, unknown_key
from fem_biobot.design_checks import unused_keys
from fem_biobot.design_files import content_of, must_be_readable, named_files, named_in, place_files
from fem_biobot.design_kinds import FILE_KEYS, OptionalText
from fem_biobot.design_tissue import without_following
from fem_biobot.errors import DesignError, FileError
from fem_biobot.units import DIMENSIONS, format_quantity, one_line, parse_quantity, shown

PRESETS = Path(__file__).parent / "presets"
_ORDER = ("junction_bot", "ring_bot", "elastica_walker", "strip", "cantilever")
_LARGEST_FILE = 1_000_000
# what muscle.orientation gives
_MEASURED = ("theta", "spread")
_NUMBER_PATTERN = r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?"

Table = dict[str, Any]


@cache
def presets() -> Mapping[str, str]:
    """Names of the designs that come with the package, each with a line about it."""
    return {name: str(read_table(PRESETS / f"{name}.toml")["description"]) for name in _preset_names()}


@cache
def _preset_names() -> tuple[str, ...]:
    found = {path.stem for path in PRESETS.glob("*.toml")}
    return (*(name for name in _ORDER if name in found), *sorted(found.difference(_ORDER)))


def load_design(name_or_path: str | Path, overrides: Sequence[str] = ()) -> Design:
    """Design of a preset or of a TOML file.

    Parameters
    ----------
    name_or_path
        Name of a preset, or path of a file. A file may start from another design with ``base = "junction_bot"`` (a
        preset, or a path beside the file) and give only the keys that differ.
    overrides
        Texts such as ``muscle.theta=80 deg``, applied last, in order. Files in them are looked for in the current
        folder, files that a design file names beside it.

    Raises
    ------
    FileError
        No such preset or file, or it cannot be read; the same for files that it names.
    DesignError
        Not TOML, or not a design; one line with the key or the line, what was found and what was expected.
    """
    path = _design_path(name_or_path, Path())
    table = _resolved_table(path, ())
    table.setdefault("name", path.stem)
    if any(override.strip().startswith("muscle.tissue.") for override in overrides):
        _make_room_for_tissue(table)
    for override in overrides:
        _apply(table, override)
    named = {key: Path(text) for key, (_, text) in named_in(table).items()}
    try:
        design = Design.model_validate(_with_orientation(_values(table, "")))
    except (FileError, ValueError) as error:  # of a measurement that is read for its angles, or that no file can be
        if not isinstance(error, DesignError):
            must_be_readable(named)
        raise
    must_be_readable(named)
    return design


def to_toml(design: Design) -> str:
    """Text of a design file that reads back as the identical design, every key of this kind of machine in it."""
    unused = unused_keys(design)
    lines: list[str] = []
    section = ""
    for name, key in keys().items():
        value = design.value(name)
        if value is None or name in unused:
            continue
        inside, _, last = name.rpartition(".")
        if inside != section:
            section = inside
            lines += ["", f"[{section}]"]
        lines.append(f"{last} = {_toml_value(value, key)}")
    return "\n".join(lines).lstrip("\n") + "\n"


def digest(design: Design) -> str:
    """Sixteen hexadecimal characters that name what a design computes; blind to its name, units and key order.

    Of a file that the design names, its content counts and not where it lies.
    """
    return _digest(design, [name for name in keys() if name not in ("name", "description")])


def geometry_digest(design: Design) -> str:
    """As `digest`, over what the mesh's shape depends on only: kind and lengths, not the mesh size."""
    shape = ("kind", "skeleton.pillar_count", "muscle.layout")
    lengths = [
        name
        for name, key in keys().items()
        if name.startswith(("skeleton.", "muscle."))
        # the lengths that follow from the tissue are there, and a picture's edges shape nothing
        and not name.startswith(("muscle.tissue.", "muscle.activation."))
        and key.quantity is not None
        and key.quantity.unit == "mm"
    ]
    chosen = [*shape, *lengths]
    return _digest(design, chosen)


def json_schema() -> dict[str, Any]:
    """JSON schema (draft 7) of a design file, for completion and checks in editors; `presets/` holds a copy."""
    schema = _section_schema(Design, "")
    schema["properties"] = {
        "base": {"type": "string", "description": "Preset or file to start from; give only the keys that differ"},
        **schema["properties"],
    }
    return {
        "$schema": "http://json-schema.org/draft-07/schema#",
        "title": "Design of a muscle-driven hydrogel machine",
        **schema,
        "anyOf": [{"required": ["kind"]}, {"required": ["base"]}],
    }


def _section_schema(record: type[BaseModel], prefix: str) -> dict[str, Any]:
    properties: dict[str, Any] = {}
    for name, field in record.model_fields.items():
        inner = section_type(field)
        found = _key_schema(keys()[prefix + name]) if inner is None else _section_schema(inner, f"{prefix}{name}.")
        properties[name] = {"description": field.description, **found}
    return {"type": "object", "additionalProperties": False, "properties": properties}


def _key_schema(key: Key) -> dict[str, Any]:
    default = key.field.default
    if key.quantity is None:
        kind = {"enum": list(key.choices)} if key.choices else {"type": "integer"}
        schema = {"type": "string"} if key.field.annotation in (str, OptionalText) else kind
        if key.field.annotation == OptionalText:
            return schema
        return schema if key.field.is_required() else {**schema, "default": default}
    unit = key.quantity.unit
    if unit == "1":
        limits = {"minimum": key.quantity.low, "maximum": key.quantity.high}
        number = {"type": "number", **{name: limit for name, limit in limits.items() if math.isfinite(limit)}}
        percent = {"type": "string", "pattern": rf"^\s*{_NUMBER_PATTERN}\s*(%|percent)?\s*$"}
        schema = {"anyOf": [number, percent]}
        return schema if key.field.is_required() else {**schema, "default": default}
    # the unit itself is left to the program, which knows every one; the editor sees that there is one
    pattern = rf"^\s*{_NUMBER_PATTERN}\s*(1\s*/\s*)?[^0-9\s.,+/-].*$"
    schema = {"type": "string", "pattern": pattern, "examples": [DIMENSIONS[unit].example]}
    if default is None or key.field.is_required():
        return schema
    return {**schema, "default": format_quantity(default, unit)}


def _digest(design: Design, names: Sequence[str]) -> str:
    unused = unused_keys(design)
    content = {name: design.value(name) for name in names if name not in unused}
    # -0.0 and 0.0 are the same design
    content = {k: v + 0.0 if isinstance(v, float) else v for k, v in content.items() if v is not None}
    content |= {name: content_of(path) for name, path in named_files(design).items() if name in content}
    text = json.dumps(content, sort_keys=True, allow_nan=False, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _design_path(name_or_path: str | Path, folder: Path) -> Path:
    text = str(name_or_path)
    if text in _preset_names():
        return PRESETS / f"{text}.toml"
    path = folder / text
    names = ", ".join(_preset_names())
    quoted = one_line(text)
    try:
        if path.is_file():
            return path
        found = "a folder" if path.is_dir() else "no regular file" if path.exists() else ""
    except OSError as error:
        raise FileError(
            f"{quoted}: cannot be read ({error.strerror}), expected a TOML file or one of: {names}"
        ) from None
    if found:
        raise FileError(f"{quoted}: found {found}, expected a TOML file or one of: {names}")
    near = difflib.get_close_matches(text, _preset_names(), 1, 0.6)
    hint = f"; did you mean {near[0]}?" if near else ""
    raise FileError(f"{quoted}: no such file or preset, expected a TOML file or one of: {names}{hint}")


def read_table(path: Path) -> Table:
    """Content of a TOML file as it stands; the one reader, also of files that are no designs.

    Raises
    ------
    FileError
        It cannot be read, or is far too large.
    DesignError
        Not TOML; one line with the line.
    """
    where = one_line(str(path))
    try:
        size = path.stat().st_size
        if size > _LARGEST_FILE:
            raise FileError(f"{where}: found {size} bytes, expected a design file of at most {_LARGEST_FILE}")
        text = path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise FileError(f"{where}: cannot be read ({error.strerror}), expected a TOML file") from None
    except UnicodeDecodeError:
        raise FileError(f"{where}: found bytes that are not UTF-8 text, expected a TOML file") from None
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise DesignError(f"{where}: found values nested too deeply, expected a design file") from None
    except ValueError as error:  # also what is no TOMLDecodeError, such as a number of 5000 digits
        message = " ".join(str(error).split())
        place = re.search(r"\(at line (\d+), column \d+\)$", message)
        line = place[1] if place else str(len(text.splitlines()))
        what = re.sub(r"\s*\(at [^()]*\)$", "", message)
        if "overwrite" in what or "twice" in what:
            raise DesignError(f"{where}, line {line}: found a key or section again, expected it once") from None
        raise DesignError(f"{where}, line {line}: not valid TOML: {what[:1].lower()}{what[1:]}") from None


def _resolved_table(path: Path, seen: tuple[Path, ...]) -> Table:
    """Table of a file laid over the table of its base."""
    here = path.resolve()
    if here in seen:
        raise DesignError(f"base: found {path.name}, which leads back to itself, expected a preset or another file")
    table = read_table(path)
    place_files(table, path.parent)
    base = table.pop("base", None)
    if base is None:
        return table
    if not isinstance(base, str):
        raise DesignError(f"base: found {shown(base)}, expected the name of a preset or the path of a file")
    below = _resolved_table(_design_path(base, path.parent), (*seen, here))
    if isinstance(table.get("muscle"), dict) and "tissue" in table["muscle"]:
        _make_room_for_tissue(below)
    below.pop("name", None)
    below.pop("description", None)
    return _overlay(below, table)


def _make_room_for_tissue(table: Table) -> None:
    """Drop what a base says of the section and the tension, which follow from the tissue then."""
    if isinstance(table.get("muscle"), dict):
        table["muscle"] = without_following(table["muscle"])


def _without_angles(below: object, above: object) -> object:
    """A section of the muscle without theta and spread, where what is laid over it brings their measurement."""
    new = above.get("orientation") if isinstance(above, dict) else None
    if isinstance(below, dict) and isinstance(new, str) and new:
        return {name: value for name, value in below.items() if name not in _MEASURED}
    return below


def _overlay(below: Table, above: Table) -> Table:
    merged = copy.copy(below)
    if "muscle" in merged:
        merged["muscle"] = _without_angles(merged["muscle"], above.get("muscle"))
    for name, value in above.items():
        old = merged.get(name)
        merged[name] = _overlay(old, value) if isinstance(old, dict) and isinstance(value, dict) else value
    return merged


def _apply(table: Table, override: str) -> None:
    """Write one ``key.path=value unit`` into the table."""
    name, equals, text = override.partition("=")
    name, text = name.strip(), text.strip()
    if not equals or not name:
        raise DesignError(f'--set: found {shown(override)}, expected key=value, such as muscle.theta="90 deg"')
    if len(text) >= 2 and text[0] == text[-1] and text[0] in "\"'":
        text = text[1:-1]
    if name not in keys():
        raise DesignError(unknown_key(name))
    *path, last = name.split(".")
    for section in path:
        inner = table.get(section)
        if inner is not None and not isinstance(inner, dict):
            raise DesignError(f"{section}: found {shown(inner)}, expected a section")
        # a changed copy, since the table may be shared with a base
        table[section] = dict(inner or {})
        if name == "muscle.orientation" and text:
            table[section] = _without_angles(table[section], {last: text})
        table = table[section]
    table[last] = str(Path(text).absolute()) if text and text not in FILE_KEYS.get(name, (text,)) else text


def _with_orientation(values: Table) -> Table:
    """Values with theta and spread as measured, where a file of directions is named."""
    muscle = values.get("muscle")
    if not isinstance(muscle, dict) or not isinstance(muscle.get("orientation"), str):
        return values
    if not muscle["orientation"]:
        return {**values, "muscle": {k: v for k, v in muscle.items() if k != "orientation"}}

    # numbers from measured files, with scipy: only where a design asks for them
    from fem_biobot.muscle.orientation_file import orientation_of_file

    axis, image = muscle.get("orientation_axis", 0.0), muscle.get("orientation_image") or ""
    found = orientation_of_file(muscle["orientation"], image=image, axis=axis)
    measured = {"theta": found.theta, "spread": found.spread}
    for name, value in measured.items():
        given = muscle.get(name)
        # the resolved design of a run has both, and they agree
        if given is not None and abs(given - value) > 1e-9:
            raise DesignError(
                f"muscle.{name}: found {format_quantity(given, 'rad', digits=12)} beside muscle.orientation, which "
                f"gives {format_quantity(value, 'rad', digits=6)}, expected one of the two keys"
            )
    return {**values, "muscle": {**muscle, **measured}}


def _values(table: Table, prefix: str) -> Table:
    """The table with every text turned into what `Design` takes."""
    result: Table = {}
    for name, value in table.items():
        full = prefix + name
        if full in sections():
            if not isinstance(value, dict):
                raise DesignError(
                    f"{full}: found {shown(value)}, expected a section with keys such as {first_key(full)}"
                )
            result[name] = _values(value, full + ".")
        elif full in keys():
            result[name] = _value(value, keys()[full])
        else:
            raise DesignError(unknown_key(full, "section" if isinstance(value, dict) else "key"))
    return result


def _value(value: object, key: Key) -> object:
    if key.quantity is not None:
        return parse_quantity(value, key.quantity.unit, key.name)
    if key.field.annotation is int and isinstance(value, str) and re.fullmatch(r"\s*[+-]?[0-9]{1,9}\s*", value):
        return int(value)
    return value


def _toml_value(value: Any, key: Key) -> str:
    if key.quantity is None:
        return json.dumps(value, ensure_ascii=False)
    text = format_quantity(value, key.quantity.unit)
    return text if key.quantity.unit == "1" else f'"{text}"'

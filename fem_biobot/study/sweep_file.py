"""The file of a sweep: which keys of a design take which values, how they are combined, and what is done with each.

A case is one design. Its keys are written as texts with units, exactly as `--set` takes them, so that a design of a
sweep is the design that the same texts give anywhere else.
"""

from __future__ import annotations

import hashlib
import itertools
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any

import numpy as np

import fem_biobot
from fem_biobot.config import digest, load_design, presets, read_table
from fem_biobot.design import Design, Key, keys, unknown_key
from fem_biobot.design_kinds import FILE_KEYS
from fem_biobot.errors import BiobotError, DesignError
from fem_biobot.units import format_quantity, parse_quantity, shown

MOST_CASES = 100_000
_SECTIONS = ("grid", "list", "sample")
_FILE = ("base", "name", "task", "start", "set", *_SECTIONS)
_RANGE = ("from", "to", "count")
_NAMES = ("name", "description")


class Task(StrEnum):
    """What is done with every case: the command of that name, without its pictures."""

    solve = "solve"
    walk = "walk"
    crosscheck = "crosscheck"


class Start(StrEnum):
    """Where solves begin.

    neighbour
        At the states of a case near by on the same mesh, where there is one; see `sweep_forest`.
    cold
        Each from the undeformed body.
    """

    neighbour = "neighbour"
    cold = "cold"


class Sampling(StrEnum):
    """How points are spread over ranges.

    latin_hypercube
        One point in every one of `count` slices of every range, paired at random (McKay, Beckman, Conover 1979).
    sobol
        A scrambled sequence of low discrepancy; `count` must be a power of two.
    """

    latin_hypercube = "latin_hypercube"
    sobol = "sobol"


@dataclass(frozen=True)
class Case:
    """One design of a sweep.

    Attributes
    ----------
    number
        From 1, in the order of the file.
    values
        Key to value, in coherent units.
    design
        What is computed; None where the values make no design.
    refused
        Why not.
    key
        Sixteen hexadecimal characters of design, task and version: equal cases give equal results.
    """

    number: int
    values: Mapping[str, Any]
    design: Design | None
    refused: str
    key: str


@dataclass(frozen=True)
class SweepPlan:
    """A sweep as its file says it.

    Attributes
    ----------
    name
        Of the sweep.
    base
        The design that the cases start from.
    task
        What is done with each.
    varied
        Keys that differ between cases.
    cases
        All of them, in order.
    text
        Of the file.
    start
        Where solves begin.
    """

    name: str
    base: Design
    task: Task
    varied: tuple[str, ...]
    cases: tuple[Case, ...]
    text: str
    start: Start = Start.cold

    @property
    def digest(self) -> str:
        """Sixteen hexadecimal characters that name what the sweep computes."""
        text = json.dumps([self.task.value, self.start.value, [case.key for case in self.cases]])
        return hashlib.sha256(text.encode()).hexdigest()[:16]


def read_sweep(path: Path) -> SweepPlan:
    """A sweep's file, every value checked; a case whose values make no design is kept with the reason.

    Raises
    ------
    FileError
        It cannot be read.
    DesignError
        An unknown key, a value without its unit, a range that is none; one line.
    """
    table = read_table(path)
    for name in table:
        if name not in _FILE:
            raise DesignError(f"{name}: unknown key of a sweep, expected one of: {', '.join(_FILE)}")
    base = _text(table, "base")
    where: str | Path = base if base in presets() else path.parent / base
    task = _choice(table, "task", Task)
    start = _start(table, task)
    fixed = [f"{key}={_one(value, keys()[key], 'set', path.parent)}" for key, value in _by_key(table, "set")]
    grid = {key: _several(value, keys()[key], "grid", path.parent) for key, value in _by_key(table, "grid")}
    rows = {key: _several(value, keys()[key], "list", path.parent) for key, value in _by_key(table, "list")}
    if len({len(texts) for texts in rows.values()}) > 1:
        counts = ", ".join(f"{len(texts)} of {key}" for key, texts in rows.items())
        raise DesignError(f"list: found {counts}, expected as many values of each key: they are rows")
    sampled = _sample(table)
    _refuse_twice(dict(_by_key(table, "set")), grid, rows, sampled)
    varied = (*grid, *rows, *sampled)
    if not varied:
        raise DesignError("grid: missing, expected a section [grid], [list] or [sample] with keys of a design")
    count = int(np.prod([len(v) for v in (*grid.values(), *list(rows.values())[:1], *list(sampled.values())[:1])]))
    if count > MOST_CASES:
        raise DesignError(f"grid: found {count} cases, expected at most {MOST_CASES}")
    design = load_design(where, fixed)
    name = _text(table, "name") if "name" in table else path.stem
    combined = itertools.product(itertools.product(*grid.values()), _zipped(rows), _zipped(sampled))
    cases = tuple(
        _case(number, where, fixed, task, dict(zip(varied, (*a, *b, *c), strict=True)))
        for number, (a, b, c) in enumerate(combined, start=1)
    )
    return SweepPlan(name, design, task, varied, cases, path.read_text(encoding="utf-8-sig"), start)


def _case(number: int, base: str | Path, fixed: Sequence[str], task: Task, texts: Mapping[str, str]) -> Case:
    """The design of some texts, or why there is none."""
    values = {key: _parsed(text, keys()[key]) for key, text in texts.items()}
    try:
        design = load_design(base, [*fixed, *(f"{key}={text}" for key, text in texts.items())])
    except BiobotError as error:
        return Case(number, values, None, str(error), _digest(["refused", *texts.items()], task))
    return Case(number, values, design, "", _digest(digest(design), task))


def _digest(what: object, task: Task) -> str:
    text = json.dumps([what, task.value, fem_biobot.__version__])
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _zipped(columns: Mapping[str, Sequence[str]]) -> list[tuple[str, ...]]:
    """Rows of columns; one empty row where there are none."""
    return list(zip(*columns.values(), strict=True)) if columns else [()]


def _text(table: Mapping[str, Any], name: str) -> str:
    value = table.get(name)
    if not (isinstance(value, str) and value.strip() and value.isprintable()):
        found = "missing" if value is None else f"found {shown(value)}"
        expected = "a preset or the path of a design" if name == "base" else "a text on one line"
        raise DesignError(f"{name}: {found}, expected {expected}")
    return value


def _choice(table: Mapping[str, Any], name: str, choices: type[StrEnum], where: str = "") -> Any:
    value = table.get(name)
    if value not in list(choices):
        found = "missing" if value is None else f"found {shown(value)}"
        raise DesignError(f"{where}{name}: {found}, expected one of: {', '.join(choices)}")
    return choices(value)


def _start(table: Mapping[str, Any], task: Task) -> Start:
    """Where solves begin: at neighbours unless the file says otherwise; other tasks always begin by themselves."""
    if "start" not in table:
        return Start.neighbour if task is Task.solve else Start.cold
    start = _choice(table, "start", Start)
    if task is not Task.solve:
        raise DesignError(f'start: found "{start}" with task {task}, expected it with task solve alone')
    return start


def _by_key(table: Mapping[str, Any], section: str) -> Iterator[tuple[str, Any]]:
    """Full keys and values of a section, written ``skeleton.beam_width`` or as sections inside it."""
    inside = table.get(section, {})
    if not isinstance(inside, dict):
        raise DesignError(f"{section}: found {shown(inside)}, expected a section with keys of a design")
    yield from _flat(inside, "", section)


def _flat(table: Mapping[str, Any], prefix: str, section: str) -> Iterator[tuple[str, Any]]:
    for name, value in table.items():
        full = prefix + name
        if full in keys() and full not in _NAMES:
            yield full, value
        elif isinstance(value, dict):
            yield from _flat(value, full + ".", section)
        else:
            raise DesignError(f"{section}.{unknown_key(full)}")


def _one(value: object, key: Key, section: str, folder: Path) -> str:
    """A value as the text that `--set` takes, refused where it cannot be one."""
    name = f"{section}.{key.name}"
    if key.quantity is not None:
        parse_quantity(value, key.quantity.unit, name)
        return str(value)
    text = str(value).strip()
    whole = isinstance(value, int) and not isinstance(value, bool)
    if key.field.annotation is int:
        if not whole:
            raise DesignError(f"{name}: found {shown(value)}, expected a whole number")
    elif not isinstance(value, str) or (key.choices and value not in key.choices):
        raise DesignError(f"{name}: found {shown(value)}, expected {key.expected}")
    elif key.name in FILE_KEYS and text and text not in FILE_KEYS[key.name]:
        return str((folder / text).absolute())
    return text


def _several(value: object, key: Key, section: str, folder: Path) -> list[str]:
    """Values of a list, or of a range with a count."""
    name = f"{section}.{key.name}"
    if isinstance(value, list) and value:
        return [_one(each, key, section, folder) for each in value]
    if not isinstance(value, dict) or set(value) != set(_RANGE):
        found = f"found {', '.join(value) or 'nothing'}" if isinstance(value, dict) else f"found {shown(value)}"
        raise DesignError(f'{name}: {found}, expected a list of values, or {{ from = "...", to = "...", count = 5 }}')
    low, high = _ends((value["from"], value["to"]), key, name)
    count = value["count"]
    if not isinstance(count, int) or isinstance(count, bool) or not 2 <= count <= MOST_CASES:
        raise DesignError(f"{name}.count: found {shown(count)}, expected a whole number of at least 2")
    return [_written(each, key) for each in np.linspace(low, high, count)]


def _ends(ends: Sequence[object], key: Key, name: str) -> tuple[float, float]:
    """Both ends of a range of a quantity."""
    if key.quantity is None:
        raise DesignError(f"{name}: found a range, expected one of a quantity only; list the values of this key")
    low, high = (parse_quantity(end, key.quantity.unit, name) for end in ends)
    if not low < high:
        raise DesignError(f"{name}: found {shown(ends[0])} to {shown(ends[1])}, expected a range that rises")
    return low, high


def _written(value: float, key: Key) -> str:
    assert key.quantity is not None
    return format_quantity(float(value), key.quantity.unit)


def _parsed(text: str, key: Key) -> Any:
    if key.quantity is not None:
        return parse_quantity(text, key.quantity.unit, key.name)
    return int(text) if key.field.annotation is int else text


def _sample(table: Mapping[str, Any]) -> dict[str, list[str]]:
    """Sampled texts by key."""
    given = table.get("sample")
    if given is None:
        return {}
    if not isinstance(given, dict):
        raise DesignError(f"sample: found {shown(given)}, expected a section with method, seed, count and over")
    for name in given:
        if name not in ("method", "seed", "count", "over"):
            raise DesignError(f"sample.{name}: unknown key of a sample, expected one of: method, seed, count, over")
    method = _choice(given, "method", Sampling, "sample.")
    for name, least in (("seed", 0), ("count", 1)):
        value = given.get(name)
        if not isinstance(value, int) or isinstance(value, bool) or not least <= value < 2**31:
            found = "missing" if value is None else f"found {shown(value)}"
            raise DesignError(f"sample.{name}: {found}, expected a whole number of at least {least}")
    count = given["count"]
    if method is Sampling.sobol and count & (count - 1):
        raise DesignError(f"sample.count: found {count} with method sobol, expected a power of two, such as 16")
    if count > MOST_CASES:
        raise DesignError(f"sample.count: found {count}, expected at most {MOST_CASES}")
    ranges = {}
    for key, value in _by_key(given, "over"):
        if not (isinstance(value, list) and len(value) == 2):
            raise DesignError(f"sample.over.{key}: found {shown(value)}, expected the two ends of a range")
        ranges[key] = _ends(value, keys()[key], f"sample.over.{key}")
    if not ranges:
        raise DesignError("sample.over: missing, expected a section with keys of a design and their ranges")

    from scipy.stats import qmc  # slow to import, and most sweeps do not sample

    make: Any = qmc.Sobol if method is Sampling.sobol else qmc.LatinHypercube
    points = make(len(ranges), seed=given["seed"]).random(count)
    return {
        key: [_written(low + share * (high - low), keys()[key]) for share in points[:, k]]
        for k, (key, (low, high)) in enumerate(ranges.items())
    }


def _refuse_twice(*groups: Mapping[str, Any]) -> None:
    names = ("set", *_SECTIONS)
    for (i, a), (j, b) in itertools.combinations(enumerate(groups), 2):
        for key in a:
            if key in b:
                raise DesignError(f"{names[j]}.{key}: found in [{names[i]}] too, expected it in one section")

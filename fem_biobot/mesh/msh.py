"""Gmsh's mesh format as it stands in a file: versions 2.2 and 4.1, text and binary, and nothing of its meaning.

A reader of our own, since meshio (5.3) keeps one physical group per entity in version 4.1 and takes a truncated file
for a whole one. Every number that is read is counted against what the file announces.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from fem_biobot.errors import MeshError

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

# number of nodes of each element type of the format
NODES = {
    **{1: 2, 2: 3, 3: 4, 4: 4, 5: 8, 6: 6, 7: 5, 8: 3, 9: 6, 10: 9, 11: 10, 12: 27, 13: 18, 14: 14, 15: 1, 16: 8},
    **{17: 20, 18: 15, 19: 13, 20: 9, 21: 10, 22: 12, 23: 15, 24: 15, 25: 21, 26: 4, 27: 5, 28: 6, 29: 20, 30: 35},
    **{31: 56, 92: 64, 93: 125},
}
POINT = (15,)
LINES = (1, 8, 26, 27, 28)
TRIANGLES = (2, 9, 20, 21, 22, 23, 24, 25)
QUADRANGLES = (3, 10, 16)
TETRAHEDRA = (4, 11, 29, 30, 31)


@dataclass
class Elements:
    """Elements of one type in the same physical groups.

    Attributes
    ----------
    kind
        Type number of the format.
    groups
        Physical tags; empty for elements in no group.
    tags
        Element numbers, (m,).
    nodes
        Node numbers, (k, m).
    """

    kind: int
    groups: tuple[int, ...]
    tags: Ints
    nodes: Ints


@dataclass
class Raw:
    """Content of a file: node numbers (n,), positions (3, n), elements, and names of physical groups."""

    version: str = ""
    binary: bool = False
    node_tags: Ints = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    points: Array = field(default_factory=lambda: np.empty((3, 0)))
    elements: list[Elements] = field(default_factory=list)
    names: dict[tuple[int, int], str] = field(default_factory=dict)


class _Short(Exception):  # noqa: N818
    """The file ends, or a section ends, before what it announced."""


class _Text:
    """Numbers of a text section, taken in order."""

    def __init__(self, body: bytes) -> None:
        self.numbers = np.array(body.split(), dtype=np.float64)
        self.position = 0

    def take(self, kind: str, n: int) -> NDArray:
        if n < 0 or self.position + n > self.numbers.size:
            raise _Short
        part = self.numbers[self.position : self.position + n]
        self.position += n
        return part if kind == "d" else _whole(part)


class _Binary:
    """Numbers of a binary section, taken in order; `kind` is "i" (int), "z" (size) or "d" (double)."""

    def __init__(self, data: bytes, position: int, order: str) -> None:
        self.data, self.position = data, position
        self.types = {"i": np.dtype(order + "i4"), "z": np.dtype(order + "u8"), "d": np.dtype(order + "f8")}

    def take(self, kind: str, n: int) -> NDArray:
        dtype = self.types[kind]
        end = self.position + n * dtype.itemsize
        if n < 0 or end > len(self.data):
            raise _Short
        part = np.frombuffer(self.data, dtype, n, self.position)
        self.position = end
        return part.astype(np.float64 if kind == "d" else np.int64)


def _whole(part: NDArray) -> Ints:
    numbers = part.astype(np.int64)
    if not np.array_equal(numbers, part):
        raise ValueError("a whole number was expected")
    return numbers


def parse(data: bytes) -> Raw:
    """Content of a mesh file.

    Raises
    ------
    MeshError
        Not a Gmsh mesh, another version, truncated or damaged; the message does not name the file.
    """
    raw = Raw()
    section = "MeshFormat"
    try:
        order, position = _header(data, raw)
        entities: dict[tuple[int, int], tuple[int, ...]] = {}
        seen = set()
        while True:
            found = re.compile(rb"\$(\w+)[ \t]*\r?\n").search(data, position)
            if found is None:
                break
            section = found.group(1).decode()
            seen.add(section)
            position = _section(data, found.end(), section, order, raw, entities)
        if data[position:].strip():
            raise _Short
    except _Short:
        raise MeshError(f"the file is truncated or damaged in its section ${section}") from None
    except (ValueError, OverflowError, MemoryError) as error:
        reason = str(error).splitlines()[0][:80] if str(error) else type(error).__name__
        raise MeshError(f"the section ${section} is damaged: {reason}") from None
    for needed in ("Nodes", "Elements"):
        if needed not in seen:
            raise MeshError(f"the file has no section ${needed}; it is truncated or holds no mesh")
    return raw


def _header(data: bytes, raw: Raw) -> tuple[str, int]:
    """Byte order of the file ("" if it is text) and where the first section ends."""
    start = len(data) - len(data.lstrip())
    head = re.compile(rb"\$MeshFormat[ \t]*\r?\n\s*([\d.]+)\s+([01])\s+(\d+)[ \t]*\r?\n").match(data, start)
    if head is None:
        if data[start : start + 11] == b"$MeshFormat"[: len(data) - start] and data.strip():
            raise _Short
        raise MeshError("this is not a Gmsh mesh, which would start with $MeshFormat")
    raw.version, raw.binary = head.group(1).decode(), head.group(2) == b"1"
    if raw.version not in ("2", "2.0", "2.1", "2.2", "4.1"):
        raise MeshError(f"the mesh format {raw.version} is not read; save it in Gmsh as version 2 or 4.1")
    if head.group(3) != b"8":
        raise MeshError(f"the mesh has numbers of {head.group(3).decode()} bytes, expected 8")
    order, position = "", head.end()
    if raw.binary:
        order = {b"\x01\x00\x00\x00": "<", b"\x00\x00\x00\x01": ">"}.get(data[position : position + 4], "")
        if not order:
            raise _Short
        position += 4
    return order, _end(data, position, "MeshFormat")


def _end(data: bytes, position: int, section: str) -> int:
    """Position after the end mark, which only blanks may precede."""
    mark = re.compile(rb"\s*\$End" + section.encode() + rb"[ \t]*(\r?\n|$)").match(data, position)
    if mark is None:
        raise _Short
    return mark.end()


def _section(
    data: bytes, start: int, section: str, order: str, raw: Raw, entities: dict[tuple[int, int], tuple[int, ...]]
) -> int:
    """Read one section into `raw`; the position after it."""
    old = raw.version[0] == "2"
    readers: dict[str, Callable[..., None]] = {
        "Entities": lambda s: _entities(s, entities),
        "Nodes": (_nodes_2_binary if raw.binary else _nodes_2) if old else _nodes_4,
        "Elements": (_elements_2_binary if raw.binary else _elements_2) if old else _elements_4,
    }
    if section == "PartitionedEntities":
        raise MeshError("the mesh is partitioned; save it in Gmsh without partitions")
    if raw.binary and section in readers:
        if old:
            count, start = _line(data, start)
            source = _Binary(data, start, order)
            args = (source, raw, int(count))
        else:
            source = _Binary(data, start, order)
            args = (source,) if section == "Entities" else (source, raw)
        if section == "Elements" and not old:
            args = (*args, entities)
        readers[section](*args)
        return _end(data, source.position, section)
    end = data.find(b"$End" + section.encode(), start)
    if end < 0:
        raise _Short
    if section == "PhysicalNames":
        _names(data[start:end], raw)
    elif section in readers:
        text = _Text(data[start:end])
        args = (text,) if section == "Entities" else (text, raw)
        if section == "Elements" and not old:
            args = (*args, entities)
        readers[section](*args)
        if text.position != text.numbers.size:
            raise _Short
    return _end(data, end, section)


def _line(data: bytes, position: int) -> tuple[bytes, int]:
    end = data.find(b"\n", position)
    if end < 0:
        raise _Short
    return data[position:end], end + 1


def _names(body: bytes, raw: Raw) -> None:
    lines = [line for line in body.decode("utf-8", errors="replace").splitlines() if line.strip()]
    if not lines or len(lines) - 1 != int(lines[0]):
        raise _Short
    for line in lines[1:]:
        parts = re.match(r'\s*(\d)\s+(-?\d+)\s+"(.*)"\s*$', line)
        if parts is None:
            raise ValueError(f"found {line.strip()!r}")
        raw.names[int(parts.group(1)), abs(int(parts.group(2)))] = parts.group(3)


def _entities(source: _Text | _Binary, entities: dict[tuple[int, int], tuple[int, ...]]) -> None:
    counts = source.take("z", 4)
    for dim, count in enumerate(counts):
        for _ in range(int(count)):
            tag = int(source.take("i", 1)[0])
            source.take("d", 3 if dim == 0 else 6)
            groups = source.take("i", int(source.take("z", 1)[0]))
            # a negative tag only says that the group sees the entity from behind
            entities[dim, tag] = tuple(sorted({abs(int(g)) for g in groups}))
            if dim:
                source.take("i", int(source.take("z", 1)[0]))


def _nodes_4(source: _Text | _Binary, raw: Raw) -> None:
    blocks, total, _, _ = (int(k) for k in source.take("z", 4))
    tags, points = [np.empty(0, dtype=np.int64)], [np.empty((0, 3))]
    for _ in range(blocks):
        dim, _, parametric = (int(k) for k in source.take("i", 3))
        count = int(source.take("z", 1)[0])
        tags.append(source.take("z", count))
        width = 3 + (dim if parametric else 0)
        points.append(source.take("d", count * width).reshape(count, width)[:, :3])
    raw.node_tags, raw.points = np.concatenate(tags), np.concatenate(points).T
    if raw.node_tags.size != total:
        raise _Short


def _elements_4(source: _Text | _Binary, raw: Raw, entities: dict[tuple[int, int], tuple[int, ...]]) -> None:
    blocks, total, _, _ = (int(k) for k in source.take("z", 4))
    found = 0
    for _ in range(blocks):
        dim, tag, kind = (int(k) for k in source.take("i", 3))
        count = int(source.take("z", 1)[0])
        width = 1 + _width(kind)
        rows = source.take("z", count * width).reshape(count, width)
        raw.elements.append(Elements(kind, entities.get((dim, tag), ()), rows[:, 0], rows[:, 1:].T))
        found += count
    if found != total:
        raise _Short


def _width(kind: int) -> int:
    if kind not in NODES:
        raise MeshError(f"the mesh has elements of the unknown type {kind}")
    return NODES[kind]


def _nodes_2(source: _Text, raw: Raw) -> None:
    count = int(source.take("z", 1)[0])
    rows = source.take("d", 4 * count).reshape(count, 4)
    raw.node_tags, raw.points = _whole(rows[:, 0]), rows[:, 1:].T


def _nodes_2_binary(source: _Binary, raw: Raw, count: int) -> None:
    record = np.dtype([("tag", source.types["i"]), ("x", source.types["d"], 3)])
    end = source.position + count * record.itemsize
    if count < 0 or end > len(source.data):
        raise _Short
    rows = np.frombuffer(source.data, record, count, source.position)
    source.position = end
    raw.node_tags, raw.points = rows["tag"].astype(np.int64), rows["x"].astype(np.float64).T


def _elements_2(source: _Text, raw: Raw) -> None:
    count = int(source.take("z", 1)[0])
    rest = source.take("z", source.numbers.size - source.position)
    numbers = rest.tolist()
    # each line has its own length: find the starts first, then read lines of one kind together
    starts, at = np.empty(count, dtype=np.int64), 0
    for k in range(count):
        starts[k] = at
        if at + 3 > len(numbers):
            raise _Short
        at += 3 + numbers[at + 2] + _width(numbers[at + 1])
    if at != len(numbers):
        raise _Short
    kinds, marks = rest[starts + 1], rest[starts + 2]
    for kind, n_marks in sorted(set(zip(kinds.tolist(), marks.tolist(), strict=True))):
        chosen = starts[(kinds == kind) & (marks == n_marks)]
        rows = rest[chosen[:, None] + np.arange(3 + n_marks + _width(kind))]
        _add_2(raw, kind, rows[:, 0], rows[:, 3 : 3 + n_marks], rows[:, 3 + n_marks :])


def _elements_2_binary(source: _Binary, raw: Raw, count: int) -> None:
    pieces: dict[tuple[int, int], list[Ints]] = {}
    found = 0
    while found < count:
        kind, follow, n_marks = (int(k) for k in source.take("i", 3))
        if follow <= 0 or n_marks < 0:
            raise _Short
        width = 1 + n_marks + _width(kind)
        pieces.setdefault((kind, n_marks), []).append(source.take("i", follow * width).reshape(follow, width))
        found += follow
    if found != count:
        raise _Short
    for (kind, n_marks), parts in sorted(pieces.items()):
        rows = np.concatenate(parts)
        _add_2(raw, kind, rows[:, 0], rows[:, 1 : 1 + n_marks], rows[:, 1 + n_marks :])


def _add_2(raw: Raw, kind: int, tags: Ints, marks: Ints, nodes: Ints) -> None:
    """Elements of version 2: the first mark is the physical group, zero for none."""
    group = np.abs(marks[:, 0]) if marks.shape[1] else np.zeros(len(tags), dtype=np.int64)
    for number in np.unique(group):
        chosen = group == number
        raw.elements.append(Elements(kind, (int(number),) if number else (), tags[chosen], nodes[chosen].T))


@dataclass(frozen=True)
class Block:
    """Elements to be written: `kind`, the physical tags of their entity, numbers (m,), node numbers (k, m)."""

    kind: int
    groups: tuple[int, ...]
    tags: Ints
    nodes: Ints


def text(points: Array, blocks: list[Block], names: dict[tuple[int, int], str]) -> str:
    """A mesh as text in version 4.1; one entity for each block, all nodes in order on the first volume."""
    dims = {**dict.fromkeys(POINT, 0), **dict.fromkeys(TRIANGLES, 2), **dict.fromkeys(TETRAHEDRA, 3)}
    lines = ["$MeshFormat", "4.1 0 8", "$EndMeshFormat", "$PhysicalNames", str(len(names))]
    lines += [f'{dim} {tag} "{name}"' for (dim, tag), name in sorted(names.items())]
    lines += ["$EndPhysicalNames", "$Entities"]
    number, counts = [], [0, 0, 0, 0]
    for block in blocks:
        counts[dims[block.kind]] += 1
        number.append(counts[dims[block.kind]])
    lines.append(" ".join(map(str, counts)))
    for dim in range(4):
        for block, tag in zip(blocks, number, strict=True):
            if dims[block.kind] != dim:
                continue
            part = points[:, block.nodes.ravel() - 1]
            box = part[:, 0] if dim == 0 else np.concatenate([part.min(axis=1), part.max(axis=1)])
            head = [tag, *map(_number, box), len(block.groups), *block.groups, *([0] if dim else [])]
            lines.append(" ".join(map(str, head)))
    n = points.shape[1]
    lines += ["$EndEntities", "$Nodes", f"1 {n} 1 {n}", f"3 1 0 {n}", *map(str, range(1, n + 1))]
    lines += [f"{_number(x)} {_number(y)} {_number(z)}" for x, y, z in points.T.tolist()]
    every = np.concatenate([block.tags for block in blocks])
    lines += ["$EndNodes", "$Elements", f"{len(blocks)} {every.size} {every.min()} {every.max()}"]
    for block, tag in zip(blocks, number, strict=True):
        lines.append(f"{dims[block.kind]} {tag} {block.kind} {block.tags.size}")
        lines += [" ".join(map(str, row)) for row in np.vstack([block.tags, block.nodes]).T.tolist()]
    return "\n".join([*lines, "$EndElements", ""])


def _number(x: float) -> str:
    """Shortest text that reads back as the same double."""
    return repr(float(x)).removesuffix(".0")

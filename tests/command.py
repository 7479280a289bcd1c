"""What tests of the command line share: calls in and out of this process, listings of folders, small meshes on file."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import pytest

from fem_biobot.cli import main

ROOT = Path(__file__).resolve().parent.parent

# a box of five tetrahedra, positively oriented (their volumes are computed in `msh`)
CUBE = ((0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0), (0, 0, 1), (1, 0, 1), (0, 1, 1), (1, 1, 1))
TETRAHEDRA = ((0, 1, 2, 4), (3, 2, 1, 7), (5, 4, 7, 1), (6, 7, 4, 2), (1, 2, 4, 7))


@dataclass(frozen=True)
class Said:
    """Outcome of a command."""

    code: int
    out: str
    err: str

    @property
    def complaint(self) -> str:
        """The last line on standard error."""
        return self.err.splitlines()[-1]


def call(capsys: pytest.CaptureFixture[str], *arguments: str | os.PathLike[str]) -> Said:
    """The command in this process."""
    capsys.readouterr()
    code = main([os.fspath(a) for a in arguments])
    captured = capsys.readouterr()
    return Said(code, captured.out, captured.err)


def environment(**changes: str) -> dict[str, str]:
    """Environment in which another process finds this package."""
    return {**os.environ, "PYTHONPATH": str(ROOT), **changes}


def command(*arguments: str | os.PathLike[str]) -> list[str]:
    """The command as a process of its own."""
    return [sys.executable, "-m", "fem_biobot", *map(os.fspath, arguments)]


def call_process(
    *arguments: str | os.PathLike[str], cwd: Path | None = None, env: Mapping[str, str] | None = None
) -> Said:
    """The command in a process of its own."""
    done = subprocess.run(
        command(*arguments), cwd=cwd, env=env or environment(), capture_output=True, text=True, timeout=300, check=False
    )
    return Said(done.returncode, done.stdout, done.stderr)


def listing(folder: Path) -> dict[str, bytes]:
    """Everything below a folder, hidden files included, with the content of the files."""
    found = sorted(folder.rglob("*"))
    return {str(p.relative_to(folder)): p.read_bytes() if p.is_file() else b"folder" for p in found}


def msh(
    path: Path,
    regions: Mapping[str, Sequence[int]],
    *,
    flipped: Sequence[int] = (),
    empty: Sequence[str] = (),
    triangles: bool = False,
) -> Path:
    """Write a mesh of the cube in Gmsh's version 2.2.

    Parameters
    ----------
    regions
        Name to which of the five tetrahedra.
    flipped
        Tetrahedra whose orientation is turned over.
    empty
        Names of volumes without tetrahedra.
    triangles
        Write a face of each tetrahedron instead.
    """
    names = [*regions, *empty]
    lines = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$PhysicalNames", str(len(names))]
    lines += [f'3 {k} "{name}"' for k, name in enumerate(names, start=1)]
    lines += ["$EndPhysicalNames", "$Nodes", str(len(CUBE))]
    lines += [f"{k} {x} {y} {z}" for k, (x, y, z) in enumerate(CUBE, start=1)]
    lines += ["$EndNodes", "$Elements", str(sum(len(which) for which in regions.values()))]
    number = 0
    for group, which in enumerate(regions.values(), start=1):
        for t in which:
            number += 1
            vertices = [v + 1 for v in TETRAHEDRA[t]]
            if t in flipped:
                vertices[:2] = vertices[1::-1]
            kind, used = (2, vertices[:3]) if triangles else (4, vertices)
            lines.append(f"{number} {kind} 2 {group} {group} " + " ".join(map(str, used)))
    path.write_text("\n".join([*lines, "$EndElements", ""]))
    return path

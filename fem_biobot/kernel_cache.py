"""Compiled kernels are told by everything they were compiled from, not by their own file alone.

Numba looks at the file of the kernel that is called: an edit in a kernel that it calls, as an update of the package may
bring, would go unseen, and the old machine code be run. Here a kernel's folder and stamp follow from the text of its
file and of all files of the package that it imports, and theirs.
"""

from __future__ import annotations

import hashlib
import re
import shutil
from functools import cache
from pathlib import Path
from typing import Any

from numba.core import caching

_PACKAGE = Path(__file__).resolve().parent
_IMPORT = re.compile(r"^\s*(?:from|import)\s+(fem_biobot[\w.]*)(?:\s+import\s+(\([^)]*\)|[^\n]*))?", re.MULTILINE)
_PREFIX = "built-"


class KernelLocator(caching._CacheLocator):
    """Where numba keeps a kernel of ours: in a folder named by its sources, below the one that numba would take."""

    def __init__(self, place: Any, stamp: str) -> None:
        self._place, self._stamp = place, stamp

    def get_cache_path(self) -> Any:
        """Folder of the index and the machine code."""
        return str(Path(self._place.get_cache_path()) / f"{_PREFIX}{self._stamp[:16]}")

    def get_source_stamp(self) -> Any:
        """Digest of the sources."""
        return self._stamp

    def get_disambiguator(self) -> Any:
        """What tells kernels of one name in one file apart."""
        return self._place.get_disambiguator()

    @classmethod
    def from_function(cls, py_func: Any, py_file: str) -> KernelLocator | None:
        """For a kernel of this package; None for those of others, which numba's own locators serve."""
        path = Path(py_file).resolve()
        if not path.is_relative_to(_PACKAGE):
            return None
        for locator in caching.CacheImpl._locator_classes:
            place = None if locator is cls else locator.from_function(py_func, py_file)
            if place is not None:
                found = cls(place, digest(path))
                _clear_others(Path(found.get_cache_path()))
                found.ensure_cache_path()
                return found
        return None


def install() -> None:
    """Have numba ask here first; once is enough."""
    classes = caching.CacheImpl._locator_classes
    if KernelLocator not in classes:
        classes.insert(0, KernelLocator)


@cache
def digest(path: Path) -> str:
    """Digest of a source file of the package and of all of the package that it imports, directly or not."""
    whole = hashlib.sha256()
    for file in sorted(_closure(path)):
        whole.update(str(file.relative_to(_PACKAGE.parent)).encode())
        whole.update(_text(file))
    return whole.hexdigest()


def _closure(path: Path) -> set[Path]:
    found, left = set(), [path]
    while left:
        file = left.pop()
        if file not in found:
            found.add(file)
            left += _imported(file)
    return found


@cache
def _text(file: Path) -> bytes:
    return file.read_bytes()


@cache
def _imported(file: Path) -> tuple[Path, ...]:
    """Files of the package that a file imports; a name imported from a folder may be one of its modules."""
    found = []
    for module, names in _IMPORT.findall(_text(file).decode()):
        below = _PACKAGE.parent.joinpath(*module.split("."))
        candidates = [below.with_suffix(".py"), below / "__init__.py"]
        candidates += [below / f"{name}.py" for name in re.findall(r"\w+", names)]
        found += [each for each in candidates if each.is_file()]
    return tuple(found)


def _clear_others(folder: Path) -> None:
    """Remove what was compiled from other sources of the same file."""
    if not folder.exists() and folder.parent.exists():
        for other in folder.parent.glob(f"{_PREFIX}*"):
            shutil.rmtree(other, ignore_errors=True)

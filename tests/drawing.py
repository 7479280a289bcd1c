"""Drawings made by Gmsh's OpenCASCADE for tests of what is read."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any


def drawn(gmsh: Any, file: Path, build: Callable[[Any], object], names: tuple[str, ...] = ()) -> Path:
    """A file of what `build` makes in OpenCASCADE's model; in STEP, its solids of these names in their order."""
    gmsh.initialize(["drawing", "-v", "0"], readConfigFiles=False, interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        build(gmsh.model.occ)
        gmsh.model.occ.synchronize()
        gmsh.write(str(file))
    finally:
        gmsh.finalize()
    if names:
        text = file.read_text(encoding="latin-1")
        for number, name in enumerate(names, start=1):
            text = re.sub(rf"PRODUCT\('[^']* \d+\.{number}',\s*'[^']*'", f"PRODUCT('{name}','{name}'", text)
        file.write_text(text, encoding="latin-1")
    return file

"""What the tests of studies share: a study as a module, and what it finds at smoke size, once for all tests."""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from fem_biobot.mesh.geometry import GmshMissing

STUDIES = Path(__file__).resolve().parent.parent.parent / "studies"


@cache
def load_study(name: str) -> ModuleType:
    """A study as a module, from its file."""
    spec = importlib.util.spec_from_file_location(f"studies_{name}", STUDIES / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # dataclasses look their module up
    spec.loader.exec_module(module)
    return module


@cache
def smoke_of(name: str) -> Any:
    """What a study finds at smoke size; not to be changed."""
    try:
        return load_study(name).run("smoke")
    except GmshMissing as missing:
        pytest.skip(f"Gmsh cannot start: {missing}")


def refuses(expect: Callable[[], None], word: str) -> None:
    """That an expectation fails, with a word that tells which."""
    with pytest.raises(AssertionError, match=word):
        expect()

"""Numba gets a folder to cache in on every machine."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from fem_biobot import compile_cache


def test_a_machine_without_a_writable_folder_gets_a_temporary_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where neither package nor home can be written to, NUMBA_CACHE_DIR points below the temporary folder.

    Catches: leaving numba to refuse to load.
    """
    monkeypatch.setenv("NUMBA_CACHE_DIR", "restored afterwards")
    monkeypatch.delenv("NUMBA_CACHE_DIR")
    monkeypatch.setattr(compile_cache, "_writable", lambda folder: False)
    compile_cache.ensure_cache_folder()
    assert "fem_biobot_kernels" in os.environ["NUMBA_CACHE_DIR"]


def test_a_usual_machine_is_left_alone(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """A writable home, even one whose cache folder is not made yet, needs no help; a user's choice is kept.

    Catches: moving every cache to the temporary folder, overriding the user.
    """
    monkeypatch.setenv("NUMBA_CACHE_DIR", "restored afterwards")
    monkeypatch.delenv("NUMBA_CACHE_DIR")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "not" / "yet"))
    compile_cache.ensure_cache_folder()
    assert "NUMBA_CACHE_DIR" not in os.environ
    monkeypatch.setenv("NUMBA_CACHE_DIR", "mine")
    compile_cache.ensure_cache_folder()
    assert os.environ["NUMBA_CACHE_DIR"] == "mine"

"""The rods' kernels are compiled before they are needed, and that is said where it takes time."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import pytest

from fem_biobot.rod import compiling
from fem_biobot.rod.address.kernels import by_address, entry
from fem_biobot.rod.compiling import cached, compile_kernels
from fem_biobot.rod.dynamics.integrate import Integrator


class Told:
    """What a listener is told."""

    def __init__(self) -> None:
        self.words: list[str] = []

    def stage(self, name: str, total: int | None = None) -> None:
        self.words.append(name)

    def advance(self, done: str = "") -> None:
        self.words.append(done)


@pytest.mark.parametrize("integrator", list(Integrator))
def test_compilation_is_told_only_where_it_happens(integrator: Integrator, monkeypatch: pytest.MonkeyPatch) -> None:
    """Silent where the cache holds all; else what is compiled, and that it is done.

    Catches: a long silence on a new machine, a message in every run.
    """
    compile_kernels(Told(), integrator)
    assert cached(integrator)
    again = Told()
    compile_kernels(again, integrator)
    assert again.words == []
    monkeypatch.setattr(compiling, "cached", lambda which: False)
    compile_kernels(again, integrator)
    assert len(again.words) == 2
    assert f"compiling the kernels of {integrator} time steps" in again.words[0]


def test_kernels_are_told_by_their_sources_and_not_by_the_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A folder of these sources without the kernel is none, one with it is one, whenever the source was written.

    Catches: a cache of an earlier version taken for this one, kernels called missing because a file was checked out.
    """
    compile_kernels(Told())
    kernel = compiling.run_kernels.implicit_run
    if not hasattr(kernel, "stats"):
        pytest.skip("kernels are not compiled")

    class Elsewhere:
        stats: Any = type("Stats", (), {"cache_path": str(tmp_path)})

    monkeypatch.setattr(compiling.run_kernels, "implicit_run", Elsewhere)
    assert not cached()
    index = tmp_path / "kernels.implicit_run-1.py311.nbi"
    index.touch()
    os.utime(index, (0.0, 0.0))
    assert cached()


def test_what_is_not_compiled_is_called_as_it_is() -> None:
    """Without numba's compiler kernels are plain functions. Catches: an address asked of a function without one."""

    def plain(a: float) -> float:
        return 2.0 * a

    assert by_address(plain, 1.0) is plain
    assert entry(plain, 1.0)(3.0) == 6.0

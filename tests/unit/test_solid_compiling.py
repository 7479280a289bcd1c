"""The solid's kernels are compiled before they are needed, those of the mixed element where it is asked for."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from fem_biobot.solid import compiling
from fem_biobot.solid.compiling import cached, compile_kernels


class Told:
    """What a listener is told."""

    def __init__(self) -> None:
        self.words: list[str] = []

    def stage(self, name: str, total: int | None = None) -> None:
        self.words.append(name)

    def advance(self, done: str = "") -> None:
        self.words.append(done)


@pytest.mark.parametrize(("element", "sliding"), [("P2", False), ("P2-P1", False), ("P2", True)])
def test_compilation_is_told_only_where_it_happens(
    element: str, sliding: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Silent where the cache holds all that the element needs; else what is compiled, and that it is done.

    Catches: a kernel that the small solve does not reach (then every run says that it compiles), a silent first run.
    """
    compile_kernels(Told(), element, sliding=sliding)
    assert cached(element, sliding=sliding)
    again = Told()
    compile_kernels(again, element, sliding=sliding)
    assert again.words == []
    monkeypatch.setattr(compiling, "cached", lambda which, *, sliding: False)
    compile_kernels(again, element, sliding=sliding)
    assert [word[:21] for word in again.words] == ["compiling the kernels", "kernels compiled"]


def test_kernels_of_the_mixed_element_are_asked_for_with_it_only(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Catches: a displacement run that waits for kernels it does not use; a mixed run that takes old ones."""
    compile_kernels(Told(), "P2-P1")
    if not hasattr(compiling.mixed_kernels.coupling, "stats"):
        pytest.skip("kernels are not compiled")

    class Elsewhere:
        stats: Any = type("Stats", (), {"cache_path": str(tmp_path)})

    monkeypatch.setattr(compiling.mixed_kernels, "coupling", Elsewhere)
    assert cached()
    assert not cached("P2-P1")

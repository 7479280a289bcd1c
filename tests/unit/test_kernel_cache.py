"""Compiled kernels follow their sources, those of the kernels that they call included."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from fem_biobot import kernel_cache
from fem_biobot.friction.kernels import solve_friction
from fem_biobot.rod.dynamics.kernels import try_step
from tests.command import ROOT, environment


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A package in which `outer` calls `inner`, which takes a number from a module of a folder."""
    root = tmp_path / "fem_biobot"
    (root / "folder").mkdir(parents=True)
    (root / "outer.py").write_text("import numpy\nfrom fem_biobot.inner import (\n    twice,\n    thrice,\n)\n")
    (root / "inner.py").write_text("from fem_biobot.folder import numbers\n")
    (root / "folder" / "numbers.py").write_text("N = 1\n")
    (root / "alone.py").write_text("N = 1\n")
    monkeypatch.setattr(kernel_cache, "_PACKAGE", root)
    _forget()
    yield root
    _forget()


def _forget() -> None:
    for cached in (kernel_cache.digest, kernel_cache._text, kernel_cache._imported):
        cached.cache_clear()


@pytest.mark.parametrize("edited", ["outer.py", "inner.py", "folder/numbers.py"])
def test_an_edit_anywhere_below_is_seen(package: Path, edited: str) -> None:
    """A kernel's digest changes with every file that it takes from, and with no other.

    Catches: stale machine code after an update (numba's own stamp is of one file); recompiling for nothing.
    """
    before = kernel_cache.digest(package / "outer.py")
    (package / "alone.py").write_text("N = 3\n")
    _forget()
    assert kernel_cache.digest(package / "outer.py") == before
    (package / edited).write_text((package / edited).read_text() + "# edited\n")
    _forget()
    assert kernel_cache.digest(package / "outer.py") != before


def test_kernels_are_kept_in_a_folder_of_their_sources() -> None:
    """Kernels of this package are found by their digest; the folder of the kernel below is in the closure of the other.

    Catches: a locator that numba does not ask.
    """
    for kernel in (try_step, solve_friction):
        source = Path(kernel.py_func.__code__.co_filename).resolve()
        assert Path(kernel.stats.cache_path).name == f"built-{kernel_cache.digest(source)[:16]}"
    friction = Path(solve_friction.py_func.__code__.co_filename).resolve()
    run = friction.parent.parent / "rod" / "dynamics" / "run" / "kernels.py"
    assert friction.parent / "dense" / "kernels.py" in kernel_cache._closure(friction)
    assert Path(try_step.py_func.__code__.co_filename).resolve() in kernel_cache._closure(run)


def test_kernels_of_others_are_left_to_numba(tmp_path: Path) -> None:
    """A function from elsewhere is not ours to place.

    Catches: files of ours in other packages' folders.
    """
    assert kernel_cache.KernelLocator.from_function(_forget, str(tmp_path / "kernels.py")) is None


def test_what_older_sources_left_is_removed(tmp_path: Path) -> None:
    """Making a new folder removes those of other digests, and nothing else; an existing one removes nothing.

    Catches: a cache that grows with every update, machine code of a kernel in use removed.
    """
    for name in ("built-0000", "built-1111", "keep"):
        (tmp_path / name).mkdir()
    kernel_cache._clear_others(tmp_path / "built-1111")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["built-0000", "built-1111", "keep"]
    kernel_cache._clear_others(tmp_path / "built-2222")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["keep"]


def test_an_edited_inner_kernel_is_compiled_into_its_caller(tmp_path: Path) -> None:
    """The real chain: a caller whose own file is unchanged returns what the edited kernel below computes.

    Catches: everything above fitting together and numba doing otherwise.
    """
    root = tmp_path / "fem_biobot"
    root.mkdir()
    for name in ("__init__.py", "compile_cache.py", "kernel_cache.py"):
        text = "" if name == "__init__.py" else (ROOT / "fem_biobot" / name).read_text()
        (root / name).write_text(text)
    head = "from fem_biobot.compile_cache import ensure_cache_folder\nensure_cache_folder()\nfrom numba import njit\n"
    below = head + "@njit(cache=True)\ndef scaled(x):\n    return {} * x\n"
    (root / "inner.py").write_text(below.format(2.0))
    (root / "outer.py").write_text(
        head + "from fem_biobot.inner import scaled\n@njit(cache=True)\ndef more(x):\n    return scaled(x) + 1.0\n"
    )
    code = "import json; from fem_biobot.outer import more; n = more(3.0); s = more.stats; "
    code += "print(json.dumps([n, sum(s.cache_hits.values())]))"

    def called() -> list[float]:
        done = subprocess.run(
            [sys.executable, "-c", code], cwd=tmp_path, env=environment(PYTHONPATH=str(tmp_path)), capture_output=True
        )
        assert done.returncode == 0, done.stderr.decode()
        return json.loads(done.stdout)

    assert called() == [7.0, 0]
    assert called() == [7.0, 1]
    (root / "inner.py").write_text(below.format(5.0))
    assert called() == [16.0, 0]

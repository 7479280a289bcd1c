"""Files appear whole or not at all, and every failure is one line that names the file."""

from __future__ import annotations

import errno
import json
import os
from pathlib import Path

import numpy as np
import pytest

from fem_biobot.errors import DiskError, FileError
from fem_biobot.files import file_error, replacing, write_bytes, write_json, write_text


def names(folder: Path) -> list[str]:
    return sorted(p.name for p in folder.iterdir())


def fail_half_way(path: Path, error: BaseException) -> None:
    with replacing(path) as temporary:
        temporary.write_text("half of the n")
        assert temporary.parent == path.parent
        assert temporary.suffix == path.suffix
        raise error


def test_what_is_written_is_read_back_and_nothing_else_is_left(tmp_path: Path) -> None:
    """Catches: the temporary file not moved, newlines translated, a text encoding of the platform."""
    write_text(tmp_path / "a.txt", "Größe\n1 µJ\n")
    write_bytes(tmp_path / "b.bin", b"\x00\r\n\xff")
    assert (tmp_path / "a.txt").read_bytes() == "Größe\n1 µJ\n".encode()
    assert (tmp_path / "b.bin").read_bytes() == b"\x00\r\n\xff"
    assert names(tmp_path) == ["a.txt", "b.bin"]


@pytest.mark.parametrize("error", [ValueError("half-way"), KeyboardInterrupt()])
def test_a_failure_half_way_leaves_the_old_file_and_no_piece(tmp_path: Path, error: BaseException) -> None:
    """Catches: writing in place, cleaning up on Exception only (Ctrl-C would leave the temporary file)."""
    path = tmp_path / "summary.json"
    write_text(path, "old")
    with pytest.raises(type(error)):
        fail_half_way(path, error)
    assert path.read_text() == "old"
    assert names(tmp_path) == ["summary.json"]


@pytest.mark.parametrize("code", [errno.ENOSPC, errno.EDQUOT])
def test_a_full_disk_is_a_disk_error_and_exit_code_3(tmp_path: Path, code: int) -> None:
    """Catches: ENOSPC reported as wrong input (exit code 2)."""
    path = tmp_path / "solid.vtu"
    with pytest.raises(DiskError, match=r"solid\.vtu") as caught:
        fail_half_way(path, OSError(code, os.strerror(code)))
    assert caught.value.exit_code == 3
    assert "\n" not in str(caught.value)
    assert names(tmp_path) == []


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_the_operating_system_itself_says_the_disk_is_full(tmp_path: Path) -> None:
    """Catches: translating only errors that a test raises by hand."""
    with pytest.raises(DiskError, match=r"a\.txt.*whole"), replacing(tmp_path / "a.txt"):
        Path("/dev/full").write_text("x")


def test_a_folder_that_is_none_is_refused(tmp_path: Path) -> None:
    """Catches: NotADirectoryError, IsADirectoryError or FileNotFoundError passing through as a traceback."""
    write_text(tmp_path / "file", "x")
    (tmp_path / "folder").mkdir()
    for path in (tmp_path / "file" / "a.json", tmp_path / "missing" / "a.json", tmp_path / "folder"):
        with pytest.raises(FileError, match=path.name) as caught:
            write_text(path, "x")
        assert caught.value.exit_code == 2
        assert not isinstance(caught.value, DiskError)
    assert names(tmp_path) == ["file", "folder"]


def test_permission_denied_is_wrong_input() -> None:
    """Catches: PermissionError counted as a failing disk."""
    error = file_error(PermissionError(errno.EACCES, "Permission denied"), "out/summary.json")
    assert type(error) is FileError
    assert str(error) == "out/summary.json: cannot write: Permission denied"


def test_a_block_that_writes_nothing_is_refused(tmp_path: Path) -> None:
    """Catches: success reported for a file that is not there."""
    with pytest.raises(FileError, match=r"a\.png"), replacing(tmp_path / "a.png"):
        pass


def test_json_takes_numpy_and_keeps_the_order_of_keys(tmp_path: Path) -> None:
    """Catches: numpy scalars refused, float32 rounding, keys sorted."""
    value = {"z_mm": np.float64(0.1), "a_1": np.int64(3), "path": Path("x/y"), "v_mm": np.array([1.5, 2.5]), "n": None}
    write_json(tmp_path / "a.json", value)
    back = json.loads((tmp_path / "a.json").read_text())
    assert back == {"z_mm": 0.1, "a_1": 3, "path": str(Path("x/y")), "v_mm": [1.5, 2.5], "n": None}
    assert list(back) == list(value)


@pytest.mark.parametrize("bad", [float("nan"), np.array([np.inf]), object()])
def test_json_refuses_what_json_cannot_say(tmp_path: Path, bad: object) -> None:
    """Catches: NaN written as a bare word, which no JSON reader takes."""
    with pytest.raises(FileError, match=r"a\.json.*JSON"):
        write_json(tmp_path / "a.json", {"x": bad})
    assert names(tmp_path) == []

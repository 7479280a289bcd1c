"""Writing of files so that a file that exists is whole.

Everything goes to a temporary name in the same folder, reaches the disk, and is then moved over the final name. What
fails half-way, an interrupt included, leaves neither a piece nor a temporary file behind, and what stood there before
still stands. Imports nothing of the package but its errors.
"""

from __future__ import annotations

import errno
import json
import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from fem_biobot.errors import BiobotError, DiskError, FileError

_DISK = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO})


def file_error(error: OSError, path: str | os.PathLike[str], *, doing: str = "write") -> FileError:
    """The package's error for an operating-system error, in one line that names the file.

    Parameters
    ----------
    error
        What the operating system said.
    path
        The file that the user knows of, not its temporary twin.
    doing
        The verb of the message.

    Returns
    -------
    FileError
        A `DiskError` where the disk is full, over quota or failing; a `FileError` otherwise.
    """
    reason = error.strerror or type(error).__name__
    if error.errno in _DISK:
        return DiskError(f"{path}: cannot {doing}: {reason}; what was whole before is still whole")
    return FileError(f"{path}: cannot {doing}: {reason}")


@contextmanager
def replacing(path: str | os.PathLike[str]) -> Iterator[Path]:
    """A temporary path that becomes `path` when the block ends well, and vanishes when it does not.

    Parameters
    ----------
    path
        Where the file shall be. Its folder must exist.

    Yields
    ------
    Path
        A name in the same folder, hidden, with the same suffix; the block writes it.

    Raises
    ------
    DiskError
        The disk is full.
    FileError
        The folder is missing or not writable, or `path` is a folder, or the block wrote nothing.
    """
    path = Path(path)
    temporary = path.with_name(f".{path.stem}.{os.getpid()}-{secrets.token_hex(4)}{path.suffix}")
    try:
        yield temporary
        _sync(temporary)
        temporary.replace(path)
    except BiobotError:
        raise
    except OSError as error:
        raise file_error(error, path) from error
    finally:
        # after the move there is nothing left to remove; BaseException (Ctrl-C) passes here too
        with suppress(OSError):
            temporary.unlink()
    with suppress(OSError):  # some file systems cannot sync a folder; the move itself is done
        _sync(path.parent)


def _sync(path: Path) -> None:
    """Force a file's content, or a folder's list of names, to the disk."""
    if os.name == "nt" and path.is_dir():
        return
    handle = os.open(path, os.O_RDWR if os.name == "nt" else os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def write_bytes(path: str | os.PathLike[str], data: bytes) -> None:
    """Write `data` to `path`, whole or not at all; refuses as `replacing` does."""
    with replacing(path) as temporary:
        temporary.write_bytes(data)


def write_text(path: str | os.PathLike[str], text: str) -> None:
    """Write `text` to `path` in UTF-8 with newlines as they stand, whole or not at all; refuses as `replacing` does."""
    write_bytes(path, text.encode("utf-8"))


def write_json(path: str | os.PathLike[str], obj: object) -> None:
    """Write `obj` to `path` as indented JSON, whole or not at all.

    Parameters
    ----------
    path
        Where the file shall be.
    obj
        Mappings, sequences, numbers and text; numpy scalars and arrays become numbers and lists. Keys keep their order.

    Raises
    ------
    FileError
        `obj` holds something that JSON cannot say (NaN and infinity included: they are not JSON), or as `replacing`.
    """
    try:
        text = json.dumps(obj, indent=2, ensure_ascii=False, allow_nan=False, default=_plain)
    except (TypeError, ValueError) as error:
        raise FileError(f"{path}: cannot be written as JSON: {error}") from error
    write_text(path, text + "\n")


def _plain(value: object) -> object:
    """Numbers and lists for numpy's scalars and arrays, text for paths."""
    tolist = getattr(value, "tolist", None)
    if tolist is not None:
        return tolist()
    if isinstance(value, Path):
        return str(value)
    raise TypeError(f"no JSON form for {type(value).__name__}")

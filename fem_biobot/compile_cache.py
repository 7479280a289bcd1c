"""Where numba keeps compiled kernels: next to the package, in the user's cache folder, or for want of both in a
temporary folder. Imported before numba, which refuses to load where it finds no folder to write to. What was compiled
is told by all its sources (`kernel_cache`).
"""

from __future__ import annotations

import os
import tempfile
from pathlib import Path
from typing import Any

# Options of kernels that other kernels alone call: without the wrappers for Python and C they compile faster. Those
# called by address keep the wrapper for C.
KERNEL: dict[str, Any] = {"cache": True, "nogil": True}
BY_ADDRESS: dict[str, Any] = {**KERNEL, "no_cpython_wrapper": True}
INNER: dict[str, Any] = {**BY_ADDRESS, "no_cfunc_wrapper": True}
# Small kernels that allocate nothing use what their caller holds, and need not count references to arrays: counting
# took a third of the time of the rods' dynamics, where tuples of arrays are passed down and rows of arrays are taken.
# A kernel without either inherits its caller's, so those that allocate say so.
BORROWS: dict[str, Any] = {"_nrt": False}
ALLOCATES: dict[str, Any] = {"_nrt": True}


def ensure_cache_folder() -> None:
    """Give numba a temporary folder where it has no writable one of its own, and our way to tell kernels apart."""
    _choose_folder()
    from fem_biobot.kernel_cache import install

    install()


def _choose_folder() -> None:
    if os.environ.get("NUMBA_CACHE_DIR"):
        return
    package = Path(__file__).resolve().parent
    home = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    if any(_writable(folder) for folder in (package, home)):
        return
    os.environ["NUMBA_CACHE_DIR"] = str(Path(tempfile.gettempdir()) / f"fem_biobot_kernels_{os.getuid()}")


def _writable(folder: Path) -> bool:
    """Whether a file could be made in the folder or, if it does not exist, in the nearest one above it."""
    while not folder.exists():
        folder = folder.parent
    return os.access(folder, os.W_OK | os.X_OK)

"""What of the program works on this machine, what is used instead of what, and the commands that bring the rest.

Every part is tried and not only looked up: modules are imported, the renderer draws a triangle in its child process.
"""

from __future__ import annotations

import importlib
import os
import platform
import re
import shutil
import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from importlib import metadata
from pathlib import Path
from typing import Any, Literal

from fem_biobot.tables import Table

Status = Literal["ok", "instead", "low", "missing"]

PYTHON_RANGE = (3, 11), (3, 14)
# distribution to module: what every run needs
NEEDED = {
    "numpy": "numpy",
    "scipy": "scipy",
    "scikit-fem": "skfem",
    "meshio": "meshio",
    "pydantic": "pydantic",
    "pint": "pint",
    "matplotlib": "matplotlib",
}
# Debian and Ubuntu packages of the shared libraries that wheels expect from the system
PACKAGES = {
    "libGLU": "libglu1-mesa",
    "libGL": "libgl1",
    "libXcursor": "libxcursor1",
    "libXft": "libxft2",
    "libXinerama": "libxinerama1",
    "libgomp": "libgomp1",
    "libXrender": "libxrender1",
    "libX11": "libx11-6",
    "libXext": "libxext6",
    "libSM": "libsm6",
    "libICE": "libice6",
    "libXfixes": "libxfixes3",
    "libEGL": "libegl1",
    "libOSMesa": "libosmesa6",
    "libfontconfig": "libfontconfig1",
}
OFFSCREEN = "libosmesa6"
# a default run of the reference machine stays below these [bytes]
MEMORY, DISK = 2 * 10**9, 2 * 10**8


@dataclass(frozen=True)
class Part:
    """One part of the program or of the machine.

    Attributes
    ----------
    name
        What it is.
    status
        ``ok``; ``instead``: something else does its work; ``low``: there, but scarce; ``missing``: nothing can run.
    found
        Version, place, or what is used instead and why.
    system, python
        Debian packages, and arguments of pip, that bring what is missing.
    command
        A command of another kind that does.
    """

    name: str
    status: Status
    found: str
    system: tuple[str, ...] = ()
    python: tuple[str, ...] = ()
    command: str = ""


def examine(folder: Path | None = None) -> list[Part]:
    """Try every part; results would be written below `folder` (the current one by default)."""
    checks: list[tuple[str, Callable[[], Part]]] = [("Python", _python)]
    checks += [(name, lambda name=name, module=module: _module(name, module)) for name, module in NEEDED.items()]
    checks += [("numba", _numba), ("linear solver", _linear_solver), ("Gmsh", _gmsh), ("renderer", _renderer)]
    checks += [("presets", _presets), ("threads", _threads), ("memory", _memory)]
    checks += [("disk", lambda: _disk(folder or Path()))]
    return [_tried(name, check) for name, check in checks]


def works(parts: Sequence[Part]) -> bool:
    """Whether the program can run, with whatever it uses instead."""
    return all(part.status != "missing" for part in parts)


def commands(parts: Sequence[Part]) -> list[str]:
    """The commands that bring all that is missing: one for system libraries, one for Python packages, others."""
    system = list(dict.fromkeys(package for part in parts for package in part.system))
    python = list(dict.fromkeys(package for part in parts for package in part.python))
    found = [f"apt-get install -y {' '.join(system)}"] if system else []
    if python:
        found.append(f"{sys.executable} -m pip install {' '.join(python)}")
    return found + list(dict.fromkeys(part.command for part in parts if part.command))


def verdict(parts: Sequence[Part]) -> list[str]:
    """Lines that say whether the program runs, and what to do for the rest."""
    broken = [part.name for part in parts if part.status == "missing"]
    replaced = [part.name for part in parts if part.status == "instead"]
    if broken:
        lines = [f"Runs will fail: {', '.join(broken)} missing."]
    elif replaced:
        lines = [f"Runs will work, with something else in place of: {', '.join(replaced)}."]
    else:
        lines = ["Everything is there."]
    told = commands(parts)
    if told:
        lines += ["To bring what is missing (apt-get as root):", *(f"  {command}" for command in told)]
    return lines


def table(parts: Sequence[Part]) -> Table:
    """The parts as a table."""
    return Table("", ("part", "state", "found"), tuple((p.name, p.status, p.found) for p in parts))


def as_json(parts: Sequence[Part]) -> dict[str, Any]:
    """The same for programs."""
    return {"works": works(parts), "commands": commands(parts), "parts": [asdict(part) for part in parts]}


def _tried(name: str, check: Callable[[], Part]) -> Part:
    """Result of a check; what it raises is a part that is missing, since a doctor must not fall ill itself."""
    try:
        return check()
    except Exception as error:
        return Part(name, "missing", f"cannot be examined: {_why(error)}")


def _why(error: BaseException) -> str:
    lines = str(error).strip().splitlines()
    return f"{type(error).__name__}: {lines[0][:200]}" if lines else type(error).__name__


def _version(distribution: str) -> str:
    try:
        return metadata.version(distribution)
    except metadata.PackageNotFoundError:
        return "of unknown version"


def _libraries(text: str) -> tuple[str, ...]:
    """Packages of the shared libraries that a message names."""
    found = [PACKAGES.get(name) for name in re.findall(r"(lib[A-Za-z0-9_]+?)(?:-[\d.]+)?\.so", text)]
    return tuple(package for package in found if package)


def _python() -> Part:
    found = f"{platform.python_version()} on {platform.system()} {platform.machine()}"
    low, high = PYTHON_RANGE
    if low <= sys.version_info[:2] < high:
        return Part("Python", "ok", found)
    expected = f"{low[0]}.{low[1]} to {high[0]}.{high[1] - 1}"
    return Part("Python", "missing", f"{found}, expected {expected}")


def _module(name: str, module: str) -> Part:
    try:
        importlib.import_module(module)
    except ModuleNotFoundError as error:
        return Part(name, "missing", f"no module named {error.name}", python=(name,))
    except Exception as error:
        again = () if _libraries(str(error)) else ("--force-reinstall", name)
        return Part(name, "missing", _why(error), _libraries(str(error)), again)
    return Part(name, "ok", _version(name))


def _numba() -> Part:
    try:
        from fem_biobot.solid import kernels
        from fem_biobot.solid.compiling import cached
    except ModuleNotFoundError as error:
        return Part("numba", "missing", f"no module named {error.name}", python=("numba",))
    except RuntimeError as error:
        # numba refuses to keep compiled kernels where no folder for them can be written
        place = Path(tempfile.gettempdir()) / "fem_biobot_kernels"
        return Part("numba", "missing", _why(error), command=f"export NUMBA_CACHE_DIR={place}")
    version = _version("numba")
    stats: Any = getattr(kernels.tangent, "stats", None)
    if stats is None:
        return Part("numba", "instead", f"{version}, switched off by NUMBA_DISABLE_JIT: plain Python, very slow")
    state = "holds the compiled kernels" if cached() else "the first run compiles the kernels, which takes a while"
    return Part("numba", "ok", f"{version}, cache {stats.cache_path} ({state})")


def _linear_solver() -> Part:
    from fem_biobot.solid.linear import pardiso_missing

    reason = pardiso_missing()
    if reason is None:
        return Part("linear solver", "ok", f"PARDISO of MKL {_version('mkl')} (pypardiso {_version('pypardiso')})")
    found = f"SuperLU of SciPy instead of PARDISO, slower on large meshes ({' '.join(reason.split())})"
    offered = platform.machine().lower() in ("x86_64", "amd64") and "FEM_BIOBOT_FACTORISATION" not in reason
    return Part("linear solver", "instead", found, python=("pypardiso",) if offered else ())


def _gmsh() -> Part:
    from fem_biobot.mesh.geometry import GMSH_LIBRARIES, GmshMissing, import_gmsh

    try:
        gmsh = import_gmsh()
    except GmshMissing as missing:
        found = f"committed meshes of the presets instead ({missing.library} is missing)"
        if missing.library == "gmsh":
            # its wheel brings no libraries, so ask for them at once
            return Part("Gmsh", "instead", found, python=("gmsh",))
        return Part("Gmsh", "instead", found, tuple(GMSH_LIBRARIES.split()))
    return Part("Gmsh", "ok", str(gmsh.__version__))


def _renderer() -> Part:
    from fem_biobot.view.pictures import renderer_status

    renderer, note = renderer_status()
    if renderer == "pyvista":
        return Part("renderer", "ok", f"pyvista {_version('pyvista')}, VTK {_version('vtk')}, off-screen")
    system = (*_libraries(note), OFFSCREEN) if "apt-get" in note else ()
    python = ("pyvista",) if "pip install pyvista" in note else ()
    # the remedy is told once, for all parts together
    reason = note.partition(";")[0].removeprefix("pictures drawn by matplotlib: ")
    return Part("renderer", "instead", f"built-in renderer instead of pyvista ({reason})", system, python)


def _presets() -> Part:
    from fem_biobot.config import presets
    from fem_biobot.mesh.committed import mesh_folder

    names = ", ".join(presets())
    folder = mesh_folder()
    if folder is None:
        return Part("presets", "low", f"{names}; committed meshes not found, so Gmsh must mesh them")
    return Part("presets", "ok", f"{names}; {len(list(folder.glob('*.msh')))} committed meshes in {folder}")


def _threads() -> Part:
    try:
        usable = len(os.sched_getaffinity(0))  # type: ignore[attr-defined,unused-ignore]
    except AttributeError:  # not on this system
        usable = os.cpu_count() or 1
    limits = [f"{name} = {os.environ[name]}" for name in ("OMP_NUM_THREADS", "MKL_NUM_THREADS") if name in os.environ]
    quota = _cgroup_number("cpu.max")
    if quota is not None and quota[1]:
        limits.append(f"the container grants {quota[0] / quota[1]:.3g}")
    return Part("threads", "ok", f"{usable} usable" + (f" ({', '.join(limits)})" if limits else ""))


def _memory() -> Part:
    available = _available_memory()
    if available is None:
        return Part("memory", "ok", "not known on this system")
    text = f"{available / 1e9:.1f} GB available"
    if available < MEMORY:
        return Part("memory", "low", f"{text}, a default run takes up to {MEMORY / 1e9:g} GB: ask for a larger --size")
    return Part("memory", "ok", text)


def _available_memory() -> float | None:
    """Memory that a new process can take [bytes], by the system's book and the container's."""
    free: list[float] = []
    try:
        book = Path("/proc/meminfo").read_text(encoding="ascii")
        found = re.search(r"^MemAvailable:\s+(\d+) kB", book, re.MULTILINE)
        if found:
            free.append(1024.0 * int(found[1]))
    except OSError:
        pass  # only Linux has it
    limit, used = _cgroup_number("memory.max"), _cgroup_number("memory.current")
    if limit is not None and used is not None:
        free.append(limit[0] - used[0])
    return min(free, default=None)


def _cgroup_number(name: str) -> list[float] | None:
    """Numbers in a file of the control group; None where there is no such limit."""
    try:
        words = Path("/sys/fs/cgroup", name).read_text(encoding="ascii").split()
        return [float(word) for word in words] if words and words[0] != "max" else None
    except (OSError, ValueError):
        return None


def _disk(folder: Path) -> Part:
    free = shutil.disk_usage(folder).free
    text = f"{free / 1e9:.1f} GB free in {folder.resolve()}"
    if not os.access(folder, os.W_OK):
        return Part("disk", "low", f"{text}, which cannot be written: give --out another folder")
    if free < DISK:
        return Part("disk", "low", f"{text}, a run writes up to {DISK / 1e9:g} GB")
    return Part("disk", "ok", text)

"""Versions of what a result was made with."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError, version
from platform import python_version

_PACKAGES = ("fem_biobot", "numpy", "scipy", "scikit-fem", "meshio", "gmsh", "pyvista", "vtk", "numba", "pypardiso")


def versions() -> dict[str, str]:
    """Of Python, and of the packages that are there."""
    found = {"python": python_version()}
    for name in _PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found

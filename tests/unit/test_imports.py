"""Imports point one way: read from the source of every file of the package, inside functions too."""

from __future__ import annotations

import ast
import subprocess
import sys
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

from tests.command import ROOT, environment

PACKAGE = ROOT / "fem_biobot"

# where alone a package may be imported; a folder ends in a slash, a bare file name stands for files of that name
HOMES = {
    "gmsh": ("mesh/geometry.py",),
    "numba": ("kernels.py", "kernel_cache.py"),
    "pint": ("units.py",),
    "tomllib": ("config.py",),
    "meshio": ("mesh/files.py", "mesh/tagged.py", "vtk.py"),
    "pypardiso": ("solid/linear.py",),
    "pyvista": ("view/",),
    "vtk": ("view/",),
    "vtkmodules": ("view/",),
    "matplotlib": ("view/",),
    "skfem": ("solid/", "muscle/oxygen.py", "muscle/oxygen_depth.py", "muscle/oxygenation.py", "muscle/laplace.py"),
    "typer": ("cli.py", "options.py", "muscle_commands.py", "study_commands.py"),
    "rich": ("cli.py", "progress.py"),
    "dask": ("study/sweep_cluster.py",),
    "distributed": ("study/sweep_cluster.py",),
}
# a part of the package, and the parts that it must not know
FORBIDDEN = {
    "solid": ("link", "rod", "view", "study", "verification", "cli"),
    "rod": ("link", "solid", "view", "study", "verification", "cli"),
    "material": ("link", "solid", "rod", "mesh", "study", "view", "verification", "cli"),
    # what solid and rod both stand on knows neither
    "friction": ("link", "mesh", "solid", "rod", "material", "muscle", "study", "view", "verification", "cli"),
    "mesh": ("link", "solid", "rod", "study", "view", "verification", "cli"),
    "muscle": ("link", "solid", "rod", "study", "view", "verification", "cli"),
    "view": ("link", "solid", "rod", "study", "verification", "cli"),
    "design": ("link", "mesh", "solid", "rod", "material", "muscle", "study", "view", "verification", "cli"),
    "design_kinds": ("link", "mesh", "solid", "rod", "material", "muscle", "study", "view", "verification", "cli"),
    "design_parts": ("link", "mesh", "solid", "rod", "material", "muscle", "study", "view", "verification", "cli"),
    "design_tissue": ("link", "mesh", "solid", "rod", "material", "study", "view", "verification", "cli"),
    "design_checks": ("link", "mesh", "solid", "rod", "material", "muscle", "study", "view", "verification", "cli"),
    "design_tissue_checks": (
        "link",
        "mesh",
        "solid",
        "rod",
        "material",
        "muscle",
        "study",
        "view",
        "verification",
        "cli",
    ),
    # of the muscle it asks for angles measured in a file
    "config": ("link", "mesh", "solid", "rod", "material", "study", "view", "verification", "cli"),
    "link": ("view", "verification", "cli", "jobs", "progress"),
    "study": ("verification", "cli", "jobs", "progress"),
    "verification": ("cli", "jobs", "progress"),
}


def sources() -> list[str]:
    """Every source file of the package, relative to it."""
    return sorted(str(path.relative_to(PACKAGE)) for path in PACKAGE.rglob("*.py"))


def module_of(source: str) -> str:
    """Dotted name of a source file."""
    return ".".join(["fem_biobot", *Path(source).with_suffix("").parts]).removesuffix(".__init__")


@cache
def imports(source: str) -> frozenset[tuple[str, bool]]:
    """Modules that a file imports by dotted name, and whether at the top (checks of types left out there)."""
    tree = ast.parse((PACKAGE / source).read_text(encoding="utf-8"))
    typing_only = {
        inner
        for node in ast.walk(tree)
        if isinstance(node, ast.If) and ast.unparse(node.test) in ("TYPE_CHECKING", "typing.TYPE_CHECKING")
        for inner in ast.walk(node)
    }
    inside = {
        inner
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
        for inner in ast.walk(node)
    }
    found: set[tuple[str, bool]] = set()
    for node in ast.walk(tree):
        top = node not in inside and node not in typing_only
        if isinstance(node, ast.Import):
            found |= {(alias.name, top) for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{source}: relative import, expected the full name"
            assert node.module is not None
            found.add((node.module, top))
            # `from package import module` imports the module
            found |= {(f"{node.module}.{alias.name}", top) for alias in node.names}
    return frozenset(found)


def at_home(source: str, homes: tuple[str, ...]) -> bool:
    return any(
        source.startswith(home) if home.endswith("/") else source == home if "/" in home else Path(source).name == home
        for home in homes
    )


@pytest.mark.parametrize("package", HOMES)
def test_packages_have_homes(package: str) -> None:
    """Each outside package is imported in its home alone, so that what it costs and breaks stays there.

    Catches: gmsh imported by a solver, numba outside the kernels, rich in a study.
    """
    importers = [s for s in sources() if any(name.split(".")[0] == package for name, _ in imports(s))]
    assert [source for source in importers if not at_home(source, HOMES[package])] == []


@pytest.mark.parametrize(
    "package", ["gmsh", "numba", "pint", "tomllib", "meshio", "pypardiso", "pyvista", "typer", "rich"]
)
def test_the_reader_of_imports_sees_those_in_functions(package: str) -> None:
    """Every package with a home is found there, late imports included.

    Catches: a reader that looks at the top of files only, with which all other tests here pass in vain.
    """
    assert [s for s in sources() if any(name.split(".")[0] == package for name, _ in imports(s))]


@pytest.mark.parametrize("part", FORBIDDEN)
def test_parts_do_not_know_what_is_above_them(part: str) -> None:
    """Solid and rod share nothing but the design; descriptions know no mesh; nothing below knows the studies.

    Catches: the solid asking the rod, a law that asks the mesh, an import inside a function that hides it.
    """
    own = [s for s in sources() if Path(s).parts[0].removesuffix(".py") == part]
    for source in own:
        known = {name.split(".")[1] for name, _ in imports(source) if name.startswith("fem_biobot.")}
        assert known.isdisjoint(FORBIDDEN[part]), f"{source} imports {sorted(known & set(FORBIDDEN[part]))}"


@pytest.mark.parametrize("source", ["muscle/compaction.py", "muscle/maturation.py"])
def test_laws_that_designs_ask_for_are_numbers_alone(source: str) -> None:
    """What follows from a tissue is computed without anything of the package but its errors.

    Catches: a design that drags the solvers in.
    """
    assert {name for name, _ in imports(source) if name.startswith("fem_biobot")} <= {
        "fem_biobot.errors", "fem_biobot.errors.DesignError",
    }  # fmt: skip


@pytest.mark.parametrize("source", ["verification/beam.py", "verification/manufactured.py"])
def test_known_answers_know_nothing_of_the_package(source: str) -> None:
    """What results are compared with is computed without what it is compared with.

    Catches: an answer that calls the code under test.
    """
    assert [name for name, _ in imports(source) if name.startswith("fem_biobot")] == []


def test_verification_goes_through_public_names() -> None:
    """Cases import no name that begins with an underscore, and no kernel but for the numbers of contact's states.

    Catches: a case that is computed by an inner function instead of what a user calls.
    """
    for source in sources():
        if not source.startswith("verification/"):
            continue
        for name, _ in imports(source):
            inner = [part for part in name.split(".") if part.startswith("_")]
            assert name.startswith("__future__") or not inner, f"{source} imports {name}"
            if "kernels." in name:
                assert name.split(".")[-1] in ("STICK", "SLIP", "LIFTED"), f"{source} imports {name}"


def test_nothing_imports_the_command_line() -> None:
    """Only the module entry starts it.

    Catches: a helper of the command line used by the package.
    """
    importers = [s for s in sources() if any(name.startswith("fem_biobot.cli") for name, _ in imports(s))]
    assert importers == ["__main__.py"]


def test_there_are_no_cycles() -> None:
    """Modules can be put in an order in which each imports earlier ones only, at their tops.

    Catches: two modules that import each other, kept alive by luck of the order.
    """
    modules = {module_of(source): source for source in sources()}
    graph = {
        name: {found for found, top in imports(source) if top and found in modules and found != name}
        for name, source in modules.items()
    }
    # a package's own page is imported with each of its modules, and exports them
    graph["fem_biobot"] = set()
    try:
        list(TopologicalSorter(graph).static_order())
    except CycleError as error:
        pytest.fail(f"cycle: {' -> '.join(error.args[1])}")


def test_descriptions_load_without_the_heavy_packages() -> None:
    """A design can be read where nothing is compiled, meshed or drawn.

    Catches: a heavy import added to a description, directly or through another module.
    """
    code = (
        "import sys, fem_biobot.config; "
        "print([m for m in ('numba', 'gmsh', 'pyvista', 'skfem', 'meshio', 'matplotlib', 'typer') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], env=environment(), capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"

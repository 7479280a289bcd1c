"""Meshes that travel with the package, for machines on which Gmsh does not start.

Each is a `.msh` file with a sidecar `.json` of the same name, which says what it is a mesh of and how to know that it
is whole. They lie in the package (`_meshes`) when installed and in `meshes/` at the top of a checkout.
"""

from __future__ import annotations

import hashlib
import json
import math
from dataclasses import asdict
from pathlib import Path
from typing import Any

from fem_biobot.config import geometry_digest
from fem_biobot.design import Design, keys
from fem_biobot.errors import MeshError
from fem_biobot.files import file_error, write_json, write_text
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.mesh.geometry import GmshMissing, build_mesh, gmsh_advice
from fem_biobot.mesh.layout import layout
from fem_biobot.mesh.tagged import mesh_text, read_mesh

# what a sidecar says of how its mesh was made
_MADE = ("generator", "gmsh_version", "size_mm", "grading")


def mesh_folder() -> Path | None:
    """Folder of the committed meshes: the installed package's, else the checkout's; None if neither exists."""
    package = Path(__file__).resolve().parent.parent
    return next((f for f in (package / "_meshes", package.parent / "meshes") if f.is_dir()), None)


def mesh_for(design: Design, size: float | None = None) -> tuple[BodyMesh, list[str]]:
    """Mesh of a design, built by Gmsh or, where Gmsh cannot start, taken from the committed ones.

    Parameters
    ----------
    design, size
        As for `fem_biobot.mesh.geometry.build_mesh`.

    Returns
    -------
    BodyMesh, list of str
        The mesh, and what was used instead of what (empty if it was built).

    Raises
    ------
    MeshError
        It cannot be built, or Gmsh is missing and no committed mesh has this geometry.
    """
    try:
        return build_mesh(design, size), []
    except GmshMissing as missing:
        mesh = committed_mesh(design, size)
        advice = gmsh_advice(missing.library)
        if mesh is None:
            raise MeshError(
                f"Gmsh cannot start ({missing.library} is missing) and no committed mesh has this geometry; {advice}, "
                f"or give a mesh file"
            ) from missing
        asked = design.mesh.size if size is None else size
        plan = layout(design)
        coarse = (
            "; along the pillars' edges it is coarse, and loose rings overlap them" if plan.edge_share < 1.0 else ""
        )
        note = (
            f"Gmsh cannot start ({missing.library} is missing): the committed mesh {mesh.source['file']} of size "
            f"{mesh.source['size_mm']:g} mm, grading {mesh.source['grading']}, was used for the size {asked:g} mm, "
            f"grading {plan.grading}, asked for{coarse}; {advice}"
        )
        return mesh, [note]


def committed_mesh(design: Design, size: float | None = None, *, folder: Path | None = None) -> BodyMesh | None:
    """The committed mesh of a design's geometry whose size is nearest, however graded, or None if there is none.

    Raises
    ------
    MeshError, FileError
        There is one, but it is not what its sidecar says.
    """
    folder = folder or mesh_folder()
    if folder is None:
        return None
    wanted = geometry_digest(design)
    asked = design.mesh.size if size is None else size
    fitting = []
    for path in sorted(folder.glob("*.json")):
        about = _sidecar(path)
        if about["geometry_digest"] == wanted:
            fitting.append((abs(math.log(about["size_mm"] / asked)), path, about))
    if not fitting:
        return None
    _, path, about = min(fitting, key=lambda entry: entry[:2])
    file = path.with_suffix(".msh")
    try:
        content = file.read_bytes()
    except OSError as error:
        raise file_error(error, file, doing="read") from None
    if hashlib.sha256(content).hexdigest() != about["sha256"]:
        raise MeshError(f"{file}: the file is not the one that its sidecar {path.name} describes")
    mesh = read_mesh(file, design=design)
    source = {key: about[key] for key in _MADE}
    parts = mesh.points, mesh.cells, mesh.regions, mesh.surfaces, mesh.landmarks
    return BodyMesh(*parts, {"file": file.name, "committed": True, **source})


def write_committed(folder: Path, name: str, design: Design, mesh: BodyMesh) -> Path:
    """Write a mesh and its sidecar as `name` into `folder`; the path of the mesh."""
    path = folder / f"{name}.msh"
    text = mesh_text(mesh)
    write_text(path, text)
    write_json(path.with_suffix(".json"), sidecar(design, mesh, text))
    return path


def sidecar(design: Design, mesh: BodyMesh, text: str) -> dict[str, Any]:
    """What a sidecar says of the mesh whose file holds `text`."""
    lengths = {
        f"{name}_mm": design.value(name)
        for name, key in keys().items()
        if name.startswith(("skeleton.", "muscle.")) and key.quantity is not None and key.quantity.unit == "mm"
    }
    counts = {
        "vertices": mesh.n_vertices,
        "elements": {name: int(elements.size) for name, elements in mesh.regions.items()},
        "facets": {name: int(triples.shape[1]) for name, triples in mesh.surfaces.items()},
        "displacement_unknowns_P2": mesh.n_unknowns,
    }
    return {
        "design": design.name,
        "kind": design.kind,
        "geometry_digest": geometry_digest(design),
        "parameters": {name: value for name, value in lengths.items() if value is not None},
        **{key: mesh.source[key] for key in _MADE},
        "counts": counts,
        "volumes_mm3": mesh.region_volumes(),
        "quality": asdict(mesh.quality()),
        "sha256": hashlib.sha256(text.encode()).hexdigest(),
    }


def _sidecar(path: Path) -> dict[str, Any]:
    try:
        about = json.loads(path.read_text(encoding="utf-8"))
        missing = {"geometry_digest", "sha256", *_MADE} - set(about)
        if missing or not about["size_mm"] > 0:
            raise ValueError(f"expected {', '.join(sorted(missing)) or 'a positive size'}")
    except OSError as error:
        raise file_error(error, path, doing="read") from None
    except (ValueError, KeyError, TypeError) as error:
        raise MeshError(f"{path}: this is no sidecar of a mesh: {error}") from None
    return about

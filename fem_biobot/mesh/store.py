"""A folder of meshes made once and shared by all results of equal geometry and size."""

from __future__ import annotations

from pathlib import Path

from fem_biobot.config import geometry_digest
from fem_biobot.design import Design
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.mesh.committed import mesh_for
from fem_biobot.mesh.layout import layout
from fem_biobot.mesh.tagged import read_mesh, write_mesh


def stored_file(design: Design, folder: Path) -> Path:
    """File of a design's mesh in a store: named by what shapes it, and by nothing else."""
    grading = layout(design).grading
    graded = "" if grading == "even" else f"_{grading}"
    return folder / f"{geometry_digest(design)}_{design.mesh.size!r}mm{graded}.msh"


def stored_mesh(design: Design, folder: Path) -> tuple[BodyMesh, list[str]]:
    """Mesh of a design from a store, made and put there if it is not yet.

    Parameters
    ----------
    design
        As for `mesh_for`.
    folder
        The store; it must exist.

    Returns
    -------
    BodyMesh, list of str
        As of `mesh_for`. Always as read from the file, so that whoever made it has the mesh that the others have. A
        mesh that was used instead of the one asked for is not stored: its note would be lost.

    Raises
    ------
    MeshError, FileError
        It cannot be built, read or written.
    """
    file = stored_file(design, folder)
    if not file.exists():
        mesh, notes = mesh_for(design)
        if notes:
            return mesh, notes
        write_mesh(file, mesh)
    return read_mesh(file, design=design), []

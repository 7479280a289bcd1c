"""Where meshes come from and go to: a person's files, the committed ones, and the choice between these and Gmsh."""

from __future__ import annotations

from fem_biobot.mesh.committed import committed_mesh, mesh_for
from fem_biobot.mesh.own_shape import shape_notes
from fem_biobot.mesh.tagged import read_mesh, write_mesh

__all__ = ["committed_mesh", "mesh_for", "read_mesh", "shape_notes", "write_mesh"]

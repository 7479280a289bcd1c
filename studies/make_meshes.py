"""Regenerate the committed meshes of the presets.

Question: which meshes travel with the package, and are they those that the present geometry gives?
Run: ``python studies/make_meshes.py [FOLDER]`` (default: ``meshes/``). The same Gmsh version gives the same files.
"""

from __future__ import annotations

import sys
from pathlib import Path

from fem_biobot.config import load_design
from fem_biobot.mesh.committed import write_committed
from fem_biobot.mesh.geometry import build_mesh

# preset to the general element sizes [mm] of its meshes; medium is the size of the preset
SIZES = {
    "junction_bot": {"small": 2.0, "medium": 0.9, "fine": 0.55},
    "ring_bot": {"small": 1.0, "medium": 0.5},
    "strip": {"small": 0.8, "medium": 0.4},
    "cantilever": {"small": 1.4, "medium": 0.7},
}


def run(folder: Path) -> None:
    """Write every mesh and its sidecar into `folder`, and a line about each."""
    for preset, sizes in SIZES.items():
        design = load_design(preset)
        for label, size in sizes.items():
            mesh = build_mesh(design, size)
            path = write_committed(folder, f"{preset}_{label}", design, mesh)
            quality = mesh.quality()
            print(
                f"{path.name:26s} size {size:4.2f} mm  {mesh.n_vertices:5d} vertices {mesh.n_elements:6d} elements "
                f"{mesh.n_unknowns:6d} unknowns  radius ratio min {quality.minimum:.3f} mean {quality.mean:.3f}"
            )


if __name__ == "__main__":
    run(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).resolve().parent.parent / "meshes")

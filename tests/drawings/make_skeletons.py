"""Draw the reference skeleton with tools that share nothing with this package: python tests/drawings/make_skeletons.py

Needs an environment of its own with cadquery, trimesh and manifold3d (versions in the sidecar). Lengths are those of
the preset junction_bot, written out. The STEP file is in the design's frame and in mm; the STL file is in cm, with its
corner at the origin, as drawings are that know nothing of a frame.
"""

from __future__ import annotations

import json
from importlib.metadata import version
from pathlib import Path

import cadquery as cq
import numpy as np
import trimesh

HERE = Path(__file__).parent
# centre and edges of beam, short and long pillar [mm]; pillars reach into the beam, so that the union has work to do
BOXES = (
    ((0.0, 0.0, 3.4), (14.0, 7.0, 0.68)),
    ((-5.25, 0.0, 2.0), (3.5, 7.0, 2.8)),
    ((5.25, 0.0, 1.7), (3.5, 7.0, 3.4)),
)


def main() -> None:
    """Write both files and their sidecar."""
    whole = cq.Workplane()
    for centre, edges in BOXES:
        whole = whole.union(cq.Workplane().box(*edges).translate(centre))
    cq.exporters.export(whole.clean(), str(HERE / "skeleton.step"))
    volume = whole.val().Volume()

    parts = [trimesh.creation.box(e, trimesh.transformations.translation_matrix(c)) for c, e in BOXES]
    surface = trimesh.boolean.union(parts, engine="manifold")
    surface.apply_translation(-surface.bounds[0])
    surface.apply_scale(0.1)
    surface.export(HERE / "skeleton_cm.stl")

    about = {
        "made_by": "tests/drawings/make_skeletons.py",
        "design": "junction_bot",
        "volume_mm3": 201.88,
        "skeleton.step": {
            "tool": f"cadquery {version('cadquery')}",
            "unit": "mm",
            "volume_found_mm3": round(volume, 9),
        },
        "skeleton_cm.stl": {
            "tool": f"trimesh {version('trimesh')}, manifold3d {version('manifold3d')}",
            "unit": "cm",
            "triangles": len(surface.faces),
            "volume_found_mm3": round(float(surface.volume) * 1e3, 6),
            "lowest_corner_cm": np.round(surface.bounds[0], 9).tolist(),
        },
    }
    (HERE / "skeletons.json").write_text(json.dumps(about, indent=2) + "\n")


if __name__ == "__main__":
    main()

"""The meshed body: vertices, tetrahedra, named regions, surfaces and landmarks, as read-only data.

Knows nothing of files, of Gmsh or of the design; checks what every solver relies on.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True)
class BodyMesh:
    """Tetrahedral mesh of a body with named parts.

    Attributes
    ----------
    points
        Vertex positions, (3, n) [mm].
    cells
        Vertices of each tetrahedron, (4, e), positively oriented.
    regions
        Name to element indices; disjoint, together all elements.
    surfaces
        Name to triangles as vertex triples, (3, f); boundary or interior.
    landmarks
        Name to vertex index.
    source
        Where the mesh comes from (file, generator, its version, size asked for).
    """

    points: Array
    cells: Ints
    regions: Mapping[str, Ints]
    surfaces: Mapping[str, Ints] = field(default_factory=dict)
    landmarks: Mapping[str, int] = field(default_factory=dict)
    source: Mapping[str, object] = field(default_factory=dict)

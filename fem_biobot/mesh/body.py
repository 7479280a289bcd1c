"""The meshed body: vertices, tetrahedra, named regions, surfaces and landmarks, as read-only data.

Knows nothing of files, of Gmsh or of the design; checks what every solver relies on.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from fem_biobot.mesh import checks, facets
from fem_biobot.mesh.layout import Layout
from fem_biobot.mesh.quality import MeshQuality, quality

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


# compared by identity: two meshes are not equal because their arrays happen to be
@dataclass(frozen=True, eq=False)
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
        Name to triangles as vertex triples, (3, f); boundary or interior. Boundary surfaces look out of the body,
        the interface from skeleton to muscle, sections toward +x.
    landmarks
        Name to vertex index.
    source
        Where the mesh comes from (file, generator, its version, size asked for).

    Notes
    -----
    The arrays are taken over as read-only copies. Construction does not check; `checked` does.
    """

    points: Array
    cells: Ints
    regions: Mapping[str, Ints]
    surfaces: Mapping[str, Ints] = field(default_factory=dict)
    landmarks: Mapping[str, int] = field(default_factory=dict)
    source: Mapping[str, object] = field(default_factory=dict)

    def __post_init__(self) -> None:
        keep = object.__setattr__
        keep(self, "points", _frozen(self.points, np.float64))
        keep(self, "cells", _frozen(self.cells, np.int64))
        for name in ("regions", "surfaces"):
            arrays = {key: _frozen(value, np.int64) for key, value in getattr(self, name).items()}
            keep(self, name, MappingProxyType(arrays))
        keep(self, "landmarks", MappingProxyType({key: int(value) for key, value in self.landmarks.items()}))
        keep(self, "source", MappingProxyType(dict(self.source)))

    def __reduce__(self) -> tuple[object, ...]:
        parts = self.points, self.cells, dict(self.regions), dict(self.surfaces), dict(self.landmarks)
        return BodyMesh, (*parts, dict(self.source))

    def checked(self, plan: Layout | None = None) -> BodyMesh:
        """This mesh, after every check that a solver relies on; against the layout of a design too, if given.

        Raises
        ------
        MeshError
            On the first defect, naming it: see `fem_biobot.mesh.checks`.
        """
        checks.check(self.points, self.cells, self.regions, self.surfaces, self.landmarks)
        if plan is not None:
            checks.check_volumes(self.region_volumes(), plan.volumes, plan.volume_slack)
        return self

    @property
    def n_vertices(self) -> int:
        """Number of vertices."""
        return self.points.shape[1]

    @property
    def n_elements(self) -> int:
        """Number of tetrahedra."""
        return self.cells.shape[1]

    @cached_property
    def edges(self) -> Ints:
        """Edges, (2, k), lower vertex first."""
        return _frozen(facets.edges(self.cells), np.int64)

    @property
    def n_unknowns(self) -> int:
        """Displacement components of quadratic elements, before supports: three at each vertex and edge."""
        return 3 * (self.n_vertices + self.edges.shape[1])

    @cached_property
    def volumes(self) -> Array:
        """Volume of each element, (e,) [mm^3]."""
        return _frozen(facets.signed_volumes(self.points, self.cells), np.float64)

    def region_of(self) -> Ints:
        """Number of the region of each element in the order of `regions`, (e,)."""
        number = np.full(self.n_elements, -1, dtype=np.int64)
        for k, elements in enumerate(self.regions.values()):
            number[elements] = k
        return number

    def region_volumes(self) -> dict[str, float]:
        """Volume of each region [mm^3]."""
        return {name: float(self.volumes[elements].sum()) for name, elements in self.regions.items()}

    def region_vertices(self, name: str) -> Ints:
        """Vertices of a region, sorted."""
        return np.unique(self.cells[:, self.regions[name]])

    def bounding_box(self) -> tuple[Array, Array]:
        """Lowest and highest corner, (3,) each [mm]."""
        return self.points.min(axis=1), self.points.max(axis=1)

    @property
    def h_mean(self) -> float:
        """Mean edge length [mm]."""
        a, b = self.points[:, self.edges[0]], self.points[:, self.edges[1]]
        return float(np.linalg.norm(b - a, axis=0).mean())

    def quality(self) -> MeshQuality:
        """Shape of the elements, summed up."""
        return quality(self.points, self.cells)


def _frozen(values: object, kind: type) -> NDArray:
    array = np.array(values, dtype=kind, order="C")
    array.flags.writeable = False
    return array

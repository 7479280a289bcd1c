"""Laplace problems on one region of a body's mesh: linear elements, values given at vertices.

What the fibre fields are made of. Vertices of the region are numbered anew; results do not depend on the numbering
beyond rounding.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import splu
from skfem import Basis, BilinearForm, ElementTetP1, MeshTet

from fem_biobot.errors import MeshError
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.mesh.facets import facets

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


@BilinearForm
def _stiffness(u, v, _):
    return sum(u.grad[k] * v.grad[k] for k in range(3))


@dataclass(frozen=True, eq=False)
class Region:
    """The tetrahedra of one region with their own vertices.

    Attributes
    ----------
    points
        Vertices, (3, n) [mm].
    cells
        Vertices of each element in the order of ``mesh.regions[name]``, (4, e).
    vertices
        Number in the body's mesh of each vertex, (n,).
    """

    points: Array
    cells: Ints
    vertices: Ints

    @classmethod
    def of(cls, mesh: BodyMesh, name: str) -> Region:
        """The region of a mesh; refused where there is none of that name."""
        if name not in mesh.regions:
            raise MeshError(f"{name}: found no such region in the mesh ({', '.join(mesh.regions)}), expected one")
        vertices, cells = np.unique(mesh.cells[:, mesh.regions[name]], return_inverse=True)
        return cls(mesh.points[:, vertices], cells.reshape(4, -1).astype(np.int64), vertices)

    @property
    def n(self) -> int:
        """Number of vertices."""
        return self.points.shape[1]

    @cached_property
    def _mesh(self) -> MeshTet:
        return MeshTet(np.ascontiguousarray(self.points), np.ascontiguousarray(self.cells))

    @cached_property
    def stiffness(self) -> csr_matrix:
        """Matrix of ``int grad u . grad v`` over the vertices, (n, n) [mm]."""
        return csr_matrix(_stiffness.assemble(Basis(self._mesh, ElementTetP1())))

    @cached_property
    def gradients(self) -> Array:
        """Gradient of each corner's shape function in each element, (3, 4, e) [1/mm]."""
        a = self.points[:, self.cells[0]]
        edges = np.stack([self.points[:, self.cells[k]] - a for k in (1, 2, 3)])  # (3 edges, 3, e)
        inverse = np.linalg.inv(np.moveaxis(edges, -1, 0))  # (e, 3, 3 edges)
        others = np.moveaxis(inverse, 0, -1)
        return np.concatenate([-others.sum(axis=1, keepdims=True), others], axis=1, dtype=np.float64)

    def gradient(self, values: Array) -> Array:
        """Gradient of values at the vertices, in each element, (3, e); constant in it."""
        return np.einsum("ike,ke->ie", self.gradients, values[self.cells])

    def recovered(self, field: Array) -> Array:
        """A field (3, e), constant in each element, averaged to the vertices by volume and back to the middles, (3, e).

        Of a gradient it takes away what differs from element to element: in the ring of the tests a third of the error
        is left, and it falls with the power 1.4 of the size instead of 1. Constant fields stay as they are.
        """
        edges = self.points[:, self.cells[1:]] - self.points[:, self.cells[:1]]
        volume = np.abs(np.einsum("ie,ie->e", np.cross(edges[:, 0], edges[:, 1], axis=0), edges[:, 2]))
        corners, weight = self.cells.ravel(), np.tile(volume, 4)
        total = np.bincount(corners, weight, minlength=self.n)
        at = np.stack([np.bincount(corners, weight * np.tile(f, 4), minlength=self.n) / total for f in field])
        return at[:, self.cells].mean(axis=1, dtype=np.float64)

    @cached_property
    def boundary(self) -> tuple[Ints, Array]:
        """Triangles of the region's surface, (3, f), and outward normals times area, (3, f) [mm^2]."""
        found = facets(self.cells)
        triangles = found.triples[:, found.boundary]
        a, b, c = (self.points[:, k] for k in triangles)
        return triangles, 0.5 * np.cross(b - a, c - a, axis=0)

    def local(self, vertices: Ints) -> Ints:
        """Numbers here of those vertices of the body's mesh that the region has, sorted."""
        return np.flatnonzero(np.isin(self.vertices, vertices))

    def harmonic(self, fixed: Ints, values: Array) -> Array:
        """Solution of Laplace's equation with given values at some vertices and no flux through the rest.

        Parameters
        ----------
        fixed
            Vertices with given values, (k,), different from each other; at least one in each connected part.
        values
            (k,).

        Returns
        -------
        Array
            (n,); the values themselves at the fixed vertices.

        Raises
        ------
        MeshError
            A part of the region has no fixed vertex.
        """
        self._check_connected(fixed)
        u = np.zeros(self.n)
        u[fixed] = values
        free = np.setdiff1d(np.arange(self.n), fixed)
        if free.size:
            rows = self.stiffness[free]
            u[free] = splu(rows[:, free].tocsc()).solve(-(rows @ u))
        return u

    def _check_connected(self, fixed: Ints) -> None:
        count, label = connected_components(self.stiffness, directed=False)
        missing = count - len(np.unique(label[fixed]))
        if missing:
            raise MeshError(
                f"muscle: found {missing} of {count} parts of the tissue that no given value reaches, "
                "expected each part to touch an end or a wall"
            )

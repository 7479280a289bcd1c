"""The finite-element space on a mesh: node numbers, slopes of the basis at quadrature points, weights.

Spaces, node numbers and quadrature come from scikit-fem; what is kept here is only what the kernels read.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
import skfem
from numpy.typing import NDArray
from skfem.quadrature import get_quadrature
from skfem.refdom import RefTet

from fem_biobot.errors import ModelError
from fem_biobot.mesh.body import BodyMesh

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


class Element(StrEnum):
    """Elements.

    * ``P2``: quadratic tetrahedra; sound up to a Poisson's ratio of about 0.49.
    * ``P1``: linear tetrahedra; locks in bending and near incompressibility; to preview and to show locking.
    * ``P2P1`` ("P2-P1"): quadratic displacement with a continuous linear pressure in each region whose law splits
      (Taylor and Hood 1973); for any Poisson's ratio up to 0.5 itself.

    Measured on Cook's membrane (coupled neo-Hooke, 8 by 8 cells, whole load in one step; deflection of the tip against
    P2-P1 on 16 by 16): at a ratio of 0.3 / 0.45 / 0.49, P2-P1 is 0.3 / 0.7 / 0.9 % too stiff in 5 or 6 iterations, P2
    0.4 / 1.3 / 2.6 % in 11 / 17 / 29, P1 17 / 33 / 51 %. P2 finds no equilibrium from 0.499 on, on 16 by 16 cells from
    0.495 on. A model says so from ratios of 0.49 (P2) and 0.4 (P1) on.
    """

    P2 = "P2"
    P1 = "P1"
    P2P1 = "P2-P1"


# Poisson's ratio up to which a displacement element is sound; see `Element`
BEARS = {Element.P2: 0.49, Element.P1: 0.4}


class LockingWarning(UserWarning):
    """A displacement element is asked for a Poisson's ratio above what it bears."""


_ELEMENTS = {Element.P2: skfem.ElementTetP2, Element.P1: skfem.ElementTetP1, Element.P2P1: skfem.ElementTetP2}


@dataclass(frozen=True)
class Space:
    """A vector space of displacements on straight-sided tetrahedra.

    Attributes
    ----------
    mesh
        The scikit-fem mesh (same vertices, same order).
    element
        Which element.
    shape
        Its scikit-fem counterpart.
    nodes
        Node numbers, (b, e): vertices first, then edge midpoints in VTK's order for quadratic tetrahedra.
    points
        Reference positions of the nodes, (3, n) [mm].
    slopes
        Gradients of the basis on the unit cell, (b, 3, q).
    values
        Values of the basis at the quadrature points, (b, q).
    corner_values
        The same of the linear basis, the barycentric coordinates, (4, q).
    to_reference
        ``d xi / d X``, (3, 3, e) [1/mm].
    dV
        Reference volume of each quadrature point, (e, q) [mm^3].
    """

    mesh: skfem.MeshTet
    element: Element
    shape: skfem.ElementH1
    nodes: Ints
    points: Array
    slopes: Array
    values: Array
    corner_values: Array
    to_reference: Array
    dV: Array

    @property
    def quadratic(self) -> bool:
        """Whether edges have nodes too."""
        return self.element is not Element.P1

    @property
    def n_nodes(self) -> int:
        """Number of nodes; the unknowns are three times as many."""
        return self.points.shape[1]

    @property
    def quadrature_points(self) -> Array:
        """Reference positions of the quadrature points, (3, e, q) [mm]."""
        return np.einsum(
            "beq,ibe->ieq",
            np.broadcast_to(self.values[:, None, :], (*self.nodes.shape, self.values.shape[1])),
            self.points[:, self.nodes],
        )

    def surface_nodes(self, triangles: Ints) -> Ints:
        """Nodes of the facets, (3 or 6, f): corners, then the midpoints of sides 01, 12, 02.

        `triangles` (3, f) are vertex triples; each side must be an edge of the mesh.
        """
        if not self.quadratic:
            return triangles
        sides = np.stack([triangles[[0, 1]], triangles[[1, 2]], triangles[[0, 2]]])  # (3, 2, f)
        sides = np.sort(sides, axis=1)
        n = self.mesh.p.shape[1]
        edges = np.sort(np.asarray(self.mesh.edges), axis=0)
        keys = edges[0] * n + edges[1]
        order = np.argsort(keys)
        wanted = sides[:, 0] * n + sides[:, 1]
        found = order[np.minimum(np.searchsorted(keys[order], wanted), len(keys) - 1)]
        if not np.array_equal(keys[found], wanted):
            raise ModelError(
                "surface: found a triangle whose side is no edge of the mesh, expected facets of the tetrahedra"
            )
        return np.concatenate([triangles, n + found])


def quadrature(degree: int) -> tuple[Array, Array]:
    """Points (3, q) and weights (q,) on the unit tetrahedron, exact at least up to `degree`, no weight negative.

    A negative weight would break the positivity of the energy.
    """
    whole = isinstance(degree, int | np.integer) and not isinstance(degree, bool) and degree >= 1
    # the tables end with one that raises
    for candidate in itertools.count(int(degree)) if whole else ():
        try:
            points, weights = get_quadrature(RefTet, candidate)
        except NotImplementedError:
            break
        if np.all(weights > 0.0):
            return points, weights
    raise ModelError(
        f"quadrature degree: found {degree!r}, expected a whole number of at least 1 for which a rule with positive "
        "weights is known"
    )


def space(mesh: BodyMesh, element: Element | str = Element.P2, degree: int | None = None) -> Space:
    """Displacement space on a mesh.

    Parameters
    ----------
    mesh
        Checked mesh with positively oriented tetrahedra.
    element
        See `Element`.
    degree
        Degree up to which the quadrature is exact; by default twice that of the strain (1 for P1, else 2: 4 points),
        which integrates the small-strain stiffness exactly. A rule with a negative weight is replaced by the next
        that has none.
    """
    try:
        element = Element(element)
    except ValueError:
        raise ModelError(f"element: found {element!r}, expected one of {', '.join(e.value for e in Element)}") from None
    default = 1 if element is Element.P1 else 2
    degree = default if degree is None else degree
    rule = quadrature(degree)
    tets = skfem.MeshTet(np.ascontiguousarray(mesh.points), np.ascontiguousarray(mesh.cells), sort_t=False)
    shape = _ELEMENTS[element]()
    basis = skfem.CellBasis(tets, shape, quadrature=rule)
    slopes = np.stack([shape.lbasis(basis.X, b)[1] for b in range(basis.Nbfun)])
    values = np.stack([shape.lbasis(basis.X, b)[0] for b in range(basis.Nbfun)])
    to_reference = basis.mapping.invDF(basis.X)[..., 0]  # affine: one per element
    nodes = np.ascontiguousarray(basis.element_dofs.astype(np.int64))
    points = mesh.points
    if element is not Element.P1:
        points = np.concatenate([points, tets.p[:, tets.edges].mean(axis=1)], axis=1)
    return Space(
        tets,
        element,
        shape,
        nodes,
        np.ascontiguousarray(points),
        np.ascontiguousarray(slopes),
        np.ascontiguousarray(np.broadcast_to(values, (basis.Nbfun, basis.X.shape[-1]))),
        np.concatenate([1.0 - rule[0].sum(axis=0, keepdims=True), rule[0]]),
        np.ascontiguousarray(to_reference),
        np.ascontiguousarray(basis.dx),
    )

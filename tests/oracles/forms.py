"""Internal force and tangent of the solid as scikit-fem forms: slow, short, and written in the first Piola stress.

With a pressure field: the volumetric part as forms of its own, one pressure basis a region.

The package works with packed second Piola quantities in compiled loops; here ``P`` and ``dP/dF`` are differentiated
directly and scikit-fem assembles, with node numbers of its own that are matched by position.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import skfem
from numpy.typing import NDArray
from scipy import sparse
from scipy.spatial import cKDTree

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Fields:
    """Material data at every point, one value an element: Lame's constants and tension (e,), fibres (3, e)."""

    mu: Array
    lmbda: Array
    tension: Array
    a0: Array


class FormOracle:
    """The forms on P2 (or P1) tetrahedra of a mesh; vectors are (n, 3) in the node order of `points`."""

    def __init__(self, points: Array, cells: NDArray[np.int64], nodes: Array, *, linear: bool = False, degree: int = 2):
        mesh = skfem.MeshTet(points, cells)
        shape = skfem.ElementTetP1() if linear else skfem.ElementTetP2()
        self.basis = skfem.Basis(mesh, skfem.ElementVector(shape), intorder=degree)
        # order[3 node + component] is scikit-fem's number of that unknown
        where = self.basis.doflocs  # (3, dofs)
        first = self.basis.nodal_dofs[0].tolist() + ([] if linear else self.basis.edge_dofs[0].tolist())
        distance, place = cKDTree(where[:, first].T).query(nodes.T)
        assert distance.max() < 1e-9 * np.ptp(points)
        self.order = (np.array(first)[place][:, None] + np.arange(3)).ravel()
        element_order = np.concatenate([mesh.p[:, mesh.t].mean(axis=1).T])
        _, self.elements = cKDTree(points[:, cells].mean(axis=1).T).query(element_order)

    def _expand(self, fields: Fields) -> Mapping[str, Array]:
        shape = (self.basis.nelems, self.basis.X.shape[-1])
        e = self.elements

        def spread(values: Array) -> Array:
            return np.broadcast_to(values[..., e][..., None], (*values.shape[:-1], *shape)).copy()

        return {
            "mu": spread(fields.mu),
            "lmbda": spread(fields.lmbda),
            "T": spread(fields.tension),
            "a0": spread(fields.a0),
        }

    def _displacement(self, u: Array) -> skfem.DiscreteField:
        mine = np.zeros(self.basis.N)
        mine[self.order] = u.ravel()
        return self.basis.interpolate(mine)

    def distance(
        self, u: Array, exact: Callable[[Array], Array], gradient: Callable[[Array], Array]
    ) -> tuple[float, float]:
        """L2 norms of the error of `u` and of its gradient, by the basis's own quadrature."""
        ours, X = self._displacement(u), np.asarray(self.basis.global_coordinates())
        value, slope = np.asarray(ours) - exact(X), ours.grad - gradient(X)
        return tuple(float(np.sqrt(np.sum(e**2 * self.basis.dx))) for e in (value, slope))

    def internal_force(self, u: Array, fields: Fields) -> Array:
        """``int P : grad v``, (n, 3)."""
        found = _force.assemble(self.basis, u=self._displacement(u), **self._expand(fields))
        return found[self.order].reshape(-1, 3)

    def tangent(self, u: Array, fields: Fields) -> sparse.csr_matrix:
        """``int grad v : dP/dF : grad du``, in the caller's order of unknowns."""
        found = _tangent.assemble(self.basis, u=self._displacement(u), **self._expand(fields))
        return sparse.csr_matrix(found)[self.order][:, self.order]

    def tangent_of(self, u: Array, laws: Sequence[Any], elements: NDArray[np.int64]) -> sparse.csr_matrix:
        """The same with ``dP/dF`` asked of the laws themselves, summed, on some elements; it need not be symmetric."""
        mine = np.flatnonzero(np.isin(self.elements, elements))
        basis = skfem.Basis(self.basis.mesh, self.basis.elem, elements=mine, quadrature=self.basis.quadrature)
        values = np.zeros(basis.N)
        values[self.order] = u.ravel()
        F = basis.interpolate(values).grad + np.eye(3)[:, :, None, None]
        found = _any_tangent.assemble(basis, tensor=np.sum([law.tangent(F) for law in laws], axis=0))
        return sparse.csr_matrix(found)[self.order][:, self.order]


def _kinematics(u: skfem.DiscreteField) -> tuple[Array, Array, Array]:
    """``F``, its inverse and ``ln J``, by cofactors."""
    F = u.grad + np.eye(3)[:, :, None, None]
    cofactor = np.stack([np.cross(F[(i + 1) % 3], F[(i + 2) % 3], axis=0) for i in range(3)])
    J = np.einsum("k...,k...->...", F[0], cofactor[0])
    return F, cofactor.swapaxes(0, 1) / J, np.log(J)


@skfem.BilinearForm
def _any_tangent(du, v, w):
    return np.einsum("ik...,ik...->...", np.einsum("ikjl...,jl...->ik...", w.tensor, du.grad), v.grad)


@skfem.LinearForm
def _force(v, w):
    F, G, ln_J = _kinematics(w.u)
    a = np.einsum("ik...,k...->i...", F, w.a0)
    s = np.sqrt(np.einsum("i...,i...->...", a, a))
    P = w.mu * F + (w.lmbda * ln_J - w.mu) * G.swapaxes(0, 1) + w.T / s * np.einsum("i...,k...->ik...", a, w.a0)
    return np.einsum("ik...,ik...->...", P, v.grad)


@skfem.BilinearForm
def _tangent(du, v, w):
    F, G, ln_J = _kinematics(w.u)
    a = np.einsum("ik...,k...->i...", F, w.a0)
    s = np.sqrt(np.einsum("i...,i...->...", a, a))
    H = du.grad
    # d(F^-T) = -F^-T H^T F^-T,  d ln J = tr(F^-1 H)
    GHG = np.einsum("ki...,lk...,jl...->ij...", G, H, G)
    dP = w.mu * H + (w.mu - w.lmbda * ln_J) * GHG
    dP = dP + w.lmbda * np.einsum("ki...,ik...->...", G, H) * G.swapaxes(0, 1)
    da = np.einsum("ik...,k...->i...", H, w.a0)
    across = da - a * np.einsum("i...,i...->...", a, da) / s**2
    dP = dP + w.T / s * np.einsum("i...,k...->ik...", across, w.a0)
    return np.einsum("ik...,ik...->...", dP, v.grad)


# --- volumetric part with a pressure ----------------------------------------------------------------------------------


@dataclass(frozen=True)
class PressurePart:
    """One region with a pressure: its elements, bulk modulus, and ``J -> g, g', g''``."""

    elements: NDArray[np.int64]
    bulk: float
    measure: Callable[[Array], tuple[Array, Array, Array]]


class PressureOracle:
    """Volumetric forces, volume residuals and their derivatives on one region, beside a `FormOracle`.

    Pressures are in the order of `vertices`, the numbers of the mesh's vertices that the region has.
    """

    def __init__(self, displacement: FormOracle, points: Array, cells: NDArray[np.int64], part: PressurePart):
        self.part, self.displacement = part, displacement
        mesh, degree = displacement.basis.mesh, displacement.basis.quadrature
        # scikit-fem may have put elements in an order of its own
        mine = np.flatnonzero(np.isin(displacement.elements, part.elements))
        self.u_basis = skfem.Basis(mesh, displacement.basis.elem, elements=mine, quadrature=degree)
        self.basis = skfem.Basis(mesh, skfem.ElementTetP1(), elements=mine, quadrature=degree)
        self.vertices = np.unique(cells[:, part.elements])
        place = cKDTree(self.basis.doflocs.T).query(points[:, self.vertices].T)[1]
        self.order = np.asarray(place)

    def _fields(self, u: Array, p: Array) -> dict[str, Array]:
        mine, pressure = np.zeros(self.u_basis.N), np.zeros(self.basis.N)
        mine[self.displacement.order] = u.ravel()
        pressure[self.order] = p
        F, G, ln_J = _kinematics(self.u_basis.interpolate(mine))
        g, slope, bend = self.part.measure(np.exp(ln_J))
        return {
            "F": F,
            "G": G,
            "J": np.exp(ln_J),
            "g": g,
            "g1": slope,
            "g2": bend,
            "p": self.basis.interpolate(pressure),
        }

    def forces(self, u: Array, p: Array) -> tuple[Array, Array]:
        """``int p dg/dF : grad v``, (n, 3), and ``int q (g - p / bulk)``, (m,)."""
        fields = self._fields(u, p)
        force = _push.assemble(self.u_basis, **fields)[self.displacement.order].reshape(-1, 3)
        return force, _volume.assemble(self.basis, bulk=self.part.bulk, **fields)[self.order]

    def matrix(self, u: Array, p: Array) -> tuple[Array, Array, Array]:
        """Derivatives of the forces by displacement and pressure, and of the residual by pressure, dense."""
        fields, order = self._fields(u, p), self.displacement.order
        K = _push_slope.assemble(self.u_basis, **fields).toarray()[np.ix_(order, order)]
        B = _coupling.assemble(self.basis, self.u_basis, **fields).toarray()[np.ix_(order, self.order)]
        C = _compliance.assemble(self.basis, bulk=self.part.bulk).toarray()[np.ix_(self.order, self.order)]
        return K, B, C


@skfem.LinearForm
def _push(v, w):
    return w.p * w.g1 * w.J * np.einsum("ki...,ik...->...", w.G, v.grad)


@skfem.LinearForm
def _volume(q, w):
    return q * (w.g - w.p / w.bulk)


@skfem.BilinearForm
def _push_slope(du, v, w):
    H, dv = du.grad, v.grad
    dJ, vJ = (np.einsum("ki...,ik...->...", w.G, slope) for slope in (H, dv))
    cross = np.einsum("ki...,lk...,jl...,ij...->...", w.G, H, w.G, dv, optimize=True)
    return w.p * w.J * ((w.J * w.g2 + w.g1) * dJ * vJ - w.g1 * cross)


@skfem.BilinearForm
def _coupling(p, v, w):
    return p * w.g1 * w.J * np.einsum("ki...,ik...->...", w.G, v.grad)


@skfem.BilinearForm
def _compliance(p, q, w):
    return -p * q / w.bulk

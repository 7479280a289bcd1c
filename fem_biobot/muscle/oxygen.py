"""Oxygen in tissue: steady diffusion with Michaelis-Menten consumption, and which part of the tissue stays viable.

    div(D grad c) = V c / (K + c),   D dc/dn = h (c_0 - c) on wetted faces (or c = c_0), no flux elsewhere.

Works on any mesh of scikit-fem, a line, a section or a body; what belongs to a design is in `muscle.oxygenation`.
Concentrations are in mM (mol/m^3), so that D in mm^2/s, V in mM/s and h in mm/s make a coherent set.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import skfem
from numpy.typing import NDArray
from scipy.sparse import diags_array
from scipy.sparse.linalg import cg, splu

from fem_biobot.errors import ModelError, SolveError

Array = NDArray[np.float64]

_ITERATIONS = 200
_RESIDUAL = 1e-10
_JUMPY, _NO_STEP = 1e-6, 1e-13
# unknowns from which conjugate gradients are cheaper than a factorisation in three dimensions
_DIRECT = 40_000
_ELEMENTS = {
    skfem.MeshLine1: skfem.ElementLineP2,
    skfem.MeshTri1: skfem.ElementTriP2,
    skfem.MeshTri2: skfem.ElementTriP2,
    skfem.MeshQuad1: skfem.ElementQuad2,
    skfem.MeshTet1: skfem.ElementTetP2,
}


@dataclass(frozen=True)
class OxygenLaw:
    """Supply and use of oxygen in a tissue.

    Attributes
    ----------
    supply
        Concentration ``c_0`` in the medium [mM].
    diffusivity
        ``D`` in the tissue [mm^2/s].
    consumption
        Largest rate ``V`` per volume of tissue [mM/s].
    half_saturation
        ``K``, the concentration at which half of that is used [mM].
    threshold
        Concentration below which tissue is taken for not viable [mM].
    film
        Transfer coefficient ``h`` of the medium's boundary film [mm/s]; None for a well-stirred medium.

    Notes
    -----
    Michaelis and Menten's rate is that of one enzyme, taken here for whole tissue as in Ehsan and George 2013 (Tissue
    Eng. A 19, 1433). No myoglobin, no dependence of consumption on what the muscle does, no memory: tissue that once
    died does not revive in life, and here is viable wherever oxygen suffices.
    """

    supply: float
    diffusivity: float
    consumption: float
    half_saturation: float
    threshold: float = 0.0
    film: float | None = None

    def __post_init__(self) -> None:
        for name in ("supply", "diffusivity", "half_saturation"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0.0):
                raise ModelError(f"{name}: found {value:g}, expected a finite number above 0")
        for name in ("consumption", "threshold"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0.0):
                raise ModelError(f"{name}: found {value:g}, expected a finite number of at least 0")
        if self.film is not None and not self.film > 0.0:
            raise ModelError(f"film: found {self.film:g} mm/s, expected above 0, or none for a well-stirred medium")
        if self.threshold >= self.supply:
            raise ModelError(
                f"threshold: found {self.threshold:g} mM, expected less than the supply ({self.supply:g} mM)"
            )

    def rate(self, c: Array) -> Array:
        """Consumption at a concentration, (...) [mM/s]; below zero its tangent at zero goes on, so that it stays
        monotone and what a coarse mesh undershoots is drawn back.
        """
        K, V = self.half_saturation, self.consumption
        return np.where(c > 0.0, V * c / (K + np.maximum(c, 0.0)), V * c / K)

    def slope(self, c: Array) -> Array:
        """Derivative of `rate`, (...) [1/s]; positive."""
        K, V = self.half_saturation, self.consumption
        return V * K / (K + np.maximum(c, 0.0)) ** 2

    def potential(self, c: Array) -> Array:
        """Integral of `rate` from zero, (...) [mM^2/s]; convex."""
        K, V = self.half_saturation, self.consumption
        up = np.maximum(c, 0.0)
        return np.where(c > 0.0, V * (up - K * np.log1p(up / K)), 0.5 * V * c**2 / K)


@dataclass(frozen=True, eq=False)
class OxygenField:
    """A solved field of oxygen.

    Attributes
    ----------
    law
        What was solved.
    basis
        Of scikit-fem, quadratic.
    c
        Concentration at its degrees of freedom, (n,) [mM]; never negative.
    undershoot
        Largest negative value that the mesh left there before it was set to zero, over the supply [1]; far above
        rounding it says that the mesh is too coarse for the consumption.
    uptake
        Oxygen used in the whole tissue [mM mm^d/s], and through the wetted faces the same.
    iterations
        Newton iterations.
    residual
        Largest residual over the largest flow of oxygen into a degree of freedom [1].
    """

    law: OxygenLaw
    basis: Any
    c: Array
    undershoot: float
    uptake: float
    iterations: int
    residual: float

    def at(self, X: Array) -> Array:
        """Concentration at positions inside the mesh, (d, k) -> (k,) [mM]."""
        return np.maximum(np.asarray(self.basis.probes(np.atleast_2d(X)) @ self.c).ravel(), 0.0)

    @property
    def points(self) -> Array:
        """Concentration at quadrature points, (e, q) [mM]."""
        return np.asarray(self.basis.interpolate(self.c))

    def viable(self) -> Array:
        """Share of each element's volume that is viable, (e,) [1]."""
        dx = self.basis.dx
        return (dx * (self.points >= self.law.threshold)).sum(axis=1) / dx.sum(axis=1)

    def gamma(self, elements: NDArray[np.int64] | None = None) -> float:
        """Viable share of these elements' volume, of all by default [1]."""
        which = slice(None) if elements is None else elements
        volume = self.basis.dx.sum(axis=1)[which]
        return float(self.viable()[which] @ volume / volume.sum())


def steady_oxygen(
    mesh: Any,
    law: OxygenLaw,
    wetted: NDArray[np.int64] | None = None,
    *,
    diffusivity: Array | None = None,
    consuming: Array | None = None,
    order: int = 5,
) -> OxygenField:
    """Steady oxygen on a mesh of scikit-fem with quadratic elements.

    Parameters
    ----------
    mesh
        Of lines, triangles, quadrilaterals or tetrahedra [mm].
    law
        Supply and use.
    wetted
        Facets in touch with the medium, (k,); the whole boundary by default.
    diffusivity
        Of each element in place of the law's, (e,) [mm^2/s].
    consuming
        Share of the law's consumption in each element, (e,) [1]; 1 by default.
    order
        Degree of the quadrature.

    Returns
    -------
    OxygenField
        The only solution: the energy whose stationarity the equation is, is convex. Newton's method with the exact
        derivative, each step cut back until the energy falls.

    Raises
    ------
    ModelError
        No wetted face: oxygen would be used up everywhere.
    SolveError
        Newton's method did not converge.

    Notes
    -----
    Third order in the concentration where it is smooth, second where Michaelis-Menten tends to constant consumption
    and an anoxic core has an edge inside an element.
    """
    facets = mesh.boundary_facets() if wetted is None else np.asarray(wetted)
    if facets.size == 0:
        raise ModelError("wetted: found no face in touch with the medium, expected some: no oxygen reaches the tissue")
    basis = skfem.Basis(mesh, _ELEMENTS[type(mesh)](), intorder=order)
    ones = np.ones((basis.nelems, 1))
    D = ones * (law.diffusivity if diffusivity is None else np.asarray(diffusivity)[:, None])
    use = ones if consuming is None else np.asarray(consuming, dtype=float)[:, None]

    A = skfem.BilinearForm(_flux).assemble(basis, D=D * np.ones_like(basis.dx))
    b = np.zeros(basis.N)
    fixed = np.zeros(0, dtype=int)
    if law.film is None:
        fixed = basis.get_dofs(facets).all()
    else:
        edge = skfem.FacetBasis(mesh, _ELEMENTS[type(mesh)](), facets=facets, intorder=order)
        A = A + law.film * skfem.BilinearForm(lambda u, v, w: u * v).assemble(edge)
        b = law.film * law.supply * skfem.LinearForm(lambda v, w: v * 1.0).assemble(edge)
    free = np.setdiff1d(np.arange(basis.N), fixed)
    mass = skfem.BilinearForm(lambda u, v, w: w.weight * u * v)
    load = skfem.LinearForm(lambda v, w: w.weight * v)

    def energy(c: Array) -> float:
        return float(0.5 * c @ (A @ c) - b @ c + (basis.dx * use * law.potential(_values(basis, c))).sum())

    c = np.full(basis.N, law.supply)
    # the flow that would be used everywhere at the full rate, plus what the supply drives
    scale = float(np.abs(load.assemble(basis, weight=use * law.consumption * np.ones_like(basis.dx))).max())
    # on tiny elements rounding of what flows between them is larger than what they use
    scale = max(scale, 1e-4 * law.supply * float(A.diagonal().max()))
    residual, done = math.inf, 0
    for done in range(_ITERATIONS):  # noqa: B007
        values = _values(basis, c)
        r = A @ c - b + load.assemble(basis, weight=use * law.rate(values))
        residual = float(np.abs(r[free]).max(initial=0.0)) / scale
        if residual <= _RESIDUAL:
            break
        K = (A + mass.assemble(basis, weight=use * law.slope(values))).tocsr()[free][:, free]
        step = np.zeros_like(c)
        step[free] = _solved(K, -r[free])
        # where half saturation is tiny the rate jumps between two neighbouring numbers, and no residual is smaller
        if residual <= _JUMPY and np.abs(step).max() <= _NO_STEP * law.supply:
            break
        c = _lowered(energy, c, step, float(r @ step))
    else:
        raise SolveError(f"oxygen: no steady field in {_ITERATIONS} iterations, residual {residual:.1e} of the supply")
    uptake = float((basis.dx * use * law.rate(_values(basis, c))).sum())
    undershoot = max(0.0, -float(c.min())) / law.supply
    return OxygenField(law, basis, np.maximum(c, 0.0), undershoot, uptake, done, residual)


def _flux(u: Any, v: Any, w: Any) -> Any:
    return w.D * np.einsum("i...,i...->...", u.grad, v.grad)


def _values(basis: Any, c: Array) -> Array:
    return np.asarray(basis.interpolate(c))


def _solved(K: Any, r: Array) -> Array:
    """Solution of a symmetric positive definite system."""
    if K.shape[0] < _DIRECT:
        return splu(K.tocsc(), permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True}).solve(r)
    x, failed = cg(K, r, rtol=1e-12, maxiter=20_000, M=diags_array(1.0 / K.diagonal()))
    if failed:
        raise SolveError(f"oxygen: conjugate gradients did not solve {K.shape[0]} unknowns")
    return np.asarray(x)


def _lowered(energy: Any, c: Array, step: Array, slope: float) -> Array:
    """State along a descent direction at which the energy has fallen as its slope promises."""
    begin, length = energy(c), 1.0
    # within rounding of the energy the full step is as good as any
    rounding = 1e-13 * abs(begin)
    while length > 1e-6:
        if energy(c + length * step) <= begin + 1e-4 * length * slope + rounding:
            break
        length *= 0.5
    return c + length * step

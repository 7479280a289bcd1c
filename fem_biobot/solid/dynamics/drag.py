"""Drag of a medium on a body's wetted surface: a traction against the velocity, linear and quadratic in it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fem_biobot.errors import ModelError
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.solid.records import numbers
from fem_biobot.solid.space import Array
from fem_biobot.solid.surfaces import Facets, Scatter, boundary, facets_on, scatter
from fem_biobot.solid.system import System

# of a coefficient over a surface: one number, or a function of reference positions (3, k) [mm] with values (k,)
Coefficient = float | Callable[[Array], Array]

_DEGREE = 4  # integrates the linear part of quadratic facets exactly


@dataclass(frozen=True)
class SurfaceDrag:
    """Resistance of a medium to the motion of a body's surface.

    Parameters
    ----------
    linear
        Traction per velocity [kPa s/mm], at least 0: a number, or a function of reference positions.
    quadratic
        Traction per velocity squared [kg/mm^3], likewise.
    velocity
        Of the medium, (3,) [mm/s].
    surfaces
        Names of the wetted surfaces; by default the whole boundary.

    Notes
    -----
    Per REFERENCE area the traction is ``-(linear + quadratic |w|) w`` with the velocity w relative to the medium, alike
    in all directions. As area and coefficients belong to the reference body nothing depends on the configuration but
    through the velocity, and the tangent ``(linear + quadratic |w|) I + quadratic w w^T / |w|`` is symmetric and not
    negative. Drag that asks for the current normal (pressure drag of a plate) would be unsymmetric, and is left out, as
    are added mass, walls, and flow made by one part at another.
    """

    linear: Coefficient = 0.0
    quadratic: Coefficient = 0.0
    velocity: Sequence[float] = (0.0, 0.0, 0.0)
    surfaces: Sequence[str] | None = None

    def __post_init__(self) -> None:
        for key in ("linear", "quadratic"):
            value = getattr(self, key)
            if not callable(value):
                _checked(numbers(value, f"drag: {key}", "a finite number of at least 0"), key, ())
        v = numbers(self.velocity, "drag: velocity", "three finite numbers")
        if v.shape != (3,):
            raise ModelError(f"drag: velocity: found {self.velocity!r}, expected three finite numbers")
        if isinstance(self.surfaces, str):
            raise ModelError(f"drag: surfaces: found {self.surfaces!r}, expected a sequence of names")


@dataclass(frozen=True, eq=False)
class DragTerm:
    """A `SurfaceDrag` on the facets of a body.

    Attributes
    ----------
    facets
        Where it acts.
    linear, quadratic
        Coefficients times reference area at the quadrature points, (f, q) [mN s/mm, kg/mm].
    stream
        Velocity of the medium, (3,) [mm/s].
    to
        Where its tangent goes.
    """

    facets: Facets
    linear: Array
    quadratic: Array
    stream: Array
    to: Scatter

    def _relative(self, v: Array) -> tuple[Array, Array]:
        """Velocity relative to the medium (f, q, 3), and its size (f, q)."""
        w = np.einsum("bfi,bq->fqi", v[self.facets.nodes], self.facets.values) - self.stream
        return w, np.sqrt(np.einsum("fqi,fqi->fq", w, w))

    def force(self, v: Array) -> Array:
        """Nodal forces on the body at velocities of its nodes (n, 3), (n, 3) [mN]."""
        w, size = self._relative(v)
        push = -(self.linear + self.quadratic * size)[:, :, None] * w
        out = np.zeros_like(v)
        np.add.at(out, self.facets.nodes, np.einsum("bq,fqi->bfi", self.facets.values, push))
        return out

    def stiffness(self, v: Array) -> Array:
        """Minus the derivative of the force by the velocity, at the entries `to.places` [mN s/mm]."""
        w, size = self._relative(v)
        gain = self.linear + self.quadratic * size
        along = np.divide(self.quadratic, size, out=np.zeros_like(size), where=size > 0.0)
        point = np.einsum("fq,ij->ijfq", gain, np.eye(3)) + np.einsum("fq,fqi,fqj->ijfq", along, w, w)
        values = self.facets.values
        blocks = np.einsum("aq,bq,ijfq->abijf", values, values, point, optimize=True)
        return self.to.parts(blocks)[0]

    @cached_property
    def resistance(self) -> tuple[float, float]:
        """Force per velocity, and per velocity squared, of a body that moves as a whole [mN s/mm, kg/mm]."""
        return float(self.linear.sum()), float(self.quadratic.sum())


def drag_term(drag: SurfaceDrag, mesh: BodyMesh, system: System) -> DragTerm:
    """Prepare a drag for a body.

    Raises
    ------
    ModelError
        An unknown surface or one inside the body; a function with values that are no coefficients.
    """
    body = system.space
    triangles = boundary(mesh, drag.surfaces, "drag")
    on = facets_on(body, triangles, _DEGREE)
    X = np.ascontiguousarray(body.points.T)
    first, second = on.tangents(X)
    area = np.linalg.norm(np.cross(first, second), axis=-1) * on.weights
    places = on.positions(X).reshape(3, -1)

    def at_points(key: str, given: Coefficient) -> Array:
        if callable(given):
            found = numbers(given(places), f"drag: {key}, a function")
            _checked(found, key, places.shape[1:])
        else:
            found = np.full(places.shape[1], float(given))
        return found.reshape(area.shape) * area

    linear, quadratic = at_points("linear", drag.linear), at_points("quadratic", drag.quadratic)
    to = scatter(on, system.pattern, system.held)
    return DragTerm(on, linear, quadratic, np.asarray(drag.velocity, dtype=float), to)


def _checked(found: Array, key: str, shape: tuple[int, ...]) -> None:
    if found.shape != shape or np.any(found < 0.0):
        what = f"shape {found.shape}" if found.shape != shape else f"{found.min():g}"
        raise ModelError(f"drag: {key}: found {what}, expected {'numbers' if shape else 'a number'} of at least 0")

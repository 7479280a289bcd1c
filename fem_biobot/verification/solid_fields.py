"""S5 and S8: fields that vary in space, against a manufactured solution and against themselves turned round."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from fem_biobot import (
    ActiveStress,
    BodyForce,
    BodyMesh,
    Fix,
    NeoHooke,
    SolidModel,
    SolidState,
    Symmetry,
    Traction,
    solve,
)
from fem_biobot.material import Law
from fem_biobot.verification.blocks import FACES, TIGHT, box_mesh, hold_everywhere, rotation, turned_about, unit
from fem_biobot.verification.manufactured import Manufactured, ManufacturedMixed
from fem_biobot.verification.records import Case, Claim, Curve, Finding, Graph, order

Array = NDArray[np.float64]

# --- S5 ---------------------------------------------------------------------------------------------------------------

FIBRE = unit(0.6, 0.3, -0.7)
COMPRESSIBLE = Manufactured(10.0, 0.36, 4.0, FIBRE)
INCOMPRESSIBLE = ManufacturedMixed(3.6, np.inf, 4.0, FIBRE)
# cells along a side; linear elements come later to their rate
CELLS = {"P2": (3, 4, 6), "P2-P1": (3, 4, 6), "P1": (4, 6, 9)}
# with which errors are measured, far above what the elements are solved with
_FINE_DEGREE = 7


@dataclass(frozen=True)
class FieldErrors:
    """L2 norms of the errors of displacement [mm^2.5], gradient [mm^1.5] and pressure [kPa mm^1.5], if there is one.

    And of the gradient of the interpolant on the nodes.
    """

    displacement: float
    gradient: float
    pressure: float | None
    interpolant: float


def _bend(X: Array) -> Array:
    """Smooth map of the unit cube onto itself that keeps its faces; meshes of all sizes are alike in shape."""
    bump = np.prod(np.sin(np.pi * X), axis=0)
    return X + bump * np.array([[0.10], [-0.07], [0.06]])


def manufactured_state(
    n: int, element: str, law: Law, exact: Manufactured | ManufacturedMixed, degree: int | None = None
) -> SolidState:
    """The equilibrium on `n` cells a side, of a law that has the exact field's stress.

    Held on its boundary and pulled at its upper face. Where held and pulled faces meet, the dual problem is singular at
    this Poisson's ratio and takes a tenth off the L2 rate of linear elements, of any code; so those are held all
    around.
    """
    pulled = None if element == "P1" else "z1"
    loads = [BodyForce(exact.body_force), *([Traction(pulled, lambda X: exact.stress(X)[:, 2])] if pulled else [])]
    model = SolidModel(
        box_mesh(n, bend=_bend),
        {"muscle": law},
        {"muscle": ActiveStress(exact.tension, exact.a0)},
        hold_everywhere(exact.displacement, [face for face in FACES if face != pulled]),
        loads,
        element=element,
        quadrature_degree=degree,
    )
    return solve(model).last


def field_errors(state: SolidState, exact: Manufactured | ManufacturedMixed) -> FieldErrors:
    """How far a state and the interpolant on its nodes are from the exact field, by a fine quadrature."""
    model = state.model
    fine = SolidModel(
        model.mesh, model.materials, supports=model.supports, element=model.element, quadrature_degree=_FINE_DEGREE
    )
    space = fine.system.space
    X, identity = space.quadrature_points, np.eye(3)[:, :, None, None]

    def norm(values: Array) -> float:
        return float(np.sqrt(np.sum(values**2 * space.dV)))

    def gradient_error(u: Array) -> float:
        return norm(SolidState(fine, state.step, u, pressure=state.pressure).F - identity - exact.gradient(X))

    u = np.einsum("bq,ibe->ieq", space.values, state.u[:, space.nodes])
    pressure = None
    if state.pressure is not None and isinstance(exact, ManufacturedMixed):
        # one region: a pressure at each vertex
        p = np.einsum("bq,be->eq", space.corner_values, state.pressure[model.mesh.cells])
        pressure = norm(p - exact.pressure(X))
    return FieldErrors(
        norm(u - exact.displacement(X)), gradient_error(state.u), pressure, gradient_error(exact.displacement(state.X))
    )


def convergence(element: str, cells: Sequence[int], degree: int | None = None) -> tuple[FieldErrors, ...]:
    """Errors on a sequence of meshes: compressible, but incompressible with the mixed element."""
    mixed = element == "P2-P1"
    exact = INCOMPRESSIBLE if mixed else COMPRESSIBLE
    law = NeoHooke(3.0 * INCOMPRESSIBLE.mu, 0.5) if mixed else NeoHooke(COMPRESSIBLE.young, COMPRESSIBLE.poisson)
    return tuple(field_errors(manufactured_state(n, element, law, exact, degree), exact) for n in cells)


def manufactured_solution() -> Finding:
    """S5: errors against a manufactured solution fall at the orders of the elements.

    Problem: cube of contracting neo-Hooke under the body force, end traction and boundary displacement of a chosen
        field with displacement gradients up to 0.6, on three smoothly bent meshes; incompressible, with a chosen
        pressure, for the mixed element.
    Measured: slopes of the L2 errors of displacement and gradient, by quadrature of degree 7; the gradient's error on
        the finest mesh over that of the interpolant on its nodes, near which the best approximation is.
    Tolerance: 0.15 of an order, less than the distance to any neighbour; a tenth of the interpolant's error, since a
        slope alone can be right around a wrong limit.
    Cannot see: interfaces, corners.
    Catches: midpoints off their edges, a body force integrated with a rule too low, locking, a lost term of the stress.
    """
    values: list[float] = []
    curves: list[Curve] = []
    for element, cells in CELLS.items():
        sizes, found = np.array([1.0 / n for n in cells]), convergence(element, cells)
        for what, rate in _rates(element).items():
            errors = [getattr(e, what) for e in found]
            values.append(order(sizes, errors))
            curves.append(Curve(f"{element}, {what}", sizes, errors))
            curves.append(Curve(f"order {rate}", sizes, errors[-1] * (sizes / sizes[-1]) ** rate, known=True))
        values.append(found[-1].gradient / found[-1].interpolant)
    return Finding.of(values, Graph("element size [mm]", "L2 error [mm^2.5, mm^1.5]", tuple(curves), logarithmic="xy"))


def _rates(element: str) -> dict[str, int]:
    """What is measured of an element, and the order at which its error falls."""
    p = 1 if element == "P1" else 2
    return {"displacement": p + 1, "gradient": p}


_SOURCES = {"displacement": "Ciarlet 1978: p + 1", "gradient": "Ciarlet 1978: p"}
S5 = Case(
    "S5",
    "manufactured solution at finite strain",
    tuple(
        claim
        for element in CELLS
        for claim in (
            *(
                Claim(f"order of the {what}, {element}", float(rate), 0.15, "1", _SOURCES[what])
                for what, rate in _rates(element).items()
            ),
            Claim(f"gradient error over the interpolant's, {element}", 1.0, 0.1, "1", "Cea 1964: best approximation"),
        )
    ),
    manufactured_solution,
)

# --- S8 ---------------------------------------------------------------------------------------------------------------

SIZE = (1.1, 0.8, 1.3)
MESH = box_mesh(2, SIZE, layers=(0.5, 1.0), names=("muscle", "skeleton"))
OWN_AXES = rotation(5)
FIBRES = np.stack([unit(0.4, 0.7, 0.5 + 0.01 * k) for k in range(len(MESH.regions["muscle"]))], axis=1)
PLACES = ("x0", "y0", "z0", "corner_111")
# rounding through a solve to 1e-13
SAME = 1e-10


@dataclass(frozen=True)
class Setting:
    """How a problem is looked at: a rotation, an offset, and factors of length and stress."""

    Q: Array = field(default_factory=lambda: np.eye(3))
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    length: float = 1.0
    stress: float = 1.0


TURNED = Setting(rotation(31), (3.0, -2.0, 5.0))


def two_region_block(s: Setting, element: str, mesh: BodyMesh = MESH, fibres: Array = FIBRES) -> SolidState:
    """Muscle under gel with oblique fibres, supports along oblique axes, tractions and a body force, as `s` sees it.

    The muscle is incompressible where the element bears it.
    """
    Q, L, p = s.Q, s.length, s.stress
    scaled = BodyMesh(L * mesh.points, mesh.cells, mesh.regions, mesh.surfaces, mesh.landmarks)

    def axes(rows: Array) -> tuple:
        return tuple(tuple(float(x) for x in row) for row in rows @ Q.T)

    def seen(value: Callable[[Array], Array], factor: float) -> Callable[[Array], Array]:
        return lambda X: factor * Q @ value(Q.T @ (X - np.reshape(s.offset, (3, 1))) / L)

    model = SolidModel(
        turned_about(scaled, Q, np.array(s.offset)),
        {"muscle": NeoHooke(9.1 * p, 0.5 if element == "P2-P1" else 0.46), "skeleton": NeoHooke(55.0 * p, 0.4)},
        {"muscle": ActiveStress(7.0 * p, Q @ fibres)},
        [
            Symmetry("x0"),
            Fix("y0", "yz", axes=axes(np.eye(3))),
            Fix("z0", "z", seen(lambda X: np.stack([0 * X[0], 0 * X[0], 0.1 * X[0] * X[1]]), L), axes=axes(np.eye(3))),
            Fix("corner_111", "xz", (0.07 * L, -0.04 * L), axes=axes(OWN_AXES)),
        ],
        [
            Traction("z1", tuple(p * Q @ np.array([1.5, -2.0, 0.7]))),
            Traction("x1", seen(lambda X: np.stack([X[1], X[2] ** 2, 0.3 * X[0]]), p)),
            BodyForce(tuple(p / L * Q @ np.array([-0.8, 0.5, 1.1])), "skeleton"),
        ],
        element=element,
    )
    return solve(model, [0.4, 1.0], settings=TIGHT).last


def turned_problem() -> Finding:
    """S8: a problem turned as a whole has the turned answer.

    Problem: two-region block with oblique fibres, displacement prescribed along oblique axes, a symmetry plane,
        tractions and a body force; then mesh, fibres, supports and loads turned together by a generic rotation.
    Measured: strain energy, displacement of all nodes, reactions: largest difference over the largest value.
    Tolerance: 1e-10, rounding through a solve to 1e-13.
    Cannot see: any error that turns with the problem.
    Catches: F for C, fibres or support axes left in the global frame, rows for columns of the axes.
    """
    values: list[float] = []
    for element in ("P2", "P2-P1"):
        plain, turned = (two_region_block(s, element) for s in (Setting(), TURNED))
        reactions = [np.array([state.reaction(place) for place in PLACES]) for state in (plain, turned)]
        values += [
            abs(turned.energy / plain.energy - 1.0),
            float(np.abs(turned.u - TURNED.Q @ plain.u).max() / np.abs(plain.u).max()),
            float(np.abs(reactions[1] - reactions[0] @ TURNED.Q.T).max() / np.abs(reactions[0]).max()),
        ]
    return Finding.of(values)


S8 = Case(
    "S8",
    "mesh, fibres, supports and loads turned together",
    tuple(
        Claim(f"change of {what}, {element}", 0.0, SAME, "1", "objectivity (Truesdell and Noll 1965)")
        for element in ("P2", "P2-P1")
        for what in ("the strain energy", "the turned displacement", "the turned reactions")
    ),
    turned_problem,
)

CASES = (S5, S8)

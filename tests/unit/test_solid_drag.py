"""Drag on the surface of a moving solid: its tangent, the surfaces it acts on, and what it refuses."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from fem_biobot.errors import ModelError
from fem_biobot.material import NeoHooke
from fem_biobot.solid.dynamics.body import MovingBody, moving_body
from fem_biobot.solid.dynamics.contact import untouched
from fem_biobot.solid.dynamics.drag import DragTerm, SurfaceDrag
from fem_biobot.solid.dynamics.settings import DynamicsSettings, Scheme
from fem_biobot.solid.dynamics.step import Interval, State, Stepper
from fem_biobot.solid.model import SolidModel
from fem_biobot.solid.records import Step, Symmetry
from tests.helpers import box_mesh, generator, on_three_corners, rotation, taylor_slope, turned_about

Array = NDArray[np.float64]

SIZE = (1.0, 0.8, 0.5)
STREAM = (3.0, -20.0, 11.0)
VARIED = SurfaceDrag(lambda X: 2e-6 + 1e-6 * X[0], lambda X: 3e-7 * (1.0 + X[1] ** 2), STREAM)


def body_in(drag: SurfaceDrag, element: str = "P2", **more: Any) -> MovingBody:
    """A block in a medium."""
    mesh = more.pop("mesh", box_mesh((2, 1, 1), SIZE))
    supports = more.pop("supports", on_three_corners(SIZE))
    model = SolidModel(mesh, {"muscle": NeoHooke(20.0, 0.3)}, supports=supports, element=element)
    return moving_body(model, {"muscle": 1.1e-6}, drag=drag, **{"free": True, **more})


def term(body: MovingBody) -> DragTerm:
    """Its drag."""
    assert body.drag is not None
    return body.drag


def test_the_tangent_is_minus_the_derivative_by_the_velocity() -> None:
    """Fields of both coefficients, a stream, velocities that differ from node to node.

    Catches: the part along the velocity, the stream left out of the size, coefficients of other points.
    """
    body, draw = body_in(VARIED), generator()
    drag, n = term(body), body.system.space.n_nodes
    v, direction = 30.0 * draw.normal(size=(n, 3)), 10.0 * draw.normal(size=(n, 3))
    data = np.zeros(len(body.system.pattern.columns))
    data[drag.to.places] += drag.stiffness(v)
    along = -body.system.product(data, direction.ravel())
    found = taylor_slope(lambda eps: drag.force(v + eps * direction).reshape(-1, 1), along[:, None])
    assert found == pytest.approx(2.0, abs=0.1)


@pytest.mark.parametrize("scheme", list(Scheme))
def test_the_drags_part_of_a_steps_tangent_is_the_derivative(scheme: Scheme) -> None:
    """What the medium adds to the derivative of the unbalanced force, at the mean velocity of the step, in any scheme.

    With nodes held in axes of their own. Catches: the step's length missing, a velocity of its end, an axis not turned.
    """
    mesh = turned_about(box_mesh((2, 1, 1), SIZE), rotation(4))
    held: dict[str, Any] = {"mesh": mesh, "supports": [Symmetry(s) for s in ("z0", "x0", "y0")], "free": False}
    body, draw = body_in(VARIED, **held), generator()
    bare = body_in(SurfaceDrag(), **held)
    system = body.system
    n = system.space.n_nodes
    free = np.ones(3 * n)
    free[system.held.dofs] = 0.0

    def field(size: float) -> Array:
        return system.to_global((free * size * draw.normal(size=3 * n)).reshape(n, 3))

    u0, u, direction = field(0.01), field(0.02), field(0.02)
    state = State(u0, field(3.0), np.zeros((n, 3)), untouched(0), np.zeros(0))
    interval = Interval(3e-3, Step(tension=0.0), Step(tension=0.0))
    steppers = [Stepper(each, None, DynamicsSettings(scheme)) for each in (body, bare)]
    here = [stepper.forces(state, u, interval) for stepper in steppers]
    with_drag, without = (s._tangent(f, f.points.S, u, interval) for s, f in zip(steppers, here, strict=True))
    local = system.to_local(direction).ravel()
    along = system.product(with_drag - without, local) * free

    def force(eps: float) -> Array:
        both = [s.forces(state, u + eps * direction, interval).unbalanced for s in steppers]
        return (both[0] - both[1])[:, None]

    assert taylor_slope(force, along[:, None]) == pytest.approx(2.0, abs=0.1)
    assert here[0].drag is not None
    assert np.abs(here[0].drag).max() > 0.0


@pytest.mark.parametrize("element", ["P1", "P2"])
def test_a_surface_is_wetted_once(element: str) -> None:
    """Of named surfaces their area, also of one named twice; by default the boundary's, whatever is named.

    Catches: facets between elements, a facet counted with each of its names.
    """
    areas = {"z0": SIZE[0] * SIZE[1], "x1": SIZE[1] * SIZE[2]}
    for names, area in (
        (["z0"], areas["z0"]),
        (["z0", "x1", "z0"], sum(areas.values())),
        (None, 2.0 * (SIZE[0] * SIZE[1] + SIZE[1] * SIZE[2] + SIZE[0] * SIZE[2])),
    ):
        found = term(body_in(SurfaceDrag(2e-6, 3e-7, surfaces=names), element)).resistance
        assert found == pytest.approx((2e-6 * area, 3e-7 * area), rel=1e-12)


def test_nothing_moves_against_the_medium() -> None:
    """In the stream's own velocity there is no force, and the tangent of a square vanishes without being none.

    Catches: a division by the velocity's size.
    """
    drag = term(body_in(SurfaceDrag(0.0, 3e-7, STREAM)))
    v = np.tile(STREAM, (drag.facets.nodes.max() + 1, 1))
    assert np.abs(drag.force(v)).max() <= 1e-20
    assert np.abs(drag.stiffness(v)).max() <= 1e-15


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"linear": -1e-6}, "drag: linear: found -1e-06, expected a number of at least 0"),
        ({"quadratic": (1.0, 2.0)}, "drag: quadratic: found shape"),
        ({"quadratic": "much"}, "drag: quadratic: found 'much'"),
        ({"velocity": (1.0, 2.0)}, "drag: velocity: found"),
        ({"surfaces": "z0"}, "drag: surfaces: found 'z0', expected a sequence"),
        ({"surfaces": ["roof"]}, "drag: found no surface named 'roof'"),
        ({"linear": lambda X: X[0] - 0.5}, "drag: linear: found -0.5, expected numbers of at least 0"),
        ({"quadratic": lambda X: X}, "drag: quadratic: found shape"),
    ],
)
def test_what_is_no_drag_is_refused(given: dict[str, Any], words: str) -> None:
    """Catches: a surface that is passed over, drag that pushes."""
    with pytest.raises(ModelError, match=words):
        body_in(SurfaceDrag(**given))

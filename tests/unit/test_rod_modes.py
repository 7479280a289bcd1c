"""Modes of rods as a function: what it refuses, how many it returns, how they are normalised."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from fem_biobot.errors import ModelError
from fem_biobot.rod.model import RodModel
from fem_biobot.rod.modes import modes
from fem_biobot.rod.records import Body, Hinge, Hold, PointLoad, Rigid, Spherical, Spring
from fem_biobot.rod.statics import statics
from tests.helpers import generator, unchanged
from tests.rods import rod_of, straight

STIFF = (40.0, 50.0, 70.0, 3.0, 2.0, 1.0)
ROD = rod_of(straight(4, 2.0), STIFF, mass_per_length=1e-4)
WEIGHTLESS = rod_of(straight(4, 2.0), STIFF)
TIP = ("rod", -1)
BASE = Hold(("rod", 0))


def _follower() -> RodModel:
    return RodModel([ROD], supports=[BASE], loads=[PointLoad(TIP, (0.0, 0.5, 0.0), following=True)])


def _pushed() -> RodModel:
    return RodModel([ROD], supports=[BASE], loads=[PointLoad(TIP, (0.0, 0.5, 0.0))])


def _compressed_without_mass() -> RodModel:
    """A weightless column beyond its buckling load, with a mass at its clamp's other side."""
    mass = Body((-1.0, 0.0, 0.0), 1.0, (1.0, 1.0, 1.0), "mass")
    return RodModel(
        [WEIGHTLESS],
        [Rigid(("rod", 0), ("mass", (0.0, 0.0, 0.0)))],
        [mass],
        loads=[PointLoad(TIP, (-5.0, 0.0, 0.0))],
        members=[Spring(("mass", (-1.0, 0.0, 0.0)), (-2.0, 0.0, 0.0), 1.0)],
        supports=[Hold(("mass", (-1.0, 0.0, 0.0)), "yz", "xyz")],
    )


@pytest.mark.parametrize(
    ("make", "word"),
    [
        (lambda: modes(_pushed(), count=0), "count: found 0"),
        (lambda: modes(_pushed(), _pushed().drawn()), "at: found a state of another model"),
        (lambda: modes(_pushed()), "out of balance"),
        (lambda: modes(m := _follower(), statics(m).last), "loads that follow"),
        (lambda: modes(RodModel([WEIGHTLESS], supports=[BASE])), "no mass that can move"),
        (lambda: modes(m := _compressed_without_mass(), statics(m).last), "part without mass that nothing holds"),
    ],
)
def test_what_has_no_modes_is_refused(make: Callable[[], object], word: str) -> None:
    """States that are no equilibrium, loads without an energy, models without mass.

    Catches: frequencies of a symmetrised follower load, of the drawn state under load.
    """
    with pytest.raises(ModelError, match=word) as refusal:
        make()
    assert "\n" not in str(refusal.value)


def test_a_massless_part_that_nothing_holds_is_refused() -> None:
    """A weightless rod that spins on a ball joint has no equation of motion.

    Catches: a mode of frequency zero or infinity for it.
    """
    mass = Body((2.0, 0.0, 1.0), 1.0, (1.0, 1.0, 1.0), "mass")
    spinning = rod_of(straight(2, 1.0) + np.array([2.0, 0.0, 0.0]), STIFF, name="loose")
    model = RodModel(
        [WEIGHTLESS, spinning],
        [Rigid(TIP, ("mass", (2.0, 0.0, 0.0))), Spherical(TIP, ("loose", 0))],
        [mass],
        [BASE],
    )
    with pytest.raises(ModelError, match="part without mass"):
        modes(model)


def _jointed() -> RodModel:
    other = rod_of(
        straight(3, 1.5, (0.2, 1.0, 0.3)) + np.array([2.0, 0.0, 0.0]), STIFF, mass_per_length=2e-4, name="other"
    )
    mass = Body((2.5, 1.8, 0.5), 3e-4, (2e-5, 3e-5, 4e-5), "mass")
    end = tuple((straight(1, 1.5, (0.2, 1.0, 0.3))[-1] + np.array([2.0, 0.0, 0.0])).tolist())
    return RodModel(
        [ROD, other],
        [Hinge(TIP, ("other", 0), (0.1, 0.3, 1.0)), Rigid(("other", -1), ("mass", end))],
        [mass],
        [BASE, Hold(("other", 1), "y", "")],
        [PointLoad(("mass", end), (0.05, 0.1, -0.03))],
        [Spring(("mass", end), (4.0, 3.0, 1.0), 0.2, rest_length=1.0)],
    )


def test_shapes_are_normalised_and_obey_the_joints() -> None:
    """Unit kinetic energy, no work between modes, and no motion that opens a joint; small oscillations check energy.

    Along a shape the energy's second derivative is the squared frequency: of a free equilibrium state, by differences
    of the model's own energy along the motion that closes the joints to second order, it is checked through statics:
    the shapes' stiffness form equals the squares.

    Catches: spatial inertia taken in the body's axes, shapes normalised by their largest entry.
    """
    from fem_biobot.rod.balance import of_state, out_of_balance, tangent
    from fem_biobot.rod.sparse import pattern

    model = _jointed()
    state = statics(model).last
    found = modes(model, state, 8)
    inertia = model.assembly.inertia
    J = np.einsum("nki,nkl,nlj->nij", state.Q, inertia.J, state.Q)
    s = found.shapes
    kinetic = np.einsum("cni,n,dni->cd", s[:, :, :3], inertia.mass, s[:, :, :3])
    kinetic += np.einsum("cni,nij,dnj->cd", s[:, :, 3:], J, s[:, :, 3:])
    np.testing.assert_allclose(kinetic, np.eye(8), rtol=0.0, atol=1e-8)
    given, at = of_state(state)
    forces = out_of_balance(model, given, at)
    unknowns = pattern(given.assembly, model.system)
    A = unknowns.matrix(*tangent(model, given, at, forces.s, forces.tension, forces.lengths)).toarray()
    u = np.array([unknowns.gather(v, np.zeros_like(forces.value)) for v in s])
    np.testing.assert_allclose(u @ A @ u.T, np.diag(found.squares), rtol=0.0, atol=1e-7 * found.squares.max())
    gaps = A[unknowns.joint] @ u.T
    assert np.abs(gaps).max() < 1e-8 * np.abs(u).max()
    np.testing.assert_allclose(found.frequencies, np.sqrt(found.squares) / (2 * np.pi), rtol=1e-14)
    assert (np.diff(found.squares) >= 0.0).all()


def test_a_prestressed_state_is_not_the_drawn_one() -> None:
    """Frequencies change with the load, and the model and state given stay as they are.

    Catches: the drawn state's tangent used for every state.
    """
    model = _jointed()
    state = statics(model).last
    with unchanged(state.x, state.Q, state.multiplier, model.built.x):
        loaded = modes(model, state, 3).squares
    more = statics(model, [2.0]).last
    assert np.abs(modes(model, more, 3).squares / loaded - 1.0).max() > 1e-3


def test_no_more_modes_than_motions() -> None:
    """One body on a rail has one.

    Catches: infinite frequencies of what joints hold.
    """
    place = ("body", (0.0, 0.0, 0.0))
    body = Body((0.0, 0.0, 0.0), 2.0, generator(3).uniform(1.0, 2.0, 3))
    model = RodModel(bodies=[body], supports=[Hold(place, "yz")], members=[Spring(place, (3.0, 0.0, 0.0), 5.0)])
    found = modes(model)
    np.testing.assert_allclose(found.squares, [2.5], rtol=1e-12)
    np.testing.assert_allclose(np.abs(found.shapes[0, 0]), [1 / np.sqrt(2.0), 0, 0, 0, 0, 0], rtol=0.0, atol=1e-12)

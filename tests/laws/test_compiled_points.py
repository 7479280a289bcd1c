"""The compiled point stage of each law against its own energy, stress and tangent; compiled and as plain Python."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack

import numpy as np
import pytest

from fem_biobot.errors import ModelError
from fem_biobot.material import NaturalState, NeoHooke, NominalTension, active, natural_state, neo_hooke
from fem_biobot.solid.system import add_law
from tests.helpers import generator, generic_gradients, plain_python, unchanged, unpack, unpack_tangent
from tests.laws.cases import CASES, F0, FIBRE, POISSON, YOUNG, Case

EPS = np.finfo(float).eps
ROUNDING = 2000 * EPS
N_ELEMENTS, N_POINTS = 6, 2
F = generic_gradients(N_ELEMENTS * N_POINTS, seed=161).reshape(3, 3, N_ELEMENTS, N_POINTS)
CHOSEN = np.array([4, 0, 3])
OTHERS = np.array([1, 2, 5])

every_law = pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)


@pytest.fixture(params=["compiled", "plain"])
def mode(request: pytest.FixtureRequest) -> Iterator[str]:
    """Run the kernels compiled, and as the Python they were compiled from."""
    with ExitStack() as stack:
        if request.param == "plain":
            stack.enter_context(plain_python(neo_hooke, "neo_hooke_points"))
            stack.enter_context(plain_python(active, "nominal_tension_points"))
            stack.enter_context(plain_python(natural_state, "pull_back_points"))
        yield request.param


def _outputs() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Outputs that already hold something, as after another law."""
    draw = generator(9)
    shape = (N_ELEMENTS, N_POINTS)
    return draw.normal(size=(6, *shape)), draw.normal(size=(21, *shape)), draw.normal(size=shape)


def _assert_added(law: object, S: np.ndarray, D: np.ndarray, psi: np.ndarray, reference: object = None) -> None:
    """What was added at CHOSEN gives the law's P = F S and A4 = I x S + F D F, and its energy; nothing elsewhere."""
    S0, D0, psi0 = _outputs()
    for new, old in ((S, S0), (D, D0), (psi, psi0)):
        np.testing.assert_array_equal(new[..., OTHERS, :], old[..., OTHERS, :])
    law = reference or law
    here = F[:, :, CHOSEN]
    S_full = unpack((S - S0)[:, CHOSEN])
    D_full = unpack_tangent((D - D0)[:, CHOSEN])
    A4 = law.tangent(here)
    scale = np.max(np.abs(A4))
    P = np.einsum("im...,mk...->ik...", here, S_full)
    np.testing.assert_allclose(P, law.stress(here), rtol=0.0, atol=ROUNDING * scale)
    found = np.einsum("ij,kl...->ikjl...", np.eye(3), S_full)
    found += np.einsum("im...,mknl...,jn...->ikjl...", here, D_full, here)
    np.testing.assert_allclose(found, A4, rtol=0.0, atol=ROUNDING * scale)
    np.testing.assert_allclose((psi - psi0)[CHOSEN], law.energy(here), rtol=0.0, atol=ROUNDING * scale)


@every_law
def test_compiled_form_agrees_with_stress_tangent_and_energy(case: Case, mode: str) -> None:
    """add_second_piola adds, at its elements only, what stress, tangent and energy say.

    Catches: a swapped packed component, a lost factor on shear, assignment for addition, elements ignored.
    """
    law = case.make()
    S, D, psi = _outputs()
    with unchanged(F, CHOSEN):
        law.add_second_piola(F, CHOSEN, S, D, psi)
    _assert_added(law, S, D, psi)


def test_tension_and_fibres_may_differ_from_point_to_point(mode: str) -> None:
    """Each point takes its own tension and fibre.

    Catches: element and point indices exchanged, the first element's fibre used for all.
    """
    draw = generator(12)
    tension = draw.uniform(1.0, 9.0, (N_ELEMENTS, N_POINTS))
    a0 = draw.normal(size=(3, N_ELEMENTS, N_POINTS))
    a0 /= np.linalg.norm(a0, axis=0)
    S, D, psi = _outputs()
    NominalTension(tension, a0).add_second_piola(F, CHOSEN, S, D, psi)
    reference = NominalTension(tension[CHOSEN], a0[:, CHOSEN])
    _assert_added(None, S, D, psi, reference)


def test_fibres_may_differ_from_element_to_element(mode: str) -> None:
    """Fibres given one an element serve all its points.

    Catches: the element axis taken for the point axis.
    """
    a0 = generator(13).normal(size=(3, N_ELEMENTS))
    a0 /= np.linalg.norm(a0, axis=0)
    S, D, psi = _outputs()
    NominalTension(4.4, a0).add_second_piola(F, CHOSEN, S, D, psi)
    _assert_added(None, S, D, psi, NominalTension(4.4, a0[:, CHOSEN]))


def test_natural_states_may_differ_from_element_to_element(mode: str) -> None:
    """Each element is measured from its own natural state.

    Catches: the inverse or the determinant of another element's natural state.
    """
    draw = generator(14)
    each = F0[:, :, None] + 0.1 * draw.normal(size=(3, 3, N_ELEMENTS))
    S, D, psi = _outputs()
    NaturalState(NeoHooke(YOUNG, POISSON), each).add_second_piola(F, CHOSEN, S, D, psi)
    _assert_added(None, S, D, psi, NaturalState(NeoHooke(YOUNG, POISSON), each[:, :, CHOSEN]))


class _Bare:
    """A law without a compiled form."""

    def __init__(self, law: object) -> None:
        self.energy, self.stress, self.tangent = law.energy, law.stress, law.tangent


@every_law
def test_a_law_without_compiled_form_is_converted(case: Case) -> None:
    """The solver turns P and A4 of any law into the same S, D and energy as a compiled one.

    Catches: a missing ``- I x S`` in the conversion, minor axes exchanged.
    """
    law = case.make()
    S, D, psi = _outputs()
    with unchanged(F):
        add_law(_Bare(law), F, CHOSEN, S, D, psi)
    _assert_added(law, S, D, psi)


def test_a_natural_state_needs_a_compiled_law_in_the_compiled_stage() -> None:
    """A law without add_second_piola inside a natural state is refused there, not converted wrongly.

    Catches: a silent AttributeError or zero stress.
    """
    law = NaturalState(_Bare(NeoHooke(YOUNG, POISSON)), F0)
    with pytest.raises(ModelError, match="add_second_piola"):
        law.add_second_piola(F, CHOSEN, *_outputs())


def test_fibre_stretch_is_the_length_of_the_carried_fibre() -> None:
    """The stretch is |F a0|, the same for -a0 and after any rotation.

    Catches: ``a0 . F a0``, a missing square root.
    """
    draw = generator(15)
    Q, _ = np.linalg.qr(draw.normal(size=(3, 3)))
    with unchanged(F, FIBRE):
        stretch = active.fibre_stretch(F, FIBRE)
    wanted = np.array([[np.linalg.norm(F[:, :, e, q] @ FIBRE) for q in range(N_POINTS)] for e in range(N_ELEMENTS)])
    np.testing.assert_allclose(stretch, wanted, rtol=20 * EPS)
    turned = np.einsum("ij,jkeq->ikeq", Q, F)
    np.testing.assert_allclose(active.fibre_stretch(turned, -FIBRE), wanted, rtol=50 * EPS)

"""The compiled point stage of each law against its own energy, stress and tangent; compiled and as plain Python."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack

import numpy as np
import pytest

from fem_biobot.errors import ModelError
from fem_biobot.material import (
    ActiveStrain,
    AngularTension,
    Dispersion,
    FibreTension,
    NaturalState,
    NeoHooke,
    fibre_tension,
    isochoric,
    natural_state,
    neo_hooke,
)
from fem_biobot.material.fibre_tension import fibre_stretch
from fem_biobot.material.law import PAIRS, add_law, at_elements, is_symmetric
from tests.helpers import generator, generic_gradients, plain_python, unchanged, unpack, unpack_tangent
from tests.laws.cases import CASES, F0, FIBRE, POISSON, YOUNG, Case, make_law

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
            stack.enter_context(plain_python(isochoric, "invariants", "add_invariant_points"))
            stack.enter_context(plain_python(fibre_tension, "tension_points"))
            stack.enter_context(plain_python(natural_state, "pull_back_points"))
        yield request.param


class _Bare:
    """A law without a compiled form."""

    def __init__(self, law: object) -> None:
        self.law, self.symmetric = law, is_symmetric(law)

    def at(self, elements: np.ndarray) -> object:
        return _Bare(at_elements(self.law, elements))

    def energy(self, F: np.ndarray) -> np.ndarray:
        return self.law.energy(F)

    def stress(self, F: np.ndarray) -> np.ndarray:
        return self.law.stress(F)

    def tangent(self, F: np.ndarray) -> np.ndarray:
        return self.law.tangent(F)


every_size = pytest.mark.parametrize("columns", [0, 21, 36])


def _outputs(columns: int = 21) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Outputs that already hold something, as after another law."""
    draw = generator(9)
    shape = (N_ELEMENTS, N_POINTS)
    return draw.normal(size=(6, *shape)), draw.normal(size=(columns, *shape)), draw.normal(size=shape)


def _full(D: np.ndarray) -> np.ndarray:
    """Packed tangent of 21 or 36 rows in full."""
    if len(D) == 21:
        return unpack_tangent(D)
    full = np.empty((3, 3, 3, 3, *D.shape[1:]))
    for a, (i, j) in enumerate(PAIRS):
        for b, (k, m) in enumerate(PAIRS):
            for p, q in ((i, j), (j, i)):
                full[p, q, k, m] = full[p, q, m, k] = D[6 * a + b]
    return full


def _assert_added(law: object, S: np.ndarray, D: np.ndarray, psi: np.ndarray) -> None:
    """What was added at CHOSEN gives the law's P = F S and A4 = I x S + F D F, and its energy; nothing elsewhere.

    `law` is that of the chosen elements. A packed triangle holds the symmetric part of an unsymmetric tangent.
    """
    S0, D0, psi0 = _outputs(len(D))
    for new, old in ((S, S0), (D, D0), (psi, psi0)):
        np.testing.assert_array_equal(new[..., OTHERS, :], old[..., OTHERS, :])
    here = F[:, :, CHOSEN]
    S_full = unpack((S - S0)[:, CHOSEN])
    A4 = law.tangent(here)
    scale = np.max(np.abs(A4))
    P = np.einsum("im...,mk...->ik...", here, S_full)
    np.testing.assert_allclose(P, law.stress(here), rtol=0.0, atol=ROUNDING * scale)
    if len(D):
        found = np.einsum("ij,kl...->ikjl...", np.eye(3), S_full)
        found += np.einsum("im...,mknl...,jn...->ikjl...", here, _full((D - D0)[:, CHOSEN]), here)
        wanted = A4 if len(D) == 36 else 0.5 * (A4 + np.moveaxis(A4, (2, 3), (0, 1)))
        np.testing.assert_allclose(found, wanted, rtol=0.0, atol=ROUNDING * scale)
    energy = law.energy(here) if is_symmetric(law) else 0.0
    np.testing.assert_allclose((psi - psi0)[CHOSEN], energy, rtol=0.0, atol=ROUNDING * scale)


@every_law
@every_size
def test_compiled_form_agrees_with_stress_tangent_and_energy(case: Case, columns: int, mode: str) -> None:
    """add_second_piola adds, at its elements only, what stress, tangent and energy say.

    Catches: a swapped packed component, a lost factor on shear, assignment for addition, elements ignored, a whole
    matrix filled by columns.
    """
    law = case.make()
    S, D, psi = _outputs(columns)
    with unchanged(F, CHOSEN):
        add_law(law, F, CHOSEN, S, D, psi)
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
    FibreTension(tension, a0).add_second_piola(F, CHOSEN, S, D, psi)
    _assert_added(FibreTension(tension[CHOSEN], a0[:, CHOSEN]), S, D, psi)


def test_fibres_may_differ_from_element_to_element(mode: str) -> None:
    """Fibres given one an element serve all its points.

    Catches: the element axis taken for the point axis.
    """
    a0 = generator(13).normal(size=(3, N_ELEMENTS))
    a0 /= np.linalg.norm(a0, axis=0)
    S, D, psi = _outputs()
    FibreTension(4.4, a0).add_second_piola(F, CHOSEN, S, D, psi)
    _assert_added(FibreTension(4.4, a0[:, CHOSEN]), S, D, psi)


FIELDS = generator(13).normal(size=(3, N_ELEMENTS))
FIELDS /= np.linalg.norm(FIELDS, axis=0)
TENSIONS = generator(17).uniform(1.0, 9.0, N_ELEMENTS)
VARIED = {
    "tension": FibreTension(TENSIONS, FIELDS, transverse=0.2),
    "integrated": AngularTension(TENSIONS, FIELDS, Dispersion(0.3, "solid"), "kirchhoff"),
    "active_strain": ActiveStrain(TENSIONS, FIELDS, NeoHooke(YOUNG, POISSON)),
    "natural_state": NaturalState(_Bare(NeoHooke(YOUNG, POISSON)), F0[:, :, None] + 0.02 * FIELDS),
    "fibres_inside": NaturalState(make_law("guccione", a0=FIELDS), F0[:, :, None] + 0.02 * FIELDS),
    "rest": make_law("blemker", a0=FIELDS).split()[0],
    "nested": NaturalState(NaturalState(NeoHooke(YOUNG, POISSON), F0[:, :, None] + 0.02 * FIELDS), F0),
}


@pytest.mark.parametrize("law", VARIED.values(), ids=VARIED)
def test_the_law_of_some_elements_is_that_of_all_there(law: object) -> None:
    """What `at` hands out for some elements says there what the compiled form adds, fields of fibres and all.

    Catches: fibres, tensions or natural states of other elements; an inner law left with all elements.
    """
    S, D, psi = _outputs()
    add_law(law, F, CHOSEN, S, D, psi)
    _assert_added(law.at(CHOSEN), S, D, psi)
    direct = _outputs()
    add_law(_Bare(law), F, CHOSEN, *direct)
    np.testing.assert_allclose(direct[0], S, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(direct[1], D, rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("fields", [{"a0": FIELDS[:, :4]}, {"tension": TENSIONS[:4]}], ids=["a0", "tension"])
def test_fields_of_another_number_of_elements_are_refused(fields: dict[str, object]) -> None:
    """Tension and fibres given by element must be given for every element of the mesh.

    Catches: reading beyond an array in the compiled code.
    """
    law = FibreTension(**{"tension": 4.4, "a0": FIBRE, **fields})
    with pytest.raises(ModelError, match=f"{next(iter(fields))}: found values for 4 elements, expected 1 or 6"):
        law.add_second_piola(F, CHOSEN, *_outputs())


def test_natural_states_may_differ_from_element_to_element(mode: str) -> None:
    """Each element is measured from its own natural state.

    Catches: the inverse or the determinant of another element's natural state.
    """
    draw = generator(14)
    each = F0[:, :, None] + 0.1 * draw.normal(size=(3, 3, N_ELEMENTS))
    S, D, psi = _outputs()
    NaturalState(NeoHooke(YOUNG, POISSON), each).add_second_piola(F, CHOSEN, S, D, psi)
    _assert_added(NaturalState(NeoHooke(YOUNG, POISSON), each[:, :, CHOSEN]), S, D, psi)


@every_law
@every_size
def test_a_law_without_compiled_form_is_converted(case: Case, columns: int) -> None:
    """The solver turns P and A4 of any law into the same S, D and energy as a compiled one.

    Catches: a missing ``- I x S`` in the conversion, minor axes exchanged, an energy asked of a law that has none.
    """
    law = case.make()
    S, D, psi = _outputs(columns)
    with unchanged(F):
        add_law(_Bare(law), F, CHOSEN, S, D, psi)
    _assert_added(law, S, D, psi)


def test_a_natural_state_takes_a_law_without_compiled_form() -> None:
    """A law of a user's own, without add_second_piola, serves inside a natural state too.

    Catches: an AttributeError, a stress of the wrong elements.
    """
    law = NaturalState(_Bare(NeoHooke(YOUNG, POISSON)), F0)
    S, D, psi = _outputs()
    law.add_second_piola(F, CHOSEN, S, D, psi)
    _assert_added(NaturalState(NeoHooke(YOUNG, POISSON), F0), S, D, psi)


def test_fibre_stretch_is_the_length_of_the_carried_fibre() -> None:
    """The stretch is |F a0|, the same for -a0 and after any rotation.

    Catches: ``a0 . F a0``, a missing square root.
    """
    draw = generator(15)
    Q, _ = np.linalg.qr(draw.normal(size=(3, 3)))
    with unchanged(F, FIBRE):
        stretch = fibre_stretch(F, FIBRE)
    wanted = np.array([[np.linalg.norm(F[:, :, e, q] @ FIBRE) for q in range(N_POINTS)] for e in range(N_ELEMENTS)])
    np.testing.assert_allclose(stretch, wanted, rtol=20 * EPS)
    turned = np.einsum("ij,jkeq->ikeq", Q, F)
    np.testing.assert_allclose(fibre_stretch(turned, -FIBRE), wanted, rtol=50 * EPS)

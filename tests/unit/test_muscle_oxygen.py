"""Oxygen in tissue: known profiles, orders, positivity, and what is refused."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import skfem
from numpy.typing import NDArray
from scipy.integrate import solve_bvp

from fem_biobot.errors import ModelError, SolveError
from fem_biobot.muscle import oxygen as module
from fem_biobot.muscle.oxygen import OxygenField, OxygenLaw, steady_oxygen
from fem_biobot.muscle.oxygen_depth import (
    anoxic_radius,
    consumption_for,
    critical_thickness,
    largest_thickness,
    section,
    slab,
    slab_gamma,
    slab_profile,
)
from tests.helpers import slope

Array = NDArray[np.float64]
# generic numbers: half saturation a twelfth of the supply, a film that takes a tenth of it
LAW = OxygenLaw(supply=0.19, diffusivity=1.6e-3, consumption=0.013, half_saturation=0.016, threshold=3e-3, film=0.03)
CONSTANT = replace(LAW, half_saturation=1e-9)


@cache
def radial(law: OxygenLaw, radius: float, power: int) -> Callable[[Array], Array]:
    """Profile across a slab (power 0) or a cylinder (1) by collocation on a line, independent of the package."""
    film = math.inf if law.film is None else law.film

    def rhs(r: Array, y: Array) -> Array:
        c = np.maximum(y[0], 0.0)
        return np.vstack([y[1], law.consumption * c / (law.half_saturation + c) / law.diffusivity])

    def ends(a: Array, b: Array) -> Array:
        inflow = b[0] - law.supply if math.isinf(film) else law.diffusivity * b[1] - film * (law.supply - b[0])
        return np.array([a[1], inflow])

    r = np.linspace(0.0, radius, 200)
    guess = law.supply * np.vstack([0.1 + 0.9 * (r / radius) ** 2, 1.8 * r / radius**2])
    # the cylinder's singular term, which makes c'' half of the rate at its axis
    S = None if power == 0 else np.array([[0.0, 0.0], [0.0, -float(power)]])
    found = solve_bvp(rhs, ends, r, guess, S=S, tol=1e-9, max_nodes=20000)
    assert found.success
    return lambda at: found.sol(at)[0]


def error(field: OxygenField, exact: Callable[[Array], Array]) -> float:
    """Root mean square of the error over the mesh, over the supply."""
    X = np.asarray(field.basis.global_coordinates())
    distance = np.sqrt((X**2).sum(axis=0)) if X.shape[0] < 3 else np.abs(X[2])
    dx = field.basis.dx
    off = field.points - exact(distance.ravel()).reshape(distance.shape)
    return float(np.sqrt((dx * off**2).sum() / dx.sum())) / field.law.supply


def test_rate_is_the_derivative_of_the_energy_and_slope_of_the_rate() -> None:
    """Central differences on both sides of zero, where the rate goes on as its tangent.

    Catches: a lost half saturation, a branch with another slope at zero, a sign.
    """
    c = np.array([-0.02, -1e-5, 2e-5, 0.004, 0.11])
    h = 1e-7
    assert (LAW.potential(c + h) - LAW.potential(c - h)) / (2 * h) == pytest.approx(LAW.rate(c), rel=1e-6)
    assert (LAW.rate(c + h) - LAW.rate(c - h)) / (2 * h) == pytest.approx(LAW.slope(c), rel=1e-5)
    assert LAW.rate(np.array([LAW.half_saturation]))[0] == pytest.approx(LAW.consumption / 2.0)


@pytest.mark.parametrize("law", [CONSTANT, replace(CONSTANT, film=None)], ids=["film", "stirred"])
def test_constant_consumption_gives_the_parabola_and_an_anoxic_core(law: OxygenLaw) -> None:
    """Thin: the parabola, which quadratic elements hold to rounding. Thick: oxygen enters half the critical thickness.

    Catches: the factor 2 or 8 of the depth, a film counted on one side only, a core of another width.
    """
    deep = critical_thickness(law)
    thin = slab(law, 0.9 * deep, 12)
    # what is left of the half saturation: its share of the least concentration
    assert np.abs(thin.c - slab_profile(law, 0.9 * deep, thin.basis.doflocs[0])).max() < 1e-6 * law.supply
    assert slab(law, deep, 12).c[0] == pytest.approx(0.0, abs=2e-4 * law.supply)
    thick = slab(law, 2.2 * deep, 300)
    exact = slab_profile(law, 2.2 * deep, thick.basis.doflocs[0])
    # the kink at the core's edge lies within an element: V h^2 / 8 D
    h = 1.1 * deep / 300
    assert np.abs(thick.c - exact).max() < 2.0 * law.consumption * h**2 / (8.0 * law.diffusivity)
    assert thick.undershoot < 1e-4
    # all oxygen that enters is used in the layer
    assert thick.uptake == pytest.approx(law.consumption * deep / 2.0, rel=2e-3)


def test_slab_agrees_with_collocation_at_third_order() -> None:
    """Michaelis-Menten in a slab with a film against a solution on a fine line; 1e-4 on few elements, order 3.

    Catches: a wrong derivative that converges to another field, linear elements, a film on the wrong end.
    """
    thickness = 0.7
    exact = radial(LAW, thickness / 2, 0)
    counts = np.array([8, 16, 32, 64])
    errors = np.array([error(slab(LAW, thickness, int(n)), exact) for n in counts])
    assert errors[-1] < 1e-6
    assert slope(1.0 / counts, errors) == pytest.approx(3.0, abs=0.15)
    # in three dimensions: a plate of distorted tetrahedra, wetted on its large faces only
    z = np.linspace(0.0, thickness / 2, 9)
    plate = skfem.MeshTet.init_tensor(np.linspace(0, 0.3, 3), np.linspace(0, 0.2, 3), z**1.1 * z[-1] ** -0.1)
    top = plate.facets_satisfying(lambda x: np.abs(x[2] - thickness / 2) < 1e-12)
    assert error(steady_oxygen(plate, LAW, top), exact) < 1e-4


def test_cylinder_agrees_with_collocation_and_has_the_core_of_krogh() -> None:
    """A disc of curved triangles against a solution along the radius, and with constant consumption its anoxic core.

    Catches: a slab's profile in a cylinder, the core radius of another equation, a film per diameter.
    """
    radius = 0.45
    exact = radial(LAW, radius, 1)
    levels = (2, 3, 4)
    discs = [skfem.MeshTri2.init_circle(n).scaled(radius) for n in levels]
    errors = np.array([error(steady_oxygen(disc, LAW), exact) for disc in discs])
    assert errors[-1] < 1e-4
    assert slope(0.5 ** np.array(levels), errors) > 2.7
    core = anoxic_radius(CONSTANT, radius)
    assert 0.2 * radius < core < 0.8 * radius

    def krogh(r: Array) -> Array:
        out = np.maximum(r, core)
        return (
            CONSTANT.consumption
            * (out**2 - core**2 - 2.0 * core**2 * np.log(out / core))
            / (4.0 * CONSTANT.diffusivity)
        )

    assert error(steady_oxygen(discs[-1], CONSTANT), krogh) < 5e-4
    assert anoxic_radius(CONSTANT, 0.9 * critical_thickness(CONSTANT) / 2.0) == 0.0


def test_no_concentration_is_negative_and_the_cut_is_told() -> None:
    """A mesh far too coarse for its consumption gives no negative oxygen, and says how much it cut off.

    Catches: negative concentrations in results, an undershoot that is hidden.
    """
    hungry = replace(LAW, consumption=3.0, half_saturation=1e-3, film=None)
    plate = skfem.MeshTet.init_tensor(*([np.linspace(0, 1, 4)] * 3))
    field = steady_oxygen(plate, hungry)
    assert field.c.min() >= 0.0
    assert field.undershoot > 1e-3
    assert slab(LAW, 0.5).undershoot == 0.0


def test_largest_thickness_scales_with_the_root_of_consumption() -> None:
    """At the thickness found the share is what was asked; four times the consumption halves it where there is no film.

    Catches: a rule that finds another share, one in which half saturation is forgotten.
    """
    law = replace(LAW, film=None)
    found = largest_thickness(law, 0.9)
    assert slab_gamma(law, found) == pytest.approx(0.9, abs=2e-4)
    quick = replace(law, consumption=4.0 * law.consumption)
    assert largest_thickness(quick, 0.9) == pytest.approx(found / 2.0, rel=1e-4)
    # tissue in which consumption falls with oxygen may be thicker than that in which it does not
    assert found > largest_thickness(replace(law, half_saturation=1e-6), 0.9)
    assert largest_thickness(replace(law, consumption=0.0)) == math.inf
    assert critical_thickness(replace(law, consumption=0.0)) == math.inf
    assert slab_gamma(law, 0.1) == 1.0


def test_a_wide_section_is_a_slab_but_for_its_ends() -> None:
    """Viable share of a rectangle: nearer to the slab's the wider it is, larger since its ends are wetted too.

    Catches: a quarter taken for a half, width and thickness mixed up, ends that are sealed.
    """
    law = replace(LAW, film=None)
    thickness = 1.3 * largest_thickness(law, 0.9)
    one = slab_gamma(law, thickness)
    near, far = (section(law, ratio * thickness, thickness, 24).gamma() for ratio in (2.0, 8.0))
    assert one < far < near < 1.0
    assert far - one < 0.3 * (near - one)
    assert section(law, thickness, 3.0 * thickness, 24).gamma() == pytest.approx(
        section(law, 3.0 * thickness, thickness, 24).gamma(), rel=1e-12
    )


def test_what_makes_no_oxygen_problem_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each impossible number, a body without a wetted face, and a Newton iteration that does not end.

    Catches: a law without a supply, a silent field of zeros, an endless loop.
    """
    for name, value in (("supply", 0.0), ("diffusivity", -1.0), ("half_saturation", 0.0), ("consumption", -1.0)):
        with pytest.raises(ModelError, match=f"{name}: found {value:g}"):
            replace(LAW, **{name: value})
    with pytest.raises(ModelError, match="film: found 0 mm/s"):
        replace(LAW, film=0.0)
    with pytest.raises(ModelError, match=r"threshold: found 0\.3 mM, expected less than the supply"):
        replace(LAW, threshold=0.3)
    with pytest.raises(ModelError, match="wetted: found no face"):
        steady_oxygen(skfem.MeshTri(), LAW, np.zeros(0, dtype=np.int64))
    with pytest.raises(ModelError, match="thickness: found 0 mm"):
        slab(LAW, 0.0)
    with pytest.raises(ModelError, match="gamma: found 1, expected a share"):
        largest_thickness(LAW, 1.0)
    monkeypatch.setattr(module, "_ITERATIONS", 1)
    with pytest.raises(SolveError, match="oxygen: no steady field in 1 iterations"):
        slab(LAW, 0.7)


def test_conjugate_gradients_give_the_same_field(monkeypatch: pytest.MonkeyPatch) -> None:
    """What large bodies are solved with agrees with the factorisation, and a failure is said.

    Catches: a tolerance that shows in the result.
    """
    plate = skfem.MeshTet.init_tensor(*([np.linspace(0, 0.4, 5)] * 3))
    direct = steady_oxygen(plate, LAW).c
    monkeypatch.setattr(module, "_DIRECT", 0)
    assert steady_oxygen(plate, LAW).c == pytest.approx(direct, abs=1e-8 * LAW.supply)
    monkeypatch.setattr(module, "cg", lambda *_, **__: (None, 1))
    with pytest.raises(SolveError, match="conjugate gradients did not solve"):
        steady_oxygen(plate, LAW)


def test_consumption_for_a_share_inverts_the_share() -> None:
    """The consumption found gives the share asked for; a share that does not fall, or is none, is refused.

    Catches: a search that stops at its first bracket.
    """
    law = replace(LAW, film=None)
    found = consumption_for(lambda here: slab_gamma(here, 0.6), law, 0.83)
    assert slab_gamma(replace(law, consumption=found), 0.6) == pytest.approx(0.83, abs=1e-3)
    with pytest.raises(ModelError, match="gamma: found 0, expected a share"):
        consumption_for(lambda here: 1.0, law, 0.0)
    with pytest.raises(ModelError, match=r"gamma: found a share above 0\.9 at any"):
        consumption_for(lambda here: 1.0, law, 0.9)

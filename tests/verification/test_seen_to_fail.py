"""Each case of the verification table fails when what it computes is a little wrong.

A fault is put between the case and the package (a load that turns along, a swapped stiffness, a fibre left in its
frame), the case is computed anew, and a named row must fail. Faults are about as small as the case promises to see.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from fem_biobot import (
    ActiveStress,
    BodyForce,
    Design,
    DistributedLoad,
    Fix,
    Foundation,
    Gravity,
    Ground,
    NeoHooke,
    PointLoad,
    Pressure,
    Section,
    SolidModel,
    Symmetry,
    reduce,
    solid_dynamics,
    walk,
)
from fem_biobot.material import law_from
from fem_biobot.solid.interface.record import Sliding
from fem_biobot.verification import (
    cardiac,
    contact,
    contact_sticking,
    cook,
    machine,
    muscle_and_spring,
    published_walker,
    rod_systems,
    rod_turned,
    rods,
    sliding,
    solid_driven,
    solid_fields,
    solid_machine,
    solid_moving,
    solid_states,
    two_models,
    walker,
)
from fem_biobot.verification.beam import EccentricStrip
from fem_biobot.verification.registry import CASES
from fem_biobot.verification.rod_parts import rod_of

Patch = pytest.MonkeyPatch
MODULES = (
    cardiac, contact, contact_sticking, cook, machine, muscle_and_spring, published_walker, rod_systems, rods, sliding,
    solid_driven, solid_machine, solid_moving, two_models, walker,
)  # fmt: skip
# case to the words of a row that must fail, and the fault
FAULTS: dict[str, tuple[str, Callable[[Patch], None]]] = {}


def fault(case: str, row: str) -> Callable[[Callable[[Patch], None]], None]:
    """Registers the fault of a case."""

    def keep(put: Callable[[Patch], None]) -> None:
        FAULTS[case] = row, put

    return keep


@fault("S1", "nominal tension of 2 mu")
def _nearly_incompressible(patch: Patch) -> None:
    patch.setattr(solid_states, "NeoHooke", lambda E, nu: NeoHooke(E, min(nu, 0.4999)))


@fault("S2", "every stretch")
def _less_tension_across(patch: Patch) -> None:
    patch.setattr(solid_states, "ActiveStress", lambda *a, transverse: ActiveStress(*a, transverse=0.999 * transverse))


@fault("S3", "along the actuation")
def _theta_from_the_actuation(patch: Patch) -> None:
    patch.setattr(solid_states, "ActiveStress", lambda T, a0, *more: ActiveStress(T, a0[[1, 0, 2]], *more))


@fault("S4", "stretch and shear, gent")
def _a_modulus_off_in_its_eighth_digit(patch: Patch) -> None:
    patch.setattr(solid_states, "law_from", lambda name, E, *a, **own: law_from(name, (1.0 + 1e-8) * E, *a, **own))


@fault("S5", "order of the displacement, P2")
def _body_force_off_by_three_thousandths(patch: Patch) -> None:
    patch.setattr(solid_fields, "BodyForce", lambda value: BodyForce(lambda X: 1.003 * value(X)))


@fault("S6", "P2-P1, 8 by 8")
def _plane_stress(patch: Patch) -> None:
    free = Fix((0.0, 0.0, 0.0), "z")
    patch.setattr(cook, "Symmetry", lambda surface: Symmetry(surface) if surface == "z0" else free)


@fault("S7", "nu = 0.4999")
def _linear_elements(patch: Patch) -> None:
    patch.setattr(cook, "SolidModel", lambda *a, element, **more: SolidModel(*a, element="P1", **more))
    # without a pressure there is no law at 1/2
    patch.setattr(cook, "isochoric", lambda poisson, made=cook.isochoric: made(min(poisson, 0.4999)))


@fault("S8", "strain energy, P2")
def _fibres_left_in_the_global_frame(patch: Patch) -> None:
    patch.setattr(solid_fields, "ActiveStress", lambda tension, a0: ActiveStress(tension, solid_fields.FIBRES))


@fault("S9", "largest reaction")
def _a_seventh_motion_held(patch: Patch) -> None:
    held = (*solid_machine.OTHER_SUPPORTS, Fix("span_short", "x"))
    patch.setattr(solid_machine, "OTHER_SUPPORTS", held)


@fault("S10", "closure at the muscle")
def _moment_arm_to_another_plane(patch: Patch) -> None:
    patch.setattr(solid_machine, "EccentricStrip", lambda E, b, t, L, h: EccentricStrip(E, b, t, L, h + 0.01))


@fault("S11", "strain at 0.4, solid")
def _a_softer_spring(patch: Patch) -> None:
    patch.setattr(muscle_and_spring, "Foundation", lambda name, k: Foundation(name, (1.0 - 1e-7) * k))


@fault("S12", "height of the free end")
def _a_dead_pressure(patch: Patch) -> None:
    patch.setattr(cardiac, "Pressure", lambda surface, value: Pressure(surface, value, follower=False))


@fault("S13", "swing of a cantilever")
def _a_body_a_hundredth_denser(patch: Patch) -> None:
    def moved(*given: Any, densities: dict[str, float], **more: Any) -> Any:
        return solid_dynamics(*given, densities={name: 1.01 * rho for name, rho in densities.items()}, **more)

    patch.setattr(solid_moving, "solid_dynamics", moved)


@fault("S14", "rate under 0.35 of the force, solid")
def _a_fastest_shortening_off_by_a_hundredth(patch: Patch) -> None:
    curve = solid_driven.ForceVelocity
    patch.setattr(solid_driven, "ForceVelocity", lambda fastest, *more: curve(1.01 * fastest, *more))


@fault("S15", "terminal speed")
def _a_millionth_more_drag(patch: Patch) -> None:
    drag = solid_driven.SurfaceDrag
    patch.setattr(solid_driven, "SurfaceDrag", lambda a, b: drag(a, (1.0 + 1e-6) * b))


@fault("R1", "x / L, half of it")
def _moment_off_in_its_ninth_digit(patch: Patch) -> None:
    patch.setattr(rods, "PointLoad", lambda place, moment: PointLoad(place, moment=(0.0, 0.0, (1 + 1e-9) * moment[2])))


@fault("R2", "w / L, P L^2 / E I = 1")
def _force_turning_along(patch: Patch) -> None:
    patch.setattr(rods, "PointLoad", lambda place, force: PointLoad(place, force=force, following=True))


@fault("R3", "x / L, q L^3 / E I = 15")
def _load_off_by_a_thousandth(patch: Patch) -> None:
    patch.setattr(rods, "DistributedLoad", lambda rod, force: DistributedLoad(rod, force=(0.0, 1.001 * force[1], 0.0)))


@fault("R4", "displacement along x")
def _torsion_off_by_a_thousandth(patch: Patch) -> None:
    patch.setattr(rods, "BEND_STIFFNESS", (*rods.BEND_STIFFNESS[:5], 1.001 * rods.BEND_STIFFNESS[5]))


@fault("R5", "shear factor 27/28")
def _shear_factor_on_the_other_side(patch: Patch) -> None:
    class Inverted(Section):
        @classmethod
        def circle(cls, radius: float, shear_factor: Any = None) -> Section:
            return Section.circle(radius, shear_factor=1.0 / shear_factor)

    patch.setattr(rods, "Section", Inverted)


@fault("R6", "root 1, clamped-free")
def _mass_off_by_a_thousandth(patch: Patch) -> None:
    def heavier(*a: Any, mass_per_length: float, **more: Any) -> Any:
        return rod_of(*a, mass_per_length=1.001 * mass_per_length, **more)

    patch.setattr(rod_systems, "rod_of", heavier)


@fault("R7", "energy, implicit")
def _dissipation_left_on(patch: Patch) -> None:
    patch.setattr(rod_systems, "CONSERVING", replace(rod_systems.CONSERVING, dissipation=20.0))


@fault("R8", "end moment")
def _twist_a_thousandth_stiffer(patch: Patch) -> None:
    patch.setattr(rod_systems, "rod_of", lambda x, C, **more: rod_of(x, (*C[:5], 1.001 * C[5]), **more))


@fault("R9", "strains")
def _weight_that_stays_downward(patch: Patch) -> None:
    patch.setattr(rod_turned, "Gravity", lambda vector: Gravity((0.0, 0.0, -float(np.linalg.norm(vector)))))


@fault("C1", "distance of the stop, step 0.25 ms")
def _friction_off_in_its_fifth_digit(patch: Patch) -> None:
    patch.setattr(contact, "Ground", lambda friction: Ground((1.0 + 1e-5) * friction))


@fault("C2", "after 10 N")
def _static_friction_kept_in_slip(patch: Patch) -> None:
    patch.setattr(contact, "Ground", lambda static, kinetic: Ground(static))


@fault("C3", "translational energy, solid ball")
def _inertia_off_in_its_sixth_digit(patch: Patch) -> None:
    made = contact.Body

    def heavier(centre: Any, mass: float, J: tuple[float, ...], name: str) -> Any:
        return made(centre, mass, tuple((1.0 + 1e-6) * j for j in J), name)

    patch.setattr(contact, "Body", heavier)


@fault("C4", "largest position")
def _kinetic_friction_off_by_a_thousandth(patch: Patch) -> None:
    patch.setattr(contact_sticking, "Ground", lambda s, k, **more: Ground(s, 1.001 * k, **more))


@fault("C5", "just below")
def _static_friction_too_low(patch: Patch) -> None:
    patch.setattr(contact_sticking, "Ground", lambda s, k: Ground((1.0 - 2e-7) * s, k))


@fault("C6", "equal feet")
def _one_pillar_a_micrometre_longer(patch: Patch) -> None:
    def walked(made: Any, **more: Any) -> Any:
        if isinstance(made, Design) and more["frequency"] == walker.FREQUENCY:
            made = made.with_values({"skeleton.long_pillar_height": 3.101})
        return walk(made, **more)

    patch.setattr(walker, "walk", walked)


@fault("C7", "acceleration on a slope of 30 degrees, backward_euler")
def _friction_a_hundredth_larger(patch: Patch) -> None:
    patch.setattr(solid_moving, "Ground", lambda *friction: Ground(*(1.01 * mu for mu in friction)))


@fault("C8", "tension ratio with friction")
def _friction_of_the_band_three_hundredths_less(patch: Patch) -> None:
    patch.setattr(sliding, "Sliding", lambda friction, **more: Sliding(friction=0.97 * friction, **more))


@fault("B1", "over linear theory")
def _a_beam_a_hundredth_thinner(patch: Patch) -> None:
    linear = machine.linear_closing
    patch.setattr(machine, "linear_closing", lambda force: linear(force) / 0.99)


@fault("B2", "closing without thickness")
def _rods_of_a_beam_a_hundredth_thicker(patch: Patch) -> None:
    def thicker(design: Design) -> Any:
        return reduce(design.with_values({"skeleton.beam_thickness": 1.01 * design.value("skeleton.beam_thickness")}))

    patch.setattr(two_models, "reduce", thicker)


@fault("B3", "weight")
def _beams_with_all_of_their_mass(patch: Patch) -> None:
    made = published_walker.load_design
    patch.setattr(published_walker, "load_design", lambda name: made(name, ["walker.halved_beam = no"]))


def _forget() -> None:
    """Drop what modules of cases remember of earlier computations."""
    for module in MODULES:
        for value in vars(module).values():
            if hasattr(value, "cache_clear"):
                value.cache_clear()


@pytest.fixture
def forgetful() -> Iterator[None]:
    """Nothing that was computed before or with a fault is used again."""
    _forget()
    yield
    _forget()


SLOW = ("S1", "S5", "S6", "S9", "S10", "R6", "R7", "C1", "C4", "C6", "C7", "C8", "S13", "B1", "B3")


@pytest.mark.usefixtures("forgetful")
@pytest.mark.parametrize("name", [pytest.param(n, marks=[pytest.mark.slow] if n in SLOW else []) for n in CASES])
def test_a_fault_fails_its_row(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """With the fault the named row fails by a number, not because the case broke off.

    Catches: a tolerance that lets everything pass, a row that does not depend on what is computed.
    """
    words, put = FAULTS[name]
    case = CASES[name]
    put(monkeypatch)
    rows = [row for row in case.rows(case.compute()) if words in row.claim.quantity]
    assert rows, words
    assert all(np.isfinite(row.ours) for row in rows)
    assert any(row.passed is False for row in rows), [(row.ours, row.claim.reference) for row in rows]

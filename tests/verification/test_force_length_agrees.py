"""The force-length curve of a design in solid and rod.

Problem: the same named curve in both; a strip under standing and stimulated tension that shortens freely.
Exact answer: the published corner points and parabolas; scalar equations of the strip.
Measured: the factor over the stretch, and the stretch at passive and full tension.
Tolerance: the rods read a table of 1025 points whose cubics round each corner off by the spacing; the solid is exact.
Cannot see: that both took the curve from the same wrong page.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

from fem_biobot.config import load_design
from fem_biobot.errors import ModelError
from fem_biobot.material import NeoHooke
from fem_biobot.material.force_length import FORCE_LENGTH, force_length
from fem_biobot.rod.activation import kernels
from fem_biobot.rod.activation.build import activations
from fem_biobot.rod.activation.named import force_length_curve
from fem_biobot.rod.records import Muscle
from fem_biobot.rod.reduce import reduce
from fem_biobot.solid.from_design import tension_of, tension_step
from fem_biobot.solid.model import SolidModel, solve
from fem_biobot.solid.records import Symmetry
from tests.helpers import TIGHT, box_mesh

NAMES = [name for name in FORCE_LENGTH if name != "none"]
PASSIVE, ACTIVE, YOUNG = 3.0, 4.0, 14.0


@pytest.mark.parametrize("optimal", [1.0, 1.15])
@pytest.mark.parametrize("name", NAMES)
def test_rods_and_solid_read_the_same_curve(name: str, optimal: float) -> None:
    """Over all stretches the rods' table is the solid's curve.

    Catches: a corner misplaced in one of the two copies, the optimal stretch as a shift in one and a factor in the
    other, no force lost beyond the table.
    """
    curve = force_length_curve(name, optimal)
    table = activations([Muscle(("a", (0.0, 0.0, 0.0)), ("b", (1.0, 0.0, 0.0)), 1.0, 10.0, force_length=curve)])
    stretches = np.linspace(0.2, 2.1, 97) * optimal
    read = [kernels.factor(table, 0, float(s))[0] for s in stretches]
    np.testing.assert_allclose(read, force_length(name, optimal)(stretches), rtol=0.0, atol=4.0 * curve.spacing)


@pytest.mark.parametrize("name", NAMES)
def test_the_curve_scales_what_stimulation_adds_and_nothing_else(name: str) -> None:
    """A free strip of nu = 0: E/2 (s - 1/s) + T_passive + f(s) T_active = 0, and without f in the passive state.

    The rods' muscle of the same design has the same tension at that stretch. Catches: the standing tension scaled too
    (the meaning of it that isometric measurements do not have), in either of them.
    """
    keys = [f"muscle.passive_tension={PASSIVE} kPa", f"muscle.active_tension={ACTIVE} kPa"]
    keys += [f"muscle.force_length={name}", "muscle.optimal_stretch=1.1"]
    design = load_design("junction_bot", keys)
    axis = np.eye(3)[0]
    model = SolidModel(
        box_mesh(1),
        {"muscle": NeoHooke(YOUNG, 0.0)},
        {"muscle": tension_of(design, axis)},
        [Symmetry(face) for face in ("x0", "y0", "z0")],
    )
    curve = force_length(name, 1.1)
    steps = [tension_step(design, t) for t in (0.5 * PASSIVE, PASSIVE, PASSIVE + 0.5 * ACTIVE, PASSIVE + ACTIVE)]
    (muscle,) = reduce(design).members[:1]
    assert isinstance(muscle, Muscle)
    assert muscle.force_length is not None
    assert (muscle.passive, muscle.active) == (PASSIVE, ACTIVE)
    table = activations([muscle])
    parts = ((0.5 * PASSIVE, 0.0), (PASSIVE, 0.0), (PASSIVE, 0.5 * ACTIVE), (PASSIVE, ACTIVE))
    for state, (standing, added) in zip(solve(model, steps, settings=TIGHT).states, parts, strict=True):

        def balance(s: float, standing: float = standing, added: float = added) -> float:
            return 0.5 * YOUNG * (s - 1.0 / s) + standing + added * float(curve(s))

        s = brentq(balance, 0.4, 1.1, xtol=1e-14)
        assert state.at((1.0, 0.5, 0.5))[0] + 1.0 == pytest.approx(s, rel=1e-9)
        assert kernels.factor(table, 0, s)[0] == pytest.approx(float(curve(s)), abs=4.0 * muscle.force_length.spacing)
    assert float(curve(s)) < 0.9


def test_a_curve_that_is_not_known_is_refused() -> None:
    """Catches: no curve at all in its place."""
    with pytest.raises(ModelError, match="force_length: found 'hill', expected one of blemker_2005"):
        force_length_curve("hill")

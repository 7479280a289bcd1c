"""B2: the solid and the rods of one design, and how they come together as the beam gets slender."""

from __future__ import annotations

from functools import cache

import numpy as np

from fem_biobot import load_design, reduce
from fem_biobot.design import Design
from fem_biobot.link.rod_side import RodSide
from fem_biobot.link.solid_side import SolidSide
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.mesh.committed import mesh_for
from fem_biobot.study.reporter import Silent
from fem_biobot.verification.blocks import committed_bot
from fem_biobot.verification.records import Case, Claim, Curve, Finding, Graph

# mm, each thinner than the one before by a factor of sqrt 2
THICKNESSES = (0.68, 0.48, 0.34, 0.24)
# beside the beam no muscle resists, none is a plate, and strains are small
LIMIT = {
    "skeleton.material.poisson": 0.0,
    "skeleton.beam_width": 1.0,
    "skeleton.pillar_width": 1.0,
    "muscle.junction_width": 0.5,
    "muscle.material.young": 1e-3,
    "muscle.material.poisson": 0.3,
}
SMALL, STANDING = 1e-4, 4.0  # kPa
SIZE = 2.0  # of the mesh, over the beam's thickness
COMPARED = {
    "muscle_force_mN": "muscle force",
    "tip_closing_mm": "tip closing",
    "sagitta_mm": "sagitta",
    "pillar_rotation_deg": "rotation of the pillars",
}


def compared(design: Design, mesh: BodyMesh, tension: float) -> dict[str, float]:
    """Each measure of the solid over that of the rods in closed form, at one nominal tension [kPa]."""
    solid, rods = (
        side.states([tension], Silent())[0][0].numbers
        for side in (SolidSide(design, mesh), RodSide(design, reduce(design)))
    )
    return {name: solid[name] / rods[name] for name in COMPARED}


@cache
def slender(thickness: float) -> dict[str, float]:
    """Closing and sagitta per muscle force, solid over rods, of the narrow machine with a beam of a thickness [mm]."""
    design = load_design("junction_bot").with_values({**LIMIT, "skeleton.beam_thickness": thickness})
    found = compared(design, mesh_for(design, SIZE * thickness)[0], SMALL)
    return {name: value / found["muscle_force_mN"] for name, value in found.items()}


@cache
def machine_itself() -> dict[str, float]:
    """The junction bot on its coarse committed mesh at 4 kPa."""
    return compared(*committed_bot(), STANDING)


def rod_against_solid() -> Finding:
    """B2: rods in closed form come to the solid as the beam gets slender.

    Problem: the junction bot narrowed to 1 mm with Poisson's ratio 0 and a muscle without stiffness of its own, at a
        small tension, with beams from 0.68 to 0.24 mm; and the machine itself at 4 kPa.
    Measured: tip closing and sagitta per muscle force, of the solid over those of rods whose constants are closed
        forms; power of the closing's difference in the thickness, and where its line meets no thickness.
    Tolerance: the ends of the beam yield by a depth of material of the order of its thickness, so the difference is of
        first order in it: 0.05 in the power, and 3e-3 at none, what meshes of two thicknesses leave. The ends yield
        alike in tension and compression and turn the whole span: the sagitta, of the chord between them, sees second
        order alone, 2e-3. The machine itself is shown: a wide beam, a stiff muscle and large strains are in it, too.
    Cannot see: what both models share, such as a wrong length in the design.
    Catches: a span, width or modulus off by a hundredth in either model, a pillar that bends in one of them alone, a
        closing measured at the axis of a beam, a fitted constant.
    """
    found = [slender(thickness) for thickness in THICKNESSES]
    more = np.array([each["tip_closing_mm"] - 1.0 for each in found])
    h = np.array(THICKNESSES)
    # a difference of either sign has a size, and a change of sign shows in where the line ends
    power = np.polyfit(np.log(h), np.log(np.abs(more)), 1)[0]
    values = [
        float(power),
        1.0 + float(np.polyfit(h, more, 1)[1]),
        found[-1]["sagitta_mm"],
        *machine_itself().values(),
    ]
    span = load_design("junction_bot").span
    curves = (
        Curve("power 1", h / span, more[-1] * h / h[-1], known=True),
        Curve("solid over rods, less 1", h / span, more),
    )
    return Finding.of(values, Graph("thickness over span [1]", "difference of the closing [1]", curves, "xy"))


B2 = Case(
    "B2",
    "rods against the solid",
    (
        Claim("power of the closing's difference in the thickness", 1.0, 0.05, "1", "O'Donnell 1960: yield of the end"),
        Claim("closing without thickness, solid over rods", 1.0, 3e-3, "1", "Euler-Bernoulli"),
        Claim("sagitta of the slender beam, solid over rods", 1.0, 2e-3, "1", "Euler-Bernoulli"),
        *(
            Claim(f"{words} of the machine itself, solid over rods", 1.0, None, "1", "the same design twice")
            for words in COMPARED.values()
        ),
    ),
    rod_against_solid,
)

CASES = (B2,)

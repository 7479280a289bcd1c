"""S12: the beam of the benchmark for heart software, which eleven groups have solved."""

from __future__ import annotations

from functools import cache

import numpy as np

from fem_biobot import Fix, Pressure, SolidModel, solve
from fem_biobot.material import Guccione
from fem_biobot.verification.blocks import box_mesh
from fem_biobot.verification.records import Case, Claim, Curve, Finding, Graph

C, ALONG, ACROSS, SHEAR = 2.0, 8.0, 2.0, 4.0  # c [kPa]; exponents [1]
PRESSURE = 0.004  # kPa, on the lower face
SIZE = (10.0, 1.0, 1.0)  # mm
MESHES = ((10, 1, 1), (15, 2, 2), (20, 2, 2), (30, 3, 3))


@cache
def end_height(cells: tuple[int, int, int]) -> float:
    """Height of the upper edge's middle at the free end, once the pressure is on [mm]."""
    # the shear modulus between two directions across the fibre is half of c times its exponent
    law = Guccione(
        1.5 * C * ACROSS,
        0.5,
        np.array([1.0, 0.0, 0.0]),
        exponent_fibre=ALONG,
        exponent_across=ACROSS,
        exponent_shear=SHEAR,
    )
    model = SolidModel(
        box_mesh(cells, SIZE, shift=0.0),
        {"muscle": law},
        supports=[Fix("x0")],
        loads=[Pressure("z0", PRESSURE)],
        element="P2-P1",
    )
    last, (length, width, height) = solve(model).last, SIZE
    # edges of an odd number of cells have no vertex in their middle
    places = [0.5 * width] if cells[1] % 2 == 0 else [0.0, width]
    return height + float(np.mean([last.at((length, y, height))[2] for y in places]))


def pressed_beam() -> Finding:
    """S12: a beam of heart muscle bends under pressure on its lower face.

    Problem: 10 x 1 x 1 mm, clamped at x = 0, incompressible, fibres along x; c = 2 kPa, exponents 8, 2 and 4; 0.004 kPa
        that turn with the face. Of mixed quadratic elements, 30 x 3 x 3 cells.
    Measured: height of the point (10, 0.5, 1) once bent.
    Tolerance: 0.5 %, the distance that Land et al. call typical between the groups' fine solutions.
    Cannot see: tension, fibres that turn.
    Catches: a dead pressure (4 % off), an exponent exchanged with another, a shear modulus off by the factor of two
        between the exponent's two ways of writing.
    """
    heights = [end_height(cells) for cells in MESHES]
    along = [float(cells[0]) for cells in MESHES]
    curves = (
        Curve("reference", [along[0], along[-1]], [4.17, 4.17], known=True),
        Curve("P2-P1", along, heights),
    )
    return Finding.of([heights[-1]], Graph("cells along the beam [1]", "height of the end [mm]", curves))


_LAND = "Land et al. 2015, problem 1, as the demonstration of fenicsx-pulse states the groups' agreement"
S12 = Case(
    "S12",
    "Heart benchmark, bent beam",
    (Claim("height of the free end, P2-P1, 30 x 3 x 3 cells", 4.17, 0.005 * 4.17, "mm", _LAND),),
    pressed_beam,
)
CASES = (S12,)

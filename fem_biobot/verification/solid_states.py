"""S1 to S4: homogeneous states of the solid, whose answers are scalar equations."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fem_biobot import ActiveStress, Fix, NeoHooke, SolidModel, SolidState, Symmetry, solve
from fem_biobot.material import Law, law_from
from fem_biobot.verification.blocks import TIGHT, box_mesh, hold_everywhere, on_three_corners, unit
from fem_biobot.verification.records import Case, Claim, Curve, Finding, Graph, worst

Array = NDArray[np.float64]

# --- S1 ---------------------------------------------------------------------------------------------------------------

OBLIQUE = unit(0.48, 0.64, -0.6)
# T / mu to the stretch: mu (s - s^-2) + T = 0, and s = (mu / (mu + T))^(1/3)
NOMINAL = {0.1: 0.967753113, 0.5: 0.858094330, 1.0: 0.754877666, 2.0: 0.618033989}
SECOND_PIOLA = {0.1: 0.968729306, 0.5: 0.873580465, 1.0: 0.793700526, 2.0: 0.693361274}


def free_block(law: Law, muscle: ActiveStress, tensions: list[float], element: str) -> list[SolidState]:
    """A unit cube of muscle without load, at multiples of its tension."""
    model = SolidModel(box_mesh(2), {"muscle": law}, {"muscle": muscle}, on_three_corners(), element=element)
    return list(solve(model, tensions, settings=TIGHT).states)


def free_contraction() -> Finding:
    """S1: a free, incompressible block of muscle contracts along its fibre.

    Problem: unit cube on a distorted mesh, neo-Hooke at a Poisson's ratio of 1/2 (element P2-P1), tension along an
        oblique fibre, no load.
    Measured: the fibre stretch of the quadrature point that is farthest off.
    Tolerance: half of the last printed digit; the residual is solved to 1e-13 of the forces.
    Cannot see: discretisation (the answer is homogeneous), shear.
    Catches: one convention of tension taken for another, a body that is only nearly incompressible (0.4999 misses by
        1e-5), a tension that is not scaled by the step.
    """
    law, tensions = NeoHooke(9.3, 0.5), list(NOMINAL)
    values: list[float] = []
    curves: list[Curve] = []
    s = np.linspace(0.6, 1.0, 81)
    known = {"nominal": s**-2 - s, "second_piola": s**-3 - 1.0}
    for convention, table in (("nominal", NOMINAL), ("second_piola", SECOND_PIOLA)):
        states = free_block(law, ActiveStress(law.mu, OBLIQUE, convention), tensions, "P2-P1")
        values += [worst(state.stretch, table[T]) for T, state in zip(tensions, states, strict=True)]
        within = known[convention] <= 2.2
        words = convention.replace("_p", " P")
        curves += [
            Curve(f"{words}, closed form", known[convention][within], s[within], known=True),
            Curve(f"{words}, solid", tensions, values[-len(tensions) :]),
        ]
    return Finding.of(values, Graph("tension / shear modulus [1]", "fibre stretch [1]", tuple(curves)))


S1 = Case(
    "S1",
    "free contraction of incompressible neo-Hooke",
    tuple(
        Claim(f"fibre stretch, {words} tension of {T:g} mu", s, 6e-10, "1", source)
        for words, table, source in (
            ("nominal", NOMINAL, "mu (s - s^-2) + T = 0"),
            ("second Piola", SECOND_PIOLA, "s = (mu / (mu + T))^(1/3)"),
        )
        for T, s in table.items()
    ),
    free_contraction,
)

# --- S2 ---------------------------------------------------------------------------------------------------------------


def tension_in_all_directions() -> Finding:
    """S2: a cube that pulls alike in all directions shrinks alike.

    Problem: unit cube, E = 1 kPa, nu = 0.3, sigma = [mu (b - I) + lmbda ln J I] / J, constant second Piola tension of
        0.5 kPa along an oblique fibre and as much across it, no load.
    Measured: the principal stretch, of all and at all quadrature points, that is farthest off.
    Tolerance: half of the last printed digit.
    Cannot see: anything that tells directions apart, except that nothing may.
    Catches: a share of the trace across the fibre, a nominal tension (0.8464).
    """
    muscle = ActiveStress(0.5, unit(0.3, -0.5, 0.8), "second_piola", transverse=1.0)
    shares = [0.2, 0.4, 0.6, 0.8, 1.0]
    found = []
    for state in free_block(NeoHooke(1.0, 0.3), muscle, shares, "P2"):
        C = np.einsum("im...,ik...->...mk", state.F, state.F)
        found.append(worst(np.sqrt(np.linalg.eigvalsh(C)), 0.8575651716))
    law, s = NeoHooke(1.0, 0.3), np.linspace(0.85, 1.0, 61)
    tension = -(law.mu * (s - 1.0 / s) + 3.0 * law.lmbda * np.log(s) / s) / s
    curves = Curve("closed form", tension, s, known=True), Curve("solid", 0.5 * np.array(shares), found)
    return Finding.of(found[-1:], Graph("second Piola tension [kPa]", "stretch in every direction [1]", curves))


S2 = Case(
    "S2",
    "free contraction, compressible, tension in all directions",
    (Claim("every stretch, second Piola tension of E / 2", 0.8575651716, 5e-11, "1", "FEBio test suite, ma20"),),
    tension_in_all_directions,
)

# --- S3 ---------------------------------------------------------------------------------------------------------------

BLOCK = (1.7, 0.9, 0.6)
PULL = 8.3
ANGLES = (35.0, 72.0, 118.0)


def blocked(a0: Array, law: Law, convention: str = "nominal", F: Array | None = None) -> SolidState:
    """A block of muscle with all its faces held, undeformed or at `F`.

    Reactions on one face sum to the face's traction because opposite side faces are meshed alike and cancel.
    """
    given = hold_everywhere() if F is None else hold_everywhere(lambda X: (F - np.eye(3)) @ X)
    muscle = ActiveStress(PULL, a0, convention)
    model = SolidModel(box_mesh((3, 2, 2), BLOCK), {"muscle": law}, {"muscle": muscle}, given)
    return solve(model, settings=TIGHT).last


def virial(state: SolidState) -> Array:
    """Sum of reaction times reference position, (3, 3) [uJ]: the volume times the first Piola stress."""
    return state.internal_force @ state.X.T


def blocked_muscle() -> Finding:
    """S3: a blocked muscle pulls with T A sin^2 along and T A sin cos across.

    Problem: block of muscle with its faces held undeformed, nominal tension along a fibre at theta from the lateral
        axis y, in the plane of x and y.
    Measured: reaction of the end face along x and along y.
    Tolerance: 1e-12 of T A, rounding of sums; the residual is solved to 1e-13.
    Cannot see: the passive law (by design), the tangent.
    Catches: theta measured from the actuation, degrees for radians, the dyad's second factor dropped.
    """
    law = NeoHooke(10.0, 0.47)
    force = []
    for angle in np.radians(ANGLES):
        state = blocked(np.array([np.sin(angle), np.cos(angle), 0.0]), law)
        force.append(state.reaction("x1")[:2])
    theta = np.linspace(0.0, 180.0, 121)
    s, c = np.sin(np.radians(theta)), np.cos(np.radians(theta))
    area = BLOCK[1] * BLOCK[2]
    curves = (
        Curve("T A sin^2", theta, PULL * area * s * s, known=True),
        Curve("along the actuation, solid", ANGLES, [f[0] for f in force]),
        Curve("T A sin cos", theta, PULL * area * s * c, known=True),
        Curve("across it, solid", ANGLES, [f[1] for f in force]),
    )
    return Finding.of(np.ravel(force), Graph("theta [degrees]", "reaction [mN]", curves))


S3 = Case(
    "S3",
    "blocked muscle at an angle",
    tuple(
        Claim(
            f"reaction {way} the actuation, theta {angle:g} degrees",
            float(PULL * BLOCK[1] * BLOCK[2] * np.sin(np.radians(angle)) * part(np.radians(angle))),
            1e-12 * PULL * BLOCK[1] * BLOCK[2],
            "mN",
            source,
        )
        for angle in ANGLES
        for way, part, source in (
            ("along", np.sin, "T A sin^2(theta)"),
            ("across", np.cos, "T A sin(theta) cos(theta)"),
        )
    ),
    blocked_muscle,
)

# --- S4 ---------------------------------------------------------------------------------------------------------------

YOUNG, POISSON = 14.2, 0.42
PATCH = (1.2, 0.9, 1.5)
FIBRE = unit(0.36, 0.72, 0.55)
GENERIC = np.array([[1.21, 0.34, -0.12], [0.08, 0.83, 0.27], [-0.19, 0.05, 1.13]])
SHORTENED = 0.6
# generic, and mild enough for this deformation; laws not named here have no parameters of their own
PARAMETERS: dict[str, dict[str, float]] = {
    "mooney_rivlin": {"second_share": 0.35},
    "yeoh": {"c2": -0.4, "c3": 0.3},
    "gent": {"chain_limit": 9.0},
    "guccione": {"exponent_fibre": 0.8, "exponent_across": 0.35, "exponent_shear": 0.55},
    "holzapfel_ogden": {"fibre_modulus": 6.0, "fibre_exponent": 0.6, "fibre_dispersion": 0.1},
    "blemker": {
        "ground": 0.7,
        "fibre_peak": 20.0,
        "fibre_onset": 0.3,
        "fibre_exponent": 2.5,
        "optimal_stretch": 1.05,
        "straight_stretch": 1.3,
    },
}
# norm of the first Piola stress at GENERIC [kPa], from each law's energy in other variables
STRESSES = {
    "neo_hooke": (5.5046401338606845, "mu/2 (I1 - 3) - mu ln J + lmbda/2 (ln J)^2"),
    "neo_hooke_isochoric": (5.299883750387839, "Simo and Taylor 1982"),
    "mooney_rivlin": (6.34441924846371, "Mooney 1940, Rivlin 1948"),
    "yeoh": (4.926357670517817, "Yeoh 1993"),
    "gent": (5.678324738141805, "Gent 1996"),
    "guccione": (8.298343478195955, "Guccione, McCulloch and Waldman 1991"),
    "holzapfel_ogden": (8.045192772047335, "Holzapfel and Ogden 2009"),
    "blemker": (6.592798254558942, "Blemker, Pinsky and Delp 2005"),
}
# end stress of a bar with free sides at the stretch SHORTENED [kPa], from dpsi/dl_2 = 0 in principal stretches
END_STRESSES = {
    "neo_hooke": -9.598713994829822,
    "neo_hooke_isochoric": -10.387690356972081,
    "mooney_rivlin": -12.49209646145873,
    "yeoh": -9.809735253165071,
    "gent": -11.12049785097262,
}
# rounding grown by the solve
CLOSE = 1e-10


def patch_law(name: str) -> Law:
    """A law with the parameters of this case."""
    return law_from(name, YOUNG, POISSON, FIBRE, **PARAMETERS.get(name, {}))


def filled(law: Law, F: Array = GENERIC, element: str = "P2") -> SolidState:
    """A distorted patch whose boundary is displaced linearly, by ``(F - I) X``."""
    given = hold_everywhere(lambda X: (F - np.eye(3)) @ X)
    return solve(SolidModel(box_mesh(2, PATCH), {"muscle": law}, supports=given, element=element), settings=TIGHT).last


def bar(law: Law, stretch: float = SHORTENED, element: str = "P2") -> SolidState:
    """The patch between its end faces, held to a stretch along x, with free sides."""
    supports = [Symmetry("x0"), Symmetry("y0"), Symmetry("z0"), Fix("x1", "x", (stretch - 1.0) * PATCH[0])]
    model = SolidModel(box_mesh(2, PATCH), {"muscle": law}, supports=supports, element=element)
    return solve(model, [0.5, 1.0], settings=TIGHT).last


def homogeneous_patch() -> Finding:
    """S4: a distorted patch stretches and shears homogeneously, by every law.

    Problem: a block of distorted tetrahedra with a generic linear displacement on its boundary; the same block held
        between its ends with free sides.
    Measured: nodes against the linear field (the worst of all laws), norm of the first Piola stress from the virial of
        the reactions, end stress from the reaction.
    Tolerance: 1e-10 of lengths and of Young's modulus, rounding grown by the solve (residual to 1e-13).
    Cannot see: rates, bending, elements other than straight-sided ones.
    Catches: slopes mapped with the inverse transposed, midpoints out of order, P transposed, a law's lost term, force
        per current area.
    """
    stresses, apart = [], []
    for name in STRESSES:
        state = filled(patch_law(name))
        apart.append(float(np.abs(state.u - (GENERIC - np.eye(3)) @ state.X).max()))
        stresses.append(np.linalg.norm(virial(state)) / np.prod(PATCH))
    ends = [bar(patch_law(name)).reaction("x1")[0] / (PATCH[1] * PATCH[2]) for name in END_STRESSES]
    return Finding.of([worst(apart, 0.0), *stresses, *ends])


S4 = Case(
    "S4",
    "homogeneous stretch and shear of a distorted patch, every law",
    (
        Claim("node farthest from the linear field, all laws", 0.0, CLOSE, "mm", "u = (F - I) X"),
        *(
            Claim(f"norm of P in stretch and shear, {name}", value, CLOSE * YOUNG, "kPa", source)
            for name, (value, source) in STRESSES.items()
        ),
        *(
            Claim(f"end stress of a bar at {SHORTENED:g}, {name}", value, CLOSE * YOUNG, "kPa", "dpsi/dl_2 = 0")
            for name, value in END_STRESSES.items()
        ),
    ),
    homogeneous_patch,
)

CASES = (S1, S2, S3, S4)

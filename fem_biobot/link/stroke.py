"""The stroke of a solid for its rods: tensions with which rods close as the solid does at each drive.

The rods' own law of force and stroke, from the beam's closed form and Eq. 2, is put aside: what counts is how far the
solid closes, floating and at rest. The rods get the passive tension with which they close as far as the passive solid,
and the active tension with which they close as far at full drive; in between the departure is told. Feet turn with the
pillars, and by how much both do at one closing is told as well.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import PchipInterpolator

from fem_biobot.design import Design
from fem_biobot.errors import ModelError
from fem_biobot.link.closing import tensions_at
from fem_biobot.link.observed import Array, Observed
from fem_biobot.link.rod_side import RodSide
from fem_biobot.link.solid_side import SolidSide
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.rod.reduce import reduce
from fem_biobot.study.reporter import Reporter, Silent

# shares of the largest drive at which the solid is solved, and of the tension from rest to the passive one
_DRIVES = (0.0, 0.25, 0.5, 0.75, 1.0)
_RISE = (0.25, 0.5, 0.75)
_MOST = 1.5  # tension over the design's largest up to which the rods are asked
_POINTS = 16
MEASURES = ("tip_closing_mm", "pillar_rotation_deg", "muscle_force_mN")


@dataclass(frozen=True)
class StrokeLaw:
    """Closing, rotation of the pillars and muscle force by drive, of solid, of rods, and of rods with its stroke.

    Attributes
    ----------
    design
        Of the rods that close as the solid does.
    drive
        (k,) [1]
    tension, rods_tension
        Of the solid and of its own rods, and of the rods with its stroke, (k,) [kPa].
    solid, rods, adapted
        Measures by name, (k,) each; see `MEASURES`.
    """

    design: Design
    drive: Array
    tension: Array
    rods_tension: Array
    solid: dict[str, Array]
    rods: dict[str, Array]
    adapted: dict[str, Array]

    def rows(self) -> list[dict[str, float]]:
        """One a drive."""
        models = {"solid": self.solid, "rods": self.rods, "rods_adapted": self.adapted}
        return [
            {
                "drive_1": float(self.drive[k]),
                "tension_kPa": float(self.tension[k]),
                "rods_adapted_tension_kPa": float(self.rods_tension[k]),
                **{f"{model}_{name}": float(found[name][k]) for name in MEASURES for model, found in models.items()},
            }
            for k in range(len(self.drive))
        ]

    @property
    def departure(self) -> float:
        """Largest difference of the adapted rods' closing from the solid's over the solid's stroke [1]."""
        name = MEASURES[0]
        return float(np.abs(self.adapted[name] - self.solid[name]).max() / np.ptp(self.solid[name]))


def stroke_law(design: Design, mesh: BodyMesh, reporter: Reporter | None = None) -> StrokeLaw:
    """Solve a design's solid over its drive, and find the tensions with which its rods close as far.

    Parameters
    ----------
    design
        A bot of two pillars, tissue as moulded, with an active tension.
    mesh
        Of the solid.

    Raises
    ------
    ModelError
        No active tension; a solid that closes further than its rods do at half as much tension again.
    SolveError
        A model that finds no state.
    """
    reporter = reporter or Silent()
    amplitude = design.drive.amplitude
    drives = np.array(_DRIVES) * amplitude
    tensions = np.array([design.tension(float(d)) for d in drives])
    if not tensions[-1] > tensions[0]:
        raise ModelError(f"muscle.active_tension: found a stroke of {np.ptp(tensions):g} kPa, expected one above 0 kPa")
    rise = [share * tensions[0] for share in _RISE] if tensions[0] > 0.0 else []
    levels = [*rise, *(float(T) for T in tensions if T > 0.0)]
    reporter.stage("the solid over its drive", len(levels))
    found = SolidSide(design, mesh).states(levels, reporter)[0]
    asked = [float(T) for T in np.linspace(0.0, _MOST * tensions[-1], _POINTS + 1)[1:]]
    side = RodSide(design, reduce(design))
    own = side.states(asked, Silent())[0]
    solid, rods = (_curves(states) for states in (found, own))
    closing = solid[MEASURES[0]](tensions)
    if found[-1].tension < tensions[-1] or not closing[-1] <= own[-1].numbers[MEASURES[0]]:
        raise ModelError(
            f"stroke: found a solid that closes by {closing[-1]:.3g} mm, expected at most the "
            f"{own[-1].numbers[MEASURES[0]]:.3g} mm of its rods at {own[-1].tension:.3g} kPa"
        )
    ends = [tensions_at(rods[MEASURES[0]], float(c))[0] if c > 0.0 else 0.0 for c in (closing[0], closing[-1])]
    adapted = ends[0] + (ends[1] - ends[0]) * drives / amplitude
    factor = ends[0] / tensions[0] if tensions[0] > 0.0 else 1.0
    values = {
        "muscle.passive_tension": factor * design.value("muscle.passive_tension"),
        "muscle.active_tension": design.value("muscle.active_tension") * (ends[1] - ends[0]) / float(np.ptp(tensions)),
    }
    of = [{name: curve(T) for name, curve in c.items()} for c, T in ((solid, tensions), (rods, tensions))]
    with_stroke = {name: curve(adapted) for name, curve in rods.items()}
    return StrokeLaw(design.with_values(values), drives, tensions, adapted, of[0], of[1], with_stroke)


def _curves(states: list[Observed]) -> dict[str, PchipInterpolator]:
    """Measures by tension, from none on."""
    T = [0.0, *(s.tension for s in states)]
    return {name: PchipInterpolator(T, [0.0, *(s.numbers[name] for s in states)]) for name in MEASURES}

"""Numbers printed by Pagan-Diaz et al. (2018) that a run is compared with, with how far each can be trusted."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Printed:
    """A printed number: value, its standard deviation where given, unit, and where it stands."""

    value: float
    unit: str
    where: str
    deviation: float | None = None


# the paper's own rod simulation of the junction bot: active force on each pillar to pillar deflection, by frequency
SIMULATED_FORCE_TO_DEFLECTION: tuple[tuple[float, Printed], ...] = (
    (0.5, Printed(0.3, "mm", "simulated, 0.5 Hz, section 2.4, approximate")),
    (1.0, Printed(0.5, "mm", "simulated, 1 Hz, section 2.4, approximate")),
    (1.4, Printed(1.0, "mm", "simulated, 2 Hz, section 2.4, approximate")),
)
# measured at 15 days; inferred from the beam's sagitta by Eq. 3
PASSIVE_FORCE = Printed(8.45, "mN", "measured by Eq. 3 at 15 days, section 2.4", 0.86)
STROKE_FORCE_2_HZ = Printed(1.10, "mN", "measured by Eq. 3 at 15 days, 2 Hz, section 2.4", 0.30)
STROKE_FORCE_4_HZ = Printed(1.14, "mN", "measured by Eq. 3 at 15 days, 4 Hz, section 2.4", 0.25)
RING_BOT_FORCE = Printed(2.6, "mN", "Eq. 2 of the ring bot, section 2.3")

# measured while walking; "efficiency" is work of walking over work on the pillars
SPEED_4_HZ = Printed(0.5, "mm/s", "measured at 4 Hz, printed as above this, abstract")
EFFICIENCY: dict[float, Printed] = {
    0.5: Printed(0.71, "1", "measured at 0.5 Hz, section 2.7", 0.21),
    1.0: Printed(0.46, "1", "measured at 1 Hz, section 2.7", 0.02),
    4.0: Printed(0.52, "1", "measured at 4 Hz, section 2.7", 0.20),
}
# of the main job's walks [Hz]: those of the paper
WALKED_FREQUENCIES = (0.5, 1.0, 2.0, 4.0)

# forces measured by seeding width [mm], section 2.5 and Fig. 6; None where they stand in a figure only
MEASURED_WIDTHS: dict[float, dict[str, float | None]] = {
    3.5: {"active_mN": 0.97, "active_sd_mN": 0.27, "passive_mN": 7.93, "passive_sd_mN": 0.30},
    7.0: {"active_mN": 0.67, "active_sd_mN": 0.26, "passive_mN": None, "passive_sd_mN": None},
    14.0: {"active_mN": 0.47, "active_sd_mN": 0.17, "passive_mN": 9.53, "passive_sd_mN": 0.68},
}

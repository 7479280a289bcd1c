"""What the paper prints beside what the software predicts: one claim a printed number, with a verdict or a reason."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum

from fem_biobot.study.paper import Printed


class Verdict(StrEnum):
    """How a prediction lies to a printed number.

    within_one, within_two
        Standard deviations of the measurement.
    outside
        Further off.
    holds, fails
        Of a bound.
    no_deviation
        The number is printed without one: the ratio is told, and nothing judged.
    not_predicted
        See the reason.
    """

    within_one = "within one deviation"
    within_two = "within two"
    outside = "outside"
    holds = "holds"
    fails = "fails"
    no_deviation = "no deviation printed"
    not_predicted = "not predicted"


FAILED = (Verdict.outside, Verdict.fails)


@dataclass(frozen=True)
class Claim:
    """A printed number and the predictions of it.

    Attributes
    ----------
    name
        What it is.
    printed
        Value, deviation, unit and place.
    solid, rods, equations
        Predictions of the continuum, of the rods, and of the paper's own closed forms; None where one has none.
    bound
        ``">"`` or ``"<"`` where the paper prints a bound, else nothing.
    simulated
        What the paper's own simulation gave, where that is printed.
    why
        Why there is no prediction, or what the prediction rests on.
    """

    name: str
    printed: Printed
    solid: float | None = None
    rods: float | None = None
    equations: float | None = None
    bound: str = ""
    simulated: float | None = None
    why: str = ""

    @property
    def predictions(self) -> dict[str, float]:
        """Those that there are, by model."""
        found = {"solid": self.solid, "rods": self.rods, "equations": self.equations}
        return {name: value for name, value in found.items() if value is not None and math.isfinite(value)}

    def z(self, value: float) -> float | None:
        """Distance of a prediction from the mean, in deviations; None where none is printed."""
        return None if not self.printed.deviation else (value - self.printed.value) / self.printed.deviation

    def verdict(self, value: float | None) -> Verdict:
        """How one prediction lies."""
        if value is None or not math.isfinite(value):
            return Verdict.not_predicted
        if self.bound:
            above = value > self.printed.value
            return Verdict.holds if above == (self.bound == ">") else Verdict.fails
        z = self.z(value)
        if z is None:
            return Verdict.no_deviation
        if abs(z) <= 1.0:
            return Verdict.within_one
        return Verdict.within_two if abs(z) <= 2.0 else Verdict.outside

    @property
    def failed(self) -> tuple[str, ...]:
        """Models whose prediction lies outside."""
        return tuple(name for name, value in self.predictions.items() if self.verdict(value) in FAILED)

    def row(self) -> dict[str, object]:
        """For tables."""
        p = self.printed
        cells: dict[str, object] = {
            "claim": self.name,
            "printed": f"{self.bound}{p.value:g}" if self.bound else p.value,
            "deviation": p.deviation,
            "unit": p.unit,
            "simulated_by_paper": self.simulated,
        }
        for name in ("solid", "rods", "equations"):
            value = self.predictions.get(name)
            cells |= {
                name: value,
                f"{name}_z_1": None if value is None else self.z(value),
                f"{name}_verdict": self.verdict(value).value,
            }
        return cells | {"where": p.where, "why": self.why}

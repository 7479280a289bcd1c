"""Settings of the time integrators."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from fem_biobot.errors import ModelError


class Integrator(StrEnum):
    """How time is stepped: see `rod.dynamics.kernels` and `rod.explicit.kernels`."""

    implicit = "implicit"
    explicit = "explicit"


@dataclass(frozen=True)
class Settings:
    """Of the integrators.

    Attributes
    ----------
    integrator
        Implicit for work; explicit as an independent witness, whose step is limited by the stiffest element.
    dissipation
        Implicit only: c in ``theta = 1/2 + c step`` [1/s], at most 1: a mode of angular frequency w is damped with the
        damping ratio ``c step^2 w`` on top of its own, as long as ``w step`` is small.
    tolerance
        Implicit only: unbalanced impulse relative to the largest that acts, and gaps of joints relative to an element's
        length [1]. Rounding of momenta and of the stiffest forces is allowed beyond it.
    parts
        Implicit only: a step in which one of the ground's contact points begins or ceases to touch, to stick or to
        slip, or turns its slip round, is made again in so many parts, and so are the two steps after it; 1 for none.
        See `rod.dynamics.run.kernels`. Where the step adapts it is halved toward the change, for touches of other parts
        as well, until a part is no longer than one of so many; it and the eight parts after it are held to no error.
        By default 4, and 128 where it adapts: in longer parts a weak strike's impulse is lost in that of the weight,
        and a foot that it would release is held.
    largest_error
        Implicit only: adapts the step. It is made in parts of halves, halves of halves and so on, so short that the
        errors of the positions in those of one step, as `rod.dynamics.adaptive.kernels` tells them, add up to no more
        than this for any node [mm], but for the parts about a change of contact (see `parts`); steps add theirs up. By
        default every step is as long as asked for.
    """

    integrator: Integrator = Integrator.implicit
    dissipation: float = 20.0
    tolerance: float = 1e-9
    parts: int | None = None
    largest_error: float | None = None

    def __post_init__(self) -> None:
        try:
            object.__setattr__(self, "integrator", Integrator(self.integrator))
        except ValueError:
            known = " or ".join(Integrator)
            raise ModelError(f"settings: integrator: found {self.integrator!r}, expected {known}") from None
        if not _number(self.dissipation) or self.dissipation < 0.0:
            raise ModelError(f"settings: dissipation: found {self.dissipation!r}, expected a number of at least 0 1/s")
        if not _number(self.tolerance) or not 1e-12 <= self.tolerance <= 1e-3:
            raise ModelError(f"settings: tolerance: found {self.tolerance!r}, expected a number from 1e-12 to 1e-3")
        whole = isinstance(self.parts, int | np.integer) and not isinstance(self.parts, bool)
        if self.parts is not None and not (whole and 1 <= self.parts <= 1000):
            raise ModelError(f"settings: parts: found {self.parts!r}, expected a whole number from 1 to 1000")
        if self.largest_error is None:
            return
        if not _number(self.largest_error) or not self.largest_error > 0.0:
            raise ModelError(f"settings: largest_error: found {self.largest_error!r}, expected a length above 0 mm")
        if self.integrator is Integrator.explicit:
            raise ModelError(
                "settings: largest_error: explicit steps have one length, expected the implicit integrator"
            )

    @property
    def division(self) -> int:
        """`parts`, or what they are by default."""
        return (4 if self.largest_error is None else 128) if self.parts is None else int(self.parts)

    def theta(self, step: float) -> float:
        """Weight of the end of the step [1]."""
        return min(0.5 + self.dissipation * step, 1.0)


def _number(value: object) -> bool:
    good = isinstance(value, int | float | np.floating | np.integer) and not isinstance(value, bool)
    return good and bool(np.isfinite(value))  # type: ignore[arg-type]

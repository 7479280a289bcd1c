"""How a load step fails: the reason, the element, the iteration, and the best that the iteration had."""

from __future__ import annotations

from enum import StrEnum
from typing import NamedTuple

from fem_biobot.solid.space import Array


class Why(StrEnum):
    """Why a step found no equilibrium."""

    inverted = "inverted"
    """An element is turned inside out."""
    outside_law = "outside_law"
    """A point is deformed beyond where its law has an energy."""
    indefinite = "indefinite"
    """The tangent of a trial is not positive definite."""
    unstable = "unstable"
    """There is an equilibrium, but its tangent is not positive definite."""
    diverged = "diverged"
    """The residual grows."""
    no_number = "no_number"
    """The residual is not a number."""
    iterations = "iterations"
    """The iterations are used up."""


class Iterate(NamedTuple):
    """Where an iteration stood: displacement (n, 3) [mm], pressures (m,) [kPa], residual over the force scale [1]."""

    u: Array
    p: Array
    residual: float


class StepFailedError(Exception):
    """The step did not converge.

    Attributes
    ----------
    why
        See `Why`.
    element
        The element that is inverted or outside its law, or where the residual is largest; None where nothing points to
        one.
    iteration
        Newton iteration in which it happened, from 0; None where the iteration had converged.
    best
        The iterate with the least residual, or None.
    """

    def __init__(
        self,
        text: str,
        why: Why,
        *,
        element: int | None = None,
        iteration: int | None = None,
        best: Iterate | None = None,
    ) -> None:
        super().__init__(text)
        self.why, self.element, self.iteration, self.best = why, element, iteration, best

    @property
    def unstable(self) -> bool:
        """Whether a loss of stability may be the reason."""
        return self.why in (Why.indefinite, Why.unstable)

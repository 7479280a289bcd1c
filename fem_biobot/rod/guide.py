"""A joint that holds some coordinates of a place alone."""

from __future__ import annotations

from dataclasses import dataclass

from fem_biobot.errors import ModelError
from fem_biobot.rod.records import Place


@dataclass(frozen=True)
class Guide:
    """A place keeps some of its coordinates beside another part; along the other axes, and in turning, both are free.

    Parameters
    ----------
    a, b
        The place that is guided, and the one that guides it.
    along
        Letters out of ``"xyz"``, axes of the world, of the coordinates that are held.

    Notes
    -----
    `a` stays level with the point of b's part that has b's coordinates as drawn, but a's along the axes held: a point
    that moves and turns with that part. Where both are drawn level it is `b` itself.
    """

    a: Place
    b: Place
    along: str

    def __post_init__(self) -> None:
        if not self.along or len(set(self.along)) != len(self.along) or not set(self.along) <= set("xyz"):
            raise ModelError(f"guide: along: found {self.along!r}, expected one or more of 'xyz', each at most once")

"""Where the measures of a walking machine are taken, for machines whose parts do not tell it by themselves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from fem_biobot.errors import ModelError
from fem_biobot.rod.records import Place, _set


@dataclass(frozen=True)
class Landmarks:
    """Places on the beam, and the muscles that are measured.

    Parameters
    ----------
    start, end, crown
        Ends of the beam's flexible span, and its middle.
    muscles
        Names of muscles, each a chain of members of equal section and tension that lie end to end and count as one:
        its length is their sum, its force that of the middle one.
    """

    start: Place
    end: Place
    crown: Place
    muscles: Sequence[Sequence[str]]

    def __post_init__(self) -> None:
        chains = tuple(tuple(chain) for chain in self.muscles)
        if not chains or not all(chains) or any(isinstance(chain, str) for chain in self.muscles):
            raise ModelError(
                f"landmarks: muscles: found {self.muscles!r}, expected chains of names, none of them empty"
            )
        _set(self, muscles=chains)

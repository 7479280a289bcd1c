"""Where the named parts of an assembly went, and what is known of them besides the kernels' arrays."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fem_biobot.errors import ModelError
from fem_biobot.rod.arrays import Assembly
from fem_biobot.rod.discretisation import Discretisation, halves, node_shares
from fem_biobot.rod.records import Body, Hold, Muscle, Place, Rod, Spring, vector

Array = NDArray[np.float64]
Member = Muscle | Spring


@dataclass(frozen=True)
class Atlas:
    """Where the named parts went: for every rod its nodes and frames, for every body its node."""

    rods: Mapping[str, Rod]
    bodies: Mapping[str, Body]
    node_of: Mapping[tuple[str, int], int]
    drawn: Mapping[str, Array]
    frames: Mapping[str, Array]
    centre: Array

    def parse(self, place: Place) -> tuple[tuple[str, int], Array]:
        """The part's key, and the position of the place as drawn."""
        try:
            name, where = place
        except (TypeError, ValueError):
            raise ModelError(f"place: found {place!r}, expected a pair such as ('beam', -1)") from None
        if name in self.rods:
            points = self.drawn[name]
            if not isinstance(where, int | np.integer) or not -len(points) <= where < len(points):
                raise ModelError(
                    f"place ('{name}', {where!r}): expected the number of one of its {len(points)} nodes, such as 0"
                )
            number = int(where) % len(points)
            return (name, number), points[number]
        if name in self.bodies:
            return (name, 0), vector(f"place on body {name}", where)
        known = ", ".join([*self.rods, *self.bodies])
        raise ModelError(f"place {place!r}: no rod or body of the name {name!r}, expected one of: {known}")

    def locate(self, place: Place) -> tuple[int, Array]:
        """Node of a place and the offset from it, in the drawing's axes [mm]."""
        key, position = self.parse(place)
        node = self.node_of[key]
        return node, position - self.centre[node]

    def shares(self, rod: str) -> Array:
        """Which share of an element's mass or load each node of a rod takes, (m, m + 1) [1]."""
        found = self.rods[rod]
        if found.discretisation is Discretisation.plain:
            return halves(len(found.sections))
        spans = np.linalg.norm(np.diff(found.points, axis=0), axis=1)
        return node_shares(spans, list(zip(found.sections, found.masses, strict=True)))


@dataclass(frozen=True)
class Moved:
    """A support that loading moves: a held node, or a constraint of the world, and its `Hold`.

    `place` is the position of the held place and `offset` its distance from the node, both as drawn (3,) [mm].
    """

    node: int
    constraint: int
    hold: Hold
    place: Array
    offset: Array


@dataclass(frozen=True)
class Built:
    """An assembly with what is known of its parts."""

    assembly: Assembly
    atlas: Atlas
    x: Array
    members: tuple[Member, ...]
    histories: tuple[Callable[[float], float] | None, ...]
    volume: Array
    moved: tuple[Moved, ...] = ()

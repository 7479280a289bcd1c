"""Where a ground touches a body: contact points on its foot surfaces, each with the area that it stands for.

The points are the nodes of the surface. On a quadratic facet the middles of the sides stand for a third of its area
each, a rule that integrates the basis exactly, so that a uniform pressure is a state of equal forces at the sides and
passes the patch test to rounding; corners stand for none of it and are there to keep the rim out of the ground. Where
pressure varies a corner would have to pull to be held at zero gap: it leaves the ground by as little as that takes, and
pressures, read at the sides, do not oscillate. On linear facets the corners stand for a third each.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fem_biobot.errors import ModelError
from fem_biobot.material.law import Array
from fem_biobot.solid.dynamics.body import MovingBody
from fem_biobot.solid.space import Ints
from fem_biobot.solid.surfaces import facets


@dataclass(frozen=True, eq=False)
class Feet:
    """Contact points of a body.

    Attributes
    ----------
    names
        Surfaces, in order.
    nodes
        The points, (c,).
    area
        Reference area that each stands for, (c,) [mm^2].
    owner
        Number of the surface of each, (c,).
    """

    names: tuple[str, ...]
    nodes: Ints
    area: Array
    owner: Ints

    def only(self, chosen: NDArray[np.bool_]) -> Feet:
        """The same feet with the chosen points alone, (c,); refuses to leave a foot without any.

        Each point keeps its area. What is left out may sink into the ground: a device to ask what the points matter.
        """
        chosen = np.asarray(chosen, dtype=bool)
        bare = [name for k, name in enumerate(self.names) if not np.any(chosen & (self.owner == k))]
        if bare:
            raise ModelError(f"feet: found no point of {bare[0]!r} chosen, expected some of every foot")
        return Feet(self.names, self.nodes[chosen], self.area[chosen], self.owner[chosen])


def feet_of(body: MovingBody, names: Sequence[str]) -> Feet:
    """Contact points of the named surfaces.

    Raises
    ------
    ModelError
        No surface, an unknown one, one inside the body, two that share a point, or nodes held in axes of their own.
    """
    names = (names,) if isinstance(names, str) else tuple(names)
    if not names:
        raise ModelError("feet: found none, expected the names of the surfaces that the ground stops")
    space, system = body.system.space, body.system
    X = np.ascontiguousarray(space.points.T)
    found, areas, owners = [], [], []
    taken = np.zeros(space.n_nodes, dtype=bool)
    for number, name in enumerate(names):
        on = facets(body.model.mesh, space, name, "feet", 1).nodes  # (b, f)
        third = np.linalg.norm(np.cross(X[on[1]] - X[on[0]], X[on[2]] - X[on[0]]), axis=1) / 6.0
        nodes = np.unique(on)
        if np.any(taken[nodes]):
            raise ModelError(f"feet: found {name!r} sharing points with another, expected surfaces apart")
        taken[nodes] = True
        if system.turned.size and np.any(system.turned[nodes] >= 0):
            raise ModelError(f"feet: found {name!r} held along axes of its own, expected it free or held along x, y, z")
        bearing = on[3:] if space.quadratic else on
        area = np.bincount(bearing.ravel(), weights=np.tile(third, 3), minlength=space.n_nodes)
        found.append(nodes)
        areas.append(area[nodes])
        owners.append(np.full(len(nodes), number, dtype=np.int64))
    return Feet(names, np.concatenate(found), np.concatenate(areas), np.concatenate(owners))

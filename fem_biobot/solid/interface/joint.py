"""A sliding contact within a system of equations: where its two surfaces are, and how far Coulomb's law is missed."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from fem_biobot.errors import ModelError
from fem_biobot.material.law import Array
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.solid.interface import kernels
from fem_biobot.solid.interface.record import Sliding
from fem_biobot.solid.interface.saddle import Saddle
from fem_biobot.solid.interface.surface import surfaces_of
from fem_biobot.solid.interface.touch import Contact, Pairing, Terms
from fem_biobot.solid.space import Ints
from fem_biobot.solid.system import System

# points nearer than this begin in contact, relative to the body's size
_TOUCHING = 1e-9


class Joint:
    """One sliding contact of a system.

    Attributes
    ----------
    system, contact
        The equations, and the two surfaces.
    nodes
        Of both surfaces.
    afloat
        Nodes of the body that nothing but contact holds.
    element, size
        Width that a quadrature point stands for, and the body's largest extent [mm].
    """

    def __init__(self, system: System, mesh: BodyMesh, sliding: Sliding) -> None:
        """Refuses pressures, and nodes of the surfaces that are held in axes of their own, with `ModelError`."""
        if system.mixed is not None:
            raise ModelError("element: found P2-P1 with a sliding contact, expected P2 or P1")
        self.system = system
        surfaces = surfaces_of(mesh, system.space, sliding)
        self.nodes = np.unique(np.concatenate([surfaces.nodes.ravel(), surfaces.other.ravel()]))
        if system.turned.size and np.any(system.turned[self.nodes] >= 0):
            raise ModelError("sliding: found nodes held along axes of their own, expected free or held along x, y, z")
        self.contact = Contact(surfaces, sliding, np.ascontiguousarray(system.space.points.T))
        self.afloat = _joined(system.space.nodes, np.unique(surfaces.other))
        self.element = float(np.sqrt(surfaces.weights.sum() / len(surfaces.weights)))
        self.size = float(np.ptp(system.space.points, axis=1).max())

    def law(self, terms: Terms, traction: Array, pairing: Pairing, stiffness: float) -> tuple[Array, Array, Ints]:
        """What Coulomb's law is missed by (c, 3) [mm], the slope of its projection (c, 3, 3), and the states (c,)."""
        c = self.contact.count
        miss, slope, state = np.zeros((c, 3)), np.zeros((c, 3, 3)), np.zeros(c, dtype=np.int64)
        share = stiffness / np.where(pairing.cover > 0.0, pairing.cover, np.inf)
        share[share == 0.0] = stiffness
        nearly = _TOUCHING * self.size
        kernels.coulomb(traction, terms.gaps, share, self.contact.radii, nearly, miss, slope, state)
        away = pairing.cover == 0.0
        miss[away], slope[away], state[away] = 0.0, 0.0, 0
        return miss, slope, state

    def guess_stick(self, slope: Array, state: Ints) -> None:
        """Where nothing presses yet, what touches is guessed to stick; changes the slopes in place."""
        slope[(state > 0) & (self.contact.radii.max(axis=1) > 0.0)] = np.eye(3)

    def stiffness(self, data: Array) -> float:
        """Of a node of the body at the contact, from a tangent's upper triangle [mN/mm]."""
        even = data if data.ndim == 1 else data[0]
        dofs = (3 * np.unique(self.contact.surfaces.other)[:, None] + np.arange(3)).ravel()
        return float(np.abs(even[self.system.pattern.starts[dofs]]).mean())

    def saddle(self, pairing: Pairing) -> Saddle:
        """The matrix of displacements and tractions for a pairing."""
        return Saddle(self.system, pairing, self.afloat)


def _joined(nodes: Ints, seeds: Ints) -> Ints:
    """Nodes of all elements (b, e) that hang together with the seeds."""
    n = int(nodes.max()) + 1
    rows, columns = np.tile(nodes[0], len(nodes) - 1), nodes[1:].ravel()
    graph = coo_array((np.ones(rows.size, dtype=np.int8), (rows, columns)), shape=(n, n))
    label = connected_components(graph, directed=False)[1]
    return np.flatnonzero(np.isin(label, label[seeds])).astype(np.int64)

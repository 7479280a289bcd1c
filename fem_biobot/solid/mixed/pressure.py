"""The pressure field of the mixed form: which regions have one, its nodes, and the volumetric energy it carries.

Taylor and Hood's tetrahedron: quadratic displacement, continuous linear pressure within a region. Where two regions
meet the pressure jumps, so every region has pressure nodes of its own on the interface.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from fem_biobot.errors import ModelError
from fem_biobot.material.law import Law
from fem_biobot.material.natural_state import NaturalState
from fem_biobot.material.volume import SplitLaw, check_compressible
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.solid.space import Array, Element, Ints, Space


@dataclass(frozen=True)
class Part:
    """One region with pressure: its elements, the inverse of its bulk modulus [1/kPa] and its volume measure."""

    elements: Ints
    compliance: float
    measure: int


@dataclass(frozen=True)
class PressureField:
    """Continuous linear pressures, one in each region that has them.

    Attributes
    ----------
    parts
        The regions, in the order of their pressure nodes.
    nodes
        Pressure nodes of each element, (4, e), in the order of its vertices; -1 in elements without.
    values
        Their basis at the quadrature points, (4, q).
    vertex
        Vertex of the mesh at which each pressure node is, (m,).
    volume
        Integral of each basis function, (m,) [mm^3].
    scale
        Pressure of a unit of each unknown, (m,) [kPa/mm]: a modulus over a length, so that unknowns, residuals and
        entries of the matrix have the units and about the sizes of those of the displacement.
    """

    parts: tuple[Part, ...]
    nodes: Ints
    values: Array
    vertex: Ints
    volume: Array
    scale: Array

    @property
    def n(self) -> int:
        """Number of pressure unknowns."""
        return len(self.vertex)

    @property
    def elements(self) -> Ints:
        """Elements with pressure, ascending."""
        return np.flatnonzero(self.nodes[0] >= 0)

    def mass(self, dV: Array) -> Array:
        """``int N_c N_d`` of the pairs ``c <= d`` of each element with pressure, (pairs, k) [mm^3]."""
        first, second = np.triu_indices(len(self.values))
        return np.einsum("pq,pq,eq->pe", self.values[first], self.values[second], dV[self.elements])


def split_laws(
    mesh: BodyMesh, element: Element, materials: Mapping[str, Law]
) -> tuple[dict[str, Law], dict[str, Part]]:
    """The law of every region as the solver evaluates it, and the volumetric part of those that go by a pressure.

    With `P2P1` a law that can be split is; a region whose law cannot, or has no volumetric energy at all, keeps the
    displacement form. Other elements refuse a law that is incompressible.
    """
    laws, parts = dict(materials), {}
    if element is not Element.P2P1:
        for law in materials.values():
            # a natural state may change the volume, and cannot be split then
            inner = law.law if isinstance(law, NaturalState) else law
            if isinstance(inner, SplitLaw):
                check_compressible(inner.split()[1].bulk)
        return laws, parts
    for name, law in materials.items():
        if not isinstance(law, SplitLaw):
            continue
        rest, volumetric = law.split()
        if volumetric.bulk > 0.0:
            laws[name] = rest
            elements = np.ascontiguousarray(mesh.regions[name], dtype=np.int64)
            parts[name] = Part(elements, 1.0 / volumetric.bulk, volumetric.measure)
    return laws, parts


def pressure_field(body: Space, parts: Mapping[str, Part], shear_moduli: Mapping[str, float]) -> PressureField | None:
    """Pressure nodes of the regions in `parts`; none where there are none.

    `shear_moduli` [kPa] set the scale of the unknowns only.
    """
    if not parts:
        return None
    vertices = body.nodes[:4]
    nodes = np.full(vertices.shape, -1, dtype=np.int64)
    vertex: list[Ints] = []
    moduli: list[Array] = []
    count = 0
    for name, part in parts.items():
        own, place = np.unique(vertices[:, part.elements], return_inverse=True)
        nodes[:, part.elements] = count + place.reshape(4, -1)
        vertex.append(own)
        moduli.append(np.full(len(own), shear_moduli[name]))
        count += len(own)
    values = body.corner_values
    volume = np.zeros(count)
    mixed = np.flatnonzero(nodes[0] >= 0)
    np.add.at(volume, nodes[:, mixed], np.einsum("cq,eq->ce", values, body.dV[mixed]))
    scale = np.concatenate(moduli) / np.cbrt(volume)
    return PressureField(tuple(parts.values()), nodes, values, np.concatenate(vertex), volume, scale)


def check_same_regions(now: Mapping[str, Part], before: PressureField | None) -> None:
    """Refuse other laws that would have other regions go by a pressure."""
    known = () if before is None else before.parts
    same = len(now) == len(known) and all(
        np.array_equal(a.elements, b.elements) for a, b in zip(now.values(), known, strict=False)
    )
    if not same:
        raise ModelError("materials: found laws that split in other regions than before, expected the same regions")

"""The equations of the mixed form beside those of the displacement: volume residual, coupling and compliance.

Stationary point in ``u`` and ``p`` of ``int psi_rest(F) + p g(J) - p^2 / (2 bulk)``; the last term is absent from an
incompressible body. The pressure is positive in tension. Unknowns are the pressures divided by `PressureField.scale`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from fem_biobot.solid.mixed import kernels
from fem_biobot.solid.mixed.pressure import Part, PressureField
from fem_biobot.solid.pattern import Pattern
from fem_biobot.solid.sharing import Shares, run_parts, split
from fem_biobot.solid.space import Array, Ints, Space


class VolumePoints(NamedTuple):
    """At every point: slope ``dg/dE`` packed, (6, e, q), and volume error ``g - p / bulk``, (e, q)."""

    slope: Array
    error: Array


@dataclass(frozen=True)
class MixedEquations:
    """What the pressure adds to the discrete equations.

    Attributes
    ----------
    field
        The pressure field.
    shares
        Elements with pressure, shared among threads.
    compliance_places, compliance
        Entries of the matrix that couple pressures with each other, and their values ``-int N_c N_d / bulk``, scaled.
    steadying
        What a preconditioner adds to those entries, ``-int N_c N_d / mu``, scaled and to be multiplied by a small
        number: with it no pivot of a pressure vanishes, also where the body is incompressible.
    """

    field: PressureField
    shares: Shares
    compliance_places: Ints
    compliance: Array
    steadying: Array

    def with_parts(self, body: Space, sparsity: Pattern, parts: tuple[Part, ...]) -> MixedEquations:
        """The same with other volumetric energies."""
        return equations(body, sparsity, replace(self.field, parts=parts), self.shares)

    def add_points(self, F: Array, p: Array, S: Array, D: Array, psi: Array) -> VolumePoints:
        """Add the pressure's stress, moduli and energy at the points; `p` (m,) [kPa]."""
        found = VolumePoints(np.zeros_like(S), np.zeros_like(psi))
        f = self.field
        for part in f.parts:

            def add(elements: Ints, part: Part = part) -> None:
                kernels.volumetric_points(
                    F, elements, f.nodes, f.values, p, part.compliance, part.measure, S, D, psi, *found
                )

            run_parts(add, split(part.elements))
        return found

    def residual(self, volume: VolumePoints, dV: Array) -> Array:
        """Volume residual of each unknown, in the units of a force, (m,) [mN]."""
        out = np.zeros(self.field.n)
        f = self.field
        self.shares.run(lambda elements: kernels.volume_residual(elements, f.nodes, f.values, dV, volume.error, out))
        return out * f.scale

    def carry(self, S: Array, volume: VolumePoints, change: Array) -> None:
        """Add to stresses `S`, in place, what a change of the pressures (m,) [kPa] adds."""
        f = self.field
        run_parts(
            lambda part: kernels.add_pressure_change(part, f.nodes, f.values, change, volume.slope, S),
            split(f.elements),
        )

    def add_matrix(
        self, s: Space, sparsity: Pattern, F: Array, volume: VolumePoints, turned: Ints, axes: Array, data: Array
    ) -> None:
        """Add to the matrix what couples displacement with pressure and pressures with each other."""
        f = self.field

        def add(elements: Ints) -> None:
            kernels.coupling(
                elements, s.nodes, s.slopes, s.to_reference, s.dV, F, volume.slope, f.nodes, f.values, f.scale,
                sparsity.starts, sparsity.coupling, turned, axes, data,
            )  # fmt: skip

        self.shares.run(add)
        data[self.compliance_places] += self.compliance


def equations(body: Space, sparsity: Pattern, field: PressureField, all_shares: Shares) -> MixedEquations:
    """The equations of a pressure field; `all_shares` may hold elements without pressure too."""
    mixed = field.nodes[0] >= 0
    own = Shares(tuple(slab[mixed[slab]] for slab in all_shares.slabs), all_shares.rest[mixed[all_shares.rest]])
    compliance = np.zeros(body.dV.shape[0])
    for part in field.parts:
        compliance[part.elements] = part.compliance
    elements = field.elements
    first, second = np.triu_indices(len(field.values))
    scaled = field.mass(body.dV) * field.scale[field.nodes[first][:, elements]]
    scaled *= field.scale[field.nodes[second][:, elements]]
    # the scale of an unknown is a shear modulus over a length
    modulus = (field.scale * np.cbrt(field.volume))[field.nodes[0, elements]]
    places, where = np.unique(sparsity.compliance[elements].T, return_inverse=True)
    sums = [
        np.asarray(np.bincount(where.ravel(), weights=(-scaled * factor).ravel()), dtype=np.float64)
        for factor in (compliance[elements], 1.0 / modulus)
    ]
    return MixedEquations(field, own, places.astype(np.int64), *sums)

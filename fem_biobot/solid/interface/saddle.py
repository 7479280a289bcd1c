"""The matrix of displacements and contact tractions together: where its entries are, and a factor of it.

Unknowns: displacements in the axes of the system, then three for each multiplier that is in use, scaled to lengths by a
stiffness, so that all entries are of one size. Rows of the multipliers say how Coulomb's law is missed. A small
diagonal there and on the nodes of a body that contact alone holds keeps pivots away from zero; it makes iterations
more, not the answer another.
"""

from __future__ import annotations

import numpy as np

from fem_biobot.material.law import Array
from fem_biobot.solid.interface.touch import Pairing, Terms
from fem_biobot.solid.linear import factorisation
from fem_biobot.solid.pattern import Pattern
from fem_biobot.solid.space import Ints
from fem_biobot.solid.system import System

# least share of the stiffness that is added to the diagonal of the multipliers, and of the body that contact holds
SOFT, STEADY = 1e-4, 1e-6


class Saddle:
    """The matrix for one pairing."""

    def __init__(self, system: System, pairing: Pairing, afloat: Ints) -> None:
        """`afloat` are the nodes that nothing but contact holds."""
        base = system.pattern
        n = base.n_dofs
        self.system, self.pairing = system, pairing
        self.used = np.flatnonzero(pairing.cover > 0.0)
        number = np.full(pairing.cover.size, -1)
        number[self.used] = np.arange(self.used.size)
        self.size = n + 3 * self.used.size
        free = np.ones(n, dtype=bool)
        free[system.held.dofs] = False
        dofs, dofs0 = (3 * nodes[:, None] + np.arange(3)[:, None] for nodes in (pairing.nodes, pairing.nodes0))
        rows = [_number(number, n, c) for c in (pairing.corners, pairing.corners0)]  # (3, 3, g)
        blocks = [
            (dofs[:, None, :, None], dofs[None, :, None, :], "abijg"),
            (dofs[:, None, None, :], rows[0][None, :, :, None], "acsig"),
            (rows[0][:, :, None, None], dofs[None, None], "csaig"),
            (rows[1][:, :, None, None], dofs0[None, None], "csaig"),
        ]
        own = n + 3 * np.arange(self.used.size)[None] + np.arange(3)[:, None]
        blocks.append((own[:, None], own[None], "ijc"))
        steady = (3 * afloat[:, None] + np.arange(3)).ravel()
        blocks.append((steady, steady, "d"))
        keys, self._where = [np.repeat(np.arange(n), np.diff(base.starts)) * self.size + base.columns], []
        for r, c, _ in blocks:
            r, c = (np.ascontiguousarray(v).ravel() for v in np.broadcast_arrays(r, c))
            usable = (r >= 0) & (c >= 0)
            for v in (r, c):
                inner = usable & (v < n)
                usable[inner] &= free[v[inner]]
            entries = np.flatnonzero(usable)
            r, c = r[entries], c[entries]
            keys.append(np.minimum(r, c) * self.size + np.maximum(r, c))
            self._where.append((entries, np.where(r == c, 1.0, 0.5), 0.5 * np.sign(c - r)))
        lengths = np.cumsum([len(k) for k in keys])[:-1]
        union, place = np.unique(np.concatenate(keys), return_inverse=True)
        self._base, *places = np.split(place, lengths)
        self._where = [(*w, p) for w, p in zip(self._where, places, strict=True)]
        starts = np.searchsorted(union, np.arange(self.size + 1) * self.size)
        none = np.zeros((0, 0), dtype=np.int32)
        self.pattern = Pattern(starts.astype(np.int32), (union % self.size).astype(np.int32), none, none, none, 0)
        self._factor = factorisation(self.pattern, symmetric=False)

    def factor(self, data: Array, terms: Terms, slope: Array, stiffness: float, calm: float) -> None:
        """Factor the matrix.

        Parameters
        ----------
        data
            Upper triangle of the body's own tangent, held unknowns blocked; with its skew part without symmetry.
        terms
            Of the contact.
        slope
            Derivative of Coulomb's projection, (c, 3, 3).
        stiffness
            Of a node at the contact [mN/mm].
        calm
            Shares of it that are added to the diagonals at least, so that a trial far from the answer does not throw
            about what is held loosely [1].
        """
        p, k = self.pairing, stiffness
        even, odd = np.zeros(len(self.pattern.columns)), np.zeros(len(self.pattern.columns))
        even[self._base] = data if data.ndim == 1 else data[0]
        if data.ndim == 2:
            odd[self._base] = data[1]
        share = k / np.where(p.cover > 0.0, p.cover, 1.0)  # of each multiplier [kPa/mm]
        mean, mean0 = share[p.corners.T], share[p.corners0.T]  # (g, 3)
        C = -terms.C * mean[:, None, :, None, None]
        own = slope[p.corners.T][..., 0]  # (g, 3, s)
        D = own[..., None, None] * (terms.D * mean[..., None, None])[:, :, None]
        across = slope[p.corners0.T][..., 1:]  # (g0, 3, s, 2)
        D0 = np.einsum("gcsr,gcrai->gcsai", across, terms.D0 * mean0[..., None, None, None])
        rest = k * ((1.0 + max(SOFT, calm)) * np.eye(3) - slope[self.used])
        steady = np.full(len(self._where[-1][0]), k * max(STEADY, calm))
        parts = [
            np.moveaxis(terms.K, 0, -1), np.moveaxis(C, 0, -1), np.moveaxis(D, 0, -1), np.moveaxis(D0, 0, -1),
            np.moveaxis(rest, 0, -1),
        ]  # fmt: skip
        values = [np.ascontiguousarray(v).ravel()[w[0]] for v, w in zip(parts, self._where, strict=False)]
        for v, (_, sym, skew, place) in zip([*values, steady], self._where, strict=True):
            even += np.bincount(place, weights=v * sym, minlength=len(even))
            odd += np.bincount(place, weights=v * skew, minlength=len(even))
        self._factor.factor(np.stack([even, odd]))

    def fits(self, pairing: Pairing) -> bool:
        """Whether this matrix has a place for every entry of another pairing's."""
        own = self.pairing
        names = ("pair", "pair0", "nodes", "nodes0", "corners", "corners0")
        same = all(np.array_equal(getattr(own, name), getattr(pairing, name)) for name in names)
        return same and np.array_equal(own.cover > 0.0, pairing.cover > 0.0)

    def solve(self, b: Array) -> Array:
        """Displacements by forces on them alone, (dofs,) or (k, dofs) in the axes of the system."""
        whole = np.zeros((*b.shape[:-1], self.size))
        whole[..., : b.shape[-1]] = b
        return self._factor.solve(whole)[..., : b.shape[-1]]

    def correction(self, unbalanced: Array, miss: Array, stiffness: float) -> tuple[Array, Array]:
        """Change of the displacement (n, 3) [mm] and of the tractions (c, 3) [kPa] that make both vanish.

        `unbalanced` (dofs,) [mN] in the axes of the system, zero where held; `miss` (c, 3) [mm].
        """
        n = len(unbalanced)
        b = np.concatenate([-unbalanced, -stiffness * miss[self.used].ravel()])
        x = self._factor.solve(b)
        change = np.zeros_like(miss)
        change[self.used] = x[n:].reshape(-1, 3) * (stiffness / self.pairing.cover[self.used])[:, None]
        return self.system.to_global(x[:n].reshape(-1, 3)), change


def _number(number: Ints, n: int, corners: Ints) -> Ints:
    """Unknowns of multipliers (3, g): (3, 3, g), negative where they are not in use."""
    found = number[corners]
    return np.where(found[:, None] >= 0, n + 3 * found[:, None] + np.arange(3)[:, None], -1)

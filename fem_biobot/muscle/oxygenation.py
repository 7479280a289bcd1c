"""Oxygen in the muscle of a design: its law, its wetted faces, the field on its mesh, and the viable share, gamma.

Where the defaults of `[muscle.oxygen]` come from:

* diffusivity 1.7e-3 mm^2/s and half saturation 8e-3 mM: measured in fibrin gel with lung fibroblasts (Ehsan and George
  2013, Tissue Eng. A 19, 1433); that muscle has the same half saturation is an assumption.
* consumption 6.7e-4 mM/s: mouse leg muscle at rest, 0.63 nmol/s per gram wet, at 1.06 g/cm^3; stimulated it used five
  times as much (Bell's account of ConsumeO2, seanet.com/~bradbell/consumeo2.htm). That engineered tissue uses as much
  is an assumption; lung fibroblasts at the paper's seeding density use a tenth of it (1.3e-17 mol/s a cell, Ehsan and
  George 2013).
* threshold 2e-3 mM: an anoxia threshold of 1.6 mmHg (Table 16.2 in On the simulation of organ-on-chip cell processes,
  Advances in Biomechanics and Tissue Regeneration), of other cells, at 0.2 mM for 159 mmHg; an assumption for muscle.
* supply 0.2 mM: an assumption, medium in equilibrium with the incubator's air.

The medium wets every face of the muscle that is not on the gel. Cut ends of a strip are taken for symmetry planes.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
import skfem
from numpy.typing import NDArray

from fem_biobot.design import Design
from fem_biobot.design_parts import Oxygen
from fem_biobot.errors import DesignError, MeshError
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.mesh.facets import facets, row_keys
from fem_biobot.muscle.oxygen import OxygenField, OxygenLaw, steady_oxygen
from fem_biobot.muscle.oxygen_depth import section

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

_SOLVED: WeakKeyDictionary[BodyMesh, dict[tuple[str, str, float], Oxygenation]] = WeakKeyDictionary()
# the middle fifth of the span stands for the section, as it does for the fibre stretch
_MIDDLE = 0.1
# elements larger than this share of the depth that oxygen reaches are divided, up to so many
_PART_OF_REACH, _MOST_ELEMENTS = 0.6, 150_000
# an undershoot of the concentration beyond this share of the supply tells of a mesh too coarse for it
COARSE = 0.02


@dataclass(frozen=True, eq=False)
class Oxygenation:
    """Oxygen in a muscle.

    Attributes
    ----------
    field
        Solved on the muscle, or with a permeable gel on the whole body; on a mesh divided further where the body's is
        coarse for the depth that oxygen reaches.
    tissue
        The field's elements that are muscle, (t,).
    element
        The element of the body that each of them lies in, (t,), counted as in ``mesh.regions["muscle"]``.
    middle
        Which of the body's muscle elements lie in the middle fifth of the span, (e,).
    """

    field: OxygenField
    tissue: Ints
    element: Ints
    middle: NDArray[np.bool_]

    @property
    def viable(self) -> Array:
        """Viable share of each muscle element of the body, (e,) [1]."""
        volume = self.field.basis.dx.sum(axis=1)[self.tissue]
        n = self.middle.size
        alive = np.bincount(self.element, volume * self.field.viable()[self.tissue], n)
        return np.clip(alive / np.bincount(self.element, volume, n), 0.0, 1.0)

    @property
    def between(self) -> Ints:
        """The field's elements in the middle fifth of the span, (k,)."""
        return self.tissue[self.middle[self.element]]

    @property
    def gamma(self) -> float:
        """Viable share of the middle fifth of the muscle between the pillars: the paper's gamma [1]."""
        return self.field.gamma(self.between)

    @property
    def gamma_whole(self) -> float:
        """Viable share of all of the muscle [1]."""
        return self.field.gamma(self.tissue)

    @property
    def least(self) -> float:
        """Smallest concentration in the muscle [mM]."""
        return max(0.0, float(self.field.points[self.tissue].min()))

    def notes(self) -> list[str]:
        """What a user must know of this field, one line each."""
        found = []
        if self.gamma == 0.0:
            found.append("oxygen: gamma is 0: no tissue between the pillars is viable, so the machine has no muscle")
        elif self.gamma_whole < 1.0 - 1e-9:
            found.append(
                f"oxygen: {100.0 * (1.0 - self.gamma_whole):.3g} % of the tissue gets less than "
                f"{self.field.law.threshold:g} mM; gamma is {self.gamma:.3f} between the pillars"
            )
        if self.field.undershoot > COARSE:
            found.append(
                f"oxygen: the mesh is too coarse for this consumption (concentrations fall {self.field.undershoot:.2g} "
                "of the supply below zero before they are cut); ask for a smaller --size"
            )
        return found


def oxygen_of(design: Design) -> Oxygen:
    """Oxygen of a design's muscle, the defaults where it has none."""
    if design.muscle is None:
        raise DesignError(f"muscle: found none (kind {design.kind}), expected one for its oxygen")
    return design.muscle.oxygen or Oxygen()


def oxygen_law(design: Design) -> OxygenLaw:
    """Law of a design's muscle, with defaults where it has no ``[muscle.oxygen]``."""
    o = oxygen_of(design)
    return OxygenLaw(o.supply, o.diffusivity, o.consumption, o.half_saturation, o.threshold, o.film)


def oxygenation(design: Design, mesh: BodyMesh) -> Oxygenation:
    """Oxygen in the muscle of a design, on its mesh; what was solved on a mesh before is returned again.

    Raises
    ------
    DesignError
        A design without a muscle.
    MeshError
        A mesh without muscle.
    SolveError
        As `steady_oxygen`.
    """
    oxygen = oxygen_of(design)
    solved = _SOLVED.setdefault(mesh, {})
    key = (oxygen.model_dump_json(), design.kind, design.span)
    if key not in solved:
        solved[key] = _oxygenation(design, oxygen, mesh)
    return solved[key]


def _oxygenation(design: Design, oxygen: Oxygen, mesh: BodyMesh) -> Oxygenation:
    law = oxygen_law(design)
    if "muscle" not in mesh.regions:
        raise MeshError(f"muscle: found no such region in the mesh ({', '.join(mesh.regions)}), expected its tissue")
    muscle = mesh.regions["muscle"]
    whole = oxygen.gel == "permeable"
    elements = np.arange(mesh.n_elements) if whole else muscle
    used, cells = np.unique(mesh.cells[:, elements], return_inverse=True)
    body = skfem.MeshTet(np.ascontiguousarray(mesh.points[:, used]), np.ascontiguousarray(cells.reshape(4, -1)))
    X = mesh.points[:, mesh.cells[:, muscle]].mean(axis=1)
    middle = np.abs(X[0]) <= _MIDDLE * design.span
    if not middle.any():
        raise MeshError("muscle: found no tissue in the middle of the span, expected some for its gamma")
    wetted = _wetted(design, mesh, elements, body, used)
    parent = np.arange(elements.size)
    while _coarse(body, law):
        body, wetted, above = divided(body, wetted)
        parent = parent[above]
    # counted among the body's muscle elements, -1 in the gel
    order = np.full(mesh.n_elements, -1)
    order[muscle] = np.arange(muscle.size)
    element = order[elements[parent]]
    tissue = np.flatnonzero(element >= 0)
    if whole:
        assert oxygen.gel_diffusivity is not None
        D = np.where(element >= 0, law.diffusivity, oxygen.gel_diffusivity)
        field = steady_oxygen(body, law, wetted, diffusivity=D, consuming=(element >= 0).astype(float))
    else:
        field = steady_oxygen(body, law, wetted)
    return Oxygenation(field, tissue, element[tissue], middle)


def _coarse(body: skfem.MeshTet, law: OxygenLaw) -> bool:
    """Whether elements are larger than a part of the depth that oxygen reaches, and few enough to be divided."""
    if law.consumption == 0.0 or 8 * body.nelements > _MOST_ELEMENTS:
        return False
    reach = np.sqrt(2.0 * law.diffusivity * law.supply / law.consumption)
    ends = body.p[:, body.edges]
    return float(np.linalg.norm(ends[:, 0] - ends[:, 1], axis=0).mean()) > _PART_OF_REACH * reach


def divided(body: skfem.MeshTet, faces: Ints) -> tuple[skfem.MeshTet, Ints, Ints]:
    """Each tetrahedron in eight: the mesh, those of its facets that lie on `faces`, and the parent of each element."""
    n, corners = body.nelements, body.p.shape[1]
    # scikit-fem carries subdomains along: one for each binary digit of an element's number
    digits: dict[str, Any] = {str(b): np.flatnonzero(np.arange(n) >> b & 1) for b in range(n.bit_length())}
    fine = body.with_subdomains(digits).refined()
    parent = np.zeros(fine.nelements, dtype=np.int64)
    for digit, inside in (fine.subdomains or {}).items():
        parent[inside] += 1 << int(digit)
    # a new vertex halves an edge, and has the number of that edge behind those of the corners
    total = fine.p.shape[1]
    edge_keys = row_keys(np.asarray(body.edges, dtype=np.int64), total)
    rank = np.argsort(edge_keys)

    def middle(a: Ints, b: Ints) -> Ints:
        return corners + rank[np.searchsorted(edge_keys, row_keys(np.stack([a, b]), total), sorter=rank)]

    a, b, c = np.asarray(body.facets, dtype=np.int64)[:, faces]
    ab, bc, ca = middle(a, b), middle(b, c), middle(c, a)
    parts = np.concatenate([np.stack(t) for t in ((a, ab, ca), (b, ab, bc), (c, bc, ca), (ab, bc, ca))], axis=1)
    boundary = fine.boundary_facets()
    keys = row_keys(np.asarray(fine.facets, dtype=np.int64)[:, boundary], total)
    return fine, boundary[np.isin(keys, row_keys(parts, total))], parent


def _wetted(design: Design, mesh: BodyMesh, elements: Ints, body: skfem.MeshTet, used: Ints) -> Ints:
    """Facets of the body that the medium reaches."""
    n = mesh.n_vertices
    dry = [np.zeros(0, dtype=np.int64)]
    others = np.setdiff1d(np.arange(mesh.n_elements), elements)
    if others.size:
        dry.append(row_keys(facets(mesh.cells[:, others]).triples, n))
    for name in ("end_minus", "end_plus"):
        if design.kind == "strip" and name in mesh.surfaces:
            dry.append(row_keys(mesh.surfaces[name], n))
    boundary = body.boundary_facets()
    keys = row_keys(used[np.asarray(body.facets)[:, boundary]], n)
    return boundary[~np.isin(keys, np.concatenate(dry))]


def viable_share(design: Design, mesh: BodyMesh) -> float | Array:
    """What a design's oxygen leaves of its tension: a share for each muscle element, (e,), or one for all [1]."""
    muscle = design.muscle
    if muscle is None or muscle.oxygen is None or muscle.oxygen.tension == "none":
        return 1.0
    if muscle.oxygen.tension == "section":
        return section_gamma(design)
    return oxygenation(design, mesh).viable


def section_gamma(design: Design) -> float:
    """Viable share of the muscle's section between the pillars, wetted all round: a plane problem, no mesh [1]."""
    muscle = design.muscle
    assert muscle is not None
    ring = muscle.layout == "ring" and design.kind == "bot"
    sides = (muscle.ring_thickness, muscle.ring_height) if ring else (muscle.junction_width, muscle.junction_thickness)
    return _section_gamma(oxygen_law(design), *sides)


@lru_cache(maxsize=64)
def _section_gamma(law: OxygenLaw, width: float, thickness: float) -> float:
    return section(law, width, thickness).gamma()


def viable_gamma(design: Design) -> float:
    """Gamma of a design as one number: given, or from its oxygen over the section between the pillars [1]."""
    muscle = design.muscle
    if muscle is None:
        raise DesignError(f"muscle: found none (kind {design.kind}), expected one for its gamma")
    if muscle.oxygen is None or muscle.oxygen.tension == "none":
        return muscle.gamma
    return section_gamma(design)

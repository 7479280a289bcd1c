"""From a design to a conforming tetrahedral mesh: the one module that speaks to Gmsh.

Gmsh is imported when a mesh is asked for and not before, since its wheel needs libraries that a bare machine lacks.
All parts are cut against each other (OpenCASCADE fragments), so muscle and gel share their vertices; landmarks and the
muscle's mid-section are part of the geometry, so they are vertices and facets of every mesh, whatever its size.
"""

from __future__ import annotations

import re
import tempfile
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem_biobot.apart import Helper, ProcessDiedError
from fem_biobot.design import Design
from fem_biobot.design_checks import refuse_without_solid
from fem_biobot.errors import MeshError
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.mesh.facets import facets
from fem_biobot.mesh.layout import Layout, layout, shortened
from fem_biobot.mesh.measured import muscle_lengths, skeleton_lengths
from fem_biobot.mesh.naming import named_landmarks, named_surfaces, require
from fem_biobot.mesh.own_pillars import refine_round
from fem_biobot.mesh.sizes import CORNER_SHARE, SizeField, set_sizes, take_sizes
from fem_biobot.mesh.solids import NONE_GIVEN, Given, drawn_muscle, drawn_skeleton, given_solids, solids

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

GMSH_LIBRARIES = "libglu1-mesa libgl1 libxcursor1 libxft2 libxinerama1 libgomp1"
GMSH_COMMAND = f"apt-get install -y {GMSH_LIBRARIES}"

# of a fillet's quarter circle in a drawing of triangles
ARC_CHORDS = 8

# beyond this a size is a slip of the pen, and the machine would be out of memory before Gmsh says so
MOST_ELEMENTS = 2e7

_OPTIONS = {
    "General.Terminal": 0,
    "General.NumThreads": 1,
    "Mesh.MaxNumThreads1D": 1,
    "Mesh.MaxNumThreads2D": 1,
    "Mesh.MaxNumThreads3D": 1,
    "Mesh.Algorithm": 6,
    # HXT: the only one whose worst elements stayed good at every size tried; its own threads are set to one
    "Mesh.Algorithm3D": 10,
    "Mesh.RandomSeed": 1,
    "Mesh.RandomFactor": 1e-9,
    "Mesh.RandomFactor3D": 1e-12,
    "Mesh.ElementOrder": 1,
    "Mesh.RecombineAll": 0,
    "Mesh.SubdivisionAlgorithm": 0,
    "Mesh.Optimize": 1,
    "Mesh.OptimizeNetgen": 0,
    "Mesh.OptimizeThreshold": 0.4,
    "Mesh.MeshSizeFromPoints": 0,
    "Mesh.MeshSizeFromCurvature": 0,
    "Mesh.MeshSizeExtendFromBoundary": 0,
    "Mesh.MeshSizeFactor": 1,
    "Mesh.MeshSizeMin": 0,
    "Mesh.MeshSizeMax": 1e22,
    "Mesh.Binary": 0,
    "Geometry.OCCUnionUnify": 1,
    "Geometry.OCCParallel": 0,
}
# Gmsh keeps one global state
_LOCK = threading.Lock()
# its tetrahedral algorithm corrupts memory at a few sizes: only this process dies of it
_GMSH = Helper()


class GmshMissing(MeshError):  # noqa: N818
    """Gmsh cannot be imported; `library` is what it lacks (the shared library, or the package itself)."""

    def __init__(self, library: str) -> None:
        self.library = library
        super().__init__(f"Gmsh cannot start: {library} is missing; {gmsh_advice(library)}")


def gmsh_advice(library: str) -> str:
    """The one command that brings what Gmsh lacks."""
    return "install it with: pip install gmsh" if library == "gmsh" else f"install it with: {GMSH_COMMAND}"


def import_gmsh() -> Any:
    """The gmsh module; raises `GmshMissing` where it cannot be loaded."""
    try:
        import gmsh
    except ModuleNotFoundError as error:
        raise GmshMissing(error.name or "gmsh") from error
    except (ImportError, OSError) as error:
        found = re.search(r"lib[\w.+-]*\.so[\w.]*", str(error))
        raise GmshMissing(found.group(0) if found else _last_line(error)) from error
    return gmsh


def build_mesh(design: Design, size: float | None = None, *, corner_share: float = CORNER_SHARE) -> BodyMesh:
    """Mesh of a design, conforming across muscle and gel.

    Parameters
    ----------
    design
        The machine, strip or cantilever.
    size
        General element size [mm]; that of the design if None. Junction, rings and re-entrant corners are finer in
        proportion to it.
    corner_share
        Element size along re-entrant corners over the general size [1]; in their middle it is at most 0.2.

    Returns
    -------
    BodyMesh
        Checked mesh with the regions, surfaces and landmarks of the design. The same design, size and Gmsh version
        give the same arrays.

    Raises
    ------
    GmshMissing
        Gmsh cannot be imported.
    MeshError
        The size is not positive, Gmsh fails or dies (in a process of its own: nothing else is lost), or the mesh does
        not have the design's parts and volumes.
    """
    refuse_without_solid(design, "mesh")
    plan = layout(design)
    return meshed(plan, design.mesh.size if size is None else size, corner_share).checked(plan)


def remeshed(design: Design, sizes: SizeField) -> BodyMesh:
    """Mesh of a design with given element sizes, checked as `build_mesh` does.

    Raises
    ------
    GmshMissing, MeshError
        As `build_mesh`.
    """
    refuse_without_solid(design, "mesh")
    plan = layout(design)
    return meshed(plan, float(sizes.values.min()), sizes=sizes).checked(plan)


def meshed(
    plan: Layout,
    size: float,
    corner_share: float = CORNER_SHARE,
    given: Given = NONE_GIVEN,
    sizes: SizeField | None = None,
) -> BodyMesh:
    """Mesh of a layout with all its surfaces and landmarks; its volumes are for the caller to check.

    Raises
    ------
    GmshMissing, MeshError
        As `build_mesh`; a given part that does not fit.
    """
    h = float(size)
    if not (np.isfinite(h) and h > 0):
        raise MeshError(f"mesh size must be a positive length, found {h:g} mm")
    # elements a cubic size of a fine mesh, measured on the junction bot: up to 30, or 70 where graded for the closing
    each = 30 if plan.grading == "even" else 70
    estimate = each * sum(plan.volumes.values()) / h**3 if sizes is None else sizes.n_elements
    if estimate > MOST_ELEMENTS:
        raise MeshError(f"mesh size {h:g} mm would give about {estimate:.0e} elements; expected a larger size")
    version = str(import_gmsh().__version__)
    try:
        points, cells, regions, drawn = _GMSH.call(tetrahedra, plan, h, corner_share, given, sizes)
    except ProcessDiedError as died:
        raise MeshError(
            f"Gmsh died over the design's mesh of size {h:g} mm: {died}; a slightly different mesh.size usually works"
        ) from None
    names = list(regions)
    region_of = np.empty(cells.shape[1], dtype=np.int64)
    for number, name in enumerate(names):
        region_of[regions[name]] = number
    surfaces = named_surfaces(plan, points, facets(cells), region_of, names)
    landmarks = named_landmarks(plan.landmarks, points)
    require("surface", plan.faces, surfaces)
    require("landmark", plan.landmarks, landmarks)
    source = {"generator": "gmsh", "gmsh_version": version, "size_mm": h, "grading": plan.grading}
    if given.skeleton is not None:
        source |= {f"drawn_{name}_mm3": volume for name, volume in drawn.items()}
    return BodyMesh(points, cells, regions, surfaces, landmarks, source)


def exported(plan: Layout, region: str, suffix: str) -> bytes:
    """Content of a STEP or STL file (`suffix`) of one region of a layout, in mm.

    Raises
    ------
    GmshMissing, MeshError
        Gmsh cannot be imported; it fails.
    """
    import_gmsh()
    try:
        return _GMSH.call(drawing, plan, region, suffix)
    except ProcessDiedError as died:
        raise MeshError(f"Gmsh died over the drawing of the {region}: {died}") from None


def drawing(plan: Layout, region: str, suffix: str) -> bytes:
    """What `exported` gives, made by Gmsh in this very process."""
    gmsh = import_gmsh()
    with _LOCK, _session(gmsh), tempfile.TemporaryDirectory() as folder:
        try:
            occ = gmsh.model.occ
            drawn_skeleton(occ, plan) if region == "skeleton" else drawn_muscle(occ, plan, [], joined=True)
            occ.synchronize()
            file = Path(folder) / f"{region}{suffix}"
            if suffix == ".stl":
                _strips(gmsh.model)
                gmsh.option.setNumber("Mesh.Binary", 1)
                gmsh.model.mesh.generate(2)
            gmsh.write(str(file))
            return file.read_bytes()
        except Exception as error:  # Gmsh raises bare Exception
            raise MeshError(f"Gmsh could not draw the {region}: {_last_line(error)}") from error


def tetrahedra(
    plan: Layout,
    h: float,
    corner_share: float = CORNER_SHARE,
    given: Given = NONE_GIVEN,
    sizes: SizeField | None = None,
) -> tuple[Array, Ints, dict[str, Ints], dict[str, float]]:
    """Vertices (3, n) [mm], cells (4, e), regions, and these' drawn volumes [mm^3], by Gmsh in this very process.

    Parameters
    ----------
    plan, h, corner_share
        As `build_mesh` has them.
    given
        Parts that come from elsewhere.
    sizes
        Element sizes instead of those that follow from `h`.

    Raises
    ------
    MeshError
        A given part does not fit; Gmsh fails.
    """
    gmsh = import_gmsh()
    # a person's parts are meshed as they are
    longer = plan.lengthened if given.skeleton is None else 1.0
    if longer != 1.0:
        plan = shortened(plan, longer)
        sizes = sizes and sizes.shortened(longer)
    with _LOCK, _session(gmsh):
        try:
            parts, followed = solids(gmsh.model.occ, plan, given, _names(gmsh.model))
            gmsh.model.occ.synchronize()
            drawn = {name: sum(float(gmsh.model.occ.getMass(3, tag)) for tag in tags) for name, tags in parts.items()}
            if sizes is None:
                set_sizes(gmsh.model.mesh.field, plan, h, corner_share)
            else:
                take_sizes(gmsh, sizes)
            refine_round(gmsh, followed, h)
            gmsh.model.mesh.generate(3)
            for method in ("Relocate3D", ""):
                gmsh.model.mesh.optimize(method)
            points, cells, regions = _arrays(gmsh.model.mesh, parts)
            points[1] *= longer
            return points, cells, regions, drawn
        except MeshError:
            raise
        except Exception as error:  # Gmsh raises bare Exception
            raise MeshError(f"Gmsh could not mesh the design at size {h:g} mm: {_last_line(error)}") from error


def drawn_lengths(given: Given, count: int, *, looped: bool) -> dict[str, float]:
    """Lengths of a given skeleton of `count` pillars, and of a muscle that comes with it, by the keys of a design [mm].

    `looped` for a muscle that is one ring round all pillars.

    Raises
    ------
    GmshMissing, MeshError
        Gmsh cannot be imported; something that the parts should have is not there.
    """
    import_gmsh()
    try:
        return _GMSH.call(read_lengths, given, count, looped)
    except ProcessDiedError as died:
        raise MeshError(f"Gmsh died over {given.skeleton and given.skeleton.file}: {died}") from None


def read_lengths(given: Given, count: int, looped: bool) -> dict[str, float]:
    """What `drawn_lengths` gives, read by Gmsh in this very process."""
    gmsh = import_gmsh()
    with _LOCK, _session(gmsh):
        occ = gmsh.model.occ
        assert given.skeleton is not None
        try:
            skeleton, muscle = given_solids(occ, given, _names(gmsh.model))
            found = skeleton_lengths(occ, given.skeleton.file, skeleton, count)
            if muscle:
                file = (given.muscle or given.skeleton).file
                found |= muscle_lengths(occ, file, muscle, skeleton, looped=looped)
            return found
        except MeshError:
            raise
        except Exception as error:  # Gmsh raises bare Exception
            raise MeshError(f"{given.skeleton.file}: Gmsh could not measure it: {_last_line(error)}") from error


def _names(model: Any) -> Callable[[int], str]:
    """Names that files gave to solids."""

    def name_of(tag: int) -> str:
        model.occ.synchronize()
        return str(model.getEntityName(3, tag))

    return name_of


def _strips(model: Any) -> None:
    """Fillets as strips along their axis; plane faces have no more triangles than their corners ask for."""
    for dim, surface in model.getEntities(2):
        if model.getType(dim, surface) != "Cylinder":
            continue
        for _, curve in model.getBoundary([(dim, surface)], oriented=False):
            straight = model.getType(1, curve) == "Line"
            model.mesh.setTransfiniteCurve(curve, 2 if straight else 1 + ARC_CHORDS)
        model.mesh.setTransfiniteSurface(surface)


def _last_line(error: Exception) -> str:
    return (str(error).strip().splitlines() or [type(error).__name__])[-1]


@contextmanager
def _session(gmsh: Any) -> Iterator[None]:
    """A fresh model with our options; afterwards Gmsh is as it was, started or not."""
    mine = not gmsh.isInitialized()
    if mine:
        # no signal handler: we may be in a thread, and Ctrl-C belongs to the caller
        gmsh.initialize(["fem_biobot", "-v", "0"], readConfigFiles=False, interruptible=False)
    before = {} if mine else {name: gmsh.option.getNumber(name) for name in _OPTIONS}
    current = "" if mine else gmsh.model.getCurrent()
    try:
        for name, value in _OPTIONS.items():
            gmsh.option.setNumber(name, value)
        gmsh.model.add("fem_biobot")
        yield
    finally:
        if mine:
            gmsh.finalize()
        else:
            gmsh.model.remove()
            for name, value in before.items():
                gmsh.option.setNumber(name, value)
            if current in gmsh.model.list():
                gmsh.model.setCurrent(current)


def _arrays(mesh: Any, parts: dict[str, list[int]]) -> tuple[Array, Ints, dict[str, Ints]]:
    """Vertices, cells and regions, numbered without gaps in the order of Gmsh's own numbers."""
    tags, coordinates, _ = mesh.getNodes()
    blocks, regions, count = [], {}, 0
    for name, volumes in parts.items():
        tets = [np.asarray(mesh.getElementsByType(4, volume)[1]).reshape(-1, 4) for volume in volumes]
        block = np.concatenate(tets).astype(np.int64)
        regions[name] = np.arange(count, count + len(block))
        count += len(block)
        blocks.append(block)
    cells = np.concatenate(blocks).T
    used = np.unique(cells)
    place = np.full(int(max(tags)) + 1, -1, dtype=np.int64)
    place[np.asarray(tags, dtype=np.int64)] = np.arange(len(tags))
    points = np.asarray(coordinates, dtype=np.float64).reshape(-1, 3)[place[used]].T
    return np.ascontiguousarray(points), np.searchsorted(used, cells), regions

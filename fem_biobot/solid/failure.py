"""What is said of a solve that failed: between which steps, at which one, why, and in which element, in one line."""

from __future__ import annotations

import numpy as np

from fem_biobot.material.law import PAIRS, Array
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.solid.moduli import PACKED_ENTRY
from fem_biobot.solid.path import PathFailedError
from fem_biobot.solid.stability import Buckling
from fem_biobot.solid.step_failed import Why
from fem_biobot.solid.system import Points, System

# what to try, beside a lower load or tension
_HELP = {
    Why.inverted: "a finer mesh, or a stiffer design",
    Why.outside_law: "a softer law, or a stiffer design",
    Why.indefinite: "a finer mesh, or a stiffer design",
    Why.unstable: "a finer mesh, or a stiffer design",
    Why.diverged: "more steps on the way, or a finer mesh",
    Why.no_number: "a law and loads that give numbers",
    Why.iterations: "more steps on the way, or more iterations (`NewtonSettings.max_iterations`)",
}
# how an element is concerned that is not itself the reason
_LOUDEST = "the largest force out of balance is in {}"
_CONCERNED = {Why.inverted: "{}", Why.outside_law: "{}", Why.unstable: "the least stiff is {}"}


def advice(failure: PathFailedError, mesh: BodyMesh, element: int | None, lost: Buckling | None) -> str:
    """The whole message: ends of the step, what is told of the last try, critical factors if any, what to try."""
    r, w = failure.last.step, failure.wanted
    (load, wanted_load), (tension, wanted_tension) = _apart(r.load, w.load), _apart(r.tension, w.tension)
    reached, wanted = [f"load x{load}", f"tension x{tension}"], [f"load x{wanted_load}", f"tension x{wanted_tension}"]
    for name in {**r.loads, **w.loads}:
        _add(reached, wanted, name, *_apart(r.load_on(name), w.load_on(name)))
    for name in {**r.tensions, **w.tensions}:
        _add(reached, wanted, name, *_apart(r.tension_in(name), w.tension_in(name)))
    buckles = "" if lost is None else f"it buckles at {lost.step.told()}; "
    return (
        f"no equilibrium between {', '.join(reached)} (reached) and {', '.join(wanted)} (asked): "
        f"{told(failure, mesh, element)}; {buckles}try a lower tension or load, {_HELP[failure.failure.why]}"
    )


def told(failure: PathFailedError, mesh: BodyMesh, element: int | None) -> str:
    """Step and iteration of the last try, why it failed, and the element concerned."""
    last = failure.failure
    when = "" if last.iteration is None else f", iteration {last.iteration}"
    where = ""
    if element is not None:
        where = "; " + _CONCERNED.get(last.why, _LOUDEST).format(place(mesh, element))
    return f"at {failure.failed_at.told()}{when}: {last}{where}"


def concerned(system: System, failure: PathFailedError) -> int | None:
    """The element that the failure names, or where an unstable equilibrium is least stiff."""
    last = failure.failure
    if last.why is not Why.unstable or last.best is None:
        return last.element
    points = system.points(system.deformation_gradient(last.best.u), failure.failed_at, last.best.p)
    return int(np.argmin(least_stiffness(points)))


def least_stiffness(points: Points) -> Array:
    """Smallest eigenvalue of the symmetric part of ``dP/dF`` among the points of each element, (e,) [kPa]."""
    least = np.full(points.F.shape[2], np.inf)
    moduli = np.empty((points.F.shape[2], 6, 6))
    for q in range(points.F.shape[3]):
        F, S = points.F[:, :, :, q], unpacked(points.S[:, :, q])
        for (a, b), entry in PACKED_ENTRY.items():
            moduli[:, a, b] = moduli[:, b, a] = points.D[entry, :, q]
        # change of the strain's six components, shears twice, by that of F
        strain = np.zeros((F.shape[2], 6, 3, 3))
        for a, (i, k) in enumerate(PAIRS):
            strain[:, a, :, k] += F[:, i].T * (0.5 if i == k else 1.0)
            strain[:, a, :, i] += F[:, k].T * (0.5 if i == k else 1.0)
        strain = strain.reshape(-1, 6, 9)
        A4 = np.einsum("eac,eab,ebd->ecd", strain, moduli, strain, optimize=True)
        A4 += np.einsum("ij,kle->eikjl", np.eye(3), S).reshape(-1, 9, 9)
        least = np.minimum(least, np.linalg.eigvalsh(A4)[:, 0])
    return least


def unpacked(packed: Array) -> Array:
    """Symmetric tensor (3, 3, ...) from its six components (6, ...) in the order of `PAIRS`."""
    full = np.empty((3, 3, *packed.shape[1:]))
    for a, (i, k) in enumerate(PAIRS):
        full[i, k] = full[k, i] = packed[a]
    return full


def place(mesh: BodyMesh, element: int) -> str:
    """An element with its region and the middle of its vertices."""
    region = next((name for name, elements in mesh.regions.items() if element in elements), "none")
    x, y, z = mesh.points[:, mesh.cells[:, element]].mean(axis=1)
    return f"element {element} in region {region} at ({x:.4g}, {y:.4g}, {z:.4g}) mm"


def _add(reached: list[str], wanted: list[str], name: str, first: str, second: str) -> None:
    reached.append(f"{name} x{first}")
    wanted.append(f"{name} x{second}")


def _apart(first: float, second: float) -> tuple[str, str]:
    """Two numbers with as many digits, at least four, as tell them apart if they differ."""
    texts = [(f"{first:.{digits}g}", f"{second:.{digits}g}") for digits in range(4, 18)]
    return next(((a, b) for a, b in texts if a != b or first == second), texts[-1])

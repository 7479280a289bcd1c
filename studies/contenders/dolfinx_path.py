"""DOLFINx's part in studies/solid_speed.py: plain Newton with MUMPS on a case written there.

Run by the Python that has DOLFINx (0.5 or later, with PETSc and MUMPS), which need not have this package:
``python3 dolfinx_path.py case.npz``; prints one line of JSON. Compiling the forms is not timed. MUMPS takes its dense
products from the system's BLAS, which the line names: with Debian's reference BLAS it takes three times as long as with
OpenBLAS (package libopenblas0).
"""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path
from typing import Any

import dolfinx  # pyright: ignore[reportMissingImports]
import numpy as np
import ufl  # pyright: ignore[reportMissingImports]
from dolfinx import fem, mesh  # pyright: ignore[reportMissingImports]
from dolfinx.fem import petsc  # pyright: ignore[reportMissingImports]
from mpi4py import MPI  # pyright: ignore[reportMissingImports]
from petsc4py import PETSc  # pyright: ignore[reportMissingImports]

_MOST_ITERATIONS = 25


def main(file: str) -> dict[str, Any]:
    """Newton's method at each tension from the state before."""
    case = np.load(file)
    linear = ufl.VectorElement("Lagrange", "tetrahedron", 1)
    body = mesh.create_mesh(MPI.COMM_SELF, case["cells"].astype(np.int64), case["points"], ufl.Mesh(linear))
    given = body.topology.original_cell_index  # cells are renumbered
    muscle = np.zeros(len(case["cells"]), dtype=bool)
    muscle[case["muscle"]] = True
    scalars, vectors = fem.FunctionSpace(body, ("DG", 0)), fem.VectorFunctionSpace(body, ("DG", 0))
    mu, lmbda, active, a0 = (fem.Function(space) for space in (scalars, scalars, scalars, vectors))
    for field, values in ((mu, case["mu"]), (lmbda, case["lmbda"]), (active, (1.0, 0.0))):
        field.x.array[:] = np.where(muscle, values[0], values[1])[given]
    a0.x.array[:] = np.where(muscle[:, None], case["a0"], (1.0, 0.0, 0.0))[given].ravel()
    V = fem.VectorFunctionSpace(body, ("Lagrange", 2))
    u, tension = fem.Function(V), fem.Constant(body, PETSc.ScalarType(0.0))
    F = ufl.Identity(3) + ufl.grad(u)
    J = ufl.det(F)
    a = F * a0
    psi = mu / 2 * (ufl.inner(F, F) - 3) - mu * ufl.ln(J) + lmbda / 2 * ufl.ln(J) ** 2
    psi += tension * active * (ufl.sqrt(ufl.inner(a, a)) - 1)
    energy = psi * ufl.dx(metadata={"quadrature_degree": 2})
    residual = ufl.derivative(energy, u, ufl.TestFunction(V))
    residual_form, tangent_form = fem.form(residual), fem.form(ufl.derivative(residual, u, ufl.TrialFunction(V)))
    held = []
    for *place, component in case["held"]:
        sub = V.sub(int(component))
        alone, _ = sub.collapse()

        def here(x: Any, place: Any = place) -> Any:
            return np.all(np.abs(x.T - place) < 1e-9, axis=1)

        dofs = fem.locate_dofs_geometrical((sub, alone), here)
        assert len(dofs[0]) == 1, f"found {len(dofs[0])} nodes at {place}, expected one"
        held.append(fem.dirichletbc(fem.Function(alone), dofs, sub))
    A, b, change = petsc.create_matrix(tangent_form), petsc.create_vector(residual_form), u.vector.duplicate()
    solver = PETSc.KSP().create(MPI.COMM_SELF)
    solver.setType("preonly")
    solver.getPC().setType("cholesky")
    solver.getPC().setFactorSolverType("mumps")
    iterations, begin = 0, time.process_time()
    for value in case["tensions"]:
        tension.value = value
        for k in range(_MOST_ITERATIONS + 1):
            b.set(0.0)
            petsc.assemble_vector(b, residual_form)
            petsc.set_bc(b, held, u.vector, -1.0)
            if b.norm() <= float(case["tolerance"]) * float(case["scale"]):
                break
            if k == _MOST_ITERATIONS:
                raise RuntimeError(f"no convergence at {value:g} kPa")
            A.zeroEntries()
            petsc.assemble_matrix(A, tangent_form, bcs=held)
            A.assemble()
            A.setOption(PETSc.Mat.Option.SYMMETRIC, True)
            solver.setOperators(A)
            solver.solve(b, change)
            u.vector.axpy(-1.0, change)
            iterations += 1
    seconds = time.process_time() - begin
    nodes = V.tabulate_dof_coordinates()
    probe = int(np.argmin(np.linalg.norm(nodes - case["probe"], axis=1)))
    return {
        "version": dolfinx.__version__,
        "blas": _blas(),
        "unknowns": 3 * len(nodes),
        "seconds": seconds,
        "iterations": iterations,
        "probe": u.x.array.reshape(-1, 3)[probe].tolist(),
    }


def _blas() -> str:
    """Which fast BLAS this process has loaded, beside those that Python packages bring for themselves."""
    maps = Path("/proc/self/maps")
    lines = maps.read_text(encoding="utf-8").lower().splitlines() if maps.exists() else []
    loaded = "".join(line for line in lines if ".libs/" not in line)
    known = {"openblas": "OpenBLAS", "mkl_": "MKL", "blis": "BLIS", "atlas": "ATLAS"}
    return next((name for word, name in known.items() if word in loaded), "reference BLAS")


if __name__ == "__main__":
    print(json.dumps(main(sys.argv[1])))

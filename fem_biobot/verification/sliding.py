"""C8: a band that slides on a drum, and blocks pressed together: contact of deformable parts through the solid."""

from __future__ import annotations

from functools import cache

import numpy as np

from fem_biobot import BodyMesh, Fix, NeoHooke, SolidModel, SolidSolution, Traction, solve
from fem_biobot.mesh.facets import facets
from fem_biobot.mesh.naming import interface
from fem_biobot.mesh.unbonded import unbonded
from fem_biobot.solid.interface.record import Sliding
from fem_biobot.solid.interface.results import footprint, part_forces
from fem_biobot.verification.blocks import TIGHT, box_mesh
from fem_biobot.verification.records import Case, Claim, Curve, Finding, Graph, worst

# a quarter of a drum, and a band around it [mm]; facets around, steps of the pull
RADIUS, THICKNESS, WIDTH, SKIN = 5.0, 0.25, 1.0, 0.5
FACETS, STEPS = 16, 5
PULL, FRICTION = 1.0, 0.4  # kPa on the band's end; Coulomb's coefficient
PRESSED = 1.5  # kPa

# moments about the drum's axis: d(T (R + h/2)) = mu p R^2 dphi with p = T / R
RATIO = float(np.exp(FRICTION * 0.5 * np.pi * RADIUS / (RADIUS + 0.5 * THICKNESS)))


def _with_interface(mesh: BodyMesh) -> BodyMesh:
    between = interface(facets(mesh.cells), mesh.region_of(), list(mesh.regions))
    return BodyMesh(mesh.points, mesh.cells, mesh.regions, {**mesh.surfaces, "interface": between})


def drum() -> BodyMesh:
    """A stiff skin of a quarter drum about y and a band on it; the band's ends are ``held`` (on z) and ``pulled``."""
    box = box_mesh((FACETS, 1, 3), shift=0.0, layers=(1.0 / 3.0, 1.0), names=("skeleton", "muscle"))
    turn, y, z = box.points
    inside = z < 1.0 / 3.0
    r = np.where(inside, RADIUS + (3.0 * z - 1.0) * SKIN, RADIUS + (1.5 * z - 0.5) * THICKNESS)
    phi = 0.5 * np.pi * (1.0 - turn)
    points = np.stack([r * np.cos(phi), WIDTH * y, r * np.sin(phi)])
    mesh = unbonded(_with_interface(BodyMesh(points, box.cells, box.regions, box.surfaces)))
    own = np.unique(mesh.cells[:, mesh.regions["muscle"]])
    ends = {
        name: mesh.surfaces[end][:, np.isin(mesh.surfaces[end], own).all(axis=0)]
        for name, end in (("held", "x0"), ("pulled", "x1"))
    }
    return BodyMesh(mesh.points, mesh.cells, mesh.regions, {**mesh.surfaces, **ends})


@cache
def pulled(friction: float) -> SolidSolution:
    """The band held at one end and pulled at the other, in equal steps."""
    model = SolidModel(
        drum(), {"skeleton": NeoHooke(1e4, 0.3), "muscle": NeoHooke(100.0, 0.0)}, {},
        [Fix("z0"), Fix("held", "x"), Fix("y0", "y")], [Traction("pulled", (0.0, 0.0, -PULL))],
        sliding=Sliding(friction=friction, axis=(0.0, 1.0, 0.0)),
    )  # fmt: skip
    return solve(model, list(np.arange(1, STEPS + 1) / STEPS))


def unaccounted(solution: SolidSolution) -> float:
    """Work of the pull less strain energy and heat of friction, over the work; by the trapezoidal rule."""
    model = solution.last.model
    slide = model.slide
    assert slide is not None
    work = heat = 0.0
    load, moved = 0.0, 0.0
    traction = np.zeros((slide.contact.count, 3))
    for state in solution.states:
        touch = state.touch
        assert touch is not None
        along = float(np.sum(model.system.dead_load * state.u.T))
        work += 0.5 * (load + state.step.load) * (along - moved)
        cover = slide.contact.paired(np.ascontiguousarray(state.u.T), touch).cover
        mean = 0.5 * (traction + touch.traction)
        heat -= float(np.einsum("c,cs,cs->", cover, mean[:, 1:], touch.gaps[:, 1:]))
        load, moved, traction = state.step.load, along, touch.traction
    return (work - solution.energy - heat) / work


def unevenness() -> float:
    """Largest departure of the traction between two pressed blocks from what presses them, over it."""
    mesh = box_mesh(2, layers=(0.5, 1.0), names=("skeleton", "muscle"))
    model = SolidModel(
        unbonded(_with_interface(mesh)), {"skeleton": NeoHooke(50.0, 0.3), "muscle": NeoHooke(10.0, 0.3)}, {},
        [Fix(name, "xyz"[axis]) for name, axis in (("x0", 0), ("x1", 0), ("y0", 1), ("y1", 1), ("z0", 2))],
        [Traction("z1", (0.0, 0.0, -PRESSED))], sliding=Sliding(friction=FRICTION),
    )  # fmt: skip
    touch = solve(model, settings=TIGHT).last.touch
    assert touch is not None
    return worst(touch.traction / PRESSED - np.array([1.0, 0.0, 0.0]), 0.0)


def sliding_parts() -> Finding:
    """C8: pressed blocks, and Eytelwein's belt on a deformable drum.

    Problem: two blocks pressed together, of different stiffness; a band over a quarter of a drum, held at one end and
        pulled at the other, without friction and with it.
    Measured: traction between the blocks; mean pressure of the band over its tension by its radius and width; tension
        of the pulled end over that of the held one; what the books of energy and of forces leave.
    Tolerance: the blocks and the forces to rounding of the solver; the drum is a polygon of 16 sides, on which facets
        that slide tilt the pressure by the square of their turn (0.1 %), and friction wants for slip beside the held
        end, over half of a side (1 %); energy by the trapezoidal rule over five steps, and the tilt again.
    Cannot see: edges, where a band's pressure is concentrated; slip that turns back.
    Catches: friction by the wrong pressure or in one direction only, slip measured from the wrong place, pressure that
        does not turn with the surface.
    """
    free, rubbed = pulled(0.0), pulled(FRICTION)
    section = THICKNESS * WIDTH
    values = [unevenness()]
    tension = PULL * section
    part = part_forces(free.last)[0]
    values.append(part.pressing / part.area * RADIUS * WIDTH / tension)
    values += [tension / -float(each.reaction("held")[0]) for each in (free, rubbed)]
    values += [unaccounted(free), unaccounted(rubbed)]
    force = part_forces(rubbed.last)[0].force + rubbed.reaction("z0")
    force[1] = 0.0  # the sides hold that
    values.append(float(np.linalg.norm(force)) / tension)
    curves = []
    for each, friction in ((free, 0.0), (rubbed, FRICTION)):
        seen = footprint(each.last)
        phi = np.arctan2(seen.points[2], seen.points[0])
        order = np.argsort(phi)
        known = PULL * THICKNESS / RADIUS * np.exp(-friction * phi[order] * RADIUS / (RADIUS + 0.5 * THICKNESS))
        degrees = np.rad2deg(phi[order])
        curves += [
            Curve(f"belt, friction {friction:g}", degrees, 1e3 * known, known=True),
            Curve(f"band, friction {friction:g}", degrees, 1e3 * seen.pressure[order]),
        ]
    graph = Graph("angle from the pulled end [deg]", "pressure [Pa]", tuple(curves))
    return Finding.of(values, graph)


C8 = Case(
    "C8",
    "parts that slide on each other",
    (
        Claim("traction between pressed blocks, departure", 0.0, 1e-9, "1", "equilibrium"),
        Claim("mean pressure of a band over T / (R w)", 1.0, 2e-3, "1", "p = T / (R w)"),
        Claim("tension ratio without friction", 1.0, 2e-3, "1", "equilibrium"),
        Claim(
            "tension ratio with friction 0.4", RATIO, 0.01 * RATIO, "1", "Euler 1769, Eytelwein: exp(mu phi R / R_m)"
        ),
        Claim("work not accounted for, without friction", 0.0, 3e-3, "1", "first law"),
        Claim("work not accounted for, with friction", 0.0, 5e-3, "1", "first law"),
        Claim("contact force less reaction of the drum, over T", 0.0, 1e-6, "1", "equilibrium"),
    ),
    sliding_parts,
)
CASES = (C8,)

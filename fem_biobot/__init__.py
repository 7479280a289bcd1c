"""fem_biobot: finite-element continuum model of muscle-driven hydrogel walking machines.

The public names below are loaded when they are first asked for, so that importing the package costs nothing.
"""

from __future__ import annotations

from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from fem_biobot.config import load_design
    from fem_biobot.design import Design
    from fem_biobot.errors import BiobotError, DesignError, FileError, MeshError, ModelError, SolveError
    from fem_biobot.friction.ground import Ground
    from fem_biobot.link.crosscheck import CrossCheck, crosscheck
    from fem_biobot.material.active import ActiveStress
    from fem_biobot.material.blemker import Blemker
    from fem_biobot.material.conventions import Convention
    from fem_biobot.material.dispersion import Dispersion
    from fem_biobot.material.force_velocity import ForceVelocity
    from fem_biobot.material.gent import Gent
    from fem_biobot.material.guccione import Guccione
    from fem_biobot.material.holzapfel_ogden import HolzapfelOgden
    from fem_biobot.material.mooney_rivlin import MooneyRivlin
    from fem_biobot.material.neo_hooke import NeoHooke
    from fem_biobot.material.neo_hooke_isochoric import NeoHookeIsochoric
    from fem_biobot.material.yeoh import Yeoh
    from fem_biobot.mesh.body import BodyMesh
    from fem_biobot.mesh.files import read_mesh, write_mesh
    from fem_biobot.mesh.foreign import export_part, import_mesh
    from fem_biobot.mesh.geometry import build_mesh
    from fem_biobot.muscle.directions import fibres_around, fibres_between
    from fem_biobot.muscle.orientation_file import orientation_of_file
    from fem_biobot.rod.activation.curve import MuscleCurve
    from fem_biobot.rod.drag.linear import LinearDrag
    from fem_biobot.rod.drag.record import Drag
    from fem_biobot.rod.dynamics.integrate import Motion, dynamics
    from fem_biobot.rod.ensemble import walk_ensemble
    from fem_biobot.rod.gait import Walk
    from fem_biobot.rod.ground import ContactPoints
    from fem_biobot.rod.guide import Guide
    from fem_biobot.rod.model import RodModel, RodState
    from fem_biobot.rod.modes import Modes, modes
    from fem_biobot.rod.records import (
        Body,
        DistributedLoad,
        Gravity,
        Hinge,
        Hold,
        Muscle,
        PointLoad,
        Resistance,
        Rigid,
        Rod,
        Spherical,
        Spring,
    )
    from fem_biobot.rod.reduce import reduce
    from fem_biobot.rod.section import RodMaterial, Section
    from fem_biobot.rod.statics import RodSolution, RodStep, reaction, statics
    from fem_biobot.rod.touch import Touch
    from fem_biobot.rod.walk import walk
    from fem_biobot.solid.dynamics.drag import SurfaceDrag
    from fem_biobot.solid.dynamics.integrate import solid_dynamics
    from fem_biobot.solid.dynamics.motion import SolidMotion
    from fem_biobot.solid.from_design import tension_step
    from fem_biobot.solid.measures import measures
    from fem_biobot.solid.model import SolidModel, SolidSolution, SolidState, solve
    from fem_biobot.solid.records import BodyForce, Fix, Foundation, Pressure, Rotate, Step, Symmetry, Traction
    from fem_biobot.study.run import run
    from fem_biobot.vtk import write_pvd, write_vtu

_HOMES = {
    "config": ("load_design",),
    "design": ("Design",),
    "errors": ("BiobotError", "DesignError", "FileError", "MeshError", "ModelError", "SolveError"),
    "friction.ground": ("Ground",),
    "link.crosscheck": ("CrossCheck", "crosscheck"),
    "material.active": ("ActiveStress",),
    "material.blemker": ("Blemker",),
    "material.conventions": ("Convention",),
    "material.dispersion": ("Dispersion",),
    "material.force_velocity": ("ForceVelocity",),
    "material.gent": ("Gent",),
    "material.guccione": ("Guccione",),
    "material.holzapfel_ogden": ("HolzapfelOgden",),
    "material.mooney_rivlin": ("MooneyRivlin",),
    "material.neo_hooke": ("NeoHooke",),
    "material.neo_hooke_isochoric": ("NeoHookeIsochoric",),
    "material.yeoh": ("Yeoh",),
    "mesh.body": ("BodyMesh",),
    "mesh.files": ("read_mesh", "write_mesh"),
    "mesh.foreign": ("export_part", "import_mesh"),
    "mesh.geometry": ("build_mesh",),
    "muscle.directions": ("fibres_around", "fibres_between"),
    "muscle.orientation_file": ("orientation_of_file",),
    "rod.activation.curve": ("MuscleCurve",),
    "rod.drag.linear": ("LinearDrag",),
    "rod.drag.record": ("Drag",),
    "rod.dynamics.integrate": ("Motion", "dynamics"),
    "rod.ensemble": ("walk_ensemble",),
    "rod.gait": ("Walk",),
    "rod.model": ("RodModel", "RodState"),
    "rod.modes": ("Modes", "modes"),
    "rod.ground": ("ContactPoints",),
    "rod.guide": ("Guide",),
    "rod.records": (
        "Body",
        "DistributedLoad",
        "Gravity",
        "Hinge",
        "Hold",
        "Muscle",
        "PointLoad",
        "Resistance",
        "Rigid",
        "Rod",
        "Spherical",
        "Spring",
    ),
    "rod.section": ("RodMaterial", "Section"),
    "rod.reduce": ("reduce",),
    "rod.touch": ("Touch",),
    "rod.statics": ("RodSolution", "RodStep", "reaction", "statics"),
    "rod.walk": ("walk",),
    "solid.dynamics.drag": ("SurfaceDrag",),
    "solid.dynamics.integrate": ("solid_dynamics",),
    "solid.dynamics.motion": ("SolidMotion",),
    "solid.from_design": ("tension_step",),
    "solid.measures": ("measures",),
    "solid.model": ("SolidModel", "SolidSolution", "SolidState", "solve"),
    "solid.records": ("BodyForce", "Fix", "Foundation", "Pressure", "Rotate", "Step", "Symmetry", "Traction"),
    "study.run": ("run",),
    "vtk": ("write_pvd", "write_vtu"),
}
_HOME_OF = {name: home for home, names in _HOMES.items() for name in names}

__all__ = [
    "ActiveStress",
    "BiobotError",
    "Blemker",
    "Body",
    "BodyForce",
    "BodyMesh",
    "ContactPoints",
    "Convention",
    "CrossCheck",
    "Design",
    "DesignError",
    "Dispersion",
    "DistributedLoad",
    "Drag",
    "FileError",
    "Fix",
    "ForceVelocity",
    "Foundation",
    "Gent",
    "Gravity",
    "Ground",
    "Guccione",
    "Guide",
    "Hinge",
    "Hold",
    "HolzapfelOgden",
    "LinearDrag",
    "MeshError",
    "ModelError",
    "Modes",
    "MooneyRivlin",
    "Motion",
    "Muscle",
    "MuscleCurve",
    "NeoHooke",
    "NeoHookeIsochoric",
    "PointLoad",
    "Pressure",
    "Resistance",
    "Rigid",
    "Rod",
    "RodMaterial",
    "RodModel",
    "RodSolution",
    "RodState",
    "RodStep",
    "Rotate",
    "Section",
    "SolidModel",
    "SolidMotion",
    "SolidSolution",
    "SolidState",
    "SolveError",
    "Spherical",
    "Spring",
    "Step",
    "SurfaceDrag",
    "Symmetry",
    "Touch",
    "Traction",
    "Walk",
    "Yeoh",
    "build_mesh",
    "crosscheck",
    "dynamics",
    "export_part",
    "fibres_around",
    "fibres_between",
    "import_mesh",
    "load_design",
    "measures",
    "modes",
    "orientation_of_file",
    "reaction",
    "read_mesh",
    "reduce",
    "run",
    "solid_dynamics",
    "solve",
    "statics",
    "tension_step",
    "walk",
    "walk_ensemble",
    "write_mesh",
    "write_pvd",
    "write_vtu",
]

try:
    __version__ = version("fem_biobot")
except PackageNotFoundError:  # a checkout that is not installed
    __version__ = "0+unknown"


def __getattr__(name: str) -> Any:
    if name not in _HOME_OF:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOME_OF[name]}"), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *_HOME_OF])

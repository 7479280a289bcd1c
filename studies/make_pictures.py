"""Renew the pictures of README.md: python studies/make_pictures.py [--size MM] [--out FOLDER]

The stressed machine as `fem-biobot run junction_bot` draws it at full drive, and the walk of README's script at 2 Hz
by steps of 1 ms, animated. Into ``studies/pictures`` by default; about a minute. All other pictures there are those of
the studies of their names, which write them with ``--out``.
"""

from __future__ import annotations

import argparse
import re
import shutil
from pathlib import Path
from tempfile import TemporaryDirectory

from fem_biobot.config import load_design
from fem_biobot.mesh.committed import mesh_for
from fem_biobot.rod.walk import walk
from fem_biobot.study.outputs import machine_of, shape_of
from fem_biobot.study.plan import Solver, Wanted
from fem_biobot.study.reporter import Silent
from fem_biobot.study.rod_outputs import draw_gait
from fem_biobot.view.machine import machine_pictures
from fem_biobot.view.pictures import draw_pictures

HERE = Path(__file__).resolve().parent
README = HERE.parent / "README.md"
STRESS, WALK = "junction_bot_stress.png", "junction_bot_walk.gif"
# the tensions of README's script, those of the published rod code; of the walk its last second is shown
TENSIONS = ["muscle.passive_tension = 0.9 kPa", "muscle.active_tension = 2.7 kPa"]
FREQUENCY, DURATION, SHOWN = 2.0, 3.0, 1.0


def shown_by(page: Path = README) -> set[str]:
    """Names of the pictures that a page shows out of the folder of pictures."""
    return set(re.findall(r"\]\(studies/pictures/([^)]+)\)", page.read_text(encoding="utf-8")))


def stress(file: Path, size: float | None) -> None:
    """The machine at full drive, coloured by von Mises stress, from the path that a run takes."""
    design = load_design("junction_bot")
    mesh, _ = mesh_for(design, size)
    solver = Solver(design, mesh, Silent())
    passive, peak = design.tension(0.0), design.tension(design.drive.amplitude)
    solver.solve(Wanted("passive", f"passive, {passive:.4g} kPa", tension=passive))
    full = solver.solve(Wanted("peak", f"stimulated, {peak:.4g} kPa", tension=peak))
    with TemporaryDirectory() as folder:
        shape = shape_of(design, full.state, full.wanted.key, full.wanted.label)
        pictures = machine_pictures(machine_of(design, full.state), [shape])
        drawn = draw_pictures([each for each in pictures if each.name == "von_mises_peak"], Path(folder))
        shutil.copyfile(drawn.files[0], file)


def gait(file: Path) -> None:
    """The rods walking."""
    draw_gait(file, walk(load_design("junction_bot", TENSIONS), frequency=FREQUENCY, duration=DURATION), shown=SHOWN)


def main() -> None:
    """Write both pictures."""
    parser = argparse.ArgumentParser(description="Renew the pictures of README.md.")
    parser.add_argument("--size", type=float, help="Mesh size [mm]; by default the preset's.")
    parser.add_argument("--out", type=Path, default=HERE / "pictures")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    stress(options.out / STRESS, options.size)
    gait(options.out / WALK)
    print(*(f"{options.out / name}: {(options.out / name).stat().st_size} bytes" for name in (STRESS, WALK)), sep="\n")


if __name__ == "__main__":
    main()

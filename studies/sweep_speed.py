"""Study: how much faster is a sweep with two workers than with one, and beside neighbours than each by itself?

Question
--------
64 walks of the junction bot's rods and 16 coarse solves of its solid, each as a sweep on one worker and on two, in
turn: what is the ratio of the times that a user waits, and do both give the same rows? And 16 solves that begin at the
states of a case near by against the same from the undeformed body, once with near neighbours and once with far ones:
how many Newton iterations and processor seconds do they take, and how far are their rows apart?

Run: ``python studies/sweep_speed.py [--level smoke|full] [--parts workers,starts] [--out FOLDER]``; a minute at smoke,
some minutes at full on two idle processors.
"""

from __future__ import annotations

import argparse
import os
import resource
import statistics
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from fem_biobot.files import replacing
from fem_biobot.progress import show_tables
from fem_biobot.study.outputs import write_table
from fem_biobot.study.sweep import sweep
from fem_biobot.study.sweep_file import SweepPlan, read_sweep
from fem_biobot.study.sweep_runner import LocalRunner, usable_processors
from fem_biobot.tables import Table

Row = dict[str, Any]

# --- design -----------------------------------------------------------------------------------------------------------

WALKS = """
base = "junction_bot"
task = "walk"
[set]
muscle.active_tension = "2.7 kPa"
drive.duration = "{duration} s"
[grid]
muscle.passive_tension = {{ from = "0.5 kPa", to = "2 kPa", count = {first} }}
skeleton.material.young = {{ from = "280 kPa", to = "360 kPa", count = {second} }}
"""
SOLVES = """
base = "{base}"
task = "solve"
[set]
mesh.size = "{size} mm"
[grid]
muscle.passive_tension = {{ from = "6 kPa", to = "9 kPa", count = {first} }}
muscle.material.young = {{ from = "9 kPa", to = "11 kPa", count = {second} }}
"""
STARTS = """
base = "junction_bot"
task = "solve"
start = "{start}"
[set]
mesh.size = "5 mm"
[grid]
muscle.passive_tension = {{ from = "{low}", to = "9 kPa", count = {count} }}
{second} = {{ from = "{soft}", to = "{stiff}", count = {count} }}
"""
TISSUE = ("muscle.material.young", "9 kPa", "11 kPa")
SKELETON = ("skeleton.material.young", "200 kPa", "400 kPa")
# tension of the first value, the other key with its ends, values of each
NEIGHBOURS = {
    "smoke": {"near": ("8 kPa", TISSUE, 2)},
    "full": {"near": ("6 kPa", TISSUE, 4), "far": ("3 kPa", SKELETON, 4)},
}
WAYS = ("cold", "neighbour")
FILES = {
    "smoke": {
        "walks": WALKS.format(duration=1, first=2, second=2),
        "solves": SOLVES.format(base="strip", size=0.8, first=2, second=2),
    },
    "full": {
        "walks": WALKS.format(duration=6, first=8, second=8),
        "solves": SOLVES.format(base="junction_bot", size=2.4, first=4, second=4),
    },
}
# parts that each sweep is cut into; one and two workers take every part in turn, the other first every second time
PARTS = {"smoke": 1, "full": 2}
WORKERS = (1, 2)
FLOOR = 1.6
# rows of both starts, at the tolerance of the states
SAME = 1e-7
# share of the iterations that near neighbours must spare in a whole sweep, roots included
SPARED = 0.25

# --- quantity, and why it can converge --------------------------------------------------------------------------------
#
# Wall seconds of the whole sweep, interpreters that start and pictures at the end included: what a user waits. Beside
# it processor seconds of the workers for each case, which other work on the machine hardly moves: two workers that did
# not get into each other's way would take as many as one.
#
# Of starts: Newton iterations of all states of all cases, which other work does not move at all, and processor seconds
# as above, interpreters, files and pictures included.


@dataclass
class Speed:
    """A row for each kind of sweep, part and number of workers; one for each distance and start; the machine's load."""

    rows: list[Row] = field(default_factory=list)
    same: dict[str, bool] = field(default_factory=dict)
    load: tuple[float, float] = (0.0, 0.0)
    starts: list[Row] = field(default_factory=list)
    apart: dict[str, float] = field(default_factory=dict)

    def total(self, kind: str, workers: int, name: str) -> float:
        """Sum over the parts of a kind."""
        return sum(row[name] for row in self.rows if (row["sweep"], row["workers_1"]) == (kind, workers))

    def ratio(self, kind: str) -> float:
        """Wall seconds of one worker over those of two."""
        return self.total(kind, 1, "wall_s") / self.total(kind, 2, "wall_s")

    def spared(self, distance: str, name: str = "newton_iterations_1") -> float:
        """Share of iterations, or of another number, that neighbours spare."""
        cold, beside = (
            next(r[name] for r in self.starts if (r["neighbours"], r["start"]) == (distance, w)) for w in WAYS
        )
        return 1.0 - beside / cold

    def busier(self, kind: str) -> float:
        """Processor seconds of two workers over those of one, for the same cases."""
        return self.total(kind, 2, "processor_s") / self.total(kind, 1, "processor_s")


# --- run --------------------------------------------------------------------------------------------------------------


def run(level: str, parts: Sequence[str] = ("workers", "starts")) -> Speed:
    """Both sweeps with one worker and with two, part by part in turn; solves cold and beside neighbours."""
    found = Speed()
    before = os.getloadavg()[0]
    with TemporaryDirectory() as name:
        folder = Path(name)
        if "starts" in parts:
            for distance, (low, (second, soft, stiff), count) in NEIGHBOURS[level].items():
                given = {"low": low, "second": second, "soft": soft, "stiff": stiff, "count": count}
                _start(found, folder, distance, given)
        if "workers" not in parts:
            found.load = (before, os.getloadavg()[0])
            return found
        for kind, text in FILES[level].items():
            file = folder / f"{kind}.toml"
            file.write_text(text)
            plan = read_sweep(file)
            # compiles, and fills the disk's memory of what interpreters read
            sweep(_part(plan, 0, len(plan.cases)), folder / f"{kind}_warm", runner=lambda _: LocalRunner(1))
            same = True
            for part in range(PARTS[level]):
                cases = _part(plan, part, PARTS[level])
                tables = []
                for workers in WORKERS if part % 2 else WORKERS[::-1]:
                    out = folder / f"{kind}_{part}_{workers}"
                    row = {"sweep": kind, "part": part, "workers_1": workers, "cases_1": len(cases.cases)}
                    with _timed(row):
                        done = sweep(cases, out, runner=lambda _, n=workers: LocalRunner(n))
                    found.rows.append({**row, "done_1": done["sweep"]["done_1"]})
                    tables.append((out / "tables" / "cases.csv").read_bytes())
                same = same and len(set(tables)) == 1
            found.same[kind] = same
    found.load = (before, os.getloadavg()[0])
    return found


def _start(found: Speed, folder: Path, distance: str, given: Row) -> None:
    """The same solves by one worker from the undeformed body, and beside neighbours."""
    numbers = []
    for start in WAYS:
        file = folder / f"{distance}_{start}.toml"
        file.write_text(STARTS.format(start=start, **given))
        plan = read_sweep(file)
        if not found.starts:
            sweep(_part(plan, 0, len(plan.cases)), folder / "starts_warm", runner=lambda _: LocalRunner(1))
        row = {"neighbours": distance, "start": start, "cases_1": len(plan.cases)}
        with _timed(row):
            done = sweep(plan, folder / f"{distance}_{start}", runner=lambda _: LocalRunner(1))["sweep"]
        taken = {name: done[name] for name in ("done_1", "begun_beside_1", "newton_iterations_1")}
        found.starts.append({**row, **taken})
        numbers.append([{k: v for k, v in each.items() if isinstance(v, float)} for each in done["rows"]])
    cold, beside = numbers
    found.apart[distance] = max(abs(b[k] / a[k] - 1.0) for a, b in zip(cold, beside, strict=True) for k in a if a[k])


def _part(plan: SweepPlan, part: int, parts: int) -> SweepPlan:
    """Every so many-th case of a plan."""
    return replace(plan, cases=plan.cases[part::parts])


@contextmanager
def _timed(row: Row) -> Iterator[None]:
    """Wall seconds of the block, and processor seconds of the workers that ended in it."""
    begin, used = time.perf_counter(), resource.getrusage(resource.RUSAGE_CHILDREN)
    yield
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    row["wall_s"] = time.perf_counter() - begin
    row["processor_s"] = after.ru_utime + after.ru_stime - used.ru_utime - used.ru_stime


# --- expect -----------------------------------------------------------------------------------------------------------


def expect(found: Speed, level: str) -> None:
    """Every case is done, with the same rows; the ratio only on two processors that nobody else uses."""
    for row in found.rows:
        assert row["done_1"] == row["cases_1"], f"{row['sweep']}: {row['done_1']} of {row['cases_1']} cases done"
    for row in found.starts:
        assert row["done_1"] == row["cases_1"], f"{row['start']}: {row['done_1']} of {row['cases_1']} cases done"
    for distance, apart in found.apart.items():
        assert apart < SAME, f"{distance}: rows beside neighbours differ by {apart:.1e}"
        spared, least = found.spared(distance), SPARED if (level, distance) == ("full", "near") else 0.0
        assert spared > least, f"{distance}: neighbours spare {spared:.0%} of the iterations"
    for kind, same in found.same.items():
        assert same, f"{kind}: two workers give other rows than one"
    if level == "full" and idle(found):
        for kind in found.same:
            assert found.ratio(kind) >= FLOOR, f"{kind}: two workers are only {found.ratio(kind):.2f} times as fast"


def idle(found: Speed) -> bool:
    """Whether there were two processors, and nobody else used them before."""
    return usable_processors() >= 2 and found.load[0] < 0.5


def verdict(found: Speed) -> list[str]:
    """Each ratio, and whether it reaches the floor."""
    lines = []
    for kind in found.same:
        met = "meets" if found.ratio(kind) >= FLOOR else "falls short of"
        lines.append(
            f"{kind}: two workers are {found.ratio(kind):.2f} times as fast as one, {met} {FLOOR:g}; they take "
            f"{found.busier(kind):.2f} times the processor seconds"
        )
    for distance, apart in found.apart.items():
        lines.append(
            f"{distance} neighbours spare {found.spared(distance):.0%} of the iterations and "
            f"{found.spared(distance, 'processor_s'):.0%} of the processor seconds; rows differ by {apart:.1e} at most"
        )
    return lines


# --- what was found ---------------------------------------------------------------------------------------------------

FOUND = """
Two idle processors (load 1.1 before, 1.4 after); one run of under five minutes.

              times as fast with two   processor seconds, two over one
  64 walks            1.83                        1.05
  16 solves           1.65                        1.08

* Both meet 1.6. On the same machine shared with other work (load 9.9 before, 7.2 after) it was 1.56 and 1.48.
* Two workers take 5 and 8 % more processor seconds for the same cases than one: an interpreter more that starts, and
  memory that both use. Pictures, which one process draws, take the rest of what is missing from 2.
* The tables of one worker and of two are the same, byte for byte.
* So it was while each solve began from the undeformed body. Beside neighbours, where cases wait for each other, idle
  (load 1.5 before, 1.3 after) 1.71 for the walks and 1.70 for the solves, 1.07 times the processor seconds of one, and
  the same bytes; on a busy machine (load 6.8 before, 7.7 after) 1.26.

Where solves begin (``--parts starts``; 16 bots, 8 073 unknowns, one worker, the machine shared: load 4.3 before, 5.3
after). Beside neighbours four of each 16 still begin from the undeformed body.

                                                      iterations            processor s
                                                    cold  neighbour       cold  neighbour
  near: tension 6 to 9, tissue 9 to 11 kPa           882     557 (-37 %)  35.9   29.2 (-19 %)
  far: tension 3 to 9, skeleton 200 to 400 kPa       853     616 (-28 %)  35.8   30.5 (-15 %)

* A solve beside a near neighbour takes 21 to 34 iterations in place of 53 to 59. States of a force, whose tension the
  neighbour knows, take 0 to 5 in place of 6 to 8; the first tensions 2 in place of 5 and 3; full drive 2 as before;
  remodelled tissue, whose natural stretch the neighbour knows, 5 to 8 in place of 12 to 18.
* Processor seconds hold files, pictures and the start of interpreters too, which neighbours do not spare.
* Rows differ by 6e-9 at most. So neighbours are the default.
* Near their limits bots beside neighbours come to the states of the path alone too (ring bot at 34 to 40 kPa, junction
  bot at 110 and 116 kPa, tried apart). Tensions that the path refuses (above 40 and above 117 kPa there: they buckle)
  are refused beside the nearest that succeeded as well: nothing was found that only a neighbour leads to.
* What was tried and gains less: the neighbour's state of the same name, or its change since the last one, in place of
  its state at the same tension (44 iterations in place of 27 from 6 to 7 kPa); of two trials that with the smaller
  residual (39 in place of 32 from 9 to 9.7 kPa of tissue): residuals of thin parts are membrane stress, which the first
  iteration takes back. Beyond the neighbour's last tension residuals do tell, and choose.
"""

# --- what was not looked at -------------------------------------------------------------------------------------------

NOT_LOOKED_AT = """
More than two processors, clusters, meshes fine enough for the processors to share a memory that is too slow for both.
"""


def tables(found: Speed) -> list[Table]:
    """What is printed."""
    header = ("sweep", "part", "workers_1", "cases_1", "wall_s", "processor_s")
    ratios = tuple((kind, found.ratio(kind), found.busier(kind), found.same[kind]) for kind in found.same)
    began = ("neighbours", "start", "cases_1", "begun_beside_1", "newton_iterations_1", "processor_s")
    every = [
        Table("Solves by where they begin", began, tuple(tuple(row[name] for name in began) for row in found.starts)),
        Table("Sweeps", header, tuple(tuple(row[name] for name in header) for row in found.rows)),
        Table("Two workers", ("sweep", "times as fast as one", "processor seconds over one's", "same rows"), ratios),
    ]
    return [table for table in every if table.rows]


def write(found: Speed, folder: Path) -> None:
    """Table of the sweeps, and a picture of seconds a case."""
    folder.mkdir(parents=True, exist_ok=True)
    write_table(folder / "sweeps.csv", found.rows)
    write_table(folder / "starts.csv", found.starts)
    panels = [*found.same, *(["starts"] if found.starts else [])]
    figure = Figure(figsize=(3.4 * len(panels), 3.6), dpi=150, layout="constrained")
    FigureCanvasAgg(figure)
    for number, (axes, kind) in enumerate(zip(figure.subplots(1, len(panels), squeeze=False)[0], panels, strict=True)):
        if kind == "starts":
            _draw_starts(axes, found)
            continue
        for place, name in enumerate(("wall_s", "processor_s")):
            each = [
                statistics.mean(r[name] / r["cases_1"] for r in found.rows if (r["sweep"], r["workers_1"]) == (kind, n))
                for n in WORKERS
            ]
            axes.bar([n + 0.3 * place for n in WORKERS], each, width=0.28, label=("waited", "worked")[place])
        axes.set_xticks([n + 0.15 for n in WORKERS], [f"{n} worker{'s' * (n > 1)}" for n in WORKERS])
        axes.set_title(f"{kind}: {found.ratio(kind):.2f} times as fast", fontsize=10)
        axes.set_ylabel("seconds a case")
        if number == 0:
            axes.legend(frameon=False, fontsize=8)
    with replacing(folder / "sweep_speed.png") as temporary:
        figure.savefig(temporary, format="png")


def _draw_starts(axes: Any, found: Speed) -> None:
    """Iterations a case from the undeformed body and beside neighbours."""
    for place, way in enumerate(WAYS):
        rows = [row for row in found.starts if row["start"] == way]
        each = [row["newton_iterations_1"] / row["cases_1"] for row in rows]
        axes.bar([n + 0.3 * place for n in range(len(rows))], each, width=0.28, label=way)
    axes.set_xticks([n + 0.15 for n in range(len(found.apart))], [f"{name} neighbours" for name in found.apart])
    axes.set_ylabel("Newton iterations a case")
    axes.set_title("where solves begin", fontsize=10)
    axes.set_ylim(top=1.25 * axes.get_ylim()[1])
    axes.legend(frameon=False, fontsize=8)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--level", choices=tuple(FILES), default="full")
    parser.add_argument("--parts", choices=("workers,starts", "workers", "starts"), default="workers,starts")
    parser.add_argument("--out", type=Path, default=Path("runs") / "studies" / "sweep_speed")
    options = parser.parse_args()
    found = run(options.level, options.parts.split(","))
    show_tables(tables(found))
    write(found, options.out)
    load = f"load {found.load[0]:.1f} before, {found.load[1]:.1f} after"
    print(f"\n{usable_processors()} processors may be used, {load}; files in {options.out}")
    for line in verdict(found):
        print(line)
    expect(found, options.level)
    print("every expectation holds")


if __name__ == "__main__":
    main()

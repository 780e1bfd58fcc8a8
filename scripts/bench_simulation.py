# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Processor time of simulated missions and of planning decisions, on one thread.

usage: .venv/bin/python scripts/bench_simulation.py [--only PART] [--repeats 5] [--quick] [--save]
"""

from __future__ import annotations

import os

for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[variable] = "1"

import cProfile
import pstats
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from tempfile import TemporaryDirectory

import numpy as np
import results

from soilmoist_ros.exploration.control.explorer import Explorer
from soilmoist_ros.exploration.control.field_access import cell_stops
from soilmoist_ros.exploration.mission.events import RequestPlan
from soilmoist_ros.exploration.mission.types import MissionRules, PlanKind
from soilmoist_ros.exploration.planning.dwell import parse_dwell
from soilmoist_ros.exploration.planning.properties import Property
from soilmoist_ros.exploration.strategies.registry import STRATEGIES, make_strategy
from soilmoist_ros.exploration.travel.travel import FreeTravel, GraphTravel, RobotMotion
from soilmoist_ros.exploration.travel.travel_graph import open_lattice
from soilmoist_ros.foundation.geodesy import LocalFrame
from soilmoist_ros.mapping import FieldGrid
from soilmoist_ros.mapping.field import Field
from soilmoist_ros.mapping.field_map import FieldMap, FieldMapSettings
from soilmoist_ros.simulation.mission.settings import MissionSettings
from soilmoist_ros.simulation.mission.simulator import simulate_mission

RECOMMENDED = MissionSettings(field="airfield-simulated", cell_m=1.0, hours=2.0)
"""3,000 cells, all records, dwell optimal: what the preset recommends."""
PUBLISHED = MissionSettings(field="synthetic-high", cell_m=1.0, hours=2.0, preset="authors")
MISSIONS = {
    "gcb": RECOMMENDED,
    "gcb, graph of 300 nodes": replace(RECOMMENDED, travel="graph"),
    "ivr": replace(RECOMMENDED, strategy="ivr"),
    "ivr, graph of 300 nodes": replace(RECOMMENDED, strategy="ivr", travel="graph"),
    "greedy as published": PUBLISHED,
    "monte_carlo as published": replace(PUBLISHED, strategy="monte_carlo"),
    "adaptive_sampling as published": replace(PUBLISHED, strategy="adaptive_sampling"),
}
"""Missions of 2 h that are timed."""
COMMAND = ("simulate", "--field", "airfield-simulated", "--cell", "1", "--hours", "2")
"""Command that is timed from the prompt to the files written."""
FITS = {
    "published (gaussian, soft_l1)": ("gaussian", "soft_l1"),
    "recommended (matern32, reml)": ("matern32", "reml"),
}


PARTS = {
    "fit of the variogram": ("fit.py", "estimate_variogram"),
    "kriging": ("soil_map.py", "make_soil_map"),
    "planning": ("explorer.py", "plan"),
    "mission logic": ("mission.py", "step"),
    "records": ("simulator.py", "record"),
    "map errors": ("map_errors.py", "map_errors"),
}
"""Profiled parts of a mission: file and function."""


def used_s(work: Callable[[], object]) -> float:
    """Processor time of some work [s]."""
    start = time.process_time()
    work()
    return time.process_time() - start


def mission_rows(repeats: int) -> list[tuple[str, str, str]]:
    """Processor seconds of missions, without imports and without the field."""
    rows = []
    for name, settings in MISSIONS.items():
        simulate_mission(replace(settings, hours=0.2))
        seconds = statistics.median(used_s(partial(simulate_mission, settings)) for _ in range(repeats))
        rows.append((f"{name}, {settings.field}", f"{seconds:.3f}", where(settings)))
    return rows


def command_row(repeats: int) -> tuple[str, str, str]:
    """Processor seconds of a command and what it starts."""

    def children_s() -> float:
        times = os.times()
        return times.children_user + times.children_system

    used = []
    with TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "soilmoist_ros.cli.main", *COMMAND, "--overwrite", "--out", folder]
        for _ in range(repeats):
            before_s = children_s()
            subprocess.run(command, check=True, capture_output=True)
            used.append(children_s() - before_s)
    seconds = statistics.median(used)
    return f"soilmoist {' '.join(COMMAND)} --out DIR", f"{seconds:.3f}", "from the prompt to the files written"


def decision_rows(repeats: int, samples: int = 60) -> list[tuple[str, ...]]:
    """Processor seconds from a new sample to the next stop: refit, map of 70,000 cells, choice of a stop."""
    polygon = np.array([[0.0, 0.0], [280.0, 0.0], [280.0, 250.0], [0.0, 250.0]])
    field = Field("bench", LocalFrame(53.0, 0.0), polygon)
    grid = FieldGrid.from_polygon(polygon, 1.0)
    motion = RobotMotion()
    graph = open_lattice(field, 12.0).graph
    request = RequestPlan(1, PlanKind.EXPLORE, (), 7200.0, 7200.0)
    rows = []
    for where in ("graph", "free"):
        stops = graph.stops if where == "graph" else cell_stops(grid)
        travel = GraphTravel(graph, motion) if where == "graph" else FreeTravel(motion, (polygon,))
        for label, (model, fit) in FITS.items():
            for strategy in STRATEGIES.names():
                rng = np.random.default_rng(1)
                field_map = FieldMap(grid, FieldMapSettings(model, fit, for_planning=True))
                explorer = Explorer(
                    [Property(field_map)], stops, travel, make_strategy(strategy, "authors"),
                    make_strategy("random"), MissionRules(budget_s=7200, dwell=parse_dwell("ami:0.03")),
                    np.random.default_rng(2),
                )  # fmt: skip
                updates, choices = [], []
                for number in range(samples + repeats):
                    x, y = rng.uniform(0, 250, 2)
                    field_map.add_sample((x, y), int(rng.poisson((4 + np.sin(x / 40)) * 300)), 300.0)
                    if number >= samples:
                        updates.append(used_s(field_map.update))
                        choices.append(used_s(partial(explorer.plan, request, (5.0, 5.0))))
                times = (f"{statistics.median(values):.3f}" for values in (updates, choices))
                rows.append((f"{len(grid.cells):,}", f"{len(stops):,} ({where})", strategy, label, *times))
    return rows


def where(settings: MissionSettings) -> str:
    """Time of the parts of a mission by the profiler, which overestimates small functions."""
    profiler = cProfile.Profile()
    profiler.runcall(simulate_mission, settings)
    cumulative: dict[tuple[str, str], float] = {}
    for (file, _, function), (*_, seconds, _) in pstats.Stats(profiler).strip_dirs().stats.items():
        cumulative[file, function] = max(seconds, cumulative.get((file, function), 0.0))
    total = cumulative["simulator.py", "simulate_mission"]
    return ", ".join(f"{name} {cumulative.get(part, 0.0) / total:.0%}" for name, part in PARTS.items())


def main() -> None:
    parser = results.parser(__doc__)
    parser.add_argument("--repeats", type=int, default=5, help="number of runs; the median counts")
    parser.add_argument("--quick", action="store_true", help="one repeat")
    parser.add_argument("--only", choices=("missions", "decisions"), help="one part")
    arguments = parser.parse_args()
    repeats = 1 if arguments.quick else arguments.repeats
    if arguments.only != "decisions":
        missions = [*mission_rows(repeats), command_row(repeats)]
        columns = ("mission of 2 h", "processor time [s]", "where the time goes")
        settings = f"cells of 1 m, one thread, medians of {repeats} runs; the parts are those of a profiler"
        results.publish("missions", columns, missions, settings, arguments.save)
    if arguments.only != "missions":
        columns = ("cells", "stops", "strategy", "variogram", "update of the map [s]", "choice of the stop [s]")
        settings = f"processor time after each of {repeats} new samples that follow 60, medians; one thread"
        results.publish("decisions", columns, decision_rows(repeats), settings, arguments.save)


if __name__ == "__main__":
    main()

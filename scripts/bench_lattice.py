#!/usr/bin/env python3
# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Strategies against the best lattice that hindsight chooses, with paired seeds.

usage: .venv/bin/python scripts/bench_lattice.py [--fields rough validation FILE.yaml] [--seeds 20] [--cell 2]
       [--strategies gcb ivr lattice:optimal] [--keep-lattices] [--save]

Lattices with fixed dwells of 10, 20, 30 and 60 s run on the same fields with the same seeds. The *best lattice* at
a time is the one with the lowest mean squared error of the rate, averaged over the seeds. Ratios are ratios of
means over the seeds; +- is the standard error of the ratio over the pairs.

Each mission is stored in the cache at once, under a digest of its settings and of the code; an interrupted run
resumes. The lattices are mapped at a quarter of the time and at its end only, all others at each plan.
``--keep-lattices`` reuses lattices of other versions of the code with the same ``LATTICE_VERSION``.
"""

from __future__ import annotations

import os

for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[variable] = "1"

import argparse
import hashlib
import json
import math
import sys
import time
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import results
from numpy.typing import NDArray

import soilmoist_ros
from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.lab.comparisons import (
    LATTICE_DWELLS,
    QUARTER,
    Against,
    Outcome,
    against_best_lattice,
)
from soilmoist_ros.simulation.fields.catalogue import surrogate_field, surrogate_field_names
from soilmoist_ros.simulation.mission.mission_result import MissionResult, map_errors
from soilmoist_ros.simulation.mission.settings import MissionSettings
from soilmoist_ros.simulation.mission.simulator import _Simulation, simulate_mission

Array = NDArray[np.float64]
Row = Mapping[str, Any]

STATIONARY = (
    "rough", "smooth", "patches", "ridge", "synthetic-high", "synthetic-low", "airfield-simulated", "validation",
)  # fmt: skip
NON_STATIONARY = ("halves", "rough-patch", "strips")
LATTICES = tuple(f"lattice:{dwell}" for dwell in LATTICE_DWELLS)
LATTICE_VERSION = 1
"""Raise it when the missions of lattices change: ``--keep-lattices`` then computes them again."""
CODE = ("foundation", "sensing", "mapping", "exploration", "simulation")
"""Folders that decide the result of a mission."""
WINDOW_M = 10.0
"""Window of the local variability of the truth [m]."""
QUARTERS = 4
EVERY_S = 60.0


@dataclass(frozen=True)
class Job:
    """One mission.

    :param field: name of a field, or path of a field file
    :param strategy: ``NAME`` with the dwell rule ``optimal``, or ``NAME:DWELL``
    :param cell_m: least cell size of the map [m]; the field's if that is larger
    """

    field: str
    strategy: str
    seed: int
    hours: float = 2.0
    speed_mps: float = 0.6
    overhead_s: float = 12.0
    cell_m: float = 0.0

    @property
    def settings(self) -> MissionSettings:
        """Settings of the simulator."""
        strategy, dwell = combination(self.strategy)
        cell_m = surrogate_field(self.field).field.cell_m
        return MissionSettings(
            field=self.field,
            strategy=strategy,
            dwell=dwell,
            hours=self.hours,
            seed=self.seed,
            speed_mps=self.speed_mps,
            stop_overhead_s=self.overhead_s,
            cell_m=max(self.cell_m, cell_m or 0.0) or None,
            series_every_s=EVERY_S,
            random_field=True,
        )

    @property
    def is_lattice(self) -> bool:
        """Whether this is a lattice, of any dwell."""
        return combination(self.strategy)[0] == "lattice"

    def key(self, field_digest: str) -> str:
        """Digest of the settings and the field, without the code."""
        own = str(LATTICE_VERSION) if self.is_lattice else ""
        about = asdict(self) | {"field": Path(self.field).stem}
        return digest(json.dumps(about) + field_digest + own)


def combination(text: str) -> tuple[str, str]:
    """Strategy and dwell rule of ``NAME`` or ``NAME:DWELL``."""
    strategy, _, dwell = text.partition(":")
    return strategy, dwell or "optimal"


def digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def code_digest() -> str:
    """Digest of the code that decides the result of a mission."""
    root = Path(soilmoist_ros.__file__).parent
    files = sorted(path for folder in CODE for path in (root / folder).rglob("*.py"))
    return digest("".join(f"{path.relative_to(root)}\n{path.read_text(encoding='utf-8')}" for path in files))


def field_digest(name: str) -> str:
    """Digest of the truth of a field for one seed: it changes with the field's file or formula."""
    field = surrogate_field(name, np.random.default_rng(0))
    cells = field.field.grid(None).cells
    return digest(",".join(f"{rate:.6g}" for rate in field.rate_at(cells[:: max(len(cells) // 500, 1)])))


def outcome(result: MissionResult, cpu_s: float) -> dict[str, Any]:
    """What the tables need of a mission."""
    end_s = 3600 * result.settings.hours
    times_s = np.append(np.arange(0.0, end_s, EVERY_S), end_s)
    columns = result.columns
    last = np.clip(np.searchsorted(columns["time_s"], times_s + 1e-6, side="right") - 1, 0, None)
    kept = {name: columns[name][last].tolist() for name in ("mse", "distance_m", "coverage95", "samples")}
    visits = result.visits
    again = sum(a.name == b.name for a, b in pairwise(visits))
    return {
        "time_s": times_s.tolist(),
        **kept,
        "quarters": quarters(result),
        "ended_s": float(columns["time_s"][-1]),
        "again": again,
        "ended": result.ended,
        "cpu_s": cpu_s,
    }


def quarters(result: MissionResult) -> list[float]:
    """Coverage of the 95 % interval in the quarters of the field by local variability, the flattest first."""
    soil_map = result.soil_map
    if soil_map is None:
        return [math.nan] * QUARTERS
    inside = np.isfinite(result.truth_rate)
    order = np.argsort(local_sd(result.truth_rate, soil_map.grid.cell_m)[inside], kind="stable")
    rate, sd, truth = (band[inside] for band in (soil_map.rate, soil_map.rate_sd, result.truth_rate))
    parts = np.array_split(order, QUARTERS)
    return [map_errors(rate[part], sd[part], truth[part], None).coverage95 for part in parts]


def local_sd(truth: Array, cell_m: float) -> Array:
    """Standard deviation of the truth in a square window around each cell, shape (ny, nx) [counts/s].

    :param truth: shape (ny, nx) [counts/s], NaN outside the field
    """
    from scipy.ndimage import uniform_filter

    width = 2 * max(round(WINDOW_M / cell_m / 2), 1) + 1
    inside = np.isfinite(truth)
    filled = np.where(inside, truth - np.nanmean(truth), 0.0)
    share, mean, square = (
        uniform_filter(band, width, mode="constant") for band in (inside * 1.0, filled, filled**2)
    )
    share = np.maximum(share, 1e-12)
    return np.sqrt(np.maximum(square / share - (mean / share) ** 2, 0.0))


class Cache:
    """Outcomes of missions, one JSON file each."""

    def __init__(self, folder: Path, keep_lattices: bool) -> None:
        self.folder = folder
        self.keep_lattices = keep_lattices
        self._code = code_digest()
        self._fields: dict[str, str] = {}
        folder.mkdir(parents=True, exist_ok=True)

    def path(self, job: Job) -> Path:
        """File of a mission, made by this version of the code."""
        if job.field not in self._fields:
            self._fields[job.field] = field_digest(job.field)
        folder = self.folder / Path(job.field).stem / job.strategy.replace(":", "_")
        return folder / f"{job.seed:03d}-{job.key(self._fields[job.field])}-{self._code}.json"

    def read(self, job: Job) -> Row | None:
        """Outcome of a mission, ``None`` if it is not stored."""
        path = self.path(job)
        if not path.exists() and job.is_lattice and self.keep_lattices:
            others = path.parent.glob(path.name.replace(self._code, "*"))
            path = max(others, key=lambda other: other.stat().st_mtime, default=path)
        return json.loads(path.read_text()) if path.exists() else None

    def write(self, job: Job, row: Row) -> None:
        """Store the outcome of a mission."""
        path = self.path(job)
        path.parent.mkdir(parents=True, exist_ok=True)
        unfinished = path.with_suffix(f".{os.getpid()}")
        unfinished.write_text(json.dumps({"job": asdict(job), **row}))
        unfinished.replace(path)


class _MappedTwice(_Simulation):
    """A mission of fixed stops whose map is made at a quarter of the time and at the end only.

    The map decides nothing in such a mission, and the maps take most of the computing time.
    """

    def update_map(self, later: bool = False) -> None:
        if all(robot.ended for robot in self.robots):
            super().update_map()

    def enter_series(self) -> None:
        if self.now_s == 900 * self.settings.hours:
            super().update_map()
        super().enter_series()


def run(job: Job) -> dict[str, Any]:
    """Simulate one mission."""
    settings = job.settings
    started = time.process_time()
    result = _MappedTwice(settings).run(lambda share: None) if job.is_lattice else simulate_mission(settings)
    return outcome(result, time.process_time() - started)


def all_rows(jobs: Sequence[Job], cache: Cache, processes: int) -> dict[Job, Row]:
    """Outcomes of all missions; those not in the cache are simulated and stored."""
    rows = {job: row for job in jobs if (row := cache.read(job)) is not None}
    todo = [job for job in jobs if job not in rows]
    print(f"{len(rows)} of {len(jobs)} missions are stored", file=sys.stderr)

    def take(job: Job, row: Row) -> None:
        cache.write(job, row)
        rows[job] = row
        print(f"\r{len(rows)} of {len(jobs)}", end="", file=sys.stderr, flush=True)

    if processes < 2:
        for job in todo:
            take(job, run(job))
    elif todo:
        with ProcessPoolExecutor(processes) as pool:
            running = {pool.submit(run, job): job for job in todo}
            for future in as_completed(running):
                take(running[future], future.result())
    print(file=sys.stderr)
    return rows


def column(rows: Iterable[Row], name: str, share: float = 1.0) -> Array:
    """Values of a quantity at a share of the mission time, one per mission."""
    return np.array([row[name][round(share * (len(row[name]) - 1))] for row in rows])


@dataclass(frozen=True)
class Line:
    """One line of the table: a strategy on a field, and how it compares with the best lattices."""

    field: str
    against: Against
    coverage: float
    quarters: tuple[float, ...]
    stops: float
    again: float
    ended: float


def lines(field: str, rows: Mapping[str, Sequence[Row]]) -> list[Line]:
    """Compare the strategies on a field with its best lattices.

    :param rows: outcomes by strategy, all with the same seeds
    """
    outcomes = {
        combination(strategy): dict(
            enumerate(map(Outcome, column(mine, "mse", QUARTER), column(mine, "mse"), column(mine, "distance_m")))
        )
        for strategy, mine in rows.items()
    }
    return [
        Line(
            field=Path(field).stem,
            against=against,
            coverage=float(column(mine, "coverage95").mean()),
            quarters=tuple(np.mean([row["quarters"] for row in mine], axis=0).tolist()),
            stops=float(column(mine, "samples").mean()),
            again=float(np.mean([row["again"] for row in mine])),
            ended=float(np.mean([row["ended_s"] / row["time_s"][-1] for row in mine])),
        )
        for against, mine in zip(against_best_lattice(outcomes), rows.values(), strict=True)
    ]


HEAD = (
    "field", "strategy", "error at the end", "÷ best lattice", "at a quarter ÷ best lattice then", "driven [m]",
    "driven ÷ best lattice", "in 95 %", "flat to rough", "stops", "same stop again", "ended at",
)  # fmt: skip


def cells(one: Line) -> tuple[str, ...]:
    """A line as text."""
    about = one.against
    return (
        one.field,
        about.strategy if about.dwell == "optimal" else f"{about.strategy} {about.dwell}",
        f"{1e3 * about.mse:.3g}",
        f"{about.end_ratio:.2f} ± {about.end_ratio_se:.2f}",
        f"{about.quarter_ratio:.2f} ± {about.quarter_ratio_se:.2f}",
        f"{about.distance_m:.0f}",
        f"{about.distance_ratio:.2f}",
        f"{100 * one.coverage:.1f} %",
        " ".join(f"{100 * share:.0f}" for share in one.quarters),
        f"{one.stops:.0f}",
        f"{one.again:.1f}",
        f"{100 * one.ended:.0f} %",
    )


def best_lattice(field: Sequence[Line]) -> tuple[str, ...]:
    """The lattices of a field that are best at the end and at a quarter of the time."""
    about = field[0].against
    best = next(
        one.against for one in field if one.against.strategy == "lattice" and one.against.dwell == about.end_best
    )
    return field[0].field, about.end_best, f"{1e3 * best.mse:.3g}", f"{best.distance_m:.0f}", about.quarter_best


def known_fields() -> list[str]:
    """The fields of the benchmark that this version has."""
    from soilmoist_ros.foundation.configuration import resource_names

    known = {*surrogate_field_names(), *resource_names("fields")}
    return [name for name in (*STATIONARY, *NON_STATIONARY) if name in known]


def arguments() -> argparse.Namespace:
    parser = results.parser(__doc__)
    parser.add_argument("--fields", nargs="+", help="names or field files; default: all families")
    parser.add_argument("--strategies", nargs="+", default=["gcb"], help="NAME (dwell optimal) or NAME:DWELL")
    parser.add_argument("--seeds", type=int, default=20, help="seeds 1 to this number")
    parser.add_argument("--cell", type=float, default=0.0, help="least cell size [m]; larger is faster")
    parser.add_argument("--hours", type=float, default=2.0)
    parser.add_argument("--speed", type=float, default=0.6, help="[m/s]")
    parser.add_argument("--overhead", type=float, default=12.0, help="[s]")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--cache", type=Path, default=Path("bench/lattice"))
    parser.add_argument(
        "--keep-lattices", action="store_true", help="reuse lattices of other versions of the code"
    )
    parser.add_argument("--all", action="store_true", help="show the lattices too")
    return parser.parse_args()


def main() -> None:
    given = arguments()
    cache = Cache(given.cache, given.keep_lattices)
    fields = given.fields or known_fields()
    strategies = list(dict.fromkeys((*given.strategies, *LATTICES)))
    jobs = {
        (field, strategy): [
            Job(field, strategy, seed, given.hours, given.speed, given.overhead, given.cell)
            for seed in range(1, given.seeds + 1)
        ]
        for field in fields
        for strategy in strategies
    }
    found = all_rows([job for some in jobs.values() for job in some], cache, given.processes)
    shown, best = [], []
    names = strategies if given.all else given.strategies
    for field in fields:
        compared = lines(
            field, {strategy: [found[job] for job in jobs[field, strategy]] for strategy in strategies}
        )
        best.append(best_lattice(compared))
        shown += [one for name, one in zip(strategies, compared, strict=True) if name in names]
    settings = (
        f"{given.hours:g} h, {given.speed:g} m/s, {given.overhead:g} s per stop, seeds 1 to {given.seeds}, "
        f"cells of {f'at least {given.cell:g} m' if given.cell else 'the field'}"
    )
    columns = ("field", "best lattice at the end", "error at the end", "driven [m]", "best lattice at a quarter")
    results.publish("lattices", columns, best, settings, given.save)
    results.publish("strategies", HEAD, map(cells, shown), settings, given.save)


if __name__ == "__main__":
    try:
        main()
    except InputError as error:
        sys.exit(str(error))

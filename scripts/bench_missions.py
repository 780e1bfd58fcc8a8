#!/usr/bin/env python3
# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Simulated missions: strategies against the best lattice, forecasts, and hours that a field needs.

usage: .venv/bin/python scripts/bench_missions.py lattices [--fields rough FILE.yaml] [--seeds 20] [--cell 2]
                                                  [--strategies gcb lattice:optimal] [--save]
       .venv/bin/python scripts/bench_missions.py lattices --fields odd --cell 2
       .venv/bin/python scripts/bench_missions.py forecasts|until|hours [--seeds N] [--surfaces DIR] [--save]

*lattices*: lattices with fixed dwells of 10, 20, 30 and 60 s run on the same fields with the same seeds. The *best
lattice* at a time is the one with the lowest mean squared error of the rate, averaged over the seeds. Ratios are
ratios of means over the seeds; +- is the standard error of the ratio over the pairs. The lattices
are mapped at a quarter of the time and at its end only, all others at each plan.

*forecasts*: each mission draws its random field from its seed; every second seed has half of the field's usual
time. A row is the forecast for the end that was made at a share of the time. ``reached`` is the standard deviation
of the map at the end, ``error`` the root mean squared error of the map against the truth, both divided by the
forecast. Uniform fields and those with few counts are part of the set. ``--surfaces`` adds the surfaces of
``bench_zoo.py``, whose fields are the same with each seed. Each field is measured by a robot and by a person.

*until*: missions of ``gcb`` planned for an aim, against missions of 2 h without one that end once it is met.
The aim is the median figure of the latter at :data:`AIM_AT` of the time. Every third surface is taken, by name.

*hours*: root mean squared error of the moisture [% by volume] at the end of missions of the recommended strategy
on random square fields, by the size of the field and by how fast the soil changes.
"""

from __future__ import annotations

import os

for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[variable] = "1"

import argparse
import math
import sys
import tempfile
from bisect import bisect
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple
from unittest import mock

import numpy as np
import pandas as pd
import results
from bench_zoo import real_surfaces, zoo_field
from numpy.typing import NDArray

from soilmoist_ros.exploration.control.explorer import Explorer
from soilmoist_ros.exploration.mission.mission import GOOD_FORECASTS, MIN_GOOD_SAMPLES
from soilmoist_ros.exploration.planning.properties import Aim
from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.lab.comparisons import LATTICE_DWELLS, QUARTER, hindsight_table
from soilmoist_ros.mapping import FieldMap, estimate_variogram
from soilmoist_ros.mapping.field import Field
from soilmoist_ros.simulation.fields.catalogue import surrogate_field
from soilmoist_ros.simulation.fields.formulas import formula
from soilmoist_ros.simulation.fields.surrogate_field import GridExtent, SurrogateField
from soilmoist_ros.simulation.mission.mission_result import MissionResult, achieved, reported
from soilmoist_ros.simulation.mission.settings import MissionSettings
from soilmoist_ros.simulation.mission.simulator import _Simulation, simulate_mission

Array = NDArray[np.float64]
Row = Mapping[str, Any]

# Lattices --------------------------------------------------------------------------------------------------------

STATIONARY = (
    "rough", "smooth", "patches", "ridge", "synthetic-high", "synthetic-low", "airfield-simulated", "validation",
)  # fmt: skip
NON_STATIONARY = ("halves", "rough-patch", "strips")
LATTICES = tuple(f"lattice:{dwell}" for dwell in LATTICE_DWELLS)
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
        field = made_field(self.field, self.seed) if self.field in (*MADE, *ODD) else self.field
        cell_m = (surrogate_field(field) if isinstance(field, str) else field).field.cell_m
        return MissionSettings(
            field=field,
            strategy=strategy,
            dwell=dwell,
            hours=self.hours,
            seed=self.seed,
            speed_mps=self.speed_mps,
            stop_overhead_s=self.overhead_s,
            cell_m=max(self.cell_m, cell_m or 0.0) or None,
            series_every_s=EVERY_S,
            random_field=isinstance(field, str),
        )

    @property
    def is_lattice(self) -> bool:
        """Whether this is a lattice, of any dwell."""
        return combination(self.strategy)[0] == "lattice"


def combination(text: str) -> tuple[str, str]:
    """Strategy and dwell rule of ``NAME`` or ``NAME:DWELL``."""
    strategy, _, dwell = text.partition(":")
    return strategy, dwell or "optimal"


def outcome(result: MissionResult) -> dict[str, Any]:
    """What the tables need of a mission."""
    end_s = 3600 * result.settings.hours
    times_s = np.append(np.arange(0.0, end_s, EVERY_S), end_s)
    columns = result.columns
    last = np.clip(np.searchsorted(columns["time_s"], times_s + 1e-6, side="right") - 1, 0, None)
    return {name: columns[name][last].tolist() for name in ("mse", "distance_m", "coverage95", "samples")}


class _MappedTwice(_Simulation):
    """A mission of fixed stops whose map is made at a quarter of the time and at the end only.

    The map decides nothing in such a mission, and the maps take most of the computing time.
    """

    def __init__(self, settings: MissionSettings) -> None:
        super().__init__(settings)
        for channel in self.channels:
            channel.update_later = lambda now_s: None

    def enter_series(self) -> None:
        if self.now_s == 900 * self.settings.hours:
            for channel in self.channels:
                channel.update(self.now_s)
        super().enter_series()


def run(job: Job) -> dict[str, Any]:
    """Simulate one mission."""
    settings = job.settings
    return outcome(
        _MappedTwice(settings).run(lambda share: None) if job.is_lattice else simulate_mission(settings)
    )


def column(rows: Iterable[Row], name: str, share: float = 1.0) -> Array:
    """Values of a quantity at a share of the mission time, one per mission."""
    return np.array([row[name][round(share * (len(row[name]) - 1))] for row in rows])


def lines(field: str, rows: Mapping[str, Sequence[Row]]) -> list[tuple[Any, Sequence[Row]]]:
    """Strategies against the best lattices of a field: rows of the table of hindsight, and the outcomes.

    :param rows: outcomes by strategy, all with the same seeds
    """
    missions = pd.concat([
        pd.DataFrame({
            "field": field, **dict(zip(("strategy", "dwell"), combination(strategy), strict=True)),
            "seed": range(len(mine)), "mse_quarter": column(mine, "mse", QUARTER),
            "mse": column(mine, "mse"), "distance_m": column(mine, "distance_m"),
        })
        for strategy, mine in rows.items()
    ])  # fmt: skip
    compared = hindsight_table(missions, ["field"]).itertuples(index=False)
    return list(zip(compared, rows.values(), strict=True))


HEAD = (
    "field", "strategy", "error at the end", "÷ best lattice", "at a quarter ÷ best lattice then", "driven [m]",
    "driven ÷ best lattice", "in 95 %", "stops",
)  # fmt: skip


def cells(about: Any, rows: Sequence[Row]) -> tuple[str, ...]:
    """One line of the table: a strategy on a field, and how it compares with the best lattices."""
    return (
        Path(about.field).stem,
        about.strategy if about.dwell == "optimal" else f"{about.strategy} {about.dwell}",
        f"{1e3 * about.mse:.3g}",
        f"{about.end_ratio:.2f} ± {about.end_ratio_se:.2f}",
        f"{about.quarter_ratio:.2f} ± {about.quarter_ratio_se:.2f}",
        f"{about.distance_m:.0f}",
        f"{about.distance_ratio:.2f}",
        f"{100 * column(rows, 'coverage95').mean():.1f} %",
        f"{column(rows, 'samples').mean():.0f}",
    )


def best_lattice(field: Iterable[Any]) -> tuple[str, ...]:
    """The lattices of a field that are best at the end and at a quarter of the time."""
    best = next(about for about in field if (about.strategy, about.dwell) == ("lattice", about.end_best))
    end = f"{1e3 * best.mse:.3g}", f"{best.distance_m:.0f}"
    return Path(best.field).stem, best.end_best, *end, best.quarter_best


def lattices(given: argparse.Namespace) -> None:
    """Compare strategies with the best lattices of each field."""
    fields = given.fields or [*STATIONARY, *NON_STATIONARY]
    fields = [name for one in fields for name in (ODD if one == "odd" else [one])]
    strategies = list(dict.fromkeys((*given.strategies, *LATTICES)))
    seeds = range(1, given.seeds + 1)
    shown, best = [], []
    with ProcessPoolExecutor(given.processes) as pool:
        for field in fields:
            rows = {
                strategy: list(
                    pool.map(run, [Job(field, strategy, seed, given.hours, cell_m=given.cell) for seed in seeds])
                )
                for strategy in strategies
            }
            compared = lines(field, rows)
            best.append(best_lattice(about for about, _ in compared))
            shown += [
                cells(*one) for name, one in zip(strategies, compared, strict=True) if name in given.strategies
            ]
            print(*best[-1], flush=True)
    settings = (
        f"{given.hours:g} h, {Job.speed_mps:g} m/s, {Job.overhead_s:g} s per stop, seeds 1 to {given.seeds}, "
        f"cells of {f'at least {given.cell:g} m' if given.cell else 'the field'}"
    )
    columns = ("field", "best lattice at the end", "error at the end", "driven [m]", "best lattice at a quarter")
    results.publish("lattices", columns, best, settings, given.save)
    results.publish("strategies", HEAD, shown, settings, given.save)


# Forecasts -------------------------------------------------------------------------------------------------------

MADE = {
    "uniform": (60, 50, 2.0, {"family": "gradient", "low": 4.0, "high": 4.0}),
    "few counts": (60, 50, 2.0, {"family": "matern32", "mean": 0.5, "sd": 0.1, "range_m": 20}),
    "many counts": (60, 50, 2.0, {"family": "matern32", "mean": 60.0, "sd": 6.0, "range_m": 15}),
    "15 x 15 m": (15, 15, 1.0, {"family": "gaussian_field", "mean": 4.0, "sd": 0.5, "range_m": 8}),
    "100 ha": (1000, 1000, 6.0, {"family": "matern32", "mean": 4.0, "sd": 0.5, "range_m": 200}),
}
"""Extents [m], hours and formulas of further fields."""
BOX = [(0, 0), (60, 0), (60, 50), (0, 50)]
ISLANDS = [
    (0, 0), (24, 0), (24, 10), (36, 10), (36, 0), (60, 0), (60, 20), (52, 20), (52, 30), (60, 30), (60, 50),
    (36, 50), (36, 28), (50, 28), (50, 20), (36, 20), (36, 12), (24, 12), (24, 50), (0, 50),
]  # fmt: skip
ODD: dict[str, tuple[Sequence[tuple[int, int]], Sequence[Any]]] = {
    "U": ([(0, 0), (60, 0), (60, 60), (40, 60), (40, 15), (20, 15), (20, 60), (0, 60)], ()),
    "L": ([(0, 0), (60, 0), (60, 20), (20, 20), (20, 60), (0, 60)], ()),
    "pond": (BOX, [[(15, 15), (45, 15), (50, 25), (45, 35), (15, 35), (10, 25)]]),
    "islands": (ISLANDS, ()),
    "two-gates": (
        BOX,
        [[(29, low), (31, low), (31, high), (29, high)] for low, high in ((0, 4), (7, 43), (46, 50))],
    ),
    "strip": ([(0, 0), (600, 0), (600, 2), (0, 2)], ()),
    "few-counts": (BOX, ()),
}
"""Outlines and no-go areas [m] of fields with detours, of one 2 m wide, and of one with 0.05 counts/s."""


LONG_M = 100.0
"""Extent from which on a mission on a surface takes four hours [m]."""


class Made(NamedTuple):
    """A forecast and what became of it."""

    kind: str
    field: str
    seed: int
    hours: float
    share: float
    forecast: float
    low: float
    high: float
    reached: float
    error: float


def made_field(name: str, seed: int) -> SurrogateField:
    """One of :data:`MADE`, or one of :data:`ODD` with a cell of 1 m."""
    shipped, cell_m = surrogate_field("smooth"), None
    if name in MADE:
        width, height, hours, about = MADE[name]
        polygon, no_go = np.array([(0, 0), (width, 0), (width, height), (0, height)], float), ()
    else:
        mean, sd = (0.05, 0.01) if name == "few-counts" else (4.0, 0.5)
        hours, about = 2.0, {"family": "matern32", "mean": mean, "sd": sd, "range_m": 8}
        polygon, no_go = (np.array(one, float) for one in ODD[name])
        cell_m = 1.0
    field = Field(name, shipped.frame, polygon, tuple(no_go), cell_m=cell_m)
    seeded = about if about["family"] == "gradient" else {**about, "seed": seed}
    truth = formula(**seeded).function(GridExtent.of(polygon, cell_m or np.ptp(polygon) / 60))
    return replace(shipped, name=name, title=name, field=field, truth=truth, hours=hours)


PERSON = {"person": "usual", "speed_mps": 1.2, "stop_overhead_s": 5.0, "position_sd_m": 1.0}
KINDS: dict[str, dict[str, Any]] = {
    "own fields": {}, "own fields, by a person": PERSON, "surfaces": {}, "surfaces, by a person": PERSON,
}  # fmt: skip
"""Settings of the kinds of missions."""


def mission(name: str, seed: int, kind: str, surfaces: Path | None) -> MissionResult:
    """A mission on a field; every second seed has half of the time."""
    is_own = kind.startswith("own fields")
    made = not is_own or name in MADE
    if is_own:
        field = made_field(name, seed) if made else surrogate_field(name)
    else:
        surface = zoo_field(name, surfaces)
        assert isinstance(surface, SurrogateField)
        field = replace(surface, hours=4.0 if np.ptp(surface.polygon) > LONG_M else 2.0)
    extent_m = float(np.ptp(field.polygon, axis=0).max())
    return simulate_mission(
        MissionSettings(
            field=field if made else name,
            hours=field.hours / (1 + seed % 2),
            seed=seed,
            cell_m=max(min(2.0, extent_m / 20), extent_m / 60),
            random_field=not made,
            **KINDS[kind],
        ),
        forecasts=True,
    )


def forecasts_of(kind: str, name: str, seed: int, result: MissionResult) -> Iterator[Made]:
    """The forecasts of a mission."""
    end = achieved(result.forecasts)
    if end is None:
        return
    hours, sd = result.settings.hours, end.forecast.sd
    error = math.sqrt(result.series[-1].mse) / end.forecast.mean_rate_cps
    for share, made in reported(result.forecasts, 3600 * hours):
        expected = made.forecast.sd_end
        low, high = made.forecast.band_end
        yield Made(kind, name, seed, hours, share, expected, low, high, sd / expected, error / expected)


def forecast_table(found: Sequence[Made]) -> Iterator[tuple[str, ...]]:
    """How well the forecasts held, by the kind of missions and the share of the time at which they were made."""
    for kind, share in sorted({(row.kind, row.share) for row in found}):
        some = [row for row in found if (row.kind, row.share) == (kind, share)]
        reached = np.quantile([row.reached for row in some], [0.1, 0.5, 0.9])
        inside = np.mean([row.low <= row.reached * row.forecast <= row.high for row in some])
        factor = np.median([row.high / row.forecast for row in some])
        error = np.sqrt(np.mean([row.error**2 for row in some]))
        yield (
            kind, f"{100 * share:.0f} %", str(len(some)), f"{100 * inside:.0f} %", f"×/÷ {factor:.2f}",
            f"{reached[1]:.2f} ({reached[0]:.2f} to {reached[2]:.2f})", f"{error:.2f}",
        )  # fmt: skip


def forecasts(given: argparse.Namespace) -> None:
    """Compare forecasts with what missions reach."""
    found: list[Made] = []
    own = given.fields or [*STATIONARY, *NON_STATIONARY, *MADE]
    for seed, kind in product(range(1, given.seeds + 1), KINDS):
        if (is_foreign := kind.startswith("surfaces")) and not given.surfaces:
            continue
        for name in real_surfaces(given.surfaces) if is_foreign else own:
            result = mission(name, seed, kind, given.surfaces)
            found += forecasts_of(kind, name, seed, result)
            print(f"{kind}, {name}, seed {seed}: {result.ended}", flush=True)
    missions = len({(row.kind, row.field, row.seed) for row in found})
    columns = (
        "missions", "made at", "forecasts", "inside the band", "band", "reached / forecast (10 to 90 %)",
        "error / forecast",
    )  # fmt: skip
    results.publish("forecasts", columns, forecast_table(found), f"{missions} missions", given.save)


# Aims ------------------------------------------------------------------------------------------------------------

OUT_OF_REACH = {"sd": "sd=0.001%", "p95-sd": "p95-sd=0.001%", "zone": "zone=99.99%"}
AIM_AT = 0.6  # share of the time at which a mission that is planned for the time meets the aim
AIMED_FIELDS = 8


def met(result: MissionResult, aim: Aim) -> float | None:
    """Time at which a mission of this result would have ended by an aim [s], ``None`` if it would not."""
    arrived_s, good = [visit.arrived_s for visit in result.visits], 0
    for made in result.forecasts:
        figure = made.forecast.reaching
        enough = bisect(arrived_s, made.time_s) >= MIN_GOOD_SAMPLES and figure is not None
        good = good + 1 if enough and aim.met(figure.now) else 0
        if good == GOOD_FORECASTS:
            return made.time_s
    return None


def aimed(kind: str, name: str, seeds: Sequence[int], surfaces: Path | None) -> tuple[str, ...]:
    """Row of a field: times until the aim is met, and what the map is worth then."""

    def flown(seed: int, until: str) -> MissionResult:
        field = zoo_field(name, surfaces)
        cell_m = None if isinstance(field, str) else field.field.cell_m
        settings = MissionSettings(field=field, random_field=isinstance(field, str), cell_m=cell_m, seed=seed)
        return simulate_mission(replace(settings, until=until, series_every_s=EVERY_S))

    with mock.patch.object(Explorer, "_goal", return_value=None):  # that only ends with the aim
        plain = [flown(seed, OUT_OF_REACH[kind]) for seed in seeds]
    limit_s = 3600 * plain[0].settings.hours
    at = [next(f.forecast.reaching for f in one.forecasts if f.time_s >= AIM_AT * limit_s) for one in plain]
    aim = Aim.parse(f"{kind}={np.median([one.now for one in at]):.3g}")
    figures = []
    for seed, result in zip(seeds, plain, strict=True):
        mine, end_s = flown(seed, str(aim)), met(result, aim) or limit_s
        then = result.series[bisect([row.time_s for row in result.series], end_s) - 1]
        last = mine.series[-1]
        first = next(one for one in mine.forecasts if one.time_s >= 0.25 * last.time_s).forecast
        soonest_s, latest_s = first.reaching.times_s[1:] or (None, None)
        inside = (soonest_s or 0.0) <= 0.75 * last.time_s <= (latest_s or limit_s)
        figures.append((end_s, last.time_s, then.mse, last.mse, then.distance_m, last.distance_m, inside))
    mean, ratio = np.mean(figures, axis=0), np.array(figures)[:, 1] - np.array(figures)[:, 0]
    return (
        name, str(aim), f"{mean[0] / 60:.0f}", f"{mean[1] / 60:.0f}",
        f"{mean[1] / mean[0]:.2f} ± {ratio.std(ddof=1) / len(seeds) ** 0.5 / mean[0]:.2f}",
        f"{mean[3] / mean[2]:.2f}", f"{mean[5] / mean[4]:.2f}", f"{100 * mean[6]:.0f} %",
    )  # fmt: skip


def known_variogram(name: str, surfaces: Path | None) -> AbstractContextManager[Any]:
    """Context in which maps of a surface have the variogram of its truth."""
    truth = zoo_field(name, surfaces)
    cells, extent_m = truth.field.grid().cells[::4], truth.field.grid().extent_m
    counts, exposure_s = np.round(1e5 * truth.rate_at(cells)), np.full(len(cells), 1e5)
    fit = replace(estimate_variogram(cells, counts, exposure_s, extent_m=extent_m), local_rate=None)
    return mock.patch.object(FieldMap, "fit", lambda _, state: fit if len(state.samples) else None)


def until(given: argparse.Namespace) -> None:
    """Compare missions planned for an aim with missions that stop at it."""
    names = given.fields or real_surfaces(given.surfaces)[1::3][:AIMED_FIELDS]
    seeds, rows = range(1, given.seeds + 1), []
    for kind in given.kinds:
        for name in names:
            with known_variogram(name, given.surfaces) if given.known else nullcontext():
                rows.append(aimed(kind, name, seeds, given.surfaces))
            print(*rows[-1], flush=True)
    columns = (
        "field", "aim", "planned for 2 h [min]", "for the aim [min]", "÷ planned for 2 h", "true error ÷",
        "driven ÷", "in the band of the forecast at a quarter",
    )  # fmt: skip
    settings = f"gcb, 0.6 m/s, 12 s per stop, seeds 1 to {given.seeds}; every third real surface, by name"
    results.publish("until_known" if given.known else "until", columns, rows, settings, given.save)


# Hours -----------------------------------------------------------------------------------------------------------

HECTARES, RANGES_M, HOURS = (0.25, 1.0, 4.0), (20, 60), (1.0, 2.0, 4.0)
"""Areas, distances at which moistures are hardly alike any more (95 % of the variance), and mission times."""
SQUARE = """
name: Square of {hectares} ha
datum: {{latitude_deg: 53.2680, longitude_deg: -0.5245}}
polygon: [[0, 0], [{side}, 0], [{side}, {side}], [0, {side}]]
truth:
  formula: {{family: matern32, quantity: vwc, mean: 0.22, sd: 0.04, range_m: {range_m}}}
  hours: 1
  soil: {{bulk_density_gcm3: 1.4}}
  calibration: {{n0_cps: 6.0}}
"""
PRACTICAL = 2.74
"""Practical range of a Matérn 3/2 variogram, in units of its range parameter."""


def moisture_error(field: Path, hours: float, cell_m: float, seed: int) -> float:
    """Root mean squared error at the end of one mission [% by volume]."""
    settings = MissionSettings(
        field=str(field), random_field=True, hours=hours, seed=seed, cell_m=cell_m, target="vwc"
    )
    return 100 * simulate_mission(settings).series[-1].vwc_rmse


def hours(given: argparse.Namespace) -> None:
    """Simulate missions on squares."""
    rows = []
    with tempfile.TemporaryDirectory() as name:
        path = Path(name) / "field.yaml"
        for hectares in HECTARES:
            side = round(100 * hectares**0.5)
            for range_m in RANGES_M:
                path.write_text(
                    SQUARE.format(hectares=hectares, side=side, range_m=range_m / PRACTICAL), encoding="utf-8"
                )
                row = [f"{hectares:g}", f"{range_m}"]
                for hours in HOURS:
                    found = [moisture_error(path, hours, side / 40, seed) for seed in range(1, given.seeds + 1)]
                    row.append(f"±{np.mean(found):.1f} %")
                rows.append(row)
    columns = ("field [ha]", "alike within [m]", *(f"{hours:g} h" for hours in HOURS))
    settings = (
        f"recommended strategy, 22 ± 4 % by volume, 4 counts/s, 0.6 m/s, 12 s at a stop, {given.seeds} seeds"
    )
    results.publish("hours", columns, rows, settings, given.save)


PARTS = {"lattices": (lattices, 20), "forecasts": (forecasts, 3), "until": (until, 4), "hours": (hours, 4)}
"""Functions with their numbers of seeds."""


def main() -> None:
    parser = results.parser(__doc__)
    parser.add_argument("part", choices=PARTS)
    parser.add_argument("--seeds", type=int, help="seeds 1 to this number")
    parser.add_argument("--fields", nargs="+", help="names or field files; default: all families")
    parser.add_argument("--surfaces", type=Path, help="folder of surfaces, for forecasts; see bench_zoo.py")
    parser.add_argument("--kinds", nargs="+", choices=list(OUT_OF_REACH), default=list(OUT_OF_REACH), help="aims")
    parser.add_argument("--known", action="store_true", help="until: with the variogram of the truth")
    parser.add_argument(
        "--strategies", nargs="+", default=["gcb", "two_pass"], help="NAME (dwell optimal) or NAME:DWELL"
    )
    parser.add_argument("--cell", type=float, default=0.0, help="least cell size of lattices [m]")
    parser.add_argument("--hours", type=float, default=2.0, help="of lattices")
    parser.add_argument("--processes", type=int, default=2, help="of lattices")
    given = parser.parse_args()
    run_part, seeds = PARTS[given.part]
    given.seeds = given.seeds or seeds
    run_part(given)


if __name__ == "__main__":
    try:
        main()
    except InputError as error:
        sys.exit(str(error))

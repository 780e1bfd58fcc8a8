#!/usr/bin/env python3
# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""How well the forecasts of a mission's standard deviation hold, over many simulated missions.

usage: .venv/bin/python scripts/bench_forecast.py [--seeds 3] [--cell 2] [--strategy gcb] [--preset recommended]
       [--fields smooth patches FILE.yaml] [--rows FILE.csv] [--save]

Each mission draws its random field from its seed; every second seed has half of the field's usual time. A row is
the forecast for the end that was made at a share of the time. ``reached`` is the standard deviation of the map at
the end, ``error`` the root mean squared error of the map against the truth, both divided by the forecast.
Uniform fields and those with few counts are part of the set; ``uniform`` tells when a field was called so.
"""

from __future__ import annotations

import os

for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[variable] = "1"

import argparse
import csv
import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import results

from soilmoist_ros.mapping.field import Field
from soilmoist_ros.simulation.fields.catalogue import surrogate_field
from soilmoist_ros.simulation.fields.formulas import formula
from soilmoist_ros.simulation.fields.rate_grid import Extent
from soilmoist_ros.simulation.fields.surrogate_field import SurrogateField
from soilmoist_ros.simulation.mission.mission_result import MissionResult, achieved, reported
from soilmoist_ros.simulation.mission.settings import MissionSettings
from soilmoist_ros.simulation.mission.simulator import simulate_mission

SHIPPED = (
    "smooth", "patches", "rough", "ridge", "halves", "rough-patch", "strips", "synthetic-high", "synthetic-low",
    "airfield-simulated", "validation",
)  # fmt: skip
MADE = {
    "uniform": (60, 50, 2.0, {"family": "gradient", "low": 4.0, "high": 4.0}),
    "few counts": (60, 50, 2.0, {"family": "matern32", "mean": 0.5, "sd": 0.1, "range_m": 20}),
    "many counts": (60, 50, 2.0, {"family": "matern32", "mean": 60.0, "sd": 6.0, "range_m": 15}),
    "15 x 15 m": (15, 15, 1.0, {"family": "gaussian_field", "mean": 4.0, "sd": 0.5, "range_m": 8}),
    "100 ha": (1000, 1000, 6.0, {"family": "matern32", "mean": 4.0, "sd": 0.5, "range_m": 200}),
}
"""Extents [m], hours and formulas of further fields."""


class Row(NamedTuple):
    """A forecast and what became of it."""

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
    """One of :data:`MADE`."""
    width, height, hours, about = MADE[name]
    shipped = surrogate_field("smooth")
    polygon = np.array([(0, 0), (width, 0), (width, height), (0, height)], float)
    field = Field(name, shipped.frame, polygon)
    seeded = about if about["family"] == "gradient" else {**about, "seed": seed}
    truth = formula(**seeded).function(Extent.of(polygon, max(width, height) / 60))
    return replace(shipped, name=name, title=name, field=field, truth=truth, hours=hours)


def mission(name: str, seed: int, options: argparse.Namespace) -> MissionResult:
    """A mission on a field; every second seed has half of the time."""
    made = name in MADE
    field = made_field(name, seed) if made else surrogate_field(name)
    extent_m = float(np.ptp(field.polygon, axis=0).max())
    return simulate_mission(
        MissionSettings(
            field=field if made else name,
            hours=field.hours / (1 + seed % 2),
            seed=seed,
            strategy=options.strategy,
            preset=options.preset,
            cell_m=max(min(options.cell, extent_m / 20), extent_m / 60),
            random_field=not made,
        ),
        forecasts=True,
    )


def rows(name: str, seed: int, result: MissionResult) -> Iterator[Row]:
    """The forecasts of a mission."""
    end = achieved(result.forecasts)
    if end is None:
        return
    hours, sd = result.settings.hours, end.forecast.sd
    error = math.sqrt(result.series[-1].mse) / end.forecast.mean_rate_cps
    for share, made in reported(result.forecasts, 3600 * hours):
        expected = made.forecast.sd_end
        low, high = made.forecast.band_end
        yield Row(name, seed, hours, share, expected, low, high, sd / expected, error / expected)


def told(result: MissionResult) -> float | None:
    """Share of the time at which the field was called uniform, ``None`` if it was not."""
    for made in result.forecasts:
        if made.forecast.hidden is not None:
            return made.time_s / (3600 * result.settings.hours)
    return None


def table(found: Sequence[Row]) -> Iterator[tuple[str, ...]]:
    """How well the forecasts held, by the share of the time at which they were made."""
    for share in sorted({row.share for row in found}):
        some = [row for row in found if row.share == share]
        reached = np.quantile([row.reached for row in some], [0.1, 0.5, 0.9])
        inside = np.mean([row.low <= row.reached * row.forecast <= row.high for row in some])
        factor = np.median([row.high / row.forecast for row in some])
        error = np.sqrt(np.mean([row.error**2 for row in some]))
        yield (
            f"{100 * share:.0f} %", str(len(some)), f"{100 * inside:.0f} %", f"×/÷ {factor:.2f}",
            f"{reached[1]:.2f} ({reached[0]:.2f} to {reached[2]:.2f})", f"{error:.2f}",
        )  # fmt: skip


def main() -> None:
    parser = results.parser(__doc__)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--first-seed", type=int, default=1)
    parser.add_argument("--cell", type=float, default=2.0)
    parser.add_argument("--strategy", default=None)
    parser.add_argument("--preset", default="recommended")
    parser.add_argument("--fields", nargs="+", default=[*SHIPPED, *MADE])
    parser.add_argument("--rows", type=Path, help="write all forecasts to this CSV file")
    options = parser.parse_args()
    found: list[Row] = []
    uniform: list[str] = []
    for seed in range(options.first_seed, options.first_seed + options.seeds):
        for name in options.fields:
            result = mission(name, seed, options)
            found += rows(name, seed, result)
            share = told(result)
            if share is not None:
                uniform.append(f"{name} {seed} at {100 * share:.0f} %")
            print(f"{name}, seed {seed}: {result.ended}", flush=True)
            if options.rows:
                with options.rows.open("w", newline="", encoding="utf-8") as file:
                    csv.writer(file).writerows([Row._fields, *found])
    missions = len({(row.field, row.seed) for row in found})
    columns = (
        "made at",
        "forecasts",
        "inside the band",
        "band",
        "reached / forecast (10 to 90 %)",
        "error / forecast",
    )
    settings = (
        f"{missions} missions, preset {options.preset}, strategy {options.strategy or 'of the preset'}; "
        f"called uniform at some time: {'; '.join(uniform) or 'none'}"
    )
    results.publish("forecasts", columns, table(found), settings, options.save)


if __name__ == "__main__":
    main()

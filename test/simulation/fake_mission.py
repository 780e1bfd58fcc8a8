# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A fake mission simulator: fast, with plausibly decaying errors. Imported by path."""

from __future__ import annotations

import zlib

import numpy as np

from soilmoist_ros.exploration.mission.visit import Visit
from soilmoist_ros.foundation.geodesy import LocalFrame
from soilmoist_ros.mapping import FieldGrid, Samples, Variogram, make_soil_map
from soilmoist_ros.sensing import CalibrationCurve, CountRecord
from soilmoist_ros.simulation.mission.mission_result import MapErrors, MappedProperty, MissionResult, SeriesRow

TITLES = {
    "synthetic-high": "Synthetic airfield, high gradient", "synthetic-low": "Synthetic airfield, low gradient",
    "airfield-simulated": "Simulated airfield", "validation": "Validation field",
}  # fmt: skip
EFFORT = {"greedy": (1.0, 1.0), "monte_carlo": (0.85, 1.05), "adaptive_sampling": (0.45, 1.15),
          "random": (0.9, 1.5), "lattice": (0.35, 0.9)}  # fmt: skip


def rng_of(settings):
    text = f"{settings.field} {settings.strategy} {settings.dwell} {settings.seed}"
    return np.random.default_rng(zlib.crc32(text.encode()))


def simulate(settings, progress=None, cell_m=2.0):
    rng = rng_of(settings)
    size = (210.0, 330.0) if settings.field == "validation" else (60.0, 50.0)
    low = settings.field == "synthetic-low"
    dry, wet = (4.0, 3.0) if low else (5.0, 2.5)
    scale = 5.0 if settings.field == "validation" else 1.0
    grid = FieldGrid.from_polygon([(0, 0), (size[0], 0), size, (0, size[1])], cell_m * scale)

    def rate(xy):
        return wet + (dry - wet) / (1 + np.exp((xy[:, 0] - size[0] / 2) / (4 * scale)))

    kind, _, value = settings.dwell.partition(":")
    driving, error = EFFORT.get(settings.strategy, (0.7, 0.6))
    end_s = 3600 * settings.hours
    visits, time_s, here, track = [], 0.0, np.array([1.0, 1.0]), [np.array([1.0, 1.0])]
    xy, counts, exposure = [], [], []
    while True:
        place = rng.uniform(0, 1, 2) * size
        if settings.strategy == "greedy" and rng.uniform() < 0.8:
            edge = rng.integers(4)
            place[edge % 2] = (0.02 + 0.96 * (edge // 2)) * size[edge % 2]
        place = here + (place - here) * (driving if len(visits) > 2 else 1.0)
        expected = float(rate(place[None])[0])
        if kind == "optimal":
            dwell = 10.0 * rng.integers(6, 30)
        else:
            dwell = float(value) if kind == "fmi" else np.ceil(1 / float(value) ** 2 / expected / 10) * 10
        arrived = time_s + np.hypot(*(place - here)) / 0.6 + 12
        if arrived + dwell > end_s:
            break
        n = int(rng.poisson(expected * dwell))
        visits.append(Visit(f"P{len(visits) + 1}", *place.tolist(), arrived, dwell, n, "largest variance"))
        xy.append(place), counts.append(n), exposure.append(dwell), track.append(place)
        here, time_s = place, arrived + dwell
        if progress is not None:
            progress(time_s / end_s)
    samples = Samples(np.array(xy), np.array(counts, float), np.array(exposure))
    curve = CalibrationCurve(6.0, 1.4)
    soil_map = make_soil_map(samples, grid, Variogram("gaussian", 0.005, 15.0 * scale, 0.8), curve)
    truth = grid.to_raster(rate(grid.cells))
    records = [
        CountRecord(1.78e9 + v.arrived_s + v.dwell_s, v.x_m, v.y_m, 0.0, v.raw_counts, v.dwell_s, v.dwell_s)
        for v in visits
    ]
    mapped = MappedProperty("fake", TITLES.get(settings.field, settings.field), records, soil_map, truth)
    return MissionResult(
        settings, _series(settings, visits, track, error, low, rng, end_s), visits, (np.array(track),), [mapped],
        LocalFrame(53.268, -0.5245), "time is up",
    )  # fmt: skip


def _series(settings, visits, track, error, low, rng, end_s):
    start, floor = (0.3, 0.02) if low else (1.5, 0.04)
    slow = 1.0 if low else 1.35 if settings.dwell.startswith("fmi") else 1.0
    steps = np.cumsum(np.hypot(*np.diff(np.array(track), axis=0).T))
    rows, own = [], float(np.exp(rng.normal(0, 0.25)))
    for time_s in np.arange(0, end_s + 1, 60.0):
        done = [v for v in visits if v.arrived_s + v.dwell_s <= time_s]
        distance = float(np.interp(time_s, [0.0, *(v.arrived_s for v in visits)], [0.0, *steps]))
        mse = own * error * (floor + start * np.exp(-time_s / (1500 * slow) * (2 / settings.hours)))
        mse = float(mse * np.exp(rng.normal(0, 0.05))) if len(done) >= 3 else float("nan")
        coverage = float(np.clip(0.95 - 0.5 * np.exp(-time_s / 3000) + rng.normal(0, 0.03), 0, 1))
        counting = float(sum(v.dwell_s for v in done))
        rows.append(
            SeriesRow(float(time_s), distance, len(done), counting,
                      (MapErrors(mse, 0.06 * mse**0.5, coverage if mse == mse else float("nan")),))
        )  # fmt: skip
    return rows

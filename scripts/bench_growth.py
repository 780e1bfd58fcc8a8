#!/usr/bin/env python3
# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""How the cost of a map grows with the samples and the cells: time, peak memory, exponents.

usage: .venv/bin/python scripts/bench_growth.py [--workers 2] [--scheduler tcp://host:8786] [--most-samples N]
       [--most-cells N] [--save]

Each map is made in a new process. The robot drives lines 6 m apart, with one record of 10 s every 6 m. The model
is Matern 3/2 with a range of 30 m; maps of up to 2000 samples are exact. Workers are local processes, or those of
a Dask cluster.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from itertools import pairwise

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
import results

SPACING_M, RANGE_M, RECORD_S = 6.0, 30.0, 10.0


def measure(samples: int, cells: int, workers: int, scheduler: str | None) -> dict[str, float | str]:
    """Merge, krige; time of each [s] and peak memory of this process [MB]."""
    from bench_mapping import _peak_mb

    from soilmoist_ros.foundation.workers import shared_work
    from soilmoist_ros.mapping import FieldGrid, Variogram, make_soil_map
    from soilmoist_ros.mapping.samples import merge_records

    rng = np.random.default_rng(1)
    side = SPACING_M * np.sqrt(samples)
    line = np.arange(samples) * SPACING_M
    xy = np.column_stack([line % side, line // side * SPACING_M]) + rng.normal(0, 0.3, (samples, 2))
    rate = 4 + 0.5 * np.sin(xy[:, 0] / 40) * np.cos(xy[:, 1] / 50)
    counts = rng.poisson(rate * RECORD_S)
    now = time.process_time if workers == 1 and scheduler is None else time.perf_counter  # alone: processor time
    clock = [now()]
    merged = merge_records(xy, counts, np.full(samples, RECORD_S), 2.5)
    clock.append(now())
    corners = np.array([[0, 0], [side, 0], [side, side], [0, side]])
    grid = FieldGrid.from_polygon(corners, side / np.sqrt(cells))
    with shared_work(workers, scheduler) as compute:
        soil_map = make_soil_map(merged, grid, Variogram("matern32", 0.01, RANGE_M, 0.3), compute=compute)
    clock.append(now())
    merging_s, kriging_s = (after - before for before, after in pairwise(clock))
    kriging = "exact" if soil_map.accuracy is None else f"{soil_map.accuracy.nearest} nearest"
    return {"merging_s": merging_s, "kriging_s": kriging_s, "memory_mb": _peak_mb(), "kriging": kriging}


def in_fresh_process(*arguments: object) -> dict[str, float | str]:
    """:func:`measure` in a new process, which limits the peak memory to one map."""
    command = [sys.executable, __file__, "--one", *(str(argument) for argument in arguments)]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    return dict(json.loads(done.stdout))


def series(name: str, cases: list[tuple[int, int]], options: argparse.Namespace) -> list[list[str]]:
    """Rows of one series; the column that differs grows. The exponents are printed."""
    grows = [samples if name == "samples" else cells for samples, cells in cases]
    found = [in_fresh_process(*case, options.workers, options.scheduler or "-") for case in cases]
    for what in ("kriging_s", "memory_mb"):
        values = [float(row[what]) for row in found]
        slopes = np.diff(np.log(values)) / np.diff(np.log(grows))
        whole = np.polyfit(np.log(grows), np.log(values), 1)[0]
        steps = ", ".join(f"{slope:.2f}" for slope in slopes)
        print(f"{what} grows with {name} to the power {whole:.2f} (from row to row {steps})", flush=True)
    return [
        [
            f"{samples:,}", f"{cells:,}", f"{row['merging_s']:.2f}", f"{row['kriging_s']:.2f}",
            f"{row['memory_mb']:.0f}", str(row["kriging"]),
        ]
        for (samples, cells), row in zip(cases, found, strict=True)
    ]  # fmt: skip


def main() -> None:
    """Print the table."""
    parser = results.parser(__doc__)
    parser.add_argument("--workers", type=int, default=1, help="local processes (default 1)")
    parser.add_argument("--scheduler", help="address of a Dask scheduler")
    parser.add_argument("--most-samples", type=int, default=100_000)
    parser.add_argument("--most-cells", type=int, default=1_000_000)
    parser.add_argument("--one", nargs=4, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.one:
        samples, cells, workers, scheduler = options.one
        one = measure(int(samples), int(cells), int(workers), None if scheduler == "-" else scheduler)
        print(json.dumps(one))
        return
    samples = [10**k for k in range(2, 6) if 10**k <= options.most_samples]
    cells = [10**k for k in range(4, 7) if 10**k <= options.most_cells]
    rows = series("samples", [(n, 10_000) for n in samples], options)
    rows += series("cells", [(samples[-1], g) for g in cells], options)
    clock = "processor time" if options.workers == 1 and not options.scheduler else f"{options.workers} workers"
    columns = ("samples", "cells", "merging [s]", "kriging [s]", "peak memory [MB]", "kriging")
    results.publish("growth", columns, rows, f"samples every 6 m, Matérn 3/2, {clock}", options.save)


if __name__ == "__main__":
    main()

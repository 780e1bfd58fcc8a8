# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Time of maps on line: mean and variance of 70,000 cells after each of 300 records, compared with libKriging.

Every record begins a new sample. The map is that of a FieldMap without its fit: rows that were kept; with a
Gaussian model, large maps are made anew. libKriging, among the fastest packages in bench_mapping.py, computes each
map anew. It is timed for a few numbers of samples; linear interpolation gives its total. Samples and fixed
covariance parameters come from bench_mapping.py. One BLAS thread, CPU time, medians of three runs.

usage: .venv/bin/python scripts/bench_online.py [--quick] [--models NAME ...] [--records N] [--cells N] [--save]
"""

from __future__ import annotations

import importlib.util
import multiprocessing
import statistics
import sys
import time
from collections.abc import Callable
from dataclasses import replace

import bench_mapping  # limits the threads before numpy is imported
import numpy as np
import results
from bench_mapping import RANGE_M, SILL, Task, make_task

from soilmoist_ros.mapping import PoissonKriging, Samples, Variogram
from soilmoist_ros.mapping.kriging.rows import RasterKriging

LIBKRIGING_SHARES = (1 / 30, 1 / 3, 2 / 3, 1.0)
"""Shares of the records after which libKriging is timed."""
LAST = 20
"""Last new samples of which one update is the median, and records that join the last sample afterwards."""
COLUMNS = {
    "model": "model",
    "total_s": "all maps [s]",
    "libkriging_total_s": "libKriging [s]",
    "ratio": "libKriging takes",
    "new_sample_ms": "new sample [ms]",
    "slowest_ms": "slowest [ms]",
    "moved_sample_ms": "sample moved [ms]",
    "grown_sample_ms": "sample grown [ms]",
    "anew_ms": "all anew [ms]",
    "memory_mb": "memory [MB]",
}
"""Columns of the table. The last sample is moved and grown, or only grown."""


def first(task: Task, n: int) -> Task:
    """The task with the first samples only."""
    return replace(task, xy=task.xy[:n], counts=task.counts[:n], exposure_s=task.exposure_s[:n])


def after_record(task: Task, number: int, shift_m: float) -> Task:
    """The task after another record at one sample; the record moves the sample."""
    xy, counts, exposure_s = task.xy.copy(), task.counts.copy(), task.exposure_s.copy()
    xy[number] += shift_m
    counts[number] += 30
    exposure_s[number] += 10
    return replace(task, xy=xy, counts=counts, exposure_s=exposure_s)


class OnLine:
    """Maps of one raster, each from what was kept of the one before; the rate in the noise is that of a fit."""

    def __init__(self, task: Task) -> None:
        everywhere = np.ones((len(task.y_m), len(task.x_m)), bool)
        self.raster = RasterKriging(task.x_m, task.y_m, everywhere, keep_nugget=True)
        self.rate = float(task.counts.sum() / task.exposure_s.sum())

    def map(self, task: Task) -> tuple[float, np.ndarray]:
        """CPU time of one map [s], and the map: rate and variance."""
        start = time.process_time()
        samples, variogram = (
            Samples(task.xy, task.counts, task.exposure_s),
            Variogram(task.model, 0.0, RANGE_M, SILL),
        )
        found = self.raster.update(samples, variogram, self.rate)
        if found is None:
            kriging = PoissonKriging(variogram, mean_rate=self.rate).fit(*task_columns(task))
            found = np.array(kriging.predict_grid(task.x_m, task.y_m))
        return time.process_time() - start, found


def task_columns(task: Task) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    return task.xy, task.counts, task.exposure_s


def update(task: Task) -> tuple[list[float], OnLine, np.ndarray]:
    """CPU time of the map after each record [s], the object that computes the maps, and the last map."""
    online = OnLine(task)
    times, maps = zip(*(online.map(first(task, n)) for n in range(1, len(task.xy) + 1)), strict=True)
    return list(times), online, maps[-1]


def cpu_s(run: Callable[[], object]) -> float:
    """CPU time of a run [s], the median of three."""
    times = []
    for _ in range(3):
        start = time.process_time()
        run()
        times.append(time.process_time() - start)
    return statistics.median(times)


def _memory_child(model: str, records: int, cells: int, connection: object) -> None:
    update(make_task(model, 30, 500))  # libraries loaded
    task = make_task(model, records, cells)
    before = bench_mapping._peak_mb()
    update(task)
    connection.send(bench_mapping._peak_mb() - before)  # type: ignore[attr-defined]


def memory_mb(model: str, records: int, cells: int) -> float:
    """Growth of the peak memory of a fresh process that makes all maps [MB]."""
    context = multiprocessing.get_context("spawn")
    receiver, sender = context.Pipe(duplex=False)
    child = context.Process(target=_memory_child, args=(model, records, cells, sender))
    child.start()
    sender.close()  # a child that dies then ends the wait
    growth = float(receiver.recv())
    child.join()
    return growth


def compare(model: str, records: int, cells: int) -> dict[str, object]:
    task = make_task(model, records, cells)
    runs = []
    for _ in range(4):
        times, online, found = update(task)
        runs.append(times)
    new = np.median(runs[1:], axis=0)  # the first run loads libraries and allocates memory
    kriging = PoissonKriging(Variogram(model, 0.0, RANGE_M, SILL))
    expected = kriging.fit(task.xy, task.counts, task.exposure_s).predict(task.cells[::7])
    pairs = zip(found, expected, strict=True)
    difference = [float(np.abs(a.ravel()[::7] - b).max()) for a, b in pairs]
    standing, grown, moved = task, [], []
    for _ in range(LAST):
        for shift_m, seconds in ((0.0, grown), (0.1, moved)):
            standing = after_record(standing, -1, shift_m)
            seconds.append(online.map(standing)[0])
    anew = [online.map(standing := after_record(standing, 0, 0.1))[0] for _ in range(3)]
    row: dict[str, object] = {"model": model, "records": records, "total_s": f"{new.sum():.2f}"}
    if importlib.util.find_spec("pylibkriging") is not None:
        sizes = [max(2, round(records * share)) for share in LIBKRIGING_SHARES]
        seconds = [cpu_s(bench_mapping.pylibkriging(first(task, n))) for n in sizes]
        total = float(np.interp(np.arange(1, records + 1), sizes, seconds).sum())
        row |= {"libkriging_total_s": f"{total:.1f}", "ratio": f"{total / new.sum():.0f}"}
    for name, some in (("new", new[-LAST:]), ("moved", moved), ("grown", grown)):
        row[f"{name}_sample_ms"] = f"{1e3 * statistics.median(some):.2f}"
    row |= {"slowest_ms": f"{1e3 * new.max():.0f}", "anew_ms": f"{1e3 * statistics.median(anew):.0f}"}
    row["memory_mb"] = f"{memory_mb(model, records, cells):.0f}"
    return row | {"rate_difference": f"{difference[0]:.1e}", "variance_difference": f"{difference[1]:.1e}"}


def main() -> int:
    parser = results.parser(__doc__)
    parser.add_argument("--quick", action="store_true", help="a tenth of the cells, 100 records")
    parser.add_argument("--models", nargs="+", default=["gaussian", "exponential", "matern32"])
    parser.add_argument("--records", type=int, help="number of records (default 300)")
    parser.add_argument("--cells", type=int, help="number of cells (default 70,000)")
    arguments = parser.parse_args()
    records = arguments.records or (100 if arguments.quick else 300)
    cells = arguments.cells or (7_000 if arguments.quick else 70_000)
    rows = []
    for model in arguments.models:
        rows.append(compare(model, records, cells))
        print("  ".join(f"{column} {value}" for column, value in rows[-1].items()), flush=True)
    shares = ", ".join(f"{share:.0%}" for share in LIBKRIGING_SHARES)
    results.publish(
        "online",
        tuple(COLUMNS.values()),
        [[row.get(column, "") for column in COLUMNS] for row in rows],
        f"{cells:,} cells, {records} records, each a new sample; fixed covariance parameters, processor time of "
        f"one core, medians of 3 runs; libKriging computes each map anew, timed after {shares} of the records; "
        f"{bench_mapping.roofline()}",
        arguments.save,
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())

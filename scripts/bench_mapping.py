# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Time of kriging a raster: mean and variance of 70,000 cells, with this package and four others.

All packages use equal samples, equal fixed covariance parameters and one BLAS thread; nothing is fitted. The noise
differs between samples, but the packages differ in what they support:

* PyKrige has equal noise for all samples as a nugget; it is compared with this package on a task with equal noise.
* scikit-learn has no unknown mean: it receives our mean, and its variance excludes the uncertainty of the mean.
* libKriging's kernels are products over the axes, so only its Gaussian is the same model. Its other kernels are
  timed for the same number of samples. It receives 1000 cells at a time: the matrix of 70,000 is too large.

Times are processor times. A line for each measurement has all of it, the table the ratios.

``growth``: time and peak memory of maps made in new processes. The robot drives lines 6 m apart, with one record
of 10 s every 6 m. The model is Matern 3/2 with a range of 30 m; maps of up to 2000 samples are exact.

usage: .venv/bin/python scripts/bench_mapping.py [growth] [--quick] [--repeats N]
       [--packages NAME ...] [--save]
"""

from __future__ import annotations

import importlib.metadata
import importlib.util
import multiprocessing
import os
import resource
import statistics
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

for _variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[_variable] = "1"  # before numpy is imported

import numpy as np
import results

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from soilmoist_ros.mapping import FieldGrid, PoissonKriging, Samples, Variogram, make_soil_map

PATIENCE_S = 30.0
"""Processor time after which a measurement is not repeated [s]."""
SIDE_M, RANGE_M, SILL = 300.0, 40.0, 0.3
COLUMNS = (
    "model", "n", "package", "seconds", "slowest_s", "ratio", "rate_difference", "variance_difference"
)  # fmt: skip
EXTRA_COLUMNS = ("memory_mb", "remark")


@dataclass(frozen=True)
class Task:
    """Samples and raster axes of one comparison."""

    model: str
    xy: np.ndarray
    counts: np.ndarray
    exposure_s: np.ndarray
    x_m: np.ndarray
    y_m: np.ndarray

    @property
    def rate(self) -> np.ndarray:
        """Count rates [counts/s]."""
        return self.counts / self.exposure_s

    @property
    def noise(self) -> np.ndarray:
        """Variances of the rates [(counts/s)^2]."""
        return self.counts.sum() / self.exposure_s.sum() / self.exposure_s

    @property
    def cells(self) -> np.ndarray:
        """Cell centres, row by row [m]."""
        return np.stack(np.meshgrid(self.x_m, self.y_m), axis=-1).reshape(-1, 2)

    def with_equal_noise(self) -> Task:
        """The task with one exposure for all samples."""
        exposure_s = np.full(len(self.xy), self.exposure_s.mean())
        return Task(self.model, self.xy, np.rint(self.rate * exposure_s), exposure_s, self.x_m, self.y_m)


def make_task(model: str, n: int, cells: int) -> Task:
    rng = np.random.default_rng(n)
    columns = round(np.sqrt(cells * 1.4))
    rows = round(cells / columns)
    xy = rng.uniform(0, SIDE_M, (n, 2))
    exposure_s = rng.uniform(100, 600, n)
    counts = rng.poisson((3 + np.sin(xy[:, 0] / 40)) * exposure_s)
    return Task(model, xy, counts, exposure_s, np.linspace(0, SIDE_M, columns), np.linspace(0, SIDE_M, rows))


# -- the packages: each makes the estimator (not timed) and returns the timed function ----------------------

Run = Callable[[], tuple[np.ndarray, np.ndarray]]


def ours(task: Task) -> Run:
    kriging = PoissonKriging(Variogram(task.model, 0.0, RANGE_M, SILL))

    def run() -> tuple[np.ndarray, np.ndarray]:
        kriging.fit(task.xy, task.counts, task.exposure_s)
        rate, variance = kriging.predict_grid(task.x_m, task.y_m)
        return rate.ravel(), variance.ravel()

    return run


def pykrige(task: Task) -> Run | None:
    from pykrige.ok import OrdinaryKriging

    factors = {"gaussian": 7 / 4, "exponential": 3.0, "spherical": 1.0}
    if task.model not in factors:
        return None
    nugget = float(task.noise[0])
    parameters = {"psill": SILL, "range": RANGE_M * factors[task.model], "nugget": nugget}
    x, y = task.cells.T

    def run() -> tuple[np.ndarray, np.ndarray]:
        kriging = OrdinaryKriging(
            *task.xy.T, task.rate, variogram_model=task.model, variogram_parameters=parameters, exact_values=True
        )
        rate, variance = kriging.execute("points", x, y, backend="vectorized")
        return np.asarray(rate), np.asarray(variance) - nugget  # its target includes the nugget

    return run


def gstools(task: Task) -> Run:
    import gstools as gs

    kinds = {
        "gaussian": (gs.Gaussian, {"rescale": 1.0}),
        "exponential": (gs.Exponential, {"rescale": 1.0}),
        "spherical": (gs.Spherical, {"rescale": 1.0}),
        "matern32": (gs.Matern, {"nu": 1.5, "rescale": np.sqrt(2.0)}),
        "matern52": (gs.Matern, {"nu": 2.5, "rescale": np.sqrt(2.0)}),
    }
    kind, options = kinds[task.model]
    model = kind(dim=2, var=SILL, len_scale=RANGE_M, nugget=0.0, **options)

    def run() -> tuple[np.ndarray, np.ndarray]:
        kriging = gs.krige.Ordinary(model, task.xy.T, task.rate, exact=False, cond_err=task.noise)
        rate, variance = kriging.structured([task.x_m, task.y_m])
        return rate.T.ravel(), variance.T.ravel()

    return run


def sklearn(task: Task) -> Run | None:
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, Matern

    kernels = {
        "gaussian": RBF(RANGE_M / np.sqrt(2)),
        "exponential": Matern(RANGE_M, nu=0.5),
        "matern32": Matern(RANGE_M, nu=1.5),
        "matern52": Matern(RANGE_M, nu=2.5),
    }
    if task.model not in kernels:
        return None
    kriging = PoissonKriging(Variogram(task.model, 0.0, RANGE_M, SILL))
    mean = kriging.fit(task.xy, task.counts, task.exposure_s).map_mean
    cells = task.cells

    def run() -> tuple[np.ndarray, np.ndarray]:
        kernel = ConstantKernel(SILL) * kernels[task.model]
        process = GaussianProcessRegressor(kernel, alpha=task.noise, optimizer=None)
        rate, sd = process.fit(task.xy, task.rate - mean).predict(cells, return_std=True)
        return rate + mean, sd**2

    return run


def pylibkriging(task: Task) -> Run | None:
    import pylibkriging

    kernels = {"gaussian": "gauss", "exponential": "exp", "matern32": "matern3_2", "matern52": "matern5_2"}
    if task.model not in kernels:
        return None
    theta = RANGE_M / np.sqrt(2) if task.model == "gaussian" else RANGE_M
    parameters = {
        "sigma2": SILL,
        "theta": np.full((1, 2), theta),
        "is_sigma2_estim": False,
        "is_theta_estim": False,
    }
    cells = task.cells

    def run() -> tuple[np.ndarray, np.ndarray]:
        kriging = pylibkriging.Kriging(
            task.rate, task.xy, kernels[task.model], "constant", False, "none", "LL", parameters, task.noise
        )
        parts = [
            kriging.predict(part, True, False, False) for part in np.array_split(cells, -(-len(cells) // 1000))
        ]
        return np.concatenate([np.ravel(p[0]) for p in parts]), np.concatenate(
            [np.ravel(p[1]) for p in parts]
        ) ** 2

    return run


@dataclass(frozen=True)
class Peer:
    """A package and how its task differs."""

    module: str
    distribution: str
    make: Callable[[Task], Run | None]
    equal_noise: bool = False
    remark: str = ""


PEERS = (
    Peer("pykrige", "PyKrige", pykrige, equal_noise=True, remark="equal noise only, compared on that task"),
    Peer("gstools", "gstools", gstools),
    Peer("sklearn", "scikit-learn", sklearn, remark="known mean (ours): smaller variance"),
    Peer("pylibkriging", "pylibkriging", pylibkriging, remark="kernels are products over the axes"),
)


# -- measuring ----------------------------------------------------------------------------------------------


def timed(run: Run, repeats: int) -> tuple[list[float], tuple[np.ndarray, np.ndarray]]:
    seconds: list[float] = []
    while len(seconds) < repeats and sum(seconds) < PATIENCE_S:
        start = time.process_time()
        result = run()
        seconds.append(time.process_time() - start)
    return seconds, result


def _peak_mb() -> float:
    """Peak resident memory of this process [MB]; getrusage would start from the parent's peak."""
    try:
        status = Path("/proc/self/status").read_text()
    except OSError:
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    return int(status.partition("VmHWM:")[2].split()[0]) / 1024


def _memory_child(model: str, n: int, cells: int, connection: object) -> None:
    ours(make_task(model, 30, 500))()  # libraries loaded
    task = make_task(model, n, cells)
    before = _peak_mb()
    ours(task)()
    connection.send(_peak_mb() - before)  # type: ignore[attr-defined]


def memory_mb(model: str, n: int, cells: int) -> float:
    """Growth of the peak memory of a fresh process, fit and map together [MB]."""
    return float(in_fresh_process(_memory_child, model, n, cells))


def in_fresh_process(work: Callable[..., None], *arguments: object) -> object:
    """What a function sends in a new process, which limits the peak memory to its own."""
    context = multiprocessing.get_context("spawn")
    receiver, sender = context.Pipe(duplex=False)
    child = context.Process(target=work, args=(*arguments, sender))
    child.start()
    found = receiver.recv()
    child.join()
    return found


def compare(model: str, n: int, cells: int, repeats: int, packages: list[str] | None) -> list[dict[str, object]]:
    task = make_task(model, n, cells)
    equal = task.with_equal_noise()
    ours(make_task(model, 20, 100))()
    seconds, reference = timed(ours(task), repeats)
    own = statistics.median(seconds)
    rows = [_row(model, n, "soilmoist_ros", seconds, own, None)]
    rows[0]["memory_mb"] = f"{memory_mb(model, n, cells):.0f}"
    for peer in PEERS:
        if packages is not None and peer.distribution not in packages:
            continue
        if importlib.util.find_spec(peer.module) is None:
            rows.append({"model": model, "n": n, "package": peer.distribution, "remark": "not installed"})
            continue
        run = peer.make(equal if peer.equal_noise else task)
        if run is None:
            rows.append({"model": model, "n": n, "package": peer.distribution, "remark": "has no such model"})
            continue
        warm_up = peer.make(make_task(model, 20, 100).with_equal_noise())
        if warm_up is not None:
            warm_up()  # loads its libraries
        seconds, found = timed(run, repeats)
        expected = ours(equal)() if peer.equal_noise else reference
        difference = [float(np.abs(a - b).max()) for a, b in zip(found, expected, strict=True)]
        rows.append(_row(model, n, peer.distribution, seconds, own, difference, peer.remark))
    return rows


def _row(
    model: str,
    n: int,
    package: str,
    seconds: list[float],
    own: float,
    difference: list[float] | None,
    remark: str = "",
) -> dict[str, object]:
    median = statistics.median(seconds)
    row: dict[str, object] = {"model": model, "n": n, "package": package, "remark": remark}
    row |= {"seconds": f"{median:.4f}", "slowest_s": f"{max(seconds):.4f}", "ratio": f"{median / own:.1f}"}
    if difference is not None:
        row |= {"rate_difference": f"{difference[0]:.1e}", "variance_difference": f"{difference[1]:.1e}"}
    return row


def table(rows: list[dict[str, object]], peers: list[str]) -> Iterator[list[object]]:
    """Own time and memory, and how many times as long the other packages took: one row for each task."""
    for task in dict.fromkeys((row["model"], row["n"]) for row in rows):
        of = {row["package"]: row for row in rows if (row["model"], row["n"]) == task}
        own = of["soilmoist_ros"]
        yield [*task, own["seconds"], own["memory_mb"], *(of.get(peer, {}).get("ratio", "") for peer in peers)]


# -- growth -------------------------------------------------------------------------------------------------


def _growth_child(samples: int, cells: int, connection: object) -> None:
    rng = np.random.default_rng(1)
    side = 6.0 * np.sqrt(samples)
    line = np.arange(samples) * 6.0
    xy = np.column_stack([line % side, line // side * 6.0]) + rng.normal(0, 0.3, (samples, 2))
    rate = 4 + 0.5 * np.sin(xy[:, 0] / 40) * np.cos(xy[:, 1] / 50)
    driven = Samples(xy, rng.poisson(rate * 10.0), np.full(samples, 10.0))
    corners = np.array([[0, 0], [side, 0], [side, side], [0, side]])
    grid = FieldGrid.from_polygon(corners, side / np.sqrt(cells))
    start = time.process_time()
    soil_map = make_soil_map(driven, grid, Variogram("matern32", 0.01, 30.0, 0.3))
    seconds = time.process_time() - start
    kriging = "exact" if not soil_map.pooling else f"{len(soil_map.kriging.places):,} pools"
    row = (f"{samples:,}", f"{cells:,}", f"{seconds:.2f}", f"{_peak_mb():.0f}", kriging)
    connection.send(row)  # type: ignore[attr-defined]


def growth(quick: bool, save: bool) -> None:
    """Time and memory of maps by their samples and cells."""
    samples, cells = (10**2, 10**3, 10**4, 10**5)[: 2 if quick else 4], (10**4, 10**5, 10**6)[: 1 if quick else 3]
    cases = [*((n, 10_000) for n in samples), *((samples[-1], g) for g in cells[1:])]
    rows = [in_fresh_process(_growth_child, *case) for case in cases]
    columns = ("samples", "cells", "kriging [s]", "peak memory [MB]", "kriging")
    results.publish("growth", columns, rows, "samples every 6 m, Matérn 3/2, processor time", save)


def main() -> int:
    parser = results.parser(__doc__)
    parser.add_argument("part", nargs="?", choices=("growth",), help="instead of the comparison")
    parser.add_argument("--quick", action="store_true", help="a tenth of the cells, up to 300 samples, once each")
    parser.add_argument("--repeats", type=int, default=3, help="runs of each; the median counts (default 3)")
    parser.add_argument("--models", nargs="+", default=["gaussian", "exponential", "spherical", "matern32"])
    parser.add_argument("--sizes", type=int, nargs="+", help="numbers of samples (default 72 300 1000)")
    parser.add_argument("--packages", nargs="+", help="compare with these only (names as in the table)")
    arguments = parser.parse_args()
    cells, sizes, repeats = 70_000, (72, 300, 1000), max(1, arguments.repeats)
    if arguments.quick:
        cells, sizes, repeats = 7_000, (72, 300), 1
    sizes = arguments.sizes or sizes
    if arguments.part == "growth":
        growth(arguments.quick, arguments.save)
        return 0
    if importlib.util.find_spec("threadpoolctl") is not None:
        from threadpoolctl import threadpool_limits

        threadpool_limits(1)
    rows: list[dict[str, object]] = []
    for model in arguments.models:
        for n in sizes:
            for row in compare(model, n, cells, repeats, arguments.packages):
                rows.append(row)
                print(
                    "  ".join(f"{row.get(column, '')!s:>13}" for column in [*COLUMNS, *EXTRA_COLUMNS]), flush=True
                )
    compared = {str(row["package"]) for row in rows if "seconds" in row}
    peers = [peer.distribution for peer in PEERS if peer.distribution in compared]
    versions = ", ".join(f"{name} {importlib.metadata.version(name)}" for name in ("numpy", "scipy", *peers))
    results.publish(
        "mapping",
        ("model", "samples", "time [s]", "memory [MB]", *(f"{peer} takes" for peer in peers)),
        table(rows, peers),
        f"{cells:,} cells, fixed covariance parameters, one thread, median processor time of {repeats} runs; "
        f"the others: times as long; {versions}",
        arguments.save,
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())

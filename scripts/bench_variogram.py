# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Time of fitting a variogram to samples at random places, on one thread, in milliseconds of processor time.

* restricted maximum likelihood (REML) with one range for all directions
* REML with the search for a direction
* REML with the search for a direction, for samples with a footprint
* REML with the search for a direction and the test of a variance that differs from place to place
* the published soft-L1 fit of the binned semivariogram

usage: .venv/bin/python scripts/bench_variogram.py [--sizes 72 300 1000] [--repeats 5] [--model matern32]
       [--save]
"""

from __future__ import annotations

import os

for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[variable] = "1"

import statistics
import time
from collections.abc import Callable

import numpy as np
import results
from scipy.spatial.distance import cdist

from soilmoist_ros.mapping import Variogram
from soilmoist_ros.mapping.samples import footprint_spread
from soilmoist_ros.mapping.variogram.fit import estimate_variogram
from soilmoist_ros.mapping.variogram.model import BUILT_IN

SIDE_M = 280.0
BOX = (0.0, 0.0), (SIDE_M, SIDE_M)
SPREAD = footprint_spread(radius_m=10.0)
TRUTH = Variogram("matern32", nugget=0.02, range_m=45.0, sill=0.35)


def survey(n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Positions, counts and exposures of a survey of a random field."""
    rng = np.random.default_rng(n)
    xy = rng.uniform(0, SIDE_M, (n, 2))
    rate = 4 + np.linalg.cholesky(TRUTH.covariance(cdist(xy, xy))) @ rng.standard_normal(n)
    exposure_s = rng.choice([60.0, 120.0, 300.0], n)
    return xy, rng.poisson(np.maximum(rate, 0.1) * exposure_s), exposure_s


def median_ms(work: Callable[[], object], repeats: int) -> float:
    work()
    times = []
    for _ in range(repeats):
        start = time.process_time()
        work()
        times.append(time.process_time() - start)
    return 1000 * statistics.median(times)


def main() -> None:
    parser = results.parser(__doc__)
    parser.add_argument("--sizes", type=int, nargs="+", default=[72, 300, 1000], help="numbers of places")
    parser.add_argument("--repeats", type=int, default=5, help="number of runs; the median counts")
    parser.add_argument("--model", default="matern32", choices=[*BUILT_IN])
    arguments = parser.parse_args()
    columns = ("one range", "directions", "footprints", "local", "soft_l1")
    rows = []
    for n in arguments.sizes:
        data = survey(n)
        fits: list[Callable[[], object]] = [
            lambda data=data: estimate_variogram(*data, arguments.model, anisotropy=False, extent_m=SIDE_M),
            lambda data=data: estimate_variogram(*data, arguments.model, extent_m=SIDE_M),
            lambda data=data: estimate_variogram(*data, arguments.model, extent_m=SIDE_M, spread=SPREAD),
            lambda data=data: estimate_variogram(*data, arguments.model, extent_m=SIDE_M, box=BOX),
            lambda data=data: estimate_variogram(*data, arguments.model, "soft_l1"),
        ]
        rows.append([str(n), *(f"{median_ms(fit, arguments.repeats):.1f}" for fit in fits)])
    settings = f"{arguments.model}, processor time [ms], medians of {arguments.repeats} runs, one thread"
    results.publish("variogram", ("places", *columns), rows, settings, arguments.save)


if __name__ == "__main__":
    main()

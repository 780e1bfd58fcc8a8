# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What earlier surveys and covariates are worth: errors of maps with them, divided by those of maps without.

Random fields of 60 m x 50 m with a mean rate of 3 counts/s, of which a part persists from survey to survey.
Earlier surveys have 100 random places of 70 s: what a robot counts in two hours. The survey itself has stops on a
lattice: as many as there is time for after 8 min, 30 min and 2 h with 12 s of overhead. All parameters are
estimated from the counts. No robot drives; missions are compared by campaigns.

With --speed: time of one update on line with 30 earlier surveys and 3,000 cells, and of the fits in between.

usage: .venv/bin/python scripts/bench_knowledge.py [--seeds 40] [--range-m 30] [--cases one four]
       [--speed] [--save]
"""

from __future__ import annotations

import os

for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[variable] = "1"

import statistics
import time
from dataclasses import dataclass

import numpy as np
import results
from numpy.typing import NDArray
from scipy.spatial.distance import cdist

from soilmoist_ros.foundation import DAY_S
from soilmoist_ros.mapping import FieldGrid, FieldMap, FieldMapSettings, Samples, Variogram
from soilmoist_ros.mapping.covariates import Covariates
from soilmoist_ros.mapping.knowledge import NOTHING, EarlierSurvey, Knowledge
from soilmoist_ros.sensing.records import CountRecord

Array = NDArray[np.float64]

EAST_M, NORTH_M = 60.0, 50.0
OUTLINE = [(0, 0), (EAST_M, 0), (EAST_M, NORTH_M), (0, NORTH_M)]
GRID = FieldGrid.from_polygon(OUTLINE, cell_m=2.5)
MEAN_CPS, VARIATION = 3.0, 0.15
MEAN_SD = 0.1
"""Variation of the mean rate from survey to survey."""
EARLIER_SAMPLES, EARLIER_S = 100, 70.0
STAGES = {"8 min": (8, 40.0), "30 min": (28, 44.0), "2 h": (90, 60.0)}
"""Number of stops, and the dwell at each [s]."""
SETTINGS = FieldMapSettings(local="off")


@dataclass(frozen=True)
class Case:
    """What is known.

    :param earlier: number of earlier surveys
    :param persistence: correlation of the patterns of two surveys
    :param odd: number of an earlier survey of another field, maybe
    :param related: correlation of a covariate with the rate; 0 for none
    :param useless: number of covariates without effect
    """

    earlier: int = 0
    persistence: float = 0.9
    odd: int | None = None
    related: float = 0.0
    useless: int = 0


CASES = {
    "one": Case(1),
    "four": Case(4),
    "unrelated": Case(1, persistence=0.0),
    "four, unrelated": Case(4, persistence=0.0),
    "four, the first odd": Case(4, odd=0),
    "half": Case(1, persistence=0.5),
    "covariate": Case(related=0.7),
    "useless": Case(useless=5),
    "covariate, four useless": Case(related=0.7, useless=4),
    "one, covariate": Case(1, related=0.7),
}


def lattice(count: int, rng: np.random.Generator) -> Array:
    """Stops of a lattice."""
    columns = max(1, round(np.sqrt(count * EAST_M / NORTH_M)))
    rows = max(1, round(count / columns))
    x, y = np.meshgrid((np.arange(columns) + 0.5) / columns * EAST_M, (np.arange(rows) + 0.5) / rows * NORTH_M)
    return np.column_stack([x.ravel(), y.ravel()]) + rng.normal(0, 0.5, (x.size, 2))


def draw(case: Case, range_m: float, seed: int) -> tuple[Array, Knowledge, dict[str, Samples]]:
    """True rate in the cells, what is known, and the samples of the survey at each stage."""
    rng = np.random.default_rng(seed)
    before = [rng.uniform(0, (EAST_M, NORTH_M), (EARLIER_SAMPLES, 2)) for _ in range(case.earlier)]
    sets = [GRID.cells, *before, *(lattice(count, rng) for count, _ in STAGES.values())]
    xy, parts = (
        np.concatenate(sets),
        np.split(np.arange(sum(map(len, sets))), np.cumsum(list(map(len, sets)))[:-1]),
    )
    variogram = Variogram("matern32", 0.0, range_m, 1.0)
    practical = Variogram("matern32", 0.0, range_m**2 / variogram.practical_range_m, 1.0)
    factor = np.linalg.cholesky(practical.correlation(cdist(xy, xy)) + 1e-9 * np.eye(len(xy)))

    def pattern() -> Array:
        drawn: Array = factor @ rng.standard_normal(len(xy))
        return drawn

    def counted(rate: Array, part: NDArray[np.intp], dwell_s: float) -> Samples:
        expected = np.maximum(rate[part], 0.1) * dwell_s
        return Samples(xy[part], rng.poisson(expected), np.full(len(part), dwell_s))

    persistent, covariate, share = pattern(), pattern(), case.persistence
    rates = []
    for number in range(case.earlier + 1):
        one = np.sqrt(share) * persistent + np.sqrt(1 - share) * pattern() if number != case.odd else pattern()
        one = case.related * covariate + np.sqrt(1 - case.related**2) * one
        rates.append(MEAN_CPS * (1 + VARIATION * one))
    means = rng.normal(0, MEAN_SD * MEAN_CPS, case.earlier)
    earlier = tuple(
        EarlierSurvey(
            f"week {number}", 7 * DAY_S * number, counted(rates[number] + means[number], part, EARLIER_S)
        )
        for number, part in enumerate(parts[1 : case.earlier + 1])
    )
    layers = [covariate] * (case.related > 0) + [pattern() for _ in range(case.useless)]
    rasters = np.full((len(layers), *GRID.shape), np.nan)
    rasters[:, GRID.mask] = [layer[parts[0]] for layer in layers] if layers else np.empty((0, len(GRID.cells)))
    covariates = Covariates.over(GRID, [f"covariate {n}" for n in range(len(layers))], rasters) if layers else None
    survey = {
        stage: counted(rates[-1], part, dwell_s)
        for (stage, (_, dwell_s)), part in zip(STAGES.items(), parts[case.earlier + 1 :], strict=True)
    }
    return rates[-1][parts[0]], Knowledge(earlier, covariates), survey


def score(samples: Samples, knowledge: Knowledge, truth: Array) -> tuple[float, float]:
    """Mean squared error of a map, and the share of cells whose truth is in the 95 % interval."""
    field_map = FieldMap(GRID, SETTINGS, knowledge)
    field_map.set_samples(samples)
    field_map.update()
    error = field_map.rate - truth
    return float(np.mean(error**2)), float(np.mean(np.abs(error) < 1.96 * np.sqrt(field_map.variance)))


def ratio(with_it: Array, without: Array) -> str:
    """Ratio of means over paired seeds, and its standard error by the delta method."""
    quotient = with_it.mean() / without.mean()
    error = (with_it - quotient * without).std(ddof=1) / np.sqrt(len(without)) / without.mean()
    return f"{quotient:.2f} ± {error:.2f}"


def errors(name: str, seeds: int, range_m: float) -> list[str]:
    """Row of the table of errors."""
    found: dict[str, list[tuple[float, float, float]]] = {stage: [] for stage in STAGES}
    for seed in range(seeds):
        truth, knowledge, survey = draw(CASES[name], range_m, seed)
        for stage, samples in survey.items():
            alone, _ = score(samples, NOTHING, truth)
            found[stage].append((alone, *score(samples, knowledge, truth)))
    cells = []
    for values in found.values():
        alone, known, within = np.array(values).T
        cells.append(f"{ratio(known, alone)}, {100 * within.mean():.0f} %")
    return [name, *cells]


def speed(save: bool, surveys: int = 30, cell_m: float = 1.0) -> None:
    """Times of updates on line."""
    _, knowledge, survey = draw(Case(surveys), 30.0, 0)
    field_map = FieldMap(FieldGrid.from_polygon(OUTLINE, cell_m), SETTINGS, knowledge)
    samples = survey["2 h"]
    updates: list[float] = []
    refits: list[float] = []
    for number, ((x_m, y_m), counts) in enumerate(zip(samples.xy.tolist(), samples.counts.tolist(), strict=True)):
        before = field_map.soil_map
        field_map.add(CountRecord(1e9 + 60.0 * number, x_m, y_m, 0.0, int(counts), 60.0, 60.0))
        start = time.process_time()
        field_map.update()
        taken = 1000 * (time.process_time() - start)
        now = field_map.soil_map
        same = before is not None and now is not None and before.variogram == now.variogram
        (updates if same else refits).append(taken)
    rows = [
        ("update on line, median", f"{statistics.median(updates):.0f}"),
        ("update on line, slowest", f"{max(updates):.0f}"),
        (f"update with a fit to all surveys: {len(refits)} of {len(samples)}, slowest", f"{max(refits):.0f}"),
    ]
    settings = f"{surveys} earlier surveys, {len(field_map.grid.cells)} cells, up to {len(samples)} samples"
    results.publish("knowledge_speed", ("what", "processor time [ms]"), rows, settings, save)


def main() -> None:
    options = results.parser(__doc__)
    options.add_argument("--seeds", type=int, default=40, help="number of random fields")
    options.add_argument("--range-m", type=float, default=30.0, help="practical range of the fields [m]")
    options.add_argument("--cases", nargs="+", choices=list(CASES), default=list(CASES), help="what is known")
    options.add_argument("--speed", action="store_true", help="times instead of errors")
    given = options.parse_args()
    if given.speed:
        speed(given.save)
        return
    rows = [errors(name, given.seeds, given.range_m) for name in given.cases]
    settings = (
        f"practical range {given.range_m:g} m, {given.seeds} seeds; error / that with nothing known, and share of "
        "the cells in the 95 % interval"
    )
    results.publish("knowledge", ("known", *STAGES), rows, settings, given.save)


if __name__ == "__main__":
    main()

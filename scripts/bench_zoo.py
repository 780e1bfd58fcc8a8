#!/usr/bin/env python3
# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Defaults that may change a map, on against off, over fields that the project did not make.

usage: .venv/bin/python scripts/bench_zoo.py --surfaces FOLDER [--comparisons drift local] [--fields NAME ...]
       [--seeds 4] [--jobs 1] [--raw FILE.csv] [--save] [--decide]

A surface is a file of the folder: CSV with the columns x, y and value, of points or of a grid. One rule makes a
field of each, without a choice: the box of the points is stretched to 60 x 50 m (every third surface by name:
160 x 120 m), values within one square metre are averaged, gaps are interpolated linearly, and the values are
scaled linearly to 2.5 to 5.5 counts/s. Two surfaces of matplotlib and the project's own fields are always there.

Each mission is repeated with the default off, on the same field with the same seed. The ratio of the squared
errors is that of their means over the missions of a field, and the table has the mean over the fields. ``--raw``
keeps each mission at once: an interrupted run resumes from it, further fields, seeds and comparisons join it, and
the tables are of all its missions. A new version of the code needs a new file.

``--decide`` compares ``gcb`` for a threshold at the 30 % quantile of the truth with ``gcb`` and ``two_pass`` for
the map, in equal time. The loss of a cell in the wrong zone is the distance of its true rate from the threshold.
"""

from __future__ import annotations

import os

for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[variable] = "1"

import csv
import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
import results
from numpy.typing import NDArray

from soilmoist_ros.exploration import sample_from_text
from soilmoist_ros.exploration.planning.sealed_sample import drawn
from soilmoist_ros.mapping import Knowledge, expected_counts
from soilmoist_ros.mapping.field import Field
from soilmoist_ros.mapping.field_map import FieldMap, FieldMapSettings
from soilmoist_ros.mapping.variogram import reml
from soilmoist_ros.pipeline import map_certificate
from soilmoist_ros.simulation.fields.catalogue import DATUM
from soilmoist_ros.simulation.fields.formulas import random_field
from soilmoist_ros.simulation.fields.surrogate_field import RateGrid, SurrogateField
from soilmoist_ros.simulation.mission.mission_result import MissionResult
from soilmoist_ros.simulation.mission.settings import MissionSettings
from soilmoist_ros.simulation.mission.simulator import simulate_mission

Array = NDArray[np.float64]
Values = Mapping[str, Any]
Rows = dict[tuple[str, str, str, str], list[str]]
"""Rows of missions by field, kind, seed and arm."""

MISSIONS: Mapping[str, Values] = {
    "gcb": {"strategy": "gcb", "dwell": "optimal"},
    "two_pass": {"strategy": "two_pass", "dwell": "optimal"},
    "lattice 10 s": {"strategy": "lattice", "dwell": "fmi:10"},
    "lattice 60 s": {"strategy": "lattice", "dwell": "fmi:60"},
}
LOW_CPS, HIGH_CPS = 2.5, 5.5
SIZES_M = ((60, 50), (60, 50), (160, 120))
"""Sizes of the fields in turn, by the names of their surfaces."""
LARGE_M = 1000.0
OWN = ("patches", "rough", "smooth", "ridge", "strips", "synthetic-high", "synthetic-low")
"""Fields of the project; what is random in them is drawn from the seed."""
MATPLOTLIB = {
    "jacksboro-elevation": ("jacksboro_fault_dem.npz", "elevation"),
    "topobathy": ("topobathy.npz", "topo"),
}
FOOTPRINT_M = 10.0
WORST = 1.3
"""Ratio of squared errors that no single mission should exceed."""


def mapped_with(footprint_m: float) -> AbstractContextManager[Any]:
    """Maps take this for the radius of the footprint [m]; 0 maps the counts as they are."""
    made = FieldMap.__init__

    def init(self: FieldMap, grid: Any, settings: FieldMapSettings, *args: Any) -> None:
        made(self, grid, replace(settings, footprint_radius_m=footprint_m), *args)

    return mock.patch.object(FieldMap, "__init__", init)


CHANGES: Mapping[str, Callable[[], AbstractContextManager[Any]]] = {
    "none": nullcontext,
    "no tests of counts": lambda: mock.patch.object(expected_counts, "MAX_PROBABILITY", 0.0),
    "isotropic": lambda: mock.patch.object(reml, "MIN_ANISOTROPIC", 10**9),
    "not de-convolved": lambda: mapped_with(0.0),
    "de-convolved": lambda: mapped_with(FOOTPRINT_M),
}
"""Changes that no setting makes, by the value of ``change``."""


@dataclass(frozen=True)
class Comparison:
    """A default, on and off.

    :param about: row of the table
    :param on: settings with it
    :param off: settings without it; ``change`` is one of :data:`CHANGES`
    :param applies: whether the field has what the default is for: then it should help
    :param fired: column that counts how often it changed the map
    """

    about: str
    on: Values
    off: Values
    applies: bool = False
    fired: str = ""


DRYING: Values = {"drift": 0.1}
STILL: Values = {"drift_model": "off"}
"""The other defaults are compared without the drift model: an error of one hides none of the others."""
MEANS: Values = {**STILL, "footprint_m": FOOTPRINT_M}
SERIES: Values = {**STILL, "earlier_surveys": 3}
RAIN: Values = {"drift": -0.1, "drift_hour": 1.0}
COMPARISONS = {
    "drift": Comparison("drift model, no drift", {}, STILL, fired="drifts"),
    "drying": Comparison("drift model, drying by 10 %", DRYING, {**DRYING, **STILL}, True, "drifts"),
    "rain": Comparison("drift model, rain of 10 %", RAIN, {**RAIN, **STILL}, True, "drifts"),
    "anisotropy": Comparison("anisotropy", STILL, {**STILL, "change": "isotropic"}, fired="anisotropic"),
    "tests": Comparison("tests of counts", STILL, {**STILL, "change": "no tests of counts"}, fired="held"),
    "earlier-unrelated": Comparison("3 earlier surveys, unrelated", {**SERIES, "persistence": 0.0}, STILL),
    "earlier": Comparison("3 earlier surveys, correlation 0.9", SERIES, STILL, True),
    "covariates-unrelated": Comparison("2 covariates, unrelated", {**STILL, "useless_covariates": 2}, STILL),
    "covariates": Comparison("covariate, correlation 0.8", {**STILL, "covariate_correlation": 0.8}, STILL, True),
    "certificate": Comparison("certificate of 12 places", {"certify": 12}, {}),
    "footprint": Comparison(
        "de-convolution, footprint of 10 m", MEANS, {**MEANS, "change": "not de-convolved"}, True
    ),
    "footprint-wrong": Comparison("de-convolution, point sensor", {**STILL, "change": "de-convolved"}, STILL),
}
KEY, FIRED = ("field", "mission", "seed", "arm"), ("drifts", "jumps", "anisotropic", "held")
REDRAWN = ("mean covered", "bound of error held", "of map with sample", "half width", "bound", "rmse", "kurtosis")
"""Certificate of a mission, its sample and counts drawn 200 times over the same map, which knows none of them:
shares of the draws, rates as shares of the mean, and kurtosis of the errors of the map."""
DRAWS = 200
COLUMNS = (*KEY, "mse", "coverage95", *FIRED, *REDRAWN, "loss", "wrong", "distance_m")
QUANTILE = 0.3
"""Quantile of the truth at which the threshold of a decision lies."""
DECISIONS = (("gcb", {"target": "decision"}), ("gcb", {}), ("two_pass", {}))
"""Missions and settings of ``--decide``; the first is compared with the others."""


def arm(settings: Values) -> str:
    """Settings of an arm in the file of missions; empty for the defaults."""
    return json.dumps(settings, sort_keys=True) if settings else ""


@dataclass(frozen=True)
class Job:
    """One mission.

    :param field: name of the field
    :param mission: one of :data:`MISSIONS`
    :param arm: settings beyond those, as JSON
    :param surfaces: folder of surfaces
    """

    field: str
    mission: str
    seed: int
    arm: str = ""
    surfaces: Path | None = None

    @property
    def key(self) -> tuple[str, str, str, str]:
        """First columns of its row."""
        return self.field, self.mission, str(self.seed), self.arm

    def row(self) -> list[str]:
        """Simulate the mission."""
        values = dict(json.loads(self.arm or "{}"))
        change = CHANGES[values.pop("change", "none")]
        ground, threshold = zoo_field(self.field, self.surfaces), math.nan
        if not isinstance(ground, str):
            threshold = float(np.quantile(ground.rate_at(ground.field.grid().cells), QUANTILE))
        if values.get("target") == "decision":
            values["threshold"] = repr(threshold)
        settings = MissionSettings(
            field=ground,
            random_field=isinstance(ground, str),
            cell_m=None if isinstance(ground, str) else ground.field.cell_m,
            seed=self.seed,
            series_every_s=1e9,
            **{**MISSIONS[self.mission], **values},
        )
        with change():
            result = simulate_mission(settings)
        soil_map, last = result.soil_map, result.series[-1]
        assert soil_map is not None
        assert soil_map.fit is not None
        found, fit = soil_map.change, soil_map.fit
        fired = (
            found.drift is not None,
            found.jump is not None and found.jump.is_certain,
            fit.variogram.anisotropy > 1,
            sum(bool(record.quarantine) for record in result.records),
        )
        stated = redrawn(result) if result.certificate else [""] * len(REDRAWN)
        truth, rate = (raster[soil_map.grid.mask] for raster in (result.truth_rate, soil_map.rate))
        wrong = (truth < threshold) != (rate < threshold)
        loss = float((np.abs(truth - threshold) * wrong).mean())
        decided = f"{loss:.6g}", f"{wrong.mean():.5f}", f"{last.distance_m:.0f}"
        fires = (str(int(one)) for one in fired)
        return [*self.key, f"{last.mse:.6g}", f"{last.coverage95:.4f}", *fires, *stated, *decided]


def redrawn(result: MissionResult) -> list[str]:
    """Values of :data:`REDRAWN` for a mission; each place is counted at for as long as those of its sample."""
    soil_map, sample = result.soil_map, sample_from_text(result.certificate)
    assert soil_map is not None
    grid, choices = soil_map.grid, FieldMapSettings.chosen(result.settings)
    others = map_certificate._without_sample(result.records, result.visits, sample, stops_only=False)
    alone = map_certificate._map(others, grid, choices, Knowledge())
    assert alone is not None
    p, truth = alone.rate[grid.mask], result.truth_rate[grid.mask]
    error, rng = truth - p, np.random.default_rng(result.settings.seed)
    counted_s = [visit.effective_exposure_s for visit in result.visits if visit.name in sample.names]
    exposure_s = np.full(len(sample.cells), np.median(counted_s))
    found = []
    for _ in range(DRAWS):
        at = drawn(grid.mask, len(exposure_s), int(rng.integers(2**53)))
        made = map_certificate.state(p, at, rng.poisson(truth[at] * exposure_s).astype(float), exposure_s)
        bound = np.inf if made.rmse_below is None else made.rmse_below
        held = bound**2 >= np.mean(error**2), bound**2 >= result.series[-1].mse
        found.append((abs(made.mean - truth.mean()) <= made.half_width, *held, made.half_width, bound))
    values = np.mean(found, axis=0) / [1, 1, 1, truth.mean(), truth.mean()]
    rmse = np.sqrt(np.mean(error**2))
    return [f"{one:.5g}" for one in (*values, rmse / truth.mean(), np.mean(error**4) / rmse**4)]


def real_surfaces(folder: Path | None) -> list[str]:
    """Names of the surfaces that the project did not make."""
    found = set() if folder is None else {path.stem for path in folder.glob("*.csv")}
    return sorted(found | set(MATPLOTLIB))


def zoo_field(name: str, folder: Path | None = None) -> SurrogateField | str:
    """A field of the zoo: made of a surface, or the name of one of the project's."""
    if name in OWN:
        return name
    if name == "100 ha":
        x_m = np.arange(-20.0, LARGE_M + 21.0, 10.0)
        noise = random_field(x_m, x_m, "matern32", 100.0, np.random.default_rng(1))
        return _field(name, RateGrid(x_m, x_m, 4.0 + 0.5 * noise), (LARGE_M, LARGE_M), 20.0)
    size_m = SIZES_M[real_surfaces(folder).index(name) % len(SIZES_M)]
    truth = surface_rate(*_points(name, folder), size_m)
    return _field(name, truth, size_m, max(size_m) / 60)


def _field(name: str, truth: RateGrid, size_m: tuple[float, float], cell_m: float) -> SurrogateField:
    width_m, height_m = size_m
    corners = np.array([(0.0, 0.0), (width_m, 0.0), (width_m, height_m), (0.0, height_m)])
    return SurrogateField(name, name, Field(name, DATUM, corners, cell_m=cell_m), truth)


def _points(name: str, folder: Path | None) -> tuple[Array, Array]:
    """Positions and values of a surface."""
    path = None if folder is None else folder / f"{name}.csv"
    if path is not None and path.exists():
        table = np.genfromtxt(path, delimiter=",", names=True)
        return np.column_stack([table["x"], table["y"]]), table["value"]
    import matplotlib

    file, key = MATPLOTLIB[name]
    values = np.load(Path(matplotlib.get_data_path(), "sample_data", file))[key]
    rows, columns = np.indices(values.shape)
    return np.column_stack([columns.ravel(), -rows.ravel()]).astype(float), values.ravel().astype(float)


def surface_rate(xy: Array, values: Array, size_m: tuple[float, float]) -> RateGrid:
    """Rate of a field made of a surface, by the rule of the zoo.

    :param xy: positions in any unit, shape (n, 2)
    :param values: values in any unit, shape (n,)
    :param size_m: width and height of the field, whole numbers [m]
    """
    from scipy.interpolate import griddata

    known = np.isfinite(values)
    xy, values = xy[known], values[known]
    nodes = np.array(size_m, int)
    index = np.round((xy - xy.min(axis=0)) / np.ptp(xy, axis=0) * nodes).astype(int)
    of_node, inverse = np.unique(index, axis=0, return_inverse=True)
    mean = np.bincount(inverse.ravel(), values) / np.bincount(inverse.ravel())
    x_m, y_m = (np.arange(count + 1.0) for count in nodes)
    everywhere = np.stack(np.meshgrid(x_m, y_m), axis=-1)
    rate = griddata(of_node, mean, everywhere)
    rate = np.where(np.isnan(rate), griddata(of_node, mean, everywhere, "nearest"), rate)
    rate = LOW_CPS + (HIGH_CPS - LOW_CPS) * (rate - rate.min()) / np.ptp(rate)
    return RateGrid(x_m, y_m, rate)


def _key(row: Sequence[str]) -> tuple[str, str, str, str]:
    field, mission, seed, arm = row[: len(KEY)]
    return field, mission, seed, arm


def run(jobs: Iterable[Job], raw: Path, workers: int) -> Rows:
    """Rows of missions by their keys; those in the file are not simulated again."""
    done: Rows = {}
    raw.parent.mkdir(parents=True, exist_ok=True)
    if raw.exists():
        with raw.open(encoding="utf-8", newline="") as stream:
            done = {_key(row): row for row in list(csv.reader(stream))[1:]}
    missing = list({job.key: job for job in jobs if job.key not in done}.values())
    with raw.open("a", encoding="utf-8", newline="") as stream, ProcessPoolExecutor(workers) as pool:
        writer = csv.writer(stream, lineterminator="\n")
        if not done:
            writer.writerow(COLUMNS)
        for row in pool.map(Job.row, missing):
            done[_key(row)] = row
            writer.writerow(row)
            stream.flush()
    return done


@dataclass(frozen=True)
class Score:
    """Missions with a default and without, in pairs of one field, kind and seed.

    :param fields: field of each pair
    :param on: squared error with the default [(counts/s)^2]
    :param off: squared error without it [(counts/s)^2]
    :param coverage: share of the cells in the 95 % interval with it
    :param fired: whether it changed the map; NaN if that is not known
    """

    fields: NDArray[np.str_]
    on: Array
    off: Array
    coverage: Array
    fired: NDArray[Any]

    @classmethod
    def of(cls, comparison: Comparison, done: Rows) -> Score:
        """Figures of a comparison from all missions that have a partner."""
        on, off = arm(comparison.on), arm(comparison.off)
        keys = [key for key in done if key[3] == on and (*key[:3], off) in done]

        def column(name: str, of: str = on) -> Array:
            return np.array([float(done[*key[:3], of][COLUMNS.index(name)]) for key in keys])

        fired = column(comparison.fired) > 0 if comparison.fired else np.full(len(keys), np.nan)
        return cls(
            np.array([key[0] for key in keys]), column("mse"), column("mse", off), column("coverage95"), fired
        )

    def by_field(self, quantity: Callable[[Array, Array, Array], Any]) -> dict[str, float]:
        """A quantity of the errors with it and without and the coverage of each field."""
        parts = ((str(name), self.fields == name) for name in np.unique(self.fields))
        return {name: float(quantity(self.on[own], self.off[own], self.coverage[own])) for name, own in parts}

    @property
    def ratios(self) -> dict[str, float]:
        """Ratio of the mean squared errors of each field."""
        return self.by_field(lambda on, off, coverage: on.mean() / off.mean())

    @property
    def worst(self) -> float:
        """Greatest ratio of one mission."""
        return float((self.on / self.off).max())

    def row(self, about: str) -> tuple[str, ...]:
        """Row of the table."""
        fired = "" if np.isnan(self.fired).any() else f"{self.fired.mean():.0%}"
        return (
            about,
            str(len(self.on)),
            f"{np.mean(list(self.ratios.values())):.3f}",
            f"{self.worst:.2f}",
            str(np.count_nonzero(self.on / self.off > WORST)),
            f"{self.coverage.mean():.1%}",
            f"{min(self.by_field(lambda on, off, coverage: coverage.mean()).values()):.1%}",
            fired,
        )


def decisions(done: Rows) -> list[tuple[str, ...]]:
    """Missions for a decision against those for the map, by field, and the means with their standard errors."""
    names = [(mission, arm(values)) for mission, values in DECISIONS]
    fields, seeds = (sorted({key[at] for key in done}) for at in (0, 2))

    def mean(field: str, of: tuple[str, str], column: str) -> float:
        every = [float(done[field, of[0], seed, of[1]][COLUMNS.index(column)]) for seed in seeds]
        return float(np.mean(every))

    against = [("loss", names[1]), ("loss", names[2]), ("wrong", names[1]), ("mse", names[1])]
    ratios = np.array(
        [[mean(one, names[0], column) / mean(one, of, column) for column, of in against] for one in fields]
    )
    errors = ratios.std(axis=0, ddof=1) / math.sqrt(len(fields)) if len(fields) > 1 else ratios[0] * math.nan
    return [
        *((one, *(f"{value:.2f}" for value in own)) for one, own in zip(fields, ratios, strict=True)),
        ("mean", *(f"{value:.2f} ± {sd:.2f}" for value, sd in zip(ratios.mean(axis=0), errors, strict=True))),
    ]


def main() -> None:
    """Print a table of the comparisons, and one of the fields."""
    options = results.parser(__doc__)
    options.add_argument("--surfaces", type=Path, help="folder with surfaces as CSV: x, y, value")
    options.add_argument("--comparisons", nargs="*", choices=list(COMPARISONS), default=list(COMPARISONS))
    options.add_argument("--fields", nargs="+", help="names of fields instead of all")
    usual = [name for name in MISSIONS if name != "two_pass"]
    options.add_argument("--missions", nargs="+", choices=list(MISSIONS), default=usual)
    options.add_argument("--decide", action="store_true", help="missions for a decision instead")
    options.add_argument("--seeds", type=int, default=4)
    options.add_argument("--jobs", type=int, default=1, help="number of processes")
    options.add_argument("--raw", type=Path, default=Path("bench/zoo.csv"), help="file that keeps the missions")
    given = options.parse_args()
    real = real_surfaces(given.surfaces)
    if given.decide:
        each = [(name, seed) for seed in range(1, given.seeds + 1) for name in given.fields or real]
        jobs = [
            Job(name, mission, seed, arm(values), given.surfaces)
            for name, seed in each
            for mission, values in DECISIONS
        ]
        rows = decisions(run(jobs, given.raw, given.jobs))
        columns = ("field", "loss by that of gcb", "loss by that of two_pass", "wrong area by that of gcb",
                   "squared error by that of gcb")  # fmt: skip
        about = (
            f"{len(rows) - 1} real surfaces, threshold at the {QUANTILE:.0%} quantile, 2 h, {given.seeds} seeds"
        )
        results.publish("decisions", columns, rows, about, given.save)
        return
    jobs = [
        Job(name, mission, seed, arm(settings), given.surfaces)
        for name in given.fields or [*real, *OWN, "100 ha"]
        for comparison in given.comparisons
        for settings in (COMPARISONS[comparison].on, COMPARISONS[comparison].off)
        for mission in given.missions
        for seed in range(1, given.seeds + 1)
    ]
    done = run(jobs, given.raw, given.jobs)
    arms = {key[3] for key in done}
    scores = {
        one.about: Score.of(one, done) for one in COMPARISONS.values() if {arm(one.on), arm(one.off)} <= arms
    }
    columns = (
        "default", "missions", "squared error by that without", "worst mission", f"missions above {WORST:g}",
        "95 % intervals cover", "in the worst field", "missions whose last map it changed",
    )  # fmt: skip
    rows = [found.row(about) for about, found in scores.items()]
    fields = sorted({key[0] for key in done}, key=lambda name: (name not in real, name))
    made_of = f"{len(fields)} fields, of which {len(set(fields) & set(real))} real surfaces"
    settings = f"{made_of}; {', '.join(MISSIONS)}; 2 h, up to {len({key[2] for key in done})} seeds"
    results.publish("zoo", columns, rows, settings, given.save)
    harmless = {one.about for one in COMPARISONS.values() if not one.applies}
    ratios = {about: found.ratios for about, found in scores.items() if about in harmless}
    rows = [(name, *(f"{of[name]:.3f}" if name in of else "" for of in ratios.values())) for name in fields]
    results.publish("zoo_fields", ("field", *ratios), rows, f"{settings}; ratios of squared errors", given.save)
    rows = certificates(done)
    if rows:
        ratios = np.array(list(Score.of(COMPARISONS["certificate"], done).ratios.values()))
        cost = f"{ratios.mean():.3f} ± {ratios.std(ddof=1) / np.sqrt(len(ratios)):.3f}"
        about = f"{made_of}; gcb, 2 h; {DRAWS} draws; squared error of the map by that without: {cost}"
        results.publish("certificate", ("field", "missions", *REDRAWN), rows, about, given.save)


def certificates(done: Rows) -> list[tuple[str, ...]]:
    """Certificates of ``gcb`` by field: the means over its missions; the bound of the error, the worst first."""
    arms, first = {arm(COMPARISONS["certificate"].on)}, COLUMNS.index(REDRAWN[0])
    found: dict[str, list[list[float]]] = {}
    for (name, mission, _, one), row in done.items():
        if one in arms and mission == "gcb":
            found.setdefault(name, []).append([float(cell) for cell in row[first : first + len(REDRAWN)]])
    means = {name: (len(rows), np.mean(rows, axis=0)) for name, rows in found.items()}
    ordered = sorted(means.items(), key=lambda item: float(item[1][1][1]))
    return [
        (name, str(count), *(f"{one:.1%}" for one in values[:-1]), f"{values[-1]:.1f}")
        for name, (count, values) in ordered
    ]


if __name__ == "__main__":
    main()

#!/usr/bin/env python3
# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Predictions at left-out places of a public roving survey: kriging with covariates against the random forest.

The data are the example of soil-moisture-prediction (see ``smp_forest.py``): 99 places of two days in 1.5 km by
1.5 km, with four predictors on grids of 200 and 250 m, and slope and aspect. Both methods get the same training
places, the same predictors, and for the second day what the first day counted (the forest as its past prediction).

The data are gravimetric moistures with errors, not counts. A moisture becomes a rate by the curve of Desilets et
al. (2010) with N0 = 1 and a bulk density of 1, as g/g has. Counts and exposure follow from the relative error of
the rate: 1/sqrt(counts) = |d ln(rate)/d(moisture)| sd, with the mean of the two errors as sd. Maps are converted
back the same way. Nothing is chosen by these folds: our settings are the defaults, the forest's its example's.

Folds: ``random`` leaves out a fifth of the places at random, ``blocked`` a fifth of squares of 375 m on both days.
The left-out moistures have errors. Our predictive distributions include them, the forest's where it says so.
"""

from __future__ import annotations

import csv
import json
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import results
from numpy.typing import NDArray
from smp_forest import run

from soilmoist_ros.foundation import DAY_S
from soilmoist_ros.foundation.geodesy import LocalFrame
from soilmoist_ros.mapping.covariates import Covariates, CovariateSource, read_covariates
from soilmoist_ros.mapping.field_map import FieldMap, FieldMapSettings
from soilmoist_ros.mapping.grid import FieldGrid
from soilmoist_ros.mapping.knowledge import EarlierSurvey, Knowledge
from soilmoist_ros.mapping.samples import Samples, as_samples

Array = NDArray[np.float64]

CELL_M = 25.0
FOLDS = 5
BLOCK_M = 375.0
FINE_M = 125.0
"""Resolution of the forest's grid in its second variant [m]; on finer ones it stops at gaps of a predictor."""
LEVELS = (np.arange(200) + 0.5) / 200
"""Quantiles that stand for a predictive distribution."""


@dataclass(frozen=True, eq=False)
class Survey:
    """The survey of both days.

    :param lines: lines of the data file
    :param utm: places, shape (n, 2) [m]
    :param day: day of each place
    :param moisture: shape (n,) [g/g]
    :param error: mean of the errors to both sides, shape (n,) [g/g]
    """

    lines: NDArray[np.str_]
    utm: Array
    day: NDArray[np.str_]
    moisture: Array
    error: Array

    @classmethod
    def read(cls, path: Path) -> Survey:
        """Read the data file."""
        lines = path.read_text().splitlines()[1:]
        rows = list(csv.reader(lines))
        values = np.array([[float(one) for one in (*row[:2], *row[3:])] for row in rows])
        error = np.abs(values[:, 3:]).mean(axis=1)
        return cls(np.array(lines), values[:, :2], np.array([row[2] for row in rows]), values[:, 2], error)

    def samples(self, wanted: NDArray[np.bool_], xy: Array) -> Samples:
        """Counts and exposures of some places."""
        rate = rate_of(self.moisture[wanted])
        counts = np.maximum(np.rint(relative_error(self.moisture[wanted], self.error[wanted]) ** -2.0), 1.0)
        return as_samples(xy[wanted], counts, counts / rate)


def rate_of(moisture: Array) -> Array:
    """Rate as a share of N0 (Desilets et al. 2010) [-]."""
    return np.asarray(0.0808 / (moisture + 0.115) + 0.372)


def moisture_of(rate: Array) -> Array:
    """The inverse of :func:`rate_of`, with rates kept in its range [g/g]."""
    return np.asarray(0.0808 / (np.clip(rate, 0.3721, 1.0746) - 0.372) - 0.115)


def relative_error(moisture: Array, error: Array) -> Array:
    """Relative error of the rate, from the error of the moisture."""
    return np.asarray(0.0808 / (moisture + 0.115) ** 2 / rate_of(moisture) * error)


def write_raster(path: Path, rows: Sequence[Sequence[float]], epsg: str, nodata: float | None) -> None:
    """A predictor, given as points on a grid, as a GeoTIFF."""
    import rasterio
    from rasterio.transform import Affine

    table = np.array(rows, float)
    x, column = np.unique(table[:, 0], return_inverse=True)
    y, row = np.unique(-table[:, 1], return_inverse=True)
    values = np.full((len(y), len(x)), np.nan)
    values[row, column] = np.where(table[:, 2] == nodata, np.nan, table[:, 2])
    step_x, step_y = (float(axis[-1] - axis[0]) / (len(axis) - 1) for axis in (x, y))
    place = Affine(step_x, 0, x[0] - step_x / 2, 0, -step_y, -y[0] + step_y / 2)
    about = {
        "driver": "GTiff",
        "width": len(x),
        "height": len(y),
        "count": 1,
        "dtype": "float64",
        "nodata": np.nan,
    }
    with rasterio.open(path, "w", crs=epsg, transform=place, **about) as file:
        file.write(values, 1)


def predictors(data: Path, folder: Path) -> dict[str, list[CovariateSource]]:
    """The predictors of the example as sources of covariates, by day."""
    settings = json.loads((data / "parameters.json").read_text())
    days = sorted(
        {row[2] for row in csv.reader((data / settings["soil_moisture_data"]).read_text().splitlines()[1:])}
    )
    sources: dict[str, list[CovariateSource]] = {day: [] for day in days}
    for name, about in settings["predictors"].items():
        lines = (data / about["file_path"]).read_text().splitlines()
        rows = list(csv.reader(line for line in lines if not line.startswith("#")))
        nodata = float(about["nan_value"]) if about["nan_value"] not in ("", "NaN") else None
        for day in days:
            of_day = [[float(one) for one in row[:3]] for row in rows if about["constant"] or row[-1] == day]
            path = folder / f"{name.replace(' ', '_')}_{day}.tif"
            write_raster(path, of_day, settings["projection"], nodata)
            derive = ("elevation", "slope", "aspect") if name == "elevation" else ()
            sources[day].append(CovariateSource(path, derive=derive, name=name))
    return sources


def folds(kind: str, survey: Survey) -> NDArray[np.int_]:
    """Fold of each place, from 0."""
    rng = np.random.default_rng(16)
    if kind == "random":
        return np.asarray(rng.permutation(len(survey.utm)) % FOLDS)
    block = ((survey.utm - survey.utm.min(axis=0)) // BLOCK_M).astype(int)
    _, number = np.unique(block, axis=0, return_inverse=True)
    return np.asarray((rng.permutation(number.max() + 1) % FOLDS)[number])


@dataclass(frozen=True, eq=False)
class Case:
    """Everything that our maps need.

    :param survey: the survey
    :param xy: its places in the plane of the field, shape (n, 2) [m]
    :param grid: cells of the map
    :param covariates: by day
    """

    survey: Survey
    xy: Array
    grid: FieldGrid
    covariates: Mapping[str, Covariates]

    def kriged(self, train: NDArray[np.bool_], test: NDArray[np.bool_], joint: bool, known: bool) -> Array:
        """Quantiles of the left-out moistures, shape (n, 200).

        :param joint: whether the second day uses the counts of the first
        :param known: whether the covariates are known
        """
        from scipy.stats import norm

        survey = self.survey
        quantiles = np.full((len(survey.day), len(LEVELS)), np.nan)
        days = np.unique(survey.day)
        for number, day in enumerate(days):
            earlier = [
                EarlierSurvey(str(other), back * DAY_S, survey.samples(train & (survey.day == other), self.xy))
                for back, other in enumerate(days[:number] if joint else [])
            ]
            knowledge = Knowledge(tuple(earlier), self.covariates[day] if known else None)
            field_map = FieldMap(self.grid, FieldMapSettings(for_planning=True), knowledge)
            field_map.set_samples(survey.samples(train & (survey.day == day), self.xy))
            field_map.update()
            assert field_map.kriging is not None
            wanted = test & (survey.day == day)
            rate, variance = field_map.kriging.predict(self.xy[wanted])
            noise = rate**2 * relative_error(moisture_of(rate), survey.error[wanted]) ** 2
            sd = np.sqrt(variance + noise)[:, None]
            quantiles[wanted] = moisture_of(rate[:, None] - sd * norm.ppf(LEVELS))
        return quantiles


def forests(python: str, survey: Survey, fold: NDArray[np.int_], resolution_m: float) -> Array:
    """Predictions of the random forest, one for each Monte Carlo iteration, shape (n, iterations)."""
    days, problem = np.unique(survey.day), list[dict[str, object]]()
    for number in range(FOLDS):
        out = fold == number
        places = {str(day): survey.utm[out & (survey.day == day)].tolist() for day in days}
        problem.append({"training": survey.lines[~out].tolist(), "places": places})
    answers = run(python, {"folds": problem, "resolution_m": resolution_m})
    iterations = len(next(one for answer in answers for one in answer.values() if one)[0])
    found = np.full((len(survey.day), iterations), np.nan)
    for number, answer in enumerate(answers):
        for day, values in answer.items():
            wanted = (fold == number) & (survey.day == day)
            found[wanted] = np.array(values).reshape(-1, iterations)
    return found


def with_errors(ensemble: Array, error: Array) -> Array:
    """Quantiles of a normal distribution with the mean and variance of an ensemble, plus those of the errors."""
    from scipy.stats import norm

    sd = np.sqrt(ensemble.var(axis=1, ddof=1) + error**2)
    return np.asarray(ensemble.mean(axis=1)[:, None] + sd[:, None] * norm.ppf(LEVELS))


def scores(ensemble: Array, truth: Array) -> dict[str, float]:
    """RMSE of the mean, mean CRPS (Gneiting and Raftery 2007, eq. 21), and coverage of the 95 % interval.

    :param ensemble: equally likely values, shape (n, m)
    """
    m = ensemble.shape[1]
    ordered = np.sort(ensemble, axis=1)
    spread = (ordered * (2 * np.arange(1, m + 1) - m - 1)).sum(axis=1) / m**2
    crps = np.abs(ensemble - truth[:, None]).mean(axis=1) - spread
    low, high = np.quantile(ensemble, [0.025, 0.975], axis=1)
    return {
        "rmse": float(np.sqrt(np.mean((ensemble.mean(axis=1) - truth) ** 2))),
        "crps": float(crps.mean()),
        "coverage95": float(np.mean((truth >= low) & (truth <= high))),
    }


def main() -> None:
    """Print a table."""
    parser = results.parser(__doc__)
    parser.add_argument("--smp", required=True, help="interpreter of an environment with soil-moisture-prediction")
    parser.add_argument("--fine", action="store_true", help=f"the forest on a grid of {FINE_M:g} m, too")
    options = parser.parse_args()
    data = Path(run(options.smp))
    survey = Survey.read(data / "crn_soil-moisture.csv")
    settings = json.loads((data / "parameters.json").read_text())
    case = make_case(survey, data, settings)
    table = []
    for kind in ("random", "blocked"):
        fold = folds(kind, survey)
        rows: dict[str, Array] = {}
        for name, joint, known in (
            ("kriging of the day", False, False),
            ("kriging of both days", True, False),
            ("kriging of the day with covariates", False, True),
            ("kriging of both days with covariates", True, True),
        ):
            parts = [case.kriged(fold != number, fold == number, joint, known) for number in range(FOLDS)]
            rows[name] = np.where(np.isnan(parts), 0, parts).sum(axis=0)
        for resolution_m in (0.0, FINE_M) if options.fine else (0.0,):
            ensemble = forests(options.smp, survey, fold, resolution_m)
            grid = f"grid {resolution_m or settings['geometry'][4]:g} m"
            rows[f"random forest, {grid}, its Monte Carlo alone"] = ensemble
            rows[f"random forest, {grid}, with errors"] = with_errors(ensemble, survey.error)
        for name, ensemble in rows.items():
            score = scores(ensemble, survey.moisture)
            figures = f"{score['rmse']:.4f}", f"{score['crps']:.4f}", f"{100 * score['coverage95']:.0f} %"
            table.append((kind, name, *figures))
    columns = ("folds", "method", "RMSE", "CRPS", "in 95 %")
    results.publish("covariates", columns, table, f"moistures in g/g, {len(survey.day)} places", options.save)


def make_case(survey: Survey, data: Path, settings: Mapping[str, object]) -> Case:
    """The field, its covariates, and the places in its plane."""
    from pyproj import Transformer

    to_degrees = Transformer.from_crs(settings["projection"], 4326, always_xy=True)

    def geographic(utm: Array) -> Array:
        return np.column_stack(to_degrees.transform(*utm.T))

    west, east, south, north, _ = np.array(settings["geometry"], float)
    corners = geographic(np.array([(west, south), (east, south), (east, north), (west, north)]))
    frame = LocalFrame(*corners.mean(axis=0)[::-1].tolist())
    grid = FieldGrid.from_polygon(frame.to_local(corners[:, 1], corners[:, 0]), CELL_M)
    places = geographic(survey.utm)
    covariates = {}
    with tempfile.TemporaryDirectory() as folder:
        for day, sources in predictors(data, Path(folder)).items():
            found = read_covariates(sources, frame, grid)
            assert found is not None
            covariates[day] = found
    return Case(survey, frame.to_local(places[:, 1], places[:, 0]), grid, covariates)


if __name__ == "__main__":
    main()

# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Knowledge of a simulated field before the mission: surveys of earlier dates, and covariates.

In a series of surveys, the rate of survey s is ``mean_s + Z_s(x)``. All Z have the variance and the correlation
R(h) of the field's pattern. The correlation T of two surveys at one place is the persistence. With T = L L',
``Z_s = sum_k L[s, k] E_k``, where E_0 is the pattern of the present survey, as it is, and the other E are
independent random fields. So the present truth does not depend on the series, and the surveys of a shorter
series are the latest ones of a longer series.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.foundation import DAY_S
from soilmoist_ros.mapping import Covariates, EarlierSurvey, Field, FieldGrid, Variogram, survey_samples
from soilmoist_ros.sensing import CountRecord
from soilmoist_ros.simulation.fields.formulas import FLOOR, random_field
from soilmoist_ros.simulation.fields.surrogate_field import GridExtent, RateGrid, SurrogateField
from soilmoist_ros.simulation.mission.settings import MissionSettings
from soilmoist_ros.simulation.mission.streams import covariate_stream, series_stream
from soilmoist_ros.simulation.robot.virtual_devices import VirtualSensor

Array = NDArray[np.float64]

STOPS = 100  # approximate number of stops of an earlier survey
STOP_RECORDS = 7
"""Records of 10 s at each of them: what a robot counts in two hours, which it does on the way, too."""
RECORD_S = 10.0
SURVEY_DAYS = 7  # time between two surveys [d]
MEAN_SD = 0.08
"""Standard deviation of the mean rates of surveys, as a share of the present mean: wet and dry weather."""
_MAX_PAIR_PLACES = 400
FOLLOWS = "simulated"  # name of the covariate that follows the truth


@dataclass(frozen=True, eq=False)
class SimulatedSurvey:
    """An earlier survey of a surrogate field."""

    name: str  # how reports name it
    field: SurrogateField  # the field as it was
    records: Sequence[CountRecord]  # its records, in order of time

    def survey(self, radius_m: float, footprint_radius_m: float) -> EarlierSurvey:
        """The survey as a map takes it; the parameters are those of :func:`survey_samples`."""
        samples = survey_samples(self.records, radius_m, footprint_radius_m)
        return EarlierSurvey(self.name, self.records[-1].stamp_s, samples)


def earlier_series(
    field: SurrogateField, grid: FieldGrid, settings: MissionSettings, number: int = 0
) -> list[SimulatedSurvey]:
    """The earlier surveys that the settings ask for, the latest first."""
    count = settings.earlier_surveys
    if not count:
        return []
    pattern = field.variogram or pattern_variogram(field, grid)
    present = field.rate_at(grid.cells)
    mean, spread = float(present.mean()), math.sqrt(pattern.structured_sill)
    correlations = np.full((count + 1, count + 1), settings.persistence)
    np.fill_diagonal(correlations, 1.0 + 1e-12)  # a persistence of 1 leaves it on the border of having a factor
    lower = np.linalg.cholesky(correlations)
    extent = GridExtent.of(field.field.polygon, grid.cell_m)
    x_m, y_m = extent.axes()
    nodes = np.stack(np.meshgrid(x_m, y_m), axis=-1).reshape(-1, 2)
    persistent = field.rate_at(nodes).reshape(len(y_m), len(x_m)) - mean
    drawn = [persistent]
    surveys = []
    for back in range(1, count + 1):
        rng = series_stream(settings.seed, number, back)
        drawn.append(spread * random_field(x_m, y_m, pattern.model, pattern.range_m, rng))
        own_mean = mean * (1 + MEAN_SD * float(rng.standard_normal()))
        deviation = sum(share * one for share, one in zip(lower[back], drawn, strict=False))
        rate = RateGrid(x_m, y_m, np.maximum(own_mean + deviation, FLOOR * mean))
        was = replace(field, truth=rate)
        days = back * SURVEY_DAYS
        records = _lattice_records(was, rng, settings.footprint_m, -days * DAY_S)
        surveys.append(SimulatedSurvey(f"{days:g} days before", was, records))
    return surveys


def pattern_variogram(field: SurrogateField, grid: FieldGrid) -> Variogram:
    """Matern 3/2 variogram of a truth within the field, by least squares of its semivariances."""
    from scipy.optimize import minimize_scalar
    from scipy.spatial.distance import pdist

    cells = grid.cells[:: max(1, len(grid.cells) // _MAX_PAIR_PLACES)]
    lag_m = pdist(cells)
    near = lag_m <= grid.extent_m / 2
    gamma = pdist(field.rate_at(cells)[:, None], "sqeuclidean")[near] / 2
    lag_m = lag_m[near]

    def fitted(log_range: float) -> tuple[float, float]:
        unit = Variogram("matern32", 0.0, math.exp(log_range), 1.0)
        shape = unit.semivariance(lag_m)
        sill = float(gamma @ shape / (shape @ shape))
        return float(((gamma - sill * shape) ** 2).sum()), sill

    bounds = (math.log(grid.extent_m / 50), math.log(grid.extent_m / 4))
    found = minimize_scalar(lambda value: fitted(value)[0], bounds=bounds, method="bounded")
    sill = max(fitted(found.x)[1], 1e-12)
    return Variogram("matern32", 0.0, math.exp(found.x), sill)


def _lattice_records(
    was: SurrogateField, rng: np.random.Generator, footprint_m: float, start_s: float
) -> list[CountRecord]:
    """Records of a quick survey: some at each stop of a lattice with a random origin."""
    sensor = VirtualSensor(was, rng, RECORD_S, footprint_m)
    records: list[CountRecord] = []
    for x_m, y_m in _lattice(was.field, rng).tolist():
        here = np.array([[x_m, y_m]])
        for _ in range(STOP_RECORDS):
            record = sensor.record(RECORD_S * (len(records) + 1), here, (x_m, y_m))
            records.append(replace(record, stamp_s=start_s + record.stamp_s))
    return records


def _lattice(field: Field, rng: np.random.Generator) -> Array:
    """About :data:`STOPS` stops of a lattice with a random origin, in rows to and fro, shape (n, 2) [m]."""
    import shapely

    area = shapely.Polygon(field.polygon, field.no_go)
    step_m = math.sqrt(area.area / STOPS)
    low, high = field.polygon.min(axis=0), field.polygon.max(axis=0)
    axes = [np.arange(low[k] + rng.uniform(0, 1) * step_m, high[k], step_m) for k in (0, 1)]
    rows = [[(x, y) for x in (axes[0] if row % 2 == 0 else axes[0][::-1])] for row, y in enumerate(axes[1])]
    places = np.array([place for row in rows for place in row]).reshape(-1, 2)
    inside = shapely.contains(area, shapely.points(places))
    return places[inside] if inside.any() else np.array([area.representative_point().coords[0]])


def simulated_covariates(
    field: SurrogateField, grid: FieldGrid, settings: MissionSettings, number: int = 0
) -> Covariates | None:
    """The covariates that the settings ask for; ``None`` for none.

    The covariate that follows the truth is ``r t + sqrt(1 - r^2) e``: t is the standardised truth, and e a random
    field with the correlation R(h) of the truth's pattern, less its regression on the truth and standardised. So r
    is the correlation over the cells. Useless ones are random fields with the correlation R(h), independent of the
    truth: over the cells of one field they may be correlated with it by chance.
    """
    wanted = {} if settings.covariate_correlation is None else {FOLLOWS: settings.covariate_correlation}
    wanted |= {f"useless {index}": 0.0 for index in range(1, settings.useless_covariates + 1)}
    if not wanted:
        return None
    pattern = field.variogram or pattern_variogram(field, grid)
    truth = grid.to_raster(field.rate_at(grid.cells))
    truth = (truth - np.nanmean(truth)) / (np.nanstd(truth) or 1.0)
    rasters = []
    for index, (name, share) in enumerate(wanted.items()):
        stream = covariate_stream(settings.seed, number, 0 if name == FOLLOWS else index + (FOLLOWS not in wanted))
        other = random_field(grid.x_m, grid.y_m, pattern.model, pattern.range_m, stream)
        if name == FOLLOWS:
            other -= np.nanmean(other * truth) * truth
            other = (other - np.nanmean(other)) / np.nanstd(other)
        rasters.append(share * truth + math.sqrt(1 - share**2) * other)
    return Covariates.over(grid, list(wanted), np.array(rasters))

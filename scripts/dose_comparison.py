# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Irrigation by the dose zones of a map, compared with one dose for the whole field, on simulated fields.

The robot surveys a field, and its map has a calibration of 1.5 % that is wrong by a draw of it. The limit where
plants lack water is midway between the driest and the wettest tenth of the field, and field capacity is 5 % by
volume above it. A place that lacks water needs to be filled to field capacity, 300 mm deep; one that does not lack
it needs none. ``too much`` is water above the need of a place, ``missed`` the need that a place does not get, both
as a share of the need of the field. The uniform plan has the true mean need of the field.

``budget``: honesty of the uncertainty budget: sites drawn from its ranges, surveyed, and mapped without
knowing the draws.

For each draw the parts of the calibration get true values: uniform for a default range, normal else, by a Latin
hypercube (McKay et al. 1979, Technometrics 21:239-245). A field of moisture has a mean between 12 and 30 % by
volume, and differences of 3 % with a range parameter of 15 m. The robot counts at 30 random places for 5 minutes
each, with the rate of the *true* curve. The map has the calibration's own values and their uncertainties, and a
variogram fitted to the counts. ``level`` is the interval of the budget for the level alone, against the true
moisture at the mean rate of the map; ``mean`` the interval of the field's mean moisture; ``places`` the share of
cells inside their intervals.

usage: .venv/bin/python scripts/dose_comparison.py [budget] [--draws N] [--save]
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from statistics import NormalDist
from typing import Any, NamedTuple

for _variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ[_variable] = "1"  # before numpy is imported

import numpy as np
import results
from scipy.stats.qmc import LatinHypercube

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from soilmoist_ros.foundation import LocalFrame, squared_distances
from soilmoist_ros.mapping import FieldGrid, Samples, Variogram, estimate_variogram, make_soil_map
from soilmoist_ros.pipeline import CalibrationInfo, MapRun
from soilmoist_ros.reporting import make_budget, mean_moisture
from soilmoist_ros.reporting.dose import DoseSettings, dose_at, find_dose, zones_mean, zones_of_dose
from soilmoist_ros.reporting.geometry import field_polygon
from soilmoist_ros.sensing import (
    Calibration,
    CalibrationCurve,
    MoistureCurve,
    Site,
    Soil,
    SurveyAir,
    general_calibration,
)
from soilmoist_ros.simulation import MissionSettings, simulate_mission

FIELDS, HOURS, N0_SHARE = ("patches", "strips", "rough", "smooth"), (1.0, 3.0), 0.015
DEPTH_MM, ABOVE, STEPS_MM, WIDTH_M = 300.0, 0.05, 5.0, 6.0


def shares(field: str, hours: float, seed: int) -> tuple[float, float, float, float, float]:
    """Too much and missed of the uniform dose and of the zones, and the mean probability of right zones [0..1]."""
    result = simulate_mission(MissionSettings(field=field, hours=hours, seed=seed))
    soil_map, error = result.soil_map, np.random.default_rng(seed).normal() * N0_SHARE
    assert soil_map is not None
    mask, cells = soil_map.grid.mask, soil_map.grid.cells
    curve = soil_map.curve or CalibrationCurve(6.2, 1.4)
    curve = replace(curve, n0_sd_cps=N0_SHARE * curve.n0_cps)
    true_curve = replace(curve, n0_cps=curve.n0_cps * (1 + error))
    truth = true_curve.vwc(result.truth_rate[mask])
    stress = float(np.nanquantile(truth, (0.1, 0.9)).mean())
    limits = {"wilting_point": stress - ABOVE, "field_capacity": stress + ABOVE}
    one = DoseSettings(**limits, root_depth_mm=DEPTH_MM, steps_mm=STEPS_MM, width_m=WIDTH_M)
    need = np.where(truth < stress, (one.full - truth) * DEPTH_MM, 0.0)
    dose = find_dose(soil_map.rate[mask], soil_map.rate_sd[mask], curve, one)
    zones = zones_of_dose(dose, cells, soil_map.grid.cell_m, field_polygon(soil_map.grid), one)
    found = []
    for plan in (np.full(len(cells), need.mean()), dose_at(zones, cells)):
        found += [float(np.maximum(sign * (plan - need), 0).sum() / need.sum()) for sign in (1, -1)]
    return found[0], found[1], found[2], found[3], zones_mean(zones, "sure")


def compare(draws: int, save: bool) -> None:
    """Table of the zones against one dose."""
    rows = []
    for field in FIELDS:
        for hours in HOURS:
            found = np.mean([shares(field, hours, seed) for seed in range(draws)], axis=0)
            rows.append([field, f"{hours:g}", *(f"{100 * share:.0f} %" for share in found[:4].tolist())])
            print(rows[-1], found[4], flush=True)
    columns = ("field", "hours", "uniform: too much", "uniform: missed", "zones: too much", "zones: missed")
    results.publish("dose", columns, rows, f"means of {draws} surveys, machine of {WIDTH_M:g} m", save)


# Honesty of the uncertainty budget -------------------------------------------------------------------------------

SIDE_M, CELL_M, STOPS, DWELL_S = 60.0, 5.0, 30, 300.0
MOISTURE, SPREAD, RANGE_M = (0.12, 0.30), 0.03, 15.0
DENSITY, WATER = "bulk density", "lattice and organic water"
PLACE = SurveyAir(52.0, 0.0, 1005.0, 12.0)
CORES = {"soil": {"bulk_density_gcm3": 1.4, "bulk_density_sd_gcm3": 0.05, "bound_water_sd": 0.005}}
CALIBRATIONS: dict[str, dict[str, Any]] = {
    "general, default ranges": {"sensor_sensitivity": 10.0},
    "general, soil known": {"sensor_sensitivity": 10.0, **CORES},
    "soil cores": {"calibration": {"n0_cps": 6.0, "n0_sd_cps": 0.09}, **CORES},
}
"""Site files, as far as they matter: a sensor of ten times the counts of the reference detector."""


class Draw(NamedTuple):
    """Outcome of a survey: uncertainties [m^3/m^3], whether level and mean are inside, and the share of places."""

    level_sd: float
    place_sd: float
    level: bool
    mean: bool
    places: float


def calibration_of(name: str) -> tuple[Calibration, Soil]:
    """Calibration and soil of a site file; the general one if it has none."""
    site = Site.model_validate(CALIBRATIONS[name])
    found = general_calibration(site, PLACE) if site.calibration is None else None
    if found is not None:
        return found
    assert site.calibration is not None
    assert site.soil is not None
    return site.calibration, site.soil


def parts_of(calibration: Calibration, soil: Soil) -> list[tuple[str, float, bool]]:
    """Uncertain parts: name, standard deviation (of N0 the relative one), and whether it is a default range."""
    parts = [
        (part.name, part.share, part.origin == "default range") for part in calibration.parts if part.share > 0
    ]
    if not parts:
        parts = [("N0", (calibration.n0_sd_cps or 0.0) / calibration.n0_cps, False)]
    ranged = {part.name for part in calibration.parts if part.origin == "default range"}
    of_soil = ((DENSITY, soil.bulk_density_sd_gcm3), (WATER, soil.bound_water_sd))
    return [*parts, *((name, sd or 0.0, name in ranged) for name, sd in of_soil)]


def true_curve(
    curve: MoistureCurve, parts: Sequence[tuple[str, float, bool]], quantiles: Sequence[float]
) -> MoistureCurve:
    """A curve of true values: a quantile [0..1] of each part."""
    for (name, sd, ranged), quantile in zip(parts, quantiles, strict=True):
        away = sd * (np.sqrt(3) * (2 * quantile - 1) if ranged else NormalDist().inv_cdf(quantile))
        if name == DENSITY:
            curve = replace(curve, bulk_density_gcm3=curve.bulk_density_gcm3 + away)
        elif name == WATER:
            curve = replace(curve, lattice_water=max(curve.lattice_water + away, 0.0))
        else:
            curve = replace(curve, n0_cps=curve.n0_cps * (1 + away))
    return curve


def survey(name: str, quantiles: Sequence[float], seed: int) -> Draw:
    """Survey a site of drawn values and map it."""
    rng = np.random.default_rng(seed)
    calibration, soil = calibration_of(name)
    curve = calibration.curve_of(soil)
    truth = true_curve(curve, parts_of(calibration, soil), quantiles)
    corners = [(0.0, 0.0), (SIDE_M, 0.0), (SIDE_M, SIDE_M), (0.0, SIDE_M)]
    grid = FieldGrid.from_polygon(corners, CELL_M)
    cells, stops = grid.cells, rng.uniform(0, SIDE_M, (STOPS, 2))
    places = np.concatenate([cells, stops])
    model = Variogram("matern32", 0.0, RANGE_M, SPREAD**2)
    scaled = model.scaled(places)
    covariance = model.sill * model.correlation_of_square(squared_distances(scaled, scaled))
    factor = np.linalg.cholesky(covariance + 1e-8 * model.sill * np.eye(len(places)))
    vwc = np.clip(rng.uniform(*MOISTURE) + factor @ rng.normal(size=len(places)), 0.02, 0.45)
    exposure_s = np.full(STOPS, DWELL_S)
    counts = rng.poisson(truth.rate_cps(vwc[len(cells) :]) * exposure_s)
    fit = estimate_variogram(stops, counts, exposure_s, extent_m=SIDE_M, anisotropy=False)
    soil_map = make_soil_map(Samples(stops, counts, exposure_s), grid, fit, curve)
    about = CalibrationInfo(
        curve.n0_cps, curve.bulk_density_gcm3, curve.n0_sd_cps, method=calibration.method, parts=calibration.parts
    )
    run = MapRun(soil_map, LocalFrame(52.0, 0.0), datetime(2026, 5, 1, tzinfo=UTC), calibration=about)
    budget, mean = make_budget(run), mean_moisture(soil_map)
    assert budget is not None
    assert mean is not None
    here, inside = vwc[: len(cells)], grid.mask
    held = (soil_map.vwc_p05[inside] <= here) & (here <= soil_map.vwc_p95[inside])
    level = float(truth.vwc(np.array([budget.rate_cps]))[0])
    return Draw(
        budget.level_sd, budget.place_sd, budget.level_p05 <= level <= budget.level_p95,
        mean.p05 <= float(here.mean()) <= mean.p95, float(held.mean()),
    )  # fmt: skip


def coverage(name: str, draws: int) -> Draw:
    """Means over draws: uncertainties, and shares inside the 90 % intervals; a level not known is not inside."""
    parts = parts_of(*calibration_of(name))
    quantiles = LatinHypercube(len(parts), seed=1).random(draws).tolist()
    found = [survey(name, drawn, seed) for seed, drawn in enumerate(quantiles)]
    return Draw(*np.nanmean(found, axis=0).tolist())


def honesty(draws: int, save: bool) -> None:
    """Table of the coverage by calibrations."""
    rows = []
    for name in CALIBRATIONS:
        found = coverage(name, draws)
        shares = [f"{100 * share:.0f} %" for share in (found.level, found.mean, found.places)]
        rows.append([name, f"{100 * found.level_sd:.1f}", f"{100 * found.place_sd:.1f}", *shares])
    columns = ("calibration", "level, ± % vol.", "place, ± % vol.", "level inside", "mean inside", "places inside")
    results.publish("budget", columns, rows, f"{draws} sites each, 90 % intervals", save)


def main() -> None:
    """Print or save a table."""
    options = results.parser(__doc__)
    options.add_argument("part", nargs="?", choices=("budget",), help="instead of the doses")
    options.add_argument("--draws", type=int, help="surveys of each kind (default: 10), or sites (default: 200)")
    chosen = options.parse_args()
    if chosen.part == "budget":
        honesty(chosen.draws or 200, chosen.save)
    else:
        compare(chosen.draws or 10, chosen.save)


if __name__ == "__main__":
    main()

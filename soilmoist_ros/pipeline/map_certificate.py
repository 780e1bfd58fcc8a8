# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Certificate of a map: mean of the field and error of the map by a sealed random sample, whatever the model.

The map is made again without the sample: without the visits at its stops, and the ways to and from them. Its
rate at each cell, p, is then some function of place that does not depend on where the sample lies. With the
rates z counted at the k places, the mean of what the sensor sees is ``mean(p) + mean(z - p)``, unbiased for any
p, with the scatter of the k differences as its error (difference estimator: Särndal, Swensson and Wretman 1992,
Model Assisted Survey Sampling, 6.3; Brus 2019, Geoderma 338:464-480). The mean squared error of p is the mean
of ``(z - p)^2`` less the counting noise, which is known: ``z / t``. Moistures are developed about p to the
second order.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.exploration import MIN_PLACES, SealedSample, Visit, sample_from_text
from soilmoist_ros.foundation import SoilmoistError
from soilmoist_ros.mapping import FieldGrid, FieldMap, FieldMapSettings, Knowledge, SoilMap, possible_moisture
from soilmoist_ros.sensing import CountRecord, MoistureCurve

if TYPE_CHECKING:
    from soilmoist_ros.pipeline.run import MapRun

Array = NDArray[np.float64]

CONFIDENCE = 0.95
KURTOSIS = 6.0
"""Kurtosis of the errors of a map over the field for which the bound of the error holds; 3 if they are normal."""
REACH_M = 10.0
"""Counts farther from a place than this are not its counts [m]: robots arrive within 3 m, people 5 m."""
_CLOCK_S = 1e-3
_STEP = 0.01  # relative step of the rate for the curvature of the moisture


@dataclass(frozen=True)
class Statement:
    """Mean of a field and error of a map by a random sample: rates [counts/s], or moistures [m^3/m^3].

    :param half_width: half of the 95 % interval of the mean
    :param rmse: root mean squared error of the map without the sample; 0 if the counts show no error
    :param rmse_below: upper limit of it, with a confidence of 95 %; ``None`` if the counts are too few for one
        below the mean
    """

    mean: float
    half_width: float
    rmse: float
    rmse_below: float | None


@dataclass(frozen=True, eq=False)
class Certificate:
    """A sealed sample and what it states.

    :param measured: its places that were counted at, by their numbers from 0
    :param rate: statement on the rate, ``None`` if too few places were counted at, or there is no other map
    :param vwc: statement on the moisture, ``None`` without a calibration as well
    :param as_drawn: whether the seed draws the sample
    :param drifts: whether counts were corrected for a drift that the map has found
    """

    sample: SealedSample
    measured: tuple[int, ...]
    rate: Statement | None
    vwc: Statement | None
    as_drawn: bool
    drifts: bool = False

    @property
    def values(self) -> dict[str, Any]:
        """The statements as values of a file."""
        of = {"rate_cps": self.rate, "vwc": self.vwc}
        stated = {name: asdict(one) for name, one in of.items() if one is not None}
        return {
            "seed": self.sample.seed, "sealed": self.sample.digest, "places": len(self.sample.cells),
            "measured": len(self.measured), "visitable_share": self.sample.visitable, "as_drawn": self.as_drawn,
            "confidence": CONFIDENCE, "drift_corrected": self.drifts, **stated,
        }  # fmt: skip


def run_certificate(run: MapRun) -> Certificate | None:
    """The certificate of a run, ``None`` without a sealed sample."""
    mission = run.mission
    if mission is None or not mission.certificate:
        return None
    settings, known = mission.settings, Knowledge(tuple(one.survey for one in run.earlier), run.covariates)
    choices, curve = FieldMapSettings.chosen(settings), run.soil_map.curve
    sample, stops_only = sample_from_text(mission.certificate), settings.map_from == "stops"
    return certify(sample, run.track, mission.visits, run.soil_map.grid, choices, curve, known, stops_only)


def certify(
    sample: SealedSample,
    records: Sequence[CountRecord],
    visits: Sequence[Visit],
    grid: FieldGrid,
    settings: FieldMapSettings,
    curve: MoistureCurve | None,
    knowledge: Knowledge,
    stops_only: bool = False,
) -> Certificate:
    """Statements of a sealed sample about the map of a mission.

    :param stops_only: whether the map is of the counts at stops
    """
    from scipy.spatial import cKDTree

    visits = sorted(visits, key=lambda visit: visit.arrived_s)
    records = [one for one in records if not one.quarantine]
    there = _counted_at(sample, visits, records)
    measured = tuple(number for number, stop in enumerate(sample.stops) if there[stop.name])
    others = _without_sample(records, visits, sample, stops_only)
    soil_map = _map(others, grid, settings, knowledge) if len(measured) >= MIN_PLACES else None
    if soil_map is None:
        return Certificate(sample, measured, None, None, sample.is_as_drawn)
    p, drift = soil_map.rate[grid.mask], soil_map.change.drift
    at = np.asarray(cKDTree(grid.cells).query(sample.cells_xy[list(measured)])[1], np.intp)
    counts, exposure_s = [], []
    for number in measured:
        its = there[sample.stops[number].name]
        times_s = np.array([one.stamp_s - one.exposure_s / 2 for one in its])
        factors = np.ones(len(its)) if drift is None else drift.factor(times_s)
        counts.append(sum(one.raw_counts for one in its))
        exposure_s.append(float(np.array([one.effective_exposure_s for one in its]) @ factors))
    counted = np.array(counts, float), np.array(exposure_s)
    rate = state(p, at, *counted)
    vwc = None if curve is None else state(p, at, *counted, curve)
    return Certificate(sample, measured, rate, vwc, sample.is_as_drawn, drift is not None)


def state(
    p: Array, at: NDArray[np.intp], counts: Array, exposure_s: Array, curve: MoistureCurve | None = None
) -> Statement:
    """Mean of a field and error of a map of its rate, from counts at random cells.

    :param p: rate of the map in all cells, shape (g,) [counts/s]; it must not depend on the cells that were drawn
    :param at: the drawn cells, shape (k,); ``counts`` and effective exposures [s] at each
    """
    from scipy.special import stdtrit

    error, noise = counts / exposure_s - p[at], np.maximum(counts, 1) / exposure_s**2
    k, middle, slope, bend, kurtosis = len(at), float(p.mean()), np.ones(len(at)), np.zeros(len(at)), KURTOSIS
    if curve is not None:
        middle = float(possible_moisture(curve, p).mean())
        known, weight = np.maximum(p[at], (1 + 10 * _STEP) * curve.lowest_rate_cps), curve.weight(p)
        slope = curve.slope(known)
        bend = (curve.slope((1 + _STEP) * known) - curve.slope((1 - _STEP) * known)) / (2 * _STEP * known)
        kurtosis *= float(np.mean(weight**2) / weight.mean() ** 2)  # errors of the rate weigh more in wet soil
    difference = slope * error + bend / 2 * (error**2 - noise)
    mean = middle + float(difference.mean())
    half_width = float(stdtrit(k - 1, (1 + CONFIDENCE) / 2) * difference.std(ddof=1) / math.sqrt(k))
    square, variance = (slope * error) ** 2, slope**2 * noise
    mse = max(float(np.mean(square - variance)), 0.0)
    below = math.sqrt(error_bound(square, variance, kurtosis))
    return Statement(mean, half_width, math.sqrt(mse), below if below < mean else None)


def error_bound(square: Array, variance: Array, kurtosis: float = KURTOSIS) -> float:
    """Upper limit of the mean squared error of a map, by squared differences at random places.

    A place with a large error may be missing from the sample, so the scatter of the squares is no guide. Their
    mean is compared with a gamma distribution of the mean and the variance that it has for a mean squared error
    B, errors of this kurtosis, and normal noise: ``B + V`` and ``((kurtosis - 1) B^2 + 4 B V + 2 mean(V^2)) /
    k``. The limit is the B for which so small a mean has the probability of 5 %. A mean below the noise counts
    as the noise. Infinite if a few places show nothing of errors of this kurtosis.

    :param square: squared differences of counts and map, shape (k,); ``variance`` is that of their noise V
    """
    from scipy.optimize import brentq
    from scipy.special import gammainc

    noise = float(variance.mean())
    seen, noise2 = max(float(square.mean()), noise), 2 * float(np.mean(variance**2))

    def surplus(error: float) -> float:
        mean = error + noise
        spread = ((kurtosis - 1) * error**2 + 4 * error * noise + noise2) / len(square)
        return float(gammainc(mean**2 / spread, seen * mean / spread)) - (1 - CONFIDENCE)

    top = seen
    while surplus(top) > 0 and top < 1e6 * seen:
        top *= 2
    if surplus(top) > 0:
        return math.inf
    return float(brentq(surplus, 0.0, top, rtol=1e-4))


def _counted_at(
    sample: SealedSample, visits: Sequence[Visit], records: Sequence[CountRecord]
) -> dict[str, list[CountRecord]]:
    """Records that were counted near each stop of a sample, in the time of visits made for it, by its name."""
    places = {stop.name: stop.xy for stop in sample.stops}
    found: dict[str, list[CountRecord]] = {name: [] for name in places}
    for visit in visits:
        if visit.name not in found or sample.digest not in visit.reason:
            continue
        found[visit.name] += [
            one
            for one in records
            if visit.arrival_stamp_s - _CLOCK_S <= one.stamp_s - one.exposure_s
            and one.stamp_s - one.exposure_s / 2 <= visit.end_stamp_s  # it may end a little later: clocks differ
            and one.effective_exposure_s > 0
            and math.dist((one.x_m, one.y_m), places[visit.name]) <= REACH_M
        ]
    return found


def _without_sample(
    records: Sequence[CountRecord], visits: Sequence[Visit], sample: SealedSample, stops_only: bool
) -> list[CountRecord]:
    """Records that were counted neither at a stop of the sample nor on the way to or from one."""
    end_s = np.array([record.stamp_s for record in records])
    begin_s = end_s - [record.exposure_s for record in records]
    left_out = np.full(len(records), stops_only)
    if stops_only:
        for visit in visits:
            there = (begin_s >= visit.arrival_stamp_s - _CLOCK_S) & (end_s <= visit.end_stamp_s + _CLOCK_S)
            left_out[there] = False
    left_s = [-math.inf, *(visit.end_stamp_s for visit in visits)]
    next_s = [*(visit.arrival_stamp_s for visit in visits[1:]), math.inf]
    for visit, since_s, until_s in zip(visits, left_s, next_s, strict=False):
        if visit.name in sample.names:
            left_out |= (end_s > since_s + _CLOCK_S) & (begin_s < until_s - _CLOCK_S)
    return [record for record, out in zip(records, left_out.tolist(), strict=True) if not out]


def _map(
    records: Sequence[CountRecord], grid: FieldGrid, settings: FieldMapSettings, knowledge: Knowledge
) -> SoilMap | None:
    """Map of what the sensor sees; ``None`` if there is none."""
    field_map = FieldMap(grid, settings, knowledge)
    field_map.set_records([one for one in records if math.isfinite(one.x_m) and one.effective_exposure_s > 0])
    try:
        return field_map.update()
    except SoilmoistError:
        return None

# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Soil moisture over time, for records that all lie at one place, as those of a stationary probe."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.mapping import Bands, make_bands
from soilmoist_ros.pipeline import MapRun
from soilmoist_ros.reporting.certainty import calibration_of
from soilmoist_ros.reporting.text_files import write_table
from soilmoist_ros.sensing import CountRecord, MoistureCurve

STEP_COUNTS = 10_000
"""Counts of a step: a standard error of the rate of 1 %."""
STEPS_S = (900.0, 3600.0, 3 * 3600.0, 6 * 3600.0, 12 * 3600.0, 86_400.0)


@dataclass(frozen=True)
class MoistureSeries:
    """Rate and moisture in steps of time; steps without records are left out.

    :param step_s: duration of a step [s]
    :param begin_s: begin of each step [s since 1970 UTC], shape (n,), ascending
    :param records: number of records in each step, shape (n,)
    :param counts: their raw counts, shape (n,)
    :param exposure_s: their effective exposures [s], shape (n,)
    :param bands: rate and moisture with the interval of counting and calibration, each of shape (n,)
    """

    step_s: float
    begin_s: NDArray[np.float64]
    records: NDArray[np.int64]
    counts: NDArray[np.float64]
    exposure_s: NDArray[np.float64]
    bands: Bands


def at_one_place(run: MapRun) -> bool:
    """True if all records of a map make one sample; a mission has its visits instead."""
    return run.mission is None and len(run.soil_map.samples) == 1 and len(run.track) > 1


def moisture_series(track: Sequence[CountRecord], curve: MoistureCurve | None) -> MoistureSeries:
    """Add up records in steps that begin at whole multiples of their duration (UTC).

    The duration is the shortest of :data:`STEPS_S` with :data:`STEP_COUNTS` on average.

    :param track: records of one place, at least one
    """
    # A stamp is the end of its record; on the border of two steps it belongs to the earlier one.
    end_s = np.array([record.stamp_s for record in track]) - 1e-3
    counts = np.array([record.raw_counts for record in track], float)
    exposure = np.array([record.effective_exposure_s for record in track])
    rate_cps = max(counts.sum(), 1.0) / exposure.sum()
    step_s = next((step for step in STEPS_S if rate_cps * step >= STEP_COUNTS), STEPS_S[-1])
    steps, index = np.unique(np.floor(end_s / step_s), return_inverse=True)
    summed, time = (np.bincount(index, each).astype(float) for each in (counts, exposure))
    # Without counts the noise is that of one count.
    bands = make_bands(summed / time, np.maximum(summed, 1.0) / time**2, curve)
    return MoistureSeries(step_s, steps * step_s, np.bincount(index), summed, time, bands)


def interrupted(
    time_s: NDArray[np.float64], longest_s: float, *values: NDArray[np.float64]
) -> tuple[NDArray[np.float64], ...]:
    """Times and values with NaN values in each gap, so that no line is drawn where nothing was counted.

    :param time_s: rising times [s]
    :param longest_s: longest step that is no gap [s]
    """
    gaps = np.flatnonzero(np.diff(time_s) > longest_s) + 1
    middle = (time_s[gaps - 1] + time_s[gaps]) / 2
    return np.insert(time_s, gaps, middle), *(np.insert(each, gaps, np.nan) for each in values)


def moisture_of_all(track: Sequence[CountRecord], curve: MoistureCurve | None) -> Bands:
    """Rate and moisture of all records together, with the interval of counting and calibration, shape ()."""
    counts = float(sum(record.raw_counts for record in track))
    exposure_s = math.fsum(record.effective_exposure_s for record in track)
    return make_bands(np.array(counts / exposure_s), np.array(max(counts, 1.0) / exposure_s**2), curve)


def write_moisture(path: Path, run: MapRun) -> Path:
    """Write the series of a run as CSV, one row per step; return ``path``."""
    series, state = moisture_series(run.track, run.soil_map.curve), calibration_of(run)
    names = ("rate", "rate_sd", "vwc", "vwc_sd", "vwc_p05", "vwc_p95")
    begin = [f"{datetime.fromtimestamp(begin_s, UTC):%Y-%m-%dT%H:%M:%SZ}" for begin_s in series.begin_s]
    bands = (np.asarray(getattr(series.bands, name), float).tolist() for name in names)
    records, counts, exposure_s = series.records.tolist(), series.counts.astype(int).tolist(), series.exposure_s
    columns = ([series.step_s] * len(begin), records, counts, exposure_s.tolist(), *bands, [state] * len(begin))
    first = ("begin_utc", "step_s", "records", "raw_counts", "effective_exposure_s")
    return write_table(path, [*first, *names, "calibrated"], zip(begin, *columns, strict=True))

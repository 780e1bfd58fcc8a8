# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""When each sample of a map was counted."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.pipeline import MapRun


def sample_times(run: MapRun) -> NDArray[np.float64]:
    """Begin of the first and end of the last record of each sample, and their number; shape (n, 3) [s, s, -].

    Samples do not remember their records, so each record counts for the nearest sample. Where a mission maps only
    what was counted at stops, records between the visits are left out. NaN for a sample without a record.
    """
    from scipy.spatial import cKDTree

    samples = run.soil_map.samples
    table = np.array(
        [
            (record.x_m, record.y_m, record.stamp_s - record.exposure_s, record.stamp_s, record.raw_counts)
            for record in run.track
            if not record.quarantine
        ]
    ).reshape(-1, 5)
    table = table[np.isfinite(table[:, :2]).all(axis=1)]
    if run.mission is not None and table[:, 4].sum() > samples.counts.sum():
        visits = [(visit.arrival_stamp_s, visit.end_stamp_s) for visit in run.mission.visits]
        during = [(table[:, 2] >= begin - 1e-3) & (table[:, 3] <= end + 1e-3) for begin, end in visits]
        table = table[np.any(during, axis=0)] if during else table[:0]
    times = np.column_stack(
        [np.full(len(samples), np.inf), np.full(len(samples), -np.inf), np.zeros(len(samples))]
    )
    if len(table) and len(samples):
        nearest = cKDTree(samples.xy).query(table[:, :2])[1]
        np.minimum.at(times[:, 0], nearest, table[:, 2])
        np.maximum.at(times[:, 1], nearest, table[:, 3])
        np.add.at(times[:, 2], nearest, 1)
    return np.where(np.isfinite(times), times, np.nan)

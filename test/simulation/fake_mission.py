# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A fake mission simulator: fast, with plausibly decaying errors. Imported by path."""

from __future__ import annotations

import zlib

import numpy as np

from soilmoist_ros.foundation.geodesy import LocalFrame
from soilmoist_ros.simulation.mission.mission_result import MapErrors, MappedProperty, MissionResult, SeriesRow

STOP_S = 200.0  # time from one stop to the next; the first map has three


def simulate(settings):
    text = f"{settings.field} {settings.strategy} {settings.dwell} {settings.seed}"
    rng = np.random.default_rng(zlib.crc32(text.encode()))
    own, rows = float(np.exp(rng.normal(0, 0.25))), []
    for time_s in np.arange(0.0, 3600 * settings.hours + 1, 60.0).tolist():
        stops, errors = int(time_s // STOP_S), MapErrors()
        if stops >= 3:
            mse = own * (0.04 + 1.5 * np.exp(-time_s / 1500)) * float(np.exp(rng.normal(0, 0.05)))
            errors = MapErrors(mse, 0.06 * mse**0.5, float(np.clip(0.95 + rng.normal(0, 0.03), 0, 1)))
        rows.append(SeriesRow(time_s, 0.3 * own * time_s, stops, 0.6 * STOP_S * stops, (errors,)))
    mapped = MappedProperty("fake", f"The {settings.field} field", (), None, np.full((1, 1), np.nan))
    return MissionResult(settings, rows, (), (), [mapped], LocalFrame(53.268, -0.5245), "time is up")

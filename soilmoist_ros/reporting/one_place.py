# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Runs whose records all lie at one place, as those of a stationary probe: their mean, which is no map."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from soilmoist_ros.mapping import Bands, make_bands
from soilmoist_ros.pipeline import MapRun
from soilmoist_ros.sensing import CountRecord, MoistureCurve


def at_one_place(run: MapRun) -> bool:
    """True if all records of a map make one sample; a mission has its visits instead."""
    return run.mission is None and len(run.soil_map.samples) == 1 and len(run.track) > 1


def moisture_of_all(track: Sequence[CountRecord], curve: MoistureCurve | None) -> Bands:
    """Rate and moisture of all records together, with the interval of counting and calibration, shape ().

    Without counts the noise is that of one count.
    """
    counts = float(sum(record.raw_counts for record in track))
    exposure_s = math.fsum(record.effective_exposure_s for record in track)
    return make_bands(np.array(counts / exposure_s), np.array(max(counts, 1.0) / exposure_s**2), curve)

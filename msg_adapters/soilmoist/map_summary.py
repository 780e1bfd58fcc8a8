# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``map_summary``: the map in a few numbers, as a soilmoist_msgs/MapSummary."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from soilmoist_msgs.msg import MapSummary
from std_msgs.msg import Header

from msg_adapters.point_cloud import FRAME
from msg_adapters.stamps import to_time
from soilmoist_ros.mapping import MapState, SoilMap


def map_summary_to_message(state: MapState, soil_map: SoilMap | None, frame_id: str = FRAME) -> MapSummary:
    """Message of a map in numbers.

    :param state: what the map is made of
    :param soil_map: the map, ``None`` before the first
    :param frame_id: frame of the map
    """
    samples = state.samples
    message = MapSummary(
        header=Header(stamp=to_time(state.stamp_s), frame_id=frame_id),
        records=int(state.records),
        samples=len(samples),
        raw_counts=int(samples.counts.sum()),
        effective_exposure_s=float(samples.exposure_s.sum()),
    )
    names = ("mean_rate", "mean_vwc", "rate_sd", "vwc_sd", "normalised_variance", "nugget", "sill", "range_m")
    values = dict.fromkeys(names, math.nan)
    if soil_map is not None:
        variogram = soil_map.variogram
        message.variogram_model = str(variogram.model)
        values |= {
            "mean_rate": _mean(soil_map.rate),
            "mean_vwc": _mean(soil_map.vwc),
            "rate_sd": math.sqrt(_mean(soil_map.variance)),
            "vwc_sd": math.sqrt(_mean(soil_map.vwc_sd**2)),
            "normalised_variance": _mean(soil_map.variance) / variogram.sill,
            "nugget": variogram.nugget,
            "sill": variogram.sill,
            "range_m": variogram.range_m,
        }
    for name, value in values.items():
        setattr(message, name, float(value))
    return message


def _mean(raster: NDArray[np.float64]) -> float:
    """Mean of the cells that have a value, NaN if none has."""
    known = raster[np.isfinite(raster)]
    return float(known.mean()) if known.size else math.nan

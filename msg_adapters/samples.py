# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``samples``: the merged samples as a sensor_msgs/PointCloud2, one point per sample, in the plane z = 0."""

from __future__ import annotations

from typing import Final

import numpy as np
from sensor_msgs.msg import PointCloud2

from msg_adapters.point_cloud import FRAME, points_from_message, points_to_message
from soilmoist_ros.mapping import Samples

# Viewers read x, y and z only as 32-bit floats. Counts and exposures enter the statistics and grow without limit.
_POINT: Final = np.dtype(
    [("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("raw_counts", "<f8"), ("effective_exposure_s", "<f8")]
)
_SPREAD: Final = ("spread_xx", "spread_xy", "spread_yy", "footprint_radius_m")
_AREA: Final = np.dtype([*_POINT.descr, *((name, "<f4") for name in _SPREAD)])


def samples_to_message(samples: Samples, stamp_s: float, frame_id: str = FRAME) -> PointCloud2:
    """Message of samples.

    :param samples: any number, including zero; places and spreads are rounded to 32 bits
    :param stamp_s: end of the last record in the samples [s since 1970-01-01 UTC]
    """
    points = np.zeros(len(samples), _AREA)
    points["x"], points["y"] = samples.xy.T
    points["raw_counts"] = samples.counts
    points["effective_exposure_s"] = samples.exposure_s
    for name, moments in zip(_SPREAD, samples.spread.T, strict=True):
        points[name] = moments
    return points_to_message(points, stamp_s, frame_id)


def samples_from_message(message: PointCloud2) -> Samples:
    """Samples of a message; without spreads in the message the samples are points.

    :raises ValueError: if a field is missing, or a value is impossible
    """
    given = [field.name for field in message.fields]
    known = [name for name in _SPREAD if name in given]  # messages of earlier versions have no footprint
    kind = np.dtype([*_POINT.descr, *((name, "<f4") for name in known)])
    points = points_from_message(message, kind).ravel()
    xy = np.column_stack([points["x"], points["y"]])
    spread = np.column_stack([points[name] for name in known]) if known else np.zeros(4)
    return Samples(xy, points["raw_counts"], points["effective_exposure_s"], spread)

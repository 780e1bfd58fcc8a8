# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``counts``: corrected, geo-tagged records as a sensor_msgs/PointCloud2, one point per record.

``quarantined_counts`` has the bad ones, with the number of the reason in the field ``reason``:

| number | code | |
|---|---|---|
| 1 | ``noisy_tube`` | tube counts too much |
| 2 | ``dead_tube`` | tube counts too little |
| 3 | ``stuck_tube`` | tube repeats a number |
| 4 | ``impossible_count`` | impossible count |
| 5 | ``impossible_weather`` | impossible weather |
| 6 | ``frozen_pressure`` | pressure never changes |
| 7 | ``place_jump`` | jump of place |
| 8 | ``clock_drift`` | logger clock drifts against GNSS time |
| 9 | ``overdispersed`` | counts scatter more than counting statistics |
| 10 | ``unexpected_count`` | the map does not expect these counts |
| 11 | ``rate_jump`` | count unlike the records before |

0 and other numbers are unknown reasons.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import String

from msg_adapters.point_cloud import (
    FRAME,
    OtherFrameError,
    check_fields,
    points_from_message,
    points_to_message,
    require_frame,
)
from soilmoist_ros.foundation import LatLon, LocalFrame, other_datum
from soilmoist_ros.mapping import Samples
from soilmoist_ros.recording import (
    COUNT_DATUM,
    COUNT_POINT,
    SAMPLE_AREA,
    SAMPLE_SPREAD,
    count_points,
    count_records,
    line_text,
    sample_points,
)
from soilmoist_ros.recording import points as read_points
from soilmoist_ros.sensing import CountRecord


def counts_to_message(
    records: Sequence[CountRecord], frame_id: str = FRAME, datum: LatLon | None = None
) -> PointCloud2:
    """Message of records; its stamp is the end of the last record's counting interval.

    The field ``stamp_offset_s`` of a point is the stamp of its record minus the stamp of the message [s].

    :raises ValueError: without records
    """
    points, stamp_s = count_points(records, datum)
    return points_to_message(points, stamp_s, frame_id)


def require_plane(message: PointCloud2, frame: str, plane: LocalFrame) -> None:
    """Check that a message of counts names no other frame or datum; raises :class:`OtherFrameError`."""
    require_frame(message, frame)
    if message.width * message.height and set(COUNT_DATUM) <= {field.name for field in message.fields}:
        first = read_points(message).ravel()[0]
        if fault := other_datum((float(first[COUNT_DATUM[0]]), float(first[COUNT_DATUM[1]])), plane):
            raise OtherFrameError(fault)


def quarantined_to_message(records: Sequence[CountRecord], frame_id: str = FRAME) -> PointCloud2:
    """Message of quarantined records, as :func:`counts_to_message` with the numbers of their reasons.

    Counts above the largest number of the field become this number.

    :raises ValueError: without records
    """
    points, stamp_s = count_points(records, quarantined=True)
    return points_to_message(points, stamp_s, frame_id)


def counts_from_message(message: PointCloud2) -> list[CountRecord]:
    """Records of a message of either topic; fields are found by name, others are ignored.

    Records of a message without ``stamp_offset_s`` get the stamp of the message.

    :raises ValueError: if a field is missing or of another type, or the data are shorter than announced
    """
    check_fields(message, COUNT_POINT)
    return count_records(message)


# ``samples``: the merged samples as a sensor_msgs/PointCloud2, one point per sample, in the plane z = 0 ---------


def samples_to_message(samples: Samples, stamp_s: float, frame_id: str = FRAME) -> PointCloud2:
    """Message of samples."""
    return points_to_message(sample_points(samples), stamp_s, frame_id)


def samples_from_message(message: PointCloud2) -> Samples:
    """Samples of a message; ``ValueError`` if a field or value is impossible."""
    points = points_from_message(message, SAMPLE_AREA).ravel()
    xy = np.column_stack([points["x"], points["y"]])
    spread = np.column_stack([points[name] for name in SAMPLE_SPREAD])
    return Samples(xy, points["raw_counts"], points["effective_exposure_s"], spread)


# Lines of the devices as std_msgs/String, so that a replay can start from the bytes ----------------------------


def line_to_message(line: bytes) -> String:
    """Message of a line: each byte is one character."""
    return String(data=line_text(line))

# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Contents of the messages of nodes and recordings, without ROS: points, lines and visits."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Final, Protocol

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.exploration import Visit, VisitEnd
from soilmoist_ros.foundation import LatLon, foreign_text
from soilmoist_ros.sensing import CountRecord, Kind

if TYPE_CHECKING:
    from soilmoist_ros.mapping import Samples  # nodes that do not map need none of its code in memory

_TYPES: Final = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}
"""Kinds of numbers by the datatypes of PointField."""
DATATYPES: Final[Mapping[str, int]] = MappingProxyType({f"<{_TYPES[number]}": number for number in (6, 7, 8)})
"""Datatypes of PointField that messages of this package have, by kind of number."""
CLOUD: Final = "sensor_msgs/msg/PointCloud2"
VISIT: Final = "soilmoist_msgs/msg/Visit"
FRAME: Final = "map"
"""Frame of places: east, north, up about the datum of the field."""
STAMP_OFFSET: Final = "stamp_offset_s"
"""Field of ``counts``: stamp of the record minus stamp of the message [s]; missing in older messages."""

QUARANTINED: Final = "quarantined_counts"
"""Topic of the records that are quarantined, next to ``counts``."""
REASON: Final = "reason"
"""Field of ``quarantined_counts``: number of the reason."""
_KINDS: Final = (
    *(Kind.NOISY_TUBE, Kind.DEAD_TUBE, Kind.STUCK_TUBE, Kind.IMPOSSIBLE_COUNT, Kind.IMPOSSIBLE_WEATHER),
    *(Kind.FROZEN_PRESSURE, Kind.PLACE_JUMP, Kind.CLOCK_DRIFT, Kind.OVERDISPERSED, Kind.UNEXPECTED_COUNT),
    *(Kind.RATE_JUMP, Kind.PLACE_DOUBT),
)
REASONS: Final[Mapping[int, str]] = MappingProxyType({number: kind.value for number, kind in enumerate(_KINDS, 1)})
"""Reason codes by number. Bags hold the numbers: they never change, new ones are added at the end."""
UNKNOWN_REASON: Final = "unknown_reason"  # reason code of a number that is not in the table, such as 0


class PointCloud(Protocol):
    """The fields of a sensor_msgs/PointCloud2, decoded by ROS or by rosbags."""

    header: Any
    height: int
    width: int
    fields: Any
    is_bigendian: bool
    point_step: int
    row_step: int
    data: Any


def points(cloud: PointCloud) -> np.ndarray[Any, np.dtype[Any]]:
    """Points as a structured array of shape (height, width) with the message's fields.

    :raises ValueError: if its data are too short, or the datatype of a field is unknown
    """
    order = ">" if cloud.is_bigendian else "<"
    names, formats, offsets = [], [], []
    for field in cloud.fields:
        kind = _TYPES.get(int(field.datatype))
        if kind is None:
            raise ValueError(f"field {field.name!r} has the unknown datatype {field.datatype}")
        names.append(field.name)
        formats.append((order + kind, (int(field.count),)) if int(field.count) > 1 else order + kind)
        offsets.append(int(field.offset))
    layout = np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": int(cloud.point_step)})
    data = bytes(cloud.data)
    height, width = int(cloud.height), int(cloud.width)
    row_step = int(cloud.row_step) or width * layout.itemsize
    if height and (row_step < width * layout.itemsize or len(data) < row_step * height):
        raise ValueError(f"the message announces {height * width} points, but its data end early")
    if not height * width:
        return np.zeros((height, width), layout)
    return np.ndarray((height, width), layout, data, strides=(row_step, layout.itemsize)).copy()


def count_records(cloud: PointCloud) -> list[CountRecord]:
    """Counted records of a message of ``counts`` or, with a field ``reason``, ``quarantined_counts``.

    Records of a message without ``stamp_offset_s`` get the stamp of the message.

    :raises ValueError: if a field of counted records is missing
    """
    table = points(cloud).ravel()
    names = table.dtype.names or ()
    missing = [name for name in _COUNTS if name not in names]
    if missing:
        raise ValueError(f"the points have no field {', '.join(missing)}, only: {', '.join(names)}")
    # Columns of plain numbers are ten times faster than one point after the other.
    columns: list[list[Any]] = [
        table[name].astype(np.int64 if name == "raw_counts" else np.float64).reshape(len(table)).tolist()
        for name in _COUNTS
    ]
    stamp_s = cloud.header.stamp.sec + cloud.header.stamp.nanosec * 1e-9
    offsets = table[STAMP_OFFSET] if STAMP_OFFSET in names else np.zeros(len(table))
    columns.insert(0, (stamp_s + offsets.astype(np.float64).reshape(len(table))).tolist())
    if REASON in names:
        numbers = table[REASON].reshape(len(table)).tolist()
        columns.append([REASONS.get(int(number), UNKNOWN_REASON) for number in numbers])
    return [CountRecord(*values) for values in zip(*columns, strict=True)]


def quarantined_topic(counts: str) -> str:
    """Topic with the quarantined records of a driver, next to its ``counts``.

    >>> quarantined_topic("/robot_1/counts")
    '/robot_1/quarantined_counts'
    """
    return f"{counts.rpartition('/')[0]}/{QUARANTINED}" if "/" in counts else QUARANTINED


# Records as points, as the driver publishes them and recordings have them ---------------------------------------

# Viewers read x, y and z only as 32-bit floats: 0.5 mm at 5 km from the datum. Exposures and factors enter the
# statistics, so they keep 64 bits.
_FACTORS: Final = ("f_pressure", "f_humidity", "f_intensity")
COUNT_POINT: Final = np.dtype(
    [
        *((axis, "<f4") for axis in ("x", "y", "z")),
        ("raw_counts", "<u4"),
        *((name, "<f8") for name in ("exposure_s", "effective_exposure_s", "corrected_rate", *_FACTORS)),
    ]
)
# In the order of the fields of CountRecord, after its stamp.
_COUNTS: Final = tuple(name for name in COUNT_POINT.names or () if name != "corrected_rate")
_STAMPED: Final = np.dtype([*COUNT_POINT.descr, (STAMP_OFFSET, "<f8")])
_QUARANTINED: Final = np.dtype([*_STAMPED.descr, (REASON, "<u4")])
COUNT_DATUM: Final = ("datum_latitude_deg", "datum_longitude_deg")
_PLACED: Final = np.dtype([*_STAMPED.descr, *((name, "<f8") for name in COUNT_DATUM)])
_MAX_COUNTS: Final = 2**32 - 1
NUMBERS: Final = {code: number for number, code in REASONS.items()}
"""Number of each reason code in ``quarantined_counts``."""
_LAST_SECOND: Final = 2**31 - 1


def count_points(
    records: Sequence[CountRecord], datum: LatLon | None = None, quarantined: bool = False
) -> tuple[NDArray[Any], float]:
    """Points of a message of ``counts`` or ``quarantined_counts``, and the stamp of the message [s].

    The field ``stamp_offset_s`` of a point is the stamp of its record minus the stamp of the message [s].
    Quarantined counts above the largest number of the field become this number.

    :param datum: latitude and longitude of the datum of the places [deg], ``None`` to leave it out
    :raises ValueError: without records
    """
    if not records:
        raise ValueError("a counts message needs at least one record")
    second, nanosecond = stamp_parts(records[-1].stamp_s)
    stamp_s = float(second + nanosecond * 1e-9)
    names = [name for name in _STAMPED.names or () if name not in ("x", "y", "z", "raw_counts", STAMP_OFFSET)]
    table = np.zeros(len(records), _QUARANTINED if quarantined else _PLACED if datum is not None else _STAMPED)
    for axis in ("x", "y", "z"):
        table[axis] = [getattr(one, f"{axis}_m") for one in records]
    counts = [one.raw_counts for one in records]
    table["raw_counts"] = np.minimum(counts, _MAX_COUNTS) if quarantined else counts
    for name in names:
        table[name] = [getattr(one, name) for one in records]
    table[STAMP_OFFSET] = [one.stamp_s - stamp_s for one in records]
    if quarantined:
        table[REASON] = [NUMBERS.get(one.quarantine, 0) for one in records]
    elif datum is not None:
        table[COUNT_DATUM[0]], table[COUNT_DATUM[1]] = datum
    return table, stamp_s


# Samples as points, in the plane z = 0 ---------------------------------------------------------------------------

# Viewers read x, y and z only as 32-bit floats. Counts and exposures enter the statistics and grow without limit.
SAMPLE_SPREAD: Final = ("spread_xx", "spread_xy", "spread_yy", "footprint_radius_m")
SAMPLE_AREA: Final = np.dtype([
    *((name, "<f4") for name in "xyz"), ("raw_counts", "<f8"), ("effective_exposure_s", "<f8"),
    *((name, "<f4") for name in SAMPLE_SPREAD),
])  # fmt: skip


def sample_points(samples: Samples) -> NDArray[Any]:
    """Points of a message of ``samples``, shape (n,)."""
    table = np.zeros(len(samples), SAMPLE_AREA)
    table["x"], table["y"] = samples.xy.T
    table["raw_counts"] = samples.counts
    table["effective_exposure_s"] = samples.exposure_s
    for name, moments in zip(SAMPLE_SPREAD, samples.spread.T, strict=True):
        table[name] = moments
    return table


# Times, lines of the devices, visits ----------------------------------------------------------------------------

# A ROS string ends at the first zero. Latin-1 lacks this character, so every line is restored exactly.
_ZERO: Final = "\N{SYMBOL FOR NULL}"


def stamp_parts(stamp_s: float) -> tuple[int, int]:
    """Seconds and nanoseconds of a time; zero, which means unknown in ROS, if a message cannot represent it.

    :param stamp_s: seconds since 1970 UTC; NaN if unknown
    """
    if not (math.isfinite(stamp_s) and 0 <= stamp_s < _LAST_SECOND):
        return 0, 0
    second = math.floor(stamp_s)
    nanosecond = round((stamp_s - second) * 1e9)  # only the fraction, so that the sum restores stamp_s
    return second + nanosecond // 1_000_000_000, nanosecond % 1_000_000_000


def line_text(line: bytes) -> str:
    """Text of a line of a device: each byte is one character."""
    return line.decode("latin-1").replace("\0", _ZERO)


def line_bytes(text: str) -> bytes:
    """Line of a text of :func:`line_text`; characters of other texts that are no byte become question marks."""
    return text.replace(_ZERO, "\0").encode("latin-1", "replace")


def visit_values(visit: Visit) -> dict[str, Any]:
    """Numbers and texts of a soilmoist_msgs/Visit, by field."""
    return {
        "stop": visit.name,
        "arrival_s": float(visit.arrived_s),
        "dwell_s": float(visit.dwell_s),
        "dwell_rule": visit.dwell,
        "records": int(visit.records),
        "raw_counts": int(visit.raw_counts),
        "exposure_s": float(visit.exposure_s),
        "effective_exposure_s": float(visit.effective_exposure_s),
        "choice": visit.reason,
        "reason_code": str(visit.ended),
        "reason": visit.outcome,
    }


def visit_of(message: Any, robot: int = 1) -> Visit:
    """The visit of a soilmoist_msgs/Visit of ROS or rosbags; an unknown code becomes ``VisitEnd.UNKNOWN``.

    :raises ValueError: if a field of a visit is missing
    """
    try:
        return Visit(
            name=foreign_text(str(message.stop)),
            x_m=float(message.position.x),
            y_m=float(message.position.y),
            arrived_s=float(message.arrival_s),
            dwell_s=float(message.dwell_s),
            raw_counts=int(message.raw_counts),
            reason=foreign_text(str(message.choice)),
            robot=robot,
            records=int(message.records),
            exposure_s=float(message.exposure_s),
            effective_exposure_s=float(message.effective_exposure_s),
            ended=VisitEnd(code) if (code := str(message.reason_code)) in set(VisitEnd) else VisitEnd.UNKNOWN,
            outcome=foreign_text(str(message.reason)),
            dwell=foreign_text(str(message.dwell_rule)),
            arrival_stamp_s=_seconds(message.arrival),
            end_stamp_s=_seconds(message.header.stamp),
            stop_x_m=float(message.stop_position.x),
            stop_y_m=float(message.stop_position.y),
        )
    except AttributeError as error:
        raise ValueError(f"the message is not a visit: {error}") from None


def _seconds(stamp: Any) -> float:
    return float(stamp.sec + stamp.nanosec * 1e-9) or math.nan

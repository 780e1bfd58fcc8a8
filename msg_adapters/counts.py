"""``counts``: corrected, geo-tagged records as a sensor_msgs/PointCloud2, one point per record."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import Final

import numpy as np
from builtin_interfaces.msg import Time
from sensor_msgs.msg import PointCloud2, PointField
from std_msgs.msg import Header

from soilmoist_ros.sensing.records import CountRecord

FRAME: Final = "map"
"""East-north-up metres about the field's datum."""

# Viewers take x, y and z only as 32-bit floats: 0.5 mm at 5 km from the datum. Exposures and factors enter the
# statistics, so they keep all their digits.
_POINT: Final = np.dtype(
    [
        ("x", "<f4"),
        ("y", "<f4"),
        ("z", "<f4"),
        ("raw_counts", "<u4"),
        ("exposure_s", "<f8"),
        ("effective_exposure_s", "<f8"),
        ("corrected_rate", "<f8"),
        ("f_pressure", "<f8"),
        ("f_humidity", "<f8"),
        ("f_intensity", "<f8"),
    ]
)
_DATATYPES: Final = {"<f4": PointField.FLOAT32, "<f8": PointField.FLOAT64, "<u4": PointField.UINT32}


def counts_to_message(records: Sequence[CountRecord], frame_id: str = FRAME) -> PointCloud2:
    """Message of records; its stamp is the end of the last one's counting interval.

    :param records: at least one
    :raises ValueError: without records
    """
    if not records:
        raise ValueError("a counts message needs at least one record")
    points = np.array(
        [
            (
                record.x_m,
                record.y_m,
                record.z_m,
                record.raw_counts,
                record.exposure_s,
                record.effective_exposure_s,
                record.corrected_rate,
                record.f_pressure,
                record.f_humidity,
                record.f_intensity,
            )
            for record in records
        ],
        dtype=_POINT,
    )
    return PointCloud2(
        header=Header(stamp=_to_time(records[-1].stamp_s), frame_id=frame_id),
        height=1,
        width=len(points),
        fields=[
            PointField(name=name, offset=_offset(name), datatype=_DATATYPES[_POINT[name].str], count=1)
            for name in _POINT.names or ()
        ],
        is_bigendian=False,
        point_step=_POINT.itemsize,
        row_step=_POINT.itemsize * len(points),
        data=points.tobytes(),
        is_dense=bool(np.isfinite(points["z"]).all()),
    )


def counts_from_message(message: PointCloud2) -> list[CountRecord]:
    """Records of a message; fields are found by name, others are ignored.

    Every record gets the stamp of the message.

    :raises ValueError: if a field is missing or of another type, or the data are shorter than announced
    """
    if message.is_bigendian != (sys.byteorder == "big"):
        raise ValueError("the byte order of the message is not this machine's")
    found = {field.name: field for field in message.fields}
    for name in _POINT.names or ():
        if name not in found:
            raise ValueError(f"the message has no field {name!r}, only: {', '.join(found) or 'none'}")
        if found[name].datatype != _DATATYPES[_POINT[name].str]:
            raise ValueError(f"field {name!r} is of datatype {found[name].datatype}, not {_POINT[name].str}")
    count = message.height * message.width
    if len(message.data) < count * message.point_step:
        raise ValueError(f"the message announces {count} points, but its data end early")
    names = list(_POINT.names or ())
    layout = np.dtype(
        {
            "names": names,
            "formats": [_POINT[name] for name in names],
            "offsets": [found[name].offset for name in names],
            "itemsize": message.point_step,
        }
    )
    stamp_s = message.header.stamp.sec + message.header.stamp.nanosec * 1e-9
    return [
        CountRecord(
            stamp_s=stamp_s,
            x_m=float(point["x"]),
            y_m=float(point["y"]),
            z_m=float(point["z"]),
            raw_counts=int(point["raw_counts"]),
            exposure_s=float(point["exposure_s"]),
            effective_exposure_s=float(point["effective_exposure_s"]),
            f_pressure=float(point["f_pressure"]),
            f_humidity=float(point["f_humidity"]),
            f_intensity=float(point["f_intensity"]),
        )
        for point in np.frombuffer(bytes(message.data), dtype=layout, count=count)
    ]


def _offset(name: str) -> int:
    assert _POINT.fields is not None  # it is a structure
    return _POINT.fields[name][1]


def _to_time(stamp_s: float) -> Time:
    nanoseconds = round(stamp_s * 1e9)
    return Time(sec=nanoseconds // 1_000_000_000, nanosec=nanoseconds % 1_000_000_000)

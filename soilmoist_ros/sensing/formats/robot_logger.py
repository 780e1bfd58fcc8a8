# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Writes the lines of the robot's sensor: format ``thorvald_crs``.

``config/loggers/thorvald_crs.yaml`` defines the format. The virtual logger uses these functions;
:class:`RecordParser` reads the lines.
"""

from __future__ import annotations

import math
from datetime import UTC, datetime, timedelta

from soilmoist_ros.sensing.formats.log_values import nmea_checksum
from soilmoist_ros.sensing.records import LoggerRecord

FORMAT_NAME = "thorvald_crs"
PROTOCOL = "thorvald_crs/1"
TUBES = 12
PERIOD_S = 10.0
RECORDS_PER_HEADER = 60  # number of records after which the header is repeated; it is also sent on connection
COLUMNS = (
    "stamp_utc", "record", "live_s", "pressure_hpa", "temperature_degc", "relative_humidity_pct",
    *(f"n{tube:02d}" for tube in range(1, TUBES + 1)),
)  # fmt: skip


def format_header(serial: str = "virtual", period_s: float = PERIOD_S, simulated: bool = False) -> str:
    """The header: lines with checksums, separated by line ends; the last line has no line end.

    :param serial: serial number of the sensor; printable ASCII without ``*``
    :param period_s: nominal duration of a record [s]
    :param simulated: whether the counts are simulated; reports then contain a notice
    :raises ValueError: if the serial number cannot be written
    """
    if not (
        serial.isascii() and serial.isprintable() and serial.strip() == serial and serial and "*" not in serial
    ):
        raise ValueError(f"the serial number {serial!r} must be printable ASCII without a star")
    texts = [f"#logger={PROTOCOL}", f"#serial={serial}", f"#record_period={period_s:g} s"]
    texts += ["#simulated=yes"] if simulated else []
    texts.append("#" + ",".join(COLUMNS))
    return "\n".join(_with_checksum(text) for text in texts)


def format_record(record: LoggerRecord) -> str:
    """One record as a line with a checksum, without a line end.

    The resolution of stamp and live time is 1 ms; of pressure, temperature and humidity 0.01 hPa, degC and %.

    :param record: counts of 12 tubes, NaN for a missing tube; the position is not sent
    :raises ValueError: if there are not 12 tubes, or their live times differ
    """
    if len(record.tube_counts) != TUBES:
        raise ValueError(f"the sensor has {TUBES} tubes, the record {len(record.tube_counts)}")
    live = {live_s for live_s in record.tube_live_s if not math.isnan(live_s)}
    if len(live) != 1:
        raise ValueError(f"the tubes must have the same live time, the record has {sorted(live)}")
    fields = [
        _stamp(record.stamp_s), str(record.record_number) if record.record_number >= 0 else "",
        f"{live.pop():.3f}", _number(record.pressure_hpa, 2), _number(record.temperature_degc, 2),
        _number(record.relative_humidity * 100, 2), *(_number(count, 0) for count in record.tube_counts),
    ]  # fmt: skip
    return _with_checksum(",".join(fields))


def _stamp(stamp_s: float) -> str:
    moment = datetime(1970, 1, 1, tzinfo=UTC) + timedelta(milliseconds=round(stamp_s * 1000))
    return f"{moment:%Y-%m-%dT%H:%M:%S}.{moment.microsecond // 1000:03d}Z"


def _number(value: float, digits: int) -> str:
    return "" if math.isnan(value) else f"{value:.{digits}f}"


def _with_checksum(text: str) -> str:
    return f"{text}*{nmea_checksum(text.encode('ascii')):02X}"

# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Conversion of the fields of one line to a record, or to the reason of a lost record."""

import math

from soilmoist_ros.sensing.formats.log_layout import build_layout
from soilmoist_ros.sensing.formats.logger_format import LoggerFormat, load_logger_format
from soilmoist_ros.sensing.formats.logger_reader import RecordParser

FORMAT = LoggerFormat.model_validate(
    {
        "title": "mine",
        "source": "a test",
        "header": {},
        "time": {"columns": ["time"], "formats": ["unix_s"], "marks": "start"},
        "record_number": ["number"],
        "counts": {"columns": ["n{tube}"], "sentinels": [-1], "range": [0, 1000]},
        "live_time": {"columns": ["live{tube}"], "unit": "ms"},
        "record_period": {"default_s": 60},
        "humidity": {"sensors": [{"column": "rh", "unit": "percent"}], "sentinels": [-99]},
        "position": {
            "latitude": ["lat"], "longitude": ["lon"], "longitude_signed": False, "time_of_day": ["clock"],
        },
    }
)  # fmt: skip
NAMES = ("time", "number", "n1", "n2", "live1", "live2", "rh", "lat", "lon", "clock")
FIELDS = {
    "time": "1714557600", "number": "7", "n1": "40", "n2": "44", "live1": "59000", "live2": "60000",
    "rh": "50", "lat": "38.7", "lon": "97.4", "clock": "100055",
}  # fmt: skip


def read(**changes):
    parser = RecordParser(FORMAT, "west")
    assert parser.feed(",".join(NAMES).encode()) is None
    return parser.feed(",".join({**FIELDS, **changes}.values()).encode()), parser.problems


def test_units_side_and_end_of_the_interval():
    record, problems = read()
    assert (record.tube_counts, record.tube_live_s) == ((40, 44), (59, 60))
    assert (record.relative_humidity, record.record_number, record.line) == (0.5, 7, 2)
    assert (record.position.latitude_deg, record.position.longitude_deg) == (38.7, -97.4)
    assert record.stamp_s == 1714557660  # the stamp marks the start, the period is 60 s
    assert record.clock_ahead_s == 5.0
    assert problems == []


def test_a_missing_tube_is_nan_and_a_value_slightly_above_saturation_is_saturation():
    record, _ = read(n2="-1", rh="103")
    assert math.isnan(record.tube_counts[1])
    assert math.isnan(record.tube_live_s[1])
    assert record.relative_humidity == 1.0


def test_live_time_of_a_pair_of_tubes():
    rover = load_logger_format("hydroinnova_rover")
    names = ["RecordNum", "Date Time(UTC)", *(f"N{i}Cts" for i in range(1, 5)), "N1ETsec", "N3ETsec"]
    layout = build_layout(rover, [*names, "LatDec", "LongDec"])
    assert [source.name for source in layout.live if source] == ["N1ETsec", "N1ETsec", "N3ETsec", "N3ETsec"]
    own = build_layout(rover, ["Date Time(UTC)", "N1Cts", "N2Cts", "N1ETsec", "N2ETsec", "LatDec", "LongDec"])
    assert [source.name for source in own.live if source] == ["N1ETsec", "N2ETsec"]

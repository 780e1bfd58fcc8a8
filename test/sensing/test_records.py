# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Output records of the sensor, and public names of the folder."""

import math

import pytest

from soilmoist_ros import sensing
from soilmoist_ros.sensing.records import CountRecord, LoggerRecord

NAN = math.nan
MAX_LINE = 115


@pytest.mark.parametrize(
    ("thing", "text"),
    [
        (CountRecord(1714557610.0, 1.0, -2.25, NAN, 60, 10.0, 8.0),
         "CountRecord(2024-05-01 10:00:10Z, x=1.0 m, y=-2.2 m, 60 counts, 7.50 counts/s)"),
        (CountRecord(NAN, NAN, NAN, NAN, 60, 10.0, 10.0),
         "CountRecord(nan s, x=nan m, y=nan m, 60 counts, 6.00 counts/s)"),
        (LoggerRecord(1714557610.0, (5.0, NAN, 6.0), (10.0, NAN, 10.0), line=7),
         "LoggerRecord(2024-05-01 10:00:10Z, 11 counts of 2 of 3 tubes, line 7)"),
        (sensing.Site(name="north"), "Site(name='north')"),
        (sensing.Track(), "Track(0 positions)"),
        (sensing.load_logger_format("thorvald_crs"), None),
    ],
)  # fmt: skip
def test_the_text_of_a_result_fits_a_line(thing, text) -> None:
    assert len(repr(thing)) <= MAX_LINE
    assert text is None or repr(thing) == text

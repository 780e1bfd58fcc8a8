# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The last header of a logger, for a driver that starts again."""

import os

import pytest

from soilmoist_ros.nodes.wiring.driver_header import NAME, StoredHeader
from soilmoist_ros.sensing.formats.log_layout import Header

LOGGER = ("tcp://192.168.1.20:5000", "hydroinnova_rover")
HEADER = Header(("RecordNum", "Temp °C"), ("", "°C"), {"Recordperiod": "1 minutes."})


def test_a_header_comes_back_for_the_same_logger_only(tmp_path):
    stored = StoredHeader(tmp_path, *LOGGER)
    assert stored.header is None
    stored.update(HEADER)
    assert StoredHeader(tmp_path, *LOGGER).header == HEADER
    os.utime(tmp_path / NAME, (1.75e9, 1.75e9))
    assert StoredHeader(tmp_path, *LOGGER).header.stored_s == 1.75e9
    assert StoredHeader(tmp_path, "serial:///dev/ttyUSB0", LOGGER[1]).header is None
    assert StoredHeader(tmp_path, LOGGER[0], "toa5").header is None


def test_a_header_is_written_once_and_replaced_by_another(tmp_path):
    stored = StoredHeader(tmp_path, *LOGGER)
    stored.update(HEADER)
    (tmp_path / NAME).unlink()
    stored.update(HEADER)
    assert not (tmp_path / NAME).exists()
    stored.update(Header(("RecordNum",)))
    assert StoredHeader(tmp_path, *LOGGER).header == Header(("RecordNum",))


@pytest.mark.parametrize("content", [b"", b"{", b"[]", b"1", b"\xff", b"[" * 100_000])
def test_a_damaged_file_is_ignored(content, tmp_path, caplog):
    (tmp_path / NAME).write_bytes(content)
    stored = StoredHeader(tmp_path, *LOGGER)
    assert stored.header is None
    assert NAME in caplog.text
    stored.update(HEADER)
    assert StoredHeader(tmp_path, *LOGGER).header == HEADER


def test_a_file_with_parts_of_another_type_is_ignored(tmp_path):
    StoredHeader(tmp_path, *LOGGER).update(HEADER)
    path = tmp_path / NAME
    path.write_text(path.read_text().replace('"1 minutes."', "1").replace('"RecordNum"', "null"))
    assert StoredHeader(tmp_path, *LOGGER).header == Header(
        ("None", "Temp °C"), HEADER.units, {"Recordperiod": "1"}
    )
    path.write_text(path.read_text().replace('"units": [', '"units": 5, "others": ['))
    assert StoredHeader(tmp_path, *LOGGER).header is None

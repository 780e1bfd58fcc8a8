# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Columns of a log are found by name."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from soilmoist_ros.sensing.formats.log_layout import MissingColumnsError, build_layout
from soilmoist_ros.sensing.formats.logger_format import load_logger_format

ROVER = load_logger_format("hydroinnova_rover")


def test_live_time_of_a_pair_of_tubes() -> None:
    rover = load_logger_format("hydroinnova_rover")
    names = ["RecordNum", "Date Time(UTC)", *(f"N{i}Cts" for i in range(1, 5)), "N1ETsec", "N3ETsec"]
    layout = build_layout(rover, [*names, "LatDec", "LongDec"])
    assert [source.name for source in layout.live if source] == ["N1ETsec", "N1ETsec", "N3ETsec", "N3ETsec"]
    own = build_layout(rover, ["Date Time(UTC)", "N1Cts", "N2Cts", "N1ETsec", "N2ETsec", "LatDec", "LongDec"])
    assert [source.name for source in own.live if source] == ["N1ETsec", "N2ETsec"]


def test_missing_columns_are_all_named() -> None:
    with pytest.raises(MissingColumnsError) as caught:
        build_layout(load_logger_format("hydroinnova_rover"), ["RecordNum"])
    assert len(caught.value.columns) == 3


@pytest.mark.slow
@settings(deadline=None)
@given(st.lists(st.text(max_size=12), max_size=30))
def test_any_header_is_a_layout_or_says_what_is_missing(names) -> None:
    missing = None
    try:
        build_layout(ROVER, names)
    except MissingColumnsError as error:
        missing = error.columns
    assert missing is None or missing

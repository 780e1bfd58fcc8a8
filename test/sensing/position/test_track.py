# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
import math
import tracemalloc

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from soilmoist_ros.sensing.gnss import Fix, FixStatus
from soilmoist_ros.sensing.position.track import Track
from soilmoist_ros.sensing.records import Position


def fix(stamp_s, latitude=52.0, longitude=13.0, altitude=30.0, sd=0.02, status=FixStatus.RTK) -> Fix:
    return Fix(stamp_s, Position(latitude, longitude, altitude, sd), status)


LINE = [fix(0.0, 52.0, 13.0, 30.0, 0.02), fix(10.0, 52.2, 13.1, 40.0, 0.05)]


def test_linear_between_two_fixes() -> None:
    position = Track(LINE).at(2.5, 10.0)
    assert position is not None
    assert position.latitude_deg == pytest.approx(52.05)
    assert position.longitude_deg == pytest.approx(13.025)
    assert position.altitude_m == pytest.approx(32.5)
    assert position.horizontal_sd_m == 0.05


def test_a_fix_is_reproduced() -> None:
    assert Track(LINE).at(10.0, 1.0) == LINE[1].position


def test_too_long_a_gap() -> None:
    track = Track(LINE)
    assert track.at(5.0, 9.0) is None
    assert track.at(0.4, 9.0) == LINE[0].position
    assert track.at(9.7, 9.0) == LINE[1].position
    assert track.at(0.6, 9.0) is None


@pytest.mark.parametrize(
    ("stamp_s", "found"), [(-0.5, 0), (10.5, 1), (-0.6, None), (10.6, None), (math.nan, None)]
)
def test_outside(stamp_s, found) -> None:
    assert Track(LINE).at(stamp_s, 60.0) == (None if found is None else LINE[found].position)


def test_order_doubles_and_invalid_fixes_do_not_matter() -> None:
    odd = [fix(5.0, status=FixStatus.NO_FIX), fix(math.nan), fix(5.0, math.nan), fix(10.0, 0.0)]
    track = Track([LINE[1], *odd, LINE[0]])
    assert len(track) == 2
    assert track.at(2.5, 10.0) == Track(LINE).at(2.5, 10.0)


def test_across_180_degrees() -> None:
    track = Track([fix(0.0, longitude=179.8), fix(10.0, longitude=-179.8)])
    assert track.at(2.5, 10).longitude_deg == pytest.approx(179.9)
    assert track.at(7.5, 10).longitude_deg == pytest.approx(-179.9)


def test_empty_track() -> None:
    assert len(Track([])) == 0
    assert Track([]).at(0.0, 10.0) is None


def test_from_positions() -> None:
    track = Track.from_positions([(one.stamp_s, one.position) for one in LINE])
    assert track.at(2.5, 10.0) == Track(LINE).at(2.5, 10.0)


def test_unknown_altitude_and_sd_stay_unknown() -> None:
    position = Track([fix(0.0, altitude=math.nan, sd=math.nan), fix(1.0)]).at(0.5, 10.0)
    assert math.isnan(position.altitude_m)
    assert math.isnan(position.horizontal_sd_m)


@settings(deadline=None)
@given(st.floats(allow_nan=True), st.floats(0, 100), st.lists(st.floats(0, 100), max_size=6))
def test_never_raises_and_stays_within_its_neighbours(stamp_s, gap_s, stamps) -> None:
    track = Track([fix(one, 50 + one / 100) for one in stamps])
    position = track.at(stamp_s, gap_s)
    assert position is None or 50 <= position.latitude_deg <= 51


@pytest.mark.slow
def test_a_growing_track_ignores_epochs_that_are_not_later() -> None:
    track = Track()
    for stamp_s, place in [(0.0, LINE[0]), (10.0, LINE[1]), (10.0, LINE[0]), (5.0, LINE[0])]:
        track.add(stamp_s, place.position)
    track.add(12.0, None)
    track.add(math.nan, LINE[0].position)
    assert (len(track), track.fixed_s, track.reached_s) == (2, 10.0, 12.0)
    assert track.at(10.0, 1.0) == LINE[1].position


def test_a_growing_track_starts_again_when_the_receiver_corrects_its_clock() -> None:
    track = Track()
    track.add(1e9, LINE[0].position)
    track.add(5.0, LINE[1].position)
    assert (len(track), track.fixed_s) == (1, 5.0)


def test_only_the_latest_positions_are_remembered() -> None:
    track = Track(max_positions=10)
    for second in range(1000):
        track.add(float(second), fix(0.0, 50 + second / 1000).position)
    assert 10 <= len(track) <= 20
    assert track.at(999.0, 1.0).latitude_deg == pytest.approx(50.999)
    assert track.at(0.0, 1.0) is None


def test_a_long_track_needs_little_memory_and_knows_its_oldest_positions() -> None:
    tracemalloc.start()
    before, _ = tracemalloc.get_traced_memory()
    track = Track(max_positions=2000)
    for second in range(3999):
        track.add(float(second), fix(0.0, 50 + second / 1000, 13 + second / 1000, second / 7, second / 3).position)
    needed, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert (needed - before) / len(track) < 100  # a position as an object needs 200 bytes
    assert track.at(0.5, 1.0).latitude_deg == pytest.approx(50.0005)

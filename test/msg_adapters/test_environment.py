# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Fixes and weather over the wire."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip("rclpy")
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import BatteryState, NavSatFix, NavSatStatus

from msg_adapters.environment import (
    battery_from_message,
    diagnostics_from_message,
    diagnostics_to_message,
    fix_to_message,
    health_from_status,
    health_to_status,
    weather_to_messages,
)
from soilmoist_ros.foundation import Health, Level, foreign_text
from soilmoist_ros.sensing.gnss import CovarianceKind, Fix, FixStatus, covariance_of_ellipse, fix_from_message
from soilmoist_ros.sensing.records import LoggerRecord, Position

NAN = math.nan
T0 = 1.78e9


def numbers(low, high):
    return st.floats(low, high, allow_nan=False)


sds = numbers(1e-3, 1e3)


@st.composite
def fixes(draw):
    covariance = covariance_of_ellipse(draw(sds), draw(sds), 0.0, draw(sds))
    sd = math.sqrt((covariance[0][0] + covariance[1][1]) / 2)
    latitude_deg = draw(numbers(-90, 90).filter(bool))  # 0, 0 is no place
    place = Position(latitude_deg, draw(numbers(-180, 180)), draw(numbers(-400, 9000)), sd)
    status = draw(st.sampled_from([status for status in FixStatus if status is not FixStatus.NO_FIX]))
    kind = draw(st.sampled_from([kind for kind in CovarianceKind if kind is not CovarianceKind.UNKNOWN]))
    stamp_s = T0 + draw(st.integers(0, 10**9)) / 16
    return Fix(stamp_s, place, status, geoid_separation_m=0.0, covariance_m2=covariance, covariance_kind=kind)


def over_the_wire(message):
    return deserialize_message(serialize_message(message), type(message))


@given(fixes())
def test_fixes_come_back_over_the_wire(fix):
    found = fix_from_message(over_the_wire(fix_to_message(fix, "gnss")))
    for name in ("position", "status", "geoid_separation_m", "covariance_m2", "covariance_kind"):
        assert getattr(found, name) == getattr(fix, name)
    assert found.stamp_s == pytest.approx(fix.stamp_s, abs=1e-6)


def test_altitudes_are_above_the_ellipsoid_and_no_fix_is_published_as_such():
    place = Position(53.0, -0.5, 30.0)
    known = fix_to_message(Fix(T0, place, FixStatus.FIX, geoid_separation_m=48.0), "gnss")
    assert (known.altitude, known.header.frame_id) == (78.0, "gnss")
    assert math.isnan(fix_to_message(Fix(T0, place, FixStatus.FIX), "gnss").altitude)
    message = over_the_wire(fix_to_message(Fix(T0, Position(NAN, NAN), FixStatus.NO_FIX), "gnss"))
    assert message.status.status == NavSatStatus.STATUS_NO_FIX
    assert math.isnan(message.latitude)
    assert message.position_covariance_type == NavSatFix.COVARIANCE_TYPE_UNKNOWN
    assert set(message.position_covariance) == {0.0}


@given(
    st.integers(-128, 127),
    st.floats(),
    st.floats(),
    st.lists(st.floats(), min_size=9, max_size=9),
    st.integers(0, 255),
)
def test_any_message_is_a_fix_with_a_place_or_none(status, latitude, longitude, covariance, kind):
    message = NavSatFix(
        status=NavSatStatus(status=status), latitude=latitude, longitude=longitude, position_covariance=covariance,
        position_covariance_type=kind,
    )  # fmt: skip
    found = fix_from_message(message)
    placed = abs(found.position.latitude_deg) <= 90 and abs(found.position.longitude_deg) <= 180
    assert placed == (found.status is not FixStatus.NO_FIX)
    assert (found.status is FixStatus.NO_FIX) or int(found.status) == status


@given(numbers(300, 1085), numbers(-60, 65), numbers(0, 1))
def test_weather_comes_back_in_the_units_of_the_messages(pressure_hpa, temperature_degc, humidity):
    record = LoggerRecord(T0 + 0.5, (), (), pressure_hpa, temperature_degc, humidity)
    messages = {name: over_the_wire(message) for name, message in weather_to_messages(record, "crs").items()}
    assert messages["pressure"].fluid_pressure == pytest.approx(100 * pressure_hpa)
    assert messages["temperature"].temperature == temperature_degc
    assert messages["relative_humidity"].relative_humidity == humidity
    for message in messages.values():
        assert (message.header.stamp.nanosec, message.header.frame_id) == (500_000_000, "crs")


# State of the battery <-> message -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("percentage", "voltage", "found"),
    [
        (0.5, 0.0, (0.5, math.nan)),
        (87.0, 48.0, (0.87, 48.0)),
        (1.0, 48.0, (1.0, 48.0)),
        (math.nan, 48.0, (math.nan, 48.0)),
        (-1.0, 48.0, (math.nan, 48.0)),
        (250.0, 48.0, (math.nan, 48.0)),
        (0.0, 0.0, None),
        (0.0, math.nan, None),
    ],
)
def test_what_drivers_publish(percentage, voltage, found):
    message = BatteryState(present=True, percentage=percentage, voltage=voltage)
    assert battery_from_message(message) == (found and pytest.approx(found, nan_ok=True))


# States of health -----------------------------------------------------------------------------------------------

words = st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=20).map(foreign_text)
healths = st.builds(Health, words, st.sampled_from(Level), words, st.dictionaries(words, words, max_size=3))


@pytest.mark.slow
@given(st.lists(healths, max_size=3))
def test_states_of_health_come_back_over_the_wire(parts):
    sent = diagnostics_to_message(parts, 1.78e9, "driver", "CRS-7")
    message = deserialize_message(serialize_message(sent), DiagnosticArray)
    found = diagnostics_from_message(message)
    assert [(part.level, part.message, part.values) for part in found] == [
        (part.level, part.message, part.values) for part in parts
    ]
    assert [part.name for part in found] == [f"driver: {part.name}" for part in parts]
    assert {status.hardware_id for status in message.status} <= {"CRS-7"}
    assert message.header.stamp.sec == 1_780_000_000


def test_an_unknown_level_is_an_error_and_control_characters_of_other_nodes_do_not_come_in():
    assert health_from_status(DiagnosticStatus(level=b"\x09")).level is Level.ERROR
    odd = "no\x1b[31mrth\r\n\u202e5\x07"
    found = health_from_status(health_to_status(Health(odd, Level.WARN, odd, {odd: odd})))
    assert found == Health("north 5", Level.WARN, "north 5", {"north 5": "north 5"})

# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The mission's status as a diagnostic status."""

import math
from dataclasses import replace

import pytest

pytest.importorskip("diagnostic_msgs")
from diagnostic_msgs.msg import DiagnosticStatus
from hypothesis import given
from hypothesis import strategies as st
from rclpy.serialization import deserialize_message, serialize_message

from msg_adapters.mission import mission_from_message, mission_to_message
from soilmoist_ros.exploration.mission.types import MissionEnd, MissionStatus, Phase
from soilmoist_ros.exploration.planning.forecast import Forecast
from soilmoist_ros.exploration.travel.stop import Stop
from soilmoist_ros.foundation.plain_values import foreign_text

NUMBER = st.floats(0, 1e9)
WORD = st.text(st.characters(codec="utf-8", exclude_characters="\x00"), max_size=20).map(foreign_text)
STATUS = st.builds(
    MissionStatus, now_s=NUMBER, phase=st.sampled_from(Phase), reason=WORD,
    target=st.none() | st.builds(Stop, WORD, NUMBER, NUMBER), planned_dwell_s=NUMBER, dwell_s=NUMBER,
    progress=NUMBER, time_used_s=NUMBER, time_left_s=NUMBER, distance_m=NUMBER, samples=st.integers(0, 99),
    counting_s=NUMBER, raw_counts=st.integers(0, 9999), failures=st.integers(0, 9),
    blacklisted=st.lists(WORD, max_size=3).map(tuple), estimated_end_s=st.none() | NUMBER,
    needs_operator=st.booleans(), silent=st.booleans(),
    ended=st.none() | st.sampled_from(MissionEnd),
    forecast=st.none() | st.just(Forecast(0.03, (60.0, 600.0), (0.02, 0.01), (1.1, 1.2), 0.01, 4.0, hidden=0.06)),
)  # fmt: skip
QUIET = MissionStatus(
    now_s=math.nan, phase=Phase.IDLE, reason="waiting for start", target=None, planned_dwell_s=0.0, dwell_s=0.0,
    progress=0.0, time_used_s=0.0, time_left_s=0.0, distance_m=0.0, samples=0, counting_s=0.0, raw_counts=0,
    failures=0, blacklisted=(), estimated_end_s=None,
)  # fmt: skip


@given(STATUS)
def test_a_status_comes_back(status):
    message = deserialize_message(serialize_message(mission_to_message(status, {"more": "x"})), DiagnosticStatus)
    assert mission_from_message(message) == status


@pytest.mark.parametrize(
    ("change", "level"),
    [
        ({}, 0),
        ({"phase": Phase.COUNTING, "reason": "counting at a (ami:0.03)"}, 0),
        ({"phase": Phase.TRAVELLING, "failures": 1}, 1),
        ({"phase": Phase.PAUSED, "reason": "paused by the operator"}, 1),
        ({"phase": Phase.PAUSED, "reason": "s3 skipped because robot_2 goes there; still paused"}, 1),
        ({"phase": Phase.COUNTING, "reason": "no record from this stop for 60 s", "silent": True}, 1),
        ({"phase": Phase.PAUSED, "reason": "5 failures: ask by the operator", "needs_operator": True}, 2),
    ],
)
def test_the_level_says_whether_somebody_is_needed(change, level):
    assert mission_to_message(replace(QUIET, **change)).level == bytes([level])


def test_what_people_read():
    status = replace(QUIET, phase=Phase.PLANNING, reason="started", estimated_end_s=1780300800.0)
    message = mission_to_message(status)
    values = {pair.key: pair.value for pair in message.values}
    assert (message.name, message.message) == ("mission", "planning: started")
    assert values["estimated_end"] == "2026-06-01T08:00:00+00:00"
    assert values["reason"] == "started"
    assert values["forecast"] == ""
    forecast = Forecast(0.03, (600.0,), (0.02,), (1.2,), 0.02, 4.0)
    values = {pair.key: pair.value for pair in mission_to_message(replace(status, forecast=forecast)).values}
    assert values["forecast"] == "±3.0 % of the rate now, ±2.0 % (1.7 to 2.4) in 10 min"


@pytest.mark.parametrize("alarms", ["5", '"other_robot"', "null", '["other_robot"]'])
def test_alarms_of_another_form_say_nothing(alarms):
    paused = mission_to_message(replace(QUIET, phase=Phase.PAUSED), {"alarms": alarms})
    assert not mission_from_message(paused).yields


def test_control_characters_of_other_robots_do_not_come_in():
    odd = "no\x1b[31mrth\r\n\u202e5\x07"
    found = mission_from_message(
        mission_to_message(
            replace(QUIET, reason=odd, target=Stop(odd, 1.0, 2.0), blacklisted=(odd,), queue=(odd,))
        )
    )
    assert (found.reason, found.target.name, found.blacklisted, found.queue) == (
        "north 5",
        "north 5",
        ("north 5",),
        ("north 5",),
    )

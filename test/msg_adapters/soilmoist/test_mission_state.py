# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The mission's status as numbers and codes."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip("soilmoist_msgs")
from rclpy.serialization import deserialize_message, serialize_message
from soilmoist_msgs.msg import Mission

from msg_adapters.soilmoist.mission_state import mission_state_from_message, mission_state_to_message
from soilmoist_ros.exploration.mission.types import Alarm, MissionEnd, MissionStatus, Phase, Response
from soilmoist_ros.exploration.travel.stop import Stop
from soilmoist_ros.foundation.plain_values import foreign_text

numbers = st.floats(0, 1e9)
offsets = st.floats(-1e9, 1e9)
metres = st.floats(-5e4, 5e4, width=32)
areas = st.lists(st.lists(st.tuples(metres, metres), min_size=3, max_size=5).map(tuple), max_size=2).map(tuple)
words = st.text(st.characters(codec="utf-8", exclude_characters="\x00"), max_size=20).map(foreign_text)
names = st.lists(words, max_size=3).map(tuple)
chosen = st.none() | st.lists(words.filter(bool), max_size=3).map(tuple)
counts = st.integers(0, 2**32 - 1)
statuses = st.builds(
    MissionStatus, now_s=numbers, phase=st.sampled_from(Phase), reason=words,
    target=st.none() | st.builds(Stop, words, offsets, offsets), planned_dwell_s=numbers, dwell_s=numbers,
    progress=st.floats(0, 1), time_used_s=numbers, time_left_s=numbers, distance_m=numbers, samples=counts,
    counting_s=numbers, raw_counts=st.integers(0, 2**63), failures=counts, blacklisted=names,
    estimated_end_s=st.none() | numbers, needs_operator=st.booleans(), silent=st.booleans(),
    ended=st.none() | st.sampled_from(MissionEnd),
    alarms=st.lists(st.builds(Alarm, numbers, words, st.sampled_from(Response), words), max_size=3).map(tuple),
    emergency=st.booleans(), stop_requests=counts, queue=names, strategy=words, clock_offset_s=offsets,
    ruled_out=areas, field=words, earlier=chosen, covariates=chosen,
)  # fmt: skip
IDLE = MissionStatus(
    now_s=math.nan, phase=Phase.IDLE, reason="waiting for start", target=None, planned_dwell_s=0.0, dwell_s=0.0,
    progress=0.0, time_used_s=0.0, time_left_s=0.0, distance_m=0.0, samples=0, counting_s=0.0, raw_counts=0,
    failures=0, blacklisted=(), estimated_end_s=None,
)  # fmt: skip


def sent(status):
    message = mission_state_to_message(status, 1_790_000_000.5, "robot_1")
    return deserialize_message(serialize_message(message), Mission)


@pytest.mark.slow
@given(statuses)
def test_a_status_comes_back(status):
    assert mission_state_from_message(sent(status)) == status


def test_codes_and_numbers():
    status = replace(
        IDLE, phase=Phase.PAUSED, needs_operator=True, emergency=True, stop_requests=2, raw_counts=np.int64(3),
        dwell_s=np.float32(1.5), ended=MissionEnd.FAILSAFE,
        alarms=(Alarm(5.0, "battery", Response.RETURN, "17 % left"),),
    )  # fmt: skip
    message = sent(status)
    assert (message.phase, message.ended) == (Mission.PHASE_PAUSED, Mission.END_FAILSAFE)
    assert (message.level, message.stop_confirmed) == (2, False)
    assert (message.raw_counts, message.dwell_s) == (3, 1.5)
    (alarm,) = message.alarms
    assert (alarm.cause, alarm.response, alarm.since_s) == ("battery", alarm.RETURN_HOME, 5.0)
    assert (message.header.stamp.sec, message.header.frame_id, message.robot) == (1_790_000_000, "map", "robot_1")


def test_without_a_mission_there_is_no_time_and_no_stop():
    message = sent(IDLE)
    assert all(map(math.isnan, (message.mission_time_s, message.estimated_end_s, message.stop_position.x)))
    assert message.ended == Mission.END_NONE
    assert message.stop_confirmed


def test_codes_of_later_versions_are_refused():
    message = sent(IDLE)
    message.phase = 99
    with pytest.raises(ValueError, match="phase 99 is not known"):
        mission_state_from_message(message)


def test_control_characters_of_other_robots_do_not_come_in():
    odd = "no\x1b[31mrth\r\n\u202e5\x07"
    alarm = Alarm(0.0, "fix", next(iter(Response)), odd)
    names = (odd,)
    status = replace(
        IDLE,
        reason=odd,
        target=Stop(odd, 1.0, 2.0),
        blacklisted=names,
        queue=names,
        alarms=(alarm,),
        field=odd,
        earlier=names,
    )
    found = mission_state_from_message(sent(status))
    shown = (
        found.reason,
        found.target.name,
        *found.blacklisted,
        *found.queue,
        found.alarms[0].reason,
        found.field,
    )
    assert (set(shown), found.earlier) == ({"north 5"}, ("north 5",))

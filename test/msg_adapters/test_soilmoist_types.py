# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""An operator's request and its reply as messages."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip("soilmoist_msgs")
pytest.importorskip("soilmoist_msgs.msg")
from rclpy.serialization import deserialize_message, serialize_message
from soilmoist_msgs.msg import Mission
from soilmoist_msgs.srv import Command

from msg_adapters.soilmoist_types import (
    mission_state_to_message,
    reply_from_message,
    reply_to_message,
    request_from_message,
    request_to_message,
    survey_from_message,
    visit_from_message,
    visit_to_message,
)
from soilmoist_ros.exploration import Changes, OperatorRequest, Reply, ReplyCode, Stop, Visit, VisitEnd
from soilmoist_ros.exploration.mission.types import Alarm, MissionEnd, MissionStatus, Phase, Response, Verb
from soilmoist_ros.foundation.plain_values import foreign_text

words = st.text(st.characters(codec="utf-8", exclude_characters="\x00"), max_size=20).map(foreign_text)
numbers = st.floats(allow_nan=False)
corners = st.floats(-5e4, 5e4, width=32)
chosen = st.none() | st.lists(words.filter(bool), max_size=3).map(tuple)
requests = st.builds(
    OperatorRequest, verb=words, who=words, place=st.lists(numbers, max_size=3).map(tuple),
    geographic_place=st.lists(numbers, max_size=3).map(tuple), dwell=words,
    polygon=st.lists(st.tuples(corners, corners), max_size=5).map(tuple),
    stops=st.lists(words, max_size=4).map(tuple), hours=numbers, strategy=words, target=words, home=words,
    field=words, earlier=chosen, covariates=chosen,
)  # fmt: skip


@given(requests)
def test_a_request_comes_back(request):
    message = deserialize_message(serialize_message(request_to_message(request)), Command.Request)
    assert request_from_message(message) == request


@given(st.builds(Reply, st.sampled_from(ReplyCode), words))
def test_a_reply_comes_back(reply):
    message = deserialize_message(serialize_message(reply_to_message(reply)), Command.Response)
    assert reply_from_message(message) == reply
    assert message.accepted is (reply.code is ReplyCode.ACCEPTED)


def test_the_message_names_every_verb():
    constants = {name for name in dir(Command.Request) if name.isupper()} - {"SLOT_TYPES"}
    assert {str(getattr(Command.Request, name)) for name in constants} == {str(verb) for verb in Verb}


# Visits ---------------------------------------------------------------------------------------------------------

places = st.floats(-5e4, 5e4)
stamps = st.integers(1, 2**31 - 2).map(float)
exposures = st.floats(0, 1e6)
texts = st.text(st.characters(exclude_categories=["Cs", "Cc"])).map(foreign_text)
visits = st.builds(
    Visit, name=texts, x_m=places, y_m=places, arrived_s=exposures, dwell_s=exposures,
    raw_counts=st.integers(0, 2**63), reason=texts, robot=st.integers(1, 9), records=st.integers(0, 2**32 - 1),
    exposure_s=exposures, effective_exposure_s=exposures, ended=st.sampled_from(VisitEnd), outcome=texts,
    dwell=texts,
    arrival_stamp_s=stamps, end_stamp_s=stamps, stop_x_m=places, stop_y_m=places,
)  # fmt: skip


@given(visits)
def test_a_visit_comes_back_exactly(visit):
    message = visit_to_message(visit, "robot_1")
    assert visit_from_message(message, visit.robot) == visit
    assert (message.robot, message.header.frame_id) == ("robot_1", "map")


def test_codes_of_later_versions_are_read_and_control_characters_of_other_robots_do_not_come_in():
    odd = "no\x1b[31mrth\r\n\u202e5\x07"
    message = visit_to_message(Visit(odd, 1.0, 2.0, 3.0, 4.0, 5, odd, outcome=odd))
    message.reason_code = "struck_by_lightning"
    found = visit_from_message(message)
    assert (found.ended, found.name, found.reason, found.outcome) == (VisitEnd.UNKNOWN, *3 * ["north 5"])
    with pytest.raises(ValueError, match="not a visit"):
        visit_from_message(message.header)


# The mission's status as numbers and codes ----------------------------------------------------------------------

IDLE = MissionStatus(
    now_s=math.nan, phase=Phase.IDLE, reason="waiting for start", target=None, planned_dwell_s=0.0, dwell_s=0.0,
    progress=0.0, time_used_s=0.0, time_left_s=0.0, distance_m=0.0, samples=0, counting_s=0.0, raw_counts=0,
    failures=0, blacklisted=(), estimated_end_s=None,
)  # fmt: skip


def sent(**changes):
    message = mission_state_to_message(replace(IDLE, **changes), 1_790_000_000.5, "robot_1")
    return deserialize_message(serialize_message(message), Mission)


def test_codes_and_numbers():
    message = sent(
        phase=Phase.PAUSED, needs_operator=True, emergency=True, stop_requests=2, raw_counts=np.int64(3),
        dwell_s=np.float32(1.5), ended=MissionEnd.FAILSAFE, target=Stop("n7", 1.0, -2.0), estimated_end_s=7e8,
        alarms=(Alarm(5.0, "battery", Response.RETURN, "17 % left"),), queue=("n8",), blacklisted=("n9",),
        ruled_out=(((0.0, 0.0), (4.0, 0.0), (0.0, 3.0)),), changes=Changes(earlier=(), covariates=("soil.tif",)),
    )  # fmt: skip
    assert (message.phase, message.ended) == (Mission.PHASE_PAUSED, Mission.END_FAILSAFE)
    assert (message.level, message.stop_confirmed, message.emergency_stop) == (2, False, True)
    assert (message.raw_counts, message.dwell_s, message.estimated_end_s) == (3, 1.5, 7e8)
    assert (message.stop, message.stop_position.x, message.stop_position.y) == ("n7", 1.0, -2.0)
    (alarm,) = message.alarms
    assert (alarm.cause, alarm.response, alarm.since_s) == ("battery", alarm.RETURN_HOME, 5.0)
    assert (message.queue, message.ruled_out) == (["n8"], ["n9"])
    assert [(corner.x, corner.y) for corner in message.ruled_out_areas[0].points] == [(0, 0), (4, 0), (0, 3)]
    assert survey_from_message(message) == {"earlier": [], "covariates": ["soil.tif"]}
    assert (message.header.stamp.sec, message.header.frame_id, message.robot) == (1_790_000_000, "map", "robot_1")


@pytest.mark.parametrize("phase", Phase)
@pytest.mark.parametrize("ended", [None, *MissionEnd])
def test_every_phase_and_end_has_a_code(phase, ended):
    message = sent(phase=phase, ended=ended)
    assert message.phase == getattr(Mission, f"PHASE_{phase.name}") > 0
    assert message.ended == getattr(Mission, f"END_{ended.name if ended else 'NONE'}")
    assert math.isnan(message.stop_position.x)
    assert survey_from_message(message) == {}

# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""An operator's request and its reply as messages."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip("soilmoist_msgs")
from rclpy.serialization import deserialize_message, serialize_message
from soilmoist_msgs.srv import Command

from msg_adapters.soilmoist.command import (
    reply_from_message,
    reply_to_message,
    request_from_message,
    request_to_message,
)
from soilmoist_ros.exploration.control.operator_request import OperatorRequest, Reply, ReplyCode
from soilmoist_ros.exploration.mission.types import Verb
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


def test_numbers_of_other_types_are_sent_as_they_are():
    message = request_to_message(OperatorRequest("measure", place=(1, 2), hours=3))
    sent = deserialize_message(serialize_message(message), Command.Request)
    assert (list(sent.place), sent.hours) == ([1.0, 2.0], 3.0)


def test_what_is_left_out_is_not_given():
    assert request_from_message(Command.Request(verb="pause")) == OperatorRequest("pause")


def test_the_message_names_every_verb():
    constants = {name for name in dir(Command.Request) if name.isupper()} - {"SLOT_TYPES"}
    assert {str(getattr(Command.Request, name)) for name in constants} == {str(verb) for verb in Verb}


def test_control_characters_of_operators_do_not_come_in():
    odd = "no\x1b[31mrth\r\n\u202e5\x07"
    found = request_from_message(request_to_message(OperatorRequest("rule_out", odd, stops=(odd,), home=odd)))
    assert (found.who, found.stops, found.home) == ("north 5", ("north 5",), "north 5")
    assert reply_from_message(reply_to_message(Reply(ReplyCode.REFUSED, odd))).message == "north 5"

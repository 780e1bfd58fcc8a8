# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0

import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip("rclpy")

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.serialization import deserialize_message, serialize_message

from msg_adapters.diagnostics import (
    diagnostics_from_message,
    diagnostics_to_message,
    health_from_status,
    health_to_status,
)
from soilmoist_ros.foundation.health import Health, Level, worst
from soilmoist_ros.foundation.plain_values import foreign_text

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


@given(healths)
def test_one_state_alone_keeps_its_name(health):
    assert health_from_status(health_to_status(health)) == health


def test_levels_are_those_of_the_message():
    constants = (DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR, DiagnosticStatus.STALE)
    for level, constant in zip(Level, constants, strict=True):
        assert health_to_status(Health("x", level, "")).level == constant


def test_a_level_that_does_not_exist_is_an_error():
    assert health_from_status(DiagnosticStatus(level=b"\x09")).level is Level.ERROR


def test_the_worst_level_of_several():
    assert worst([]) is Level.OK
    assert worst([Health("a", Level.WARN, ""), Health("b", Level.ERROR, ""), Health("c", Level.OK, "")]) == 2


def test_control_characters_of_other_nodes_do_not_come_in():
    odd = "no\x1b[31mrth\r\n\u202e5\x07"
    found = health_from_status(health_to_status(Health(odd, Level.WARN, odd, {odd: odd})))
    assert found == Health("north 5", Level.WARN, "north 5", {"north 5": "north 5"})

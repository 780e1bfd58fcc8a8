# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rosbags.rosbag2.metadata import dump_qos_v8, parse_qos

from soilmoist_ros.recording.bag.metadata import (
    INFINITE_NS,
    Extent,
    Qos,
    Request,
    qos_from_yaml,
    request_for,
    to_yaml,
)

QOS = st.builds(
    Qos,
    st.sampled_from(["keep_last", "keep_all", "system_default", "unknown"]),
    st.integers(0, 1000),
    st.sampled_from(["reliable", "best_effort", "system_default", "unknown"]),
    st.sampled_from(["volatile", "transient_local", "system_default", "unknown"]),
    st.integers(0, INFINITE_NS),
    st.integers(0, INFINITE_NS),
    st.sampled_from(["automatic", "manual_by_topic", "system_default", "unknown"]),
    st.integers(0, INFINITE_NS),
)


@pytest.mark.slow
@given(st.lists(QOS, max_size=3))
def test_quality_of_service_comes_back_as_it_was(offered):
    assert qos_from_yaml(to_yaml([qos.to_dict() for qos in offered])) == tuple(offered)


def test_an_endless_duration_is_written_as_ros_does():
    assert Qos().to_dict()["deadline"] == {"sec": 9223372036, "nsec": 854775807}


@pytest.mark.slow
@given(st.lists(QOS, min_size=1, max_size=3))
def test_the_numbers_of_older_bags_become_words(offered):
    older = dump_qos_v8(parse_qos([qos.to_dict() for qos in offered]))
    read = qos_from_yaml(older)
    assert [(q.depth, q.reliability, q.durability, q.history) for q in read] == [
        (q.depth, q.reliability, q.durability, q.history) for q in offered
    ]


@pytest.mark.parametrize("text", ["", "[", "- 1", "text", "- {history: keep_last}"])
def test_nonsense_is_no_quality_of_service(text):
    assert qos_from_yaml(text) == ()


@given(st.lists(QOS, min_size=1, max_size=4))
def test_a_request_is_one_that_every_publisher_can_meet(offered):
    request = request_for(offered)
    assert request.reliable == all(qos.reliability == "reliable" for qos in offered)
    assert request.latched == all(qos.durability == "transient_local" for qos in offered)
    assert request.depth >= max(qos.depth for qos in offered)


def test_a_request_is_only_ever_weakened():
    strong, weak = Request(True, True, 100), Request(False, True, 200)
    assert weak.is_weaker(strong)
    assert not strong.is_weaker(weak)
    assert weak.weakened(strong) == Request(False, True, 200)


@given(st.lists(st.integers(0, 10**18), min_size=1))
def test_the_extent_holds_all_times(times):
    extent = Extent()
    for time_ns in times:
        extent = extent.with_message(time_ns)
    assert extent == Extent(len(times), min(times), max(times))
    assert extent.duration_ns == max(times) - min(times)

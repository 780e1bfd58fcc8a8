# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
import math

import pytest
from bags import MODEL, NOTES, START_NS
from hypothesis import given
from hypothesis import strategies as st

from soilmoist_ros.recording.bag.playback import INPUTS, Pacer, Playback, TopicChoice
from soilmoist_ros.recording.bag.reader import BagReader


@pytest.mark.slow
@pytest.mark.parametrize("start", range(24))
def test_all_from_the_start_on_after_the_last_that_is_latched(bag, start):
    with BagReader(bag.folder) as reader:
        playback = Playback(reader, ".*", float(start))
        found = [(message.topic, message.log_ns, message.data) for message in playback.messages()]
    before = [one for one in bag.messages[:start] if one[0] == MODEL.name]
    assert found == [*before[-1:], *bag.messages[start:]]


def test_only_what_is_chosen_and_how_it_was_offered(bag):
    with BagReader(bag.folder) as reader:
        playback = Playback(reader, "/notes|/robot/.*")
        playback.leave_out(MODEL.name)
        assert {message.topic for message in playback.messages()} == {NOTES.name}
        assert playback.offered(MODEL.name) == MODEL.offered
        assert not playback.has_clock
        assert (playback.share(START_NS), playback.share(playback.end_ns)) == (0.0, 1.0)


def test_inputs_are_what_the_nodes_take_in_whatever_their_namespace():
    choice = TopicChoice(INPUTS)
    assert all(choice.wanted(name) for name in ("/counts", "/r1/counts", "/fix", "/a/b/raw/logger"))
    assert not any(choice.wanted(name) for name in ("/samples", "/model", "/r1/mission", "/discounts", "/rosout"))


@given(speed=st.floats(0.01, 200), steps=st.lists(st.tuples(st.floats(0, 10), st.booleans()), max_size=30))
def test_time_passes_at_its_speed_but_not_in_a_pause_nor_to_make_up_for_lost_time(speed, steps):
    pacer, passed_s = Pacer(START_NS, speed), 0.0
    for elapsed_s, paused in steps:
        pacer.paused = paused
        pacer.step(elapsed_s)
        passed_s += 0.0 if paused else min(elapsed_s, 0.1)
    assert (pacer.now_ns - START_NS) * 1e-9 == pytest.approx(passed_s * speed, abs=1e-7)
    pacer.paused = False
    assert pacer.wait_s(pacer.now_ns + 10**9) == pytest.approx(1 / speed)
    assert pacer.wait_s(pacer.now_ns) == pacer.wait_s(START_NS) == 0
    pacer.paused = True
    assert pacer.wait_s(START_NS) == math.inf

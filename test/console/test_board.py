# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The sections of the console (board.py) as readers receive them."""

from __future__ import annotations

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from soilmoist_ros.console.board import Board, changes

VALUES = st.integers(0, 3) | st.lists(st.integers(0, 3)).map(tuple)
SECTIONS = st.dictionaries(st.sampled_from("abc"), VALUES)


def as_read(sections, message):
    """What the page makes of a message."""
    read = {**sections, **message.get("set", {})}
    for name, (kept, items) in message.get("extend", {}).items():
        read[name] = read.get(name, [])[:kept] + items
    return read


@given(st.lists(SECTIONS, min_size=1))
@pytest.mark.slow
def test_a_reader_of_all_changes_has_what_is_there(states):
    sent, read = {}, {}
    for state in states:
        now = {**sent, **state}
        message = json.loads(json.dumps(changes(sent, now)))
        read, sent = as_read(read, message), now
    assert read == {name: list(value) if isinstance(value, tuple) else value for name, value in sent.items()}


def test_ages_are_those_of_a_steady_clock():
    now = [5.0]
    board = Board(lambda: now[0])
    assert board.heard_s("map") == float("-inf")
    board.hear("map")
    now[0], before = 9.0, board.version
    board.put("a", [1])
    assert board.heard_s("map") == 5.0
    assert board.snapshot() == {"a": [1], "heard": {"map": 5.0}}
    assert board.version == before + 1

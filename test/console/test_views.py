# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What viewers see (views.py, board.py)."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from soilmoist_ros.console.board import MAX_TRAIL, MAX_VISITS, Board, RobotHistory, VisitHistory, changes
from soilmoist_ros.console.server import PAGE
from soilmoist_ros.console.views import graph_views, mission_view, place_views
from soilmoist_ros.exploration.mission.types import MissionEnd, MissionStatus, Phase
from soilmoist_ros.exploration.planning.forecast import Forecast, Reaching
from soilmoist_ros.exploration.travel.stop import Stop

NAN = math.nan
TEXTS = json.loads((PAGE / "en.json").read_text())["texts"]
STATUS = MissionStatus(
    0.0, Phase.COUNTING, "counting at r1", Stop("r1", 3.0, 4.0), 120.0, 30.0, 0.25, 60.0, 3540.0, 12.0, 2, 90.0,
    400, 0, (), None,
)  # fmt: skip


@pytest.mark.parametrize("phase", list(Phase))
def test_every_phase_has_words_and_is_json(phase):
    for status in (replace(STATUS, phase=phase), replace(STATUS, phase=phase, target=None, planned_dwell_s=NAN)):
        view = json.loads(json.dumps(mission_view(status, {}), allow_nan=False))
        assert f"phase_{view['phase']}" in TEXTS


def test_a_view_has_codes_and_values_of_which_the_page_makes_sentences():
    over = replace(STATUS, phase=Phase.FINISHED, ended=MissionEnd.TIME_UP, reason="as planned")
    assert (mission_view(over, {})["ended"], mission_view(over, {})["reason"]) == ("time_up", "as planned")
    assert {f"ended_{end}" for end in MissionEnd} <= TEXTS.keys()
    sure = Forecast(0.028, (600.0,), (0.02,), (1.25,), 0.02, 4.0, moisture=True, wrong=0.12, wrong_end=0.07)
    assert mission_view(replace(over, forecast=sure), {})["forecast"] == {
        "sd": 0.028, "moisture": True, "end": [600.0, 0.02, 0.016, 0.025],
        "wrong": pytest.approx([0.12, 0.07, 0.056, 0.0875]), "aim": None,
    }  # fmt: skip
    reaching = Reaching("p95-sd=0.03 m3/m3", True, 0.042, (0.03, 0.02, 0.04), (1500.0, 900.0, None))
    view = mission_view(replace(over, forecast=replace(sure, reaching=reaching)), {})["forecast"]["aim"]
    assert (view["about"], view["value"], view["minutes"], view["met"]) == ("p95", 0.03, [25, 15, None], False)
    assert {f"aim_{view['about']}", "aim_unknown", "aim_doubtful"} <= TEXTS.keys()
    idle = replace(STATUS, phase=Phase.IDLE)
    assert [mission_view(replace(idle, hindered=one), {})["ready"] for one in (False, True)] == [True, False]


def test_places_that_are_not_finite_are_not_shown():
    edges = np.array([[0, 2], [2, 0], [0, 1], [2, 3]])
    places = np.array([[1.234, 2.0], [NAN, NAN], [3.0, 1.0], [3.0, math.inf]])
    assert graph_views("abcd", places, edges) == ([["a", 1.23, 2.0], ["c", 3.0, 1.0]], [[0, 1]])
    assert place_views([(1.234, 2.0)]) == [[1.23, 2.0]]
    with pytest.raises(ValueError, match="not finite"):
        place_views([(1.0, 2.0), (NAN, 2.0)])


def test_a_way_is_kept_for_those_who_come_late_and_ages_are_those_of_a_steady_clock():
    now = [5.0]
    board = Board(lambda: now[0])
    assert board.heard_s("map") == float("-inf")
    board.hear("map")
    now[0], before = 9.0, board.version
    board.put("a", [1])
    assert board.snapshot() == {"a": [1], "heard": {"map": 5.0}}
    assert (board.heard_s("map"), board.version) == (5.0, before + 1)
    history = RobotHistory(board, "r1")
    history.place(0.0, 0.0, NAN)
    history.place(0.1, 0.0, 0.02)
    assert board.get("trail/r1") == ((0.0, 0.0),), "the noise of a receiver is no way"
    assert board.get("place/r1") == [0.1, 0.0, None, 0.02]
    history.place(3.0, 0.0, 0.02)
    assert board.get("place/r1") == [3.0, 0.0, 90, 0.02], "it has driven to the east"
    history.follow(replace(STATUS, phase=Phase.IDLE))
    history.place(6.0, 0.0, 0.02)
    history.follow(replace(STATUS, time_used_s=60.0))
    assert board.get("start/r1") == [3.0, 0.0], "where the mission has started"
    for step in range(2 * MAX_TRAIL):
        history.place(3.0, float(step), 0.02)
    assert len(board.get("trail/r1")) <= MAX_TRAIL


@pytest.mark.slow
def test_the_latest_visits_are_kept_and_viewers_follow():
    board = Board()
    history = VisitHistory(board)
    seen, page = board.snapshot(), []
    for number in range(3 * MAX_VISITS):
        history.add((0.0, float(number)))
        new = board.snapshot()
        kept, following = changes(seen, new)["extend"]["visits"] if number else (0, [[0.0, 0.0]])
        page, seen = [*page[:kept], *following], new
    assert page[-1] == [0.0, 3.0 * MAX_VISITS - 1]
    assert page == list(board.get("visits"))
    assert MAX_VISITS // 2 < len(page) <= MAX_VISITS


# Sections of the board as readers receive them ------------------------------------------------------------------

VALUES = st.integers(0, 3) | st.lists(st.integers(0, 3)).map(tuple)
SECTIONS = st.dictionaries(st.sampled_from("abc"), VALUES)


def as_read(sections, message):
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

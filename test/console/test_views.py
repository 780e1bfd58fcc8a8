# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What viewers see (views.py, robot_history.py)."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from soilmoist_ros.console.board import MAX_TRAIL, MAX_VISITS, Board, RobotHistory, VisitHistory, changes
from soilmoist_ros.console.views import headline, mission_view, node_views, place_views
from soilmoist_ros.exploration.mission.types import MissionEnd, MissionStatus, Phase
from soilmoist_ros.exploration.planning.forecast import Forecast
from soilmoist_ros.exploration.travel.stop import Stop

NAN = math.nan
STATUS = MissionStatus(
    0.0, Phase.COUNTING, "counting at r1", Stop("r1", 3.0, 4.0), 120.0, 30.0, 0.25, 60.0, 3540.0, 12.0, 2, 90.0,
    400, 0, (), None,
)  # fmt: skip


@pytest.mark.parametrize("phase", list(Phase))
def test_every_phase_has_words_and_is_json(phase):
    for status in (replace(STATUS, phase=phase), replace(STATUS, phase=phase, target=None, planned_dwell_s=NAN)):
        view = json.loads(json.dumps(mission_view(status, {}), allow_nan=False))
        assert view["headline"]
        assert "{" not in view["headline"]


def test_the_words_say_what_matters_most():
    assert headline(STATUS) == "Counting at r1"
    assert headline(replace(STATUS, emergency=True)) == "Emergency stop"
    assert headline(replace(STATUS, emergency=True, stop_requests=1)) == "Emergency stop: asking the robot to stop"
    assert headline(replace(STATUS, phase=Phase.PAUSED, needs_operator=True)) == "Paused: the robot needs you"
    over = replace(STATUS, phase=Phase.FINISHED, ended=MissionEnd.TIME_UP, samples=51, reason="as planned")
    assert headline(over) == "Finished: 51 stops"
    sure = Forecast(0.028, (), (), (), 0.02, 4.0, moisture=True)
    assert headline(replace(over, forecast=sure)) == "Finished: 51 stops, ±2.8 % by volume"
    assert mission_view(over, {})["reason"] == "the time is up: as planned"
    idle = replace(STATUS, phase=Phase.IDLE)
    for reason in ("waiting for start", "aborted by Ada; waiting for start"):
        assert headline(replace(idle, reason=reason)) == "Ready"
    for reason in ("waiting for a position", "waiting for start, which is refused: the battery is empty"):
        assert headline(replace(idle, reason=reason)) == "Not ready yet"
    assert mission_view(STATUS, {})["error_percent"] == 5.0
    assert mission_view(replace(STATUS, raw_counts=0), {})["error_percent"] is None


def test_places_that_are_not_finite_are_not_shown():
    assert node_views("abc", np.array([[1.234, 2.0], [NAN, NAN], [3.0, math.inf]])) == [["a", 1.23, 2.0]]
    assert place_views([(1.234, 2.0)]) == [[1.23, 2.0]]
    with pytest.raises(ValueError, match="not finite"):
        place_views([(1.0, 2.0), (NAN, 2.0)])


def test_a_way_is_kept_for_those_who_come_late():
    board = Board()
    history = RobotHistory(board, "r1")
    history.place(0.0, 0.0, NAN)
    history.place(0.1, 0.0, 0.02)
    assert board.get("trail/r1") == ((0.0, 0.0),), "the noise of a receiver is no way"
    assert board.get("place/r1") == [0.1, 0.0, None, 0.02]
    history.place(3.0, 0.0, 0.02)
    assert board.get("place/r1") == [3.0, 0.0, 90, 0.02], "it has driven to the east"
    history.count(replace(STATUS, phase=Phase.IDLE))
    history.count(replace(STATUS, time_used_s=60.0))
    assert board.get("start/r1") == [3.0, 0.0], "where the next mission starts"
    for step in range(2 * MAX_TRAIL):
        history.place(3.0, float(step), 0.02)
    assert len(board.get("trail/r1")) <= MAX_TRAIL


def test_the_count_of_a_stop_grows_and_begins_again_at_the_next():
    board = Board()
    history = RobotHistory(board, "")
    for dwell_s, counts in ((1.0, 10), (2.0, 20), (2.0, 20)):
        history.count(replace(STATUS, dwell_s=dwell_s, raw_counts=counts))
    assert board.get("count/") == ((1, 10), (2, 20))
    history.count(replace(STATUS, target=Stop("r2", 0.0, 0.0), dwell_s=0.0, raw_counts=0))
    assert board.get("count/") == ((0, 0),)
    history.count(replace(STATUS, phase=Phase.TRAVELLING))
    assert board.get("count/") == ()


@pytest.mark.slow
def test_the_latest_visits_are_kept_and_viewers_follow():
    board = Board()
    history = VisitHistory(board)
    seen, page = board.snapshot(), []
    for number in range(3 * MAX_VISITS):
        history.add({"stop": str(number)})
        new = board.snapshot()
        kept, following = changes(seen, new)["extend"]["visits"] if number else (0, [{"stop": "0"}])
        page, seen = [*page[:kept], *following], new
    assert page[-1] == {"stop": str(3 * MAX_VISITS - 1)}
    assert page == list(board.get("visits"))
    assert MAX_VISITS // 2 < len(page) <= MAX_VISITS

# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Progress and time left of a campaign: progress.py."""

from __future__ import annotations

from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from soilmoist_ros.lab.progress import CampaignProgress, Pace
from soilmoist_ros.simulation.mission.settings import MissionSettings


def missions(strategy, seeds):
    return [SimpleNamespace(settings=MissionSettings(strategy=strategy, seed=seed)) for seed in range(seeds)]


def run(done, todo, workers=1):
    """States of a campaign whose missions take the given times on so many workers."""
    states, now_s = [], [100.0]
    pace = Pace(len(todo) + 3, [mission for mission, _ in todo], states.append, lambda: now_s[0])
    for mission, time_s in todo[:done]:
        now_s[0] += time_s / workers
        pace.finished(mission, time_s)
    return states


def test_the_time_left_allows_for_the_costs_of_strategies():
    cheap = [(mission, 1.0) for mission in missions("greedy", 10)]
    dear = [(mission, 50.0) for mission in missions("gcb", 10)]
    state = run(11, [*cheap, *dear])[-1]
    assert state.left_s == pytest.approx(9 * 50.0)
    assert (state.done, state.total) == (3 + 11, 23)


@pytest.mark.slow
@given(st.lists(st.floats(0.1, 100.0), min_size=1, max_size=20), st.integers(1, 8))
def test_equal_missions_leave_the_mean_of_those_that_are_done(times_s, workers):
    todo = [
        (mission, time_s) for mission, time_s in zip(missions("greedy", 40), times_s + [1.0] * 40, strict=False)
    ]
    state = run(len(times_s), todo, workers)[-1]
    elapsed_s = times_s[0] + sum(times_s[1:]) / workers  # the first one is finished when the clock starts
    assert state.left_s == pytest.approx((40 - len(times_s)) / len(times_s) * elapsed_s)


def test_it_begins_unknown_and_ends_with_nothing():
    states = run(2, [(mission, 2.0) for mission in missions("greedy", 2)])
    assert str(states[0]) == "3 of 5 missions"
    assert states[-1].left_s == 0
    assert str(states[-1]) == "5 of 5 missions · 30 a minute"
    assert str(run(0, [])[0]) == "3 of 3 missions"


def test_failures_and_what_is_waited_for_are_shown():
    states = []
    pace = Pace(4, missions("greedy", 4), states.append, lambda: 0.0)
    pace.finished(missions("greedy", 1)[0], float("nan"), failed=True)
    pace.waits("waiting for a worker")
    assert str(states[-1]) == "1 of 4 missions · 1 failed · waiting for a worker"
    assert str(CampaignProgress(1, 2, per_minute=2.5, left_s=24.0)) == "1 of 2 missions · 2.5 a minute · 24 s left"

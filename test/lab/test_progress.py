# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Progress and time left of a campaign: progress.py."""

from __future__ import annotations

import math

from soilmoist_ros.lab.progress import CampaignProgress, Pace


def test_it_begins_unknown_and_ends_with_nothing():
    states, now_s = [], [100.0]
    pace = Pace(5, 2, states.append, lambda: now_s[0])
    for _ in range(2):
        now_s[0] += 2.0
        pace.finished(2.0)
    assert str(states[0]) == "3 of 5 missions"
    assert math.isnan(states[0].left_s)
    assert str(states[1]) == "4 of 5 missions · 30 a minute · 2 s left"
    assert str(states[-1]) == "5 of 5 missions · 30 a minute"
    assert states[-1].left_s == 0


def test_failures_and_what_is_waited_for_are_shown():
    states = []
    pace = Pace(4, 4, states.append, lambda: 0.0)
    pace.finished(float("nan"), failed=True)
    pace.waits("waiting for a worker")
    assert str(states[-1]) == "1 of 4 missions · 1 failed · waiting for a worker"
    assert str(CampaignProgress(1, 2, per_minute=2.5, left_s=24.0)) == "1 of 2 missions · 2.5 a minute · 24 s left"

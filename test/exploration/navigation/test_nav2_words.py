# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Error codes and feedback of Nav2 in words."""

import math

import pytest

from soilmoist_ros.exploration.navigation.nav2_words import failure, progress


@pytest.mark.parametrize(
    ("code", "text", "words"),
    [
        (0, "", ""),
        (0, "the tree failed", "the tree failed"),
        (208, "", "planning the path failed: no path leads to the stop (Nav2 error 208)"),
        (308, "", "planning the path failed: no path leads to the stop (Nav2 error 308)"),
        (105, "stuck", "following the path failed: the robot made no progress (Nav2 error 105: stuck)"),
        (714, "", "backing up failed: an obstacle is in the way (Nav2 error 714)"),
        (9001, "", "its behaviour tree cannot be loaded (Nav2 error 9001)"),
        (100, "", "following the path failed: unknown cause (Nav2 error 100)"),
        (4711, "odd", "unknown cause (Nav2 error 4711: odd)"),
    ],
)
def test_failures(code, text, words):
    assert failure(code, text) == words


@pytest.mark.parametrize(
    ("remaining_m", "recoveries", "words"),
    [
        (12.34, 0, "12.3 m to go"),
        (12.34, 1, "12.3 m to go, 1 recovery"),
        (math.nan, 3, "3 recoveries"),
        (math.inf, 0, ""),
    ],
)
def test_progress(remaining_m, recoveries, words):
    assert progress(remaining_m, recoveries) == words

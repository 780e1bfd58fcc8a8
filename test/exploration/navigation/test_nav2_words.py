# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Error codes and feedback of Nav2 in words."""

import math

import pytest

from soilmoist_ros.exploration.navigation.goal_client import failure, progress


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
        (52, "", "unknown cause (Nav2 error 52)"),
        (1, "", "a server of Nav2 rejected the goal (Nav2 error 1)"),
        (108, "", "following the path failed: it took too long (Nav2 error 108)"),
        (309, "", "planning the path failed: no pose is given (Nav2 error 309)"),
        (405, "", "finding a route failed: no route leads to the stop (Nav2 error 405)"),
        (741, "", "waiting failed: it took too long (Nav2 error 741)"),
        (9102, "", "a transform is missing (Nav2 error 9102)"),
        (9999, "", "unknown cause (Nav2 error 9999)"),
    ],
)
def test_failures(code, text, words):
    assert failure(code, text) == words


# Names of the constants of nav2_msgs: Jazzy, then what Kilted and Lyrical add.
CODES = [
    *range(101, 108), *range(201, 209), *range(301, 310), *range(401, 408), *range(501, 506), 601,
    *range(701, 704), *range(711, 715), *range(721, 725), 731, 732, *range(901, 907),
    602, 603, 741, 907, 9001, 9002, 9003, 9101, 9102, 9103,
    1, 2, 108,
]  # fmt: skip


@pytest.mark.parametrize("code", CODES)
def test_every_code_of_every_release_has_words(code):
    words = failure(code)
    assert words.endswith(f" (Nav2 error {code})")
    assert "unknown" not in words.replace("the dock is unknown", "")


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

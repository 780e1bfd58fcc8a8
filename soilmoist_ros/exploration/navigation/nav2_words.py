# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Numbers of Nav2 in words: error codes of its actions, and feedback on the way."""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

_TASKS: Final[Mapping[int, str]] = MappingProxyType(
    {1: "following the path", 2: "planning the path", 3: "planning the path", 5: "smoothing the path",
     70: "turning on the spot", 71: "backing up", 72: "driving straight", 73: "assisted driving"}
)  # fmt: skip
"""Ranges of error codes, by hundreds; those of recoveries by tens."""

_CAUSES: Final[Mapping[int, str]] = MappingProxyType({
    101: "there is no such controller", 102: "a transform is missing", 103: "the path is invalid",
    104: "no valid command for too long", 105: "the robot made no progress", 106: "no command avoids a collision",
    107: "the controller did not answer in time",
    201: "there is no such planner", 202: "a transform is missing", 203: "the robot is off Nav2's map",
    204: "the stop is off Nav2's map", 205: "the robot is in an obstacle", 206: "the stop is in an obstacle",
    207: "the planner took too long", 208: "no path leads to the stop",
    501: "there is no such smoother", 502: "it took too long", 503: "the smoothed path hits an obstacle",
    504: "it failed", 505: "the path is invalid",
    701: "it took too long", 702: "a transform is missing", 703: "an obstacle is in the way",
    711: "it took too long", 712: "a transform is missing", 713: "its distance is invalid",
    714: "an obstacle is in the way",
    721: "it took too long", 722: "a transform is missing", 723: "an obstacle is in the way",
    724: "its distance is invalid", 731: "it took too long", 732: "a transform is missing",
    9001: "its behaviour tree cannot be loaded", 9002: "a transform is missing", 9003: "it took too long",
})  # fmt: skip
"""Error codes: the constants of the actions of nav2_msgs 1.3 (Jazzy), and of NavigateToPose since 1.4."""


def failure(code: int, text: str = "") -> str:
    """What the result of a goal says about a failure, for operators.

    :param code: error code of the result; 0 if it has none
    :param text: message of the result
    """
    if code == 0:
        return text
    task = _TASKS.get(code // 10) or _TASKS.get(code // 100, "")
    # planning through several poses is numbered like planning to one
    cause = _CAUSES.get(code - 100 if code // 100 == 3 else code, "unknown cause")
    words = f"{task} failed: {cause}" if task else cause
    return f"{words} (Nav2 error {code}{f': {text}' if text else ''})"


def progress(remaining_m: float, recoveries: int) -> str:
    """Feedback in words; empty if there is nothing to say.

    :param remaining_m: length of the path ahead, nan if it is not known [m]
    :param recoveries: recoveries since the goal began
    """
    ahead = [f"{remaining_m:.1f} m to go"] if math.isfinite(remaining_m) else []
    tries = {0: [], 1: ["1 recovery"]}.get(recoveries, [f"{recoveries} recoveries"])
    return ", ".join([*ahead, *tries])

# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Numbers of Nav2 in words: error codes of its actions, and feedback on the way."""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

_TASKS: Final[Mapping[int, str]] = MappingProxyType(
    {100: "following the path", 200: "planning the path", 300: "planning the path", 400: "finding a route",
     500: "smoothing the path", 600: "following the way points", 700: "turning on the spot", 710: "backing up",
     720: "driving straight", 730: "assisted driving", 740: "waiting", 900: "docking"}
)  # fmt: skip
"""First error code of each task; the codes of recoveries are ten apart."""

_TF: Final = "a transform is missing"
_LATE: Final = "it took too long"
_CAUSES: Final[Mapping[int, str]] = MappingProxyType({
    1: "a server of Nav2 rejected the goal", 2: "a server of Nav2 cannot be reached",
    101: "there is no such controller", 102: _TF, 103: "the path is invalid",
    104: "no valid command for too long", 105: "the robot made no progress", 106: "no command avoids a collision",
    107: "the controller did not answer in time", 108: _LATE,
    201: "there is no such planner", 202: _TF, 203: "the robot is off Nav2's map",
    204: "the stop is off Nav2's map", 205: "the robot is in an obstacle", 206: "the stop is in an obstacle",
    207: "the planner took too long", 208: "no path leads to the stop", 309: "no pose is given",
    401: _TF, 402: "the route graph is invalid", 403: "no node of the route graph is near", 404: _LATE,
    405: "no route leads to the stop", 406: "an operation on the route failed",
    407: "a score of the edges was used wrongly",
    501: "there is no such smoother", 502: _LATE, 503: "the smoothed path hits an obstacle",
    504: "it failed", 505: "the path is invalid",
    601: "the task at a way point failed", 602: "no valid way point is given", 603: "a way point was missed",
    701: _LATE, 702: _TF, 703: "an obstacle is in the way",
    711: _LATE, 712: _TF, 713: "its distance is invalid", 714: "an obstacle is in the way",
    721: _LATE, 722: _TF, 723: "an obstacle is in the way", 724: "its distance is invalid",
    731: _LATE, 732: _TF, 741: _LATE,
    901: "the dock is unknown, or a transform is missing", 902: "the dock is invalid, or an object was not found",
    903: "the place before the dock was not reached, or control failed",
    904: "the dock was not found, or it took too long", 905: "control failed", 906: "the battery does not charge",
    907: _LATE,
    9001: "its behaviour tree cannot be loaded", 9002: _TF, 9003: _LATE,
})  # fmt: skip
"""Error codes: the constants of all actions of nav2_msgs 1.3.13 (Jazzy), 1.4.2 (Kilted) and 1.5.1 (Lyrical).

From 901 to 904 docking and following an object share numbers; where causes differ, both are named."""


def failure(code: int, text: str = "") -> str:
    """What the result of a goal says about a failure, for operators.

    :param code: error code of the result; 0 if it has none
    :param text: message of the result
    """
    if code == 0:
        return text
    task = _TASKS.get(code - code % 10) or _TASKS.get(code - code % 100, "")
    if 901 <= code <= 904:
        task = "docking or following an object"
    # What plans or drives through several poses is numbered like that to one.
    cause = _CAUSES.get(code) or _CAUSES.get(code - 100 if code // 100 in (3, 91) else code, "unknown cause")
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

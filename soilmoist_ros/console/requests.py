# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What a page asks for: JSON from the network, as requests of operators."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any, Final

from soilmoist_ros.exploration import OperatorRequest
from soilmoist_ros.foundation import InputError, finite_number, foreign_text

MAX_TEXT: Final = 200
MAX_ITEMS: Final = 500
_NUMBERS: Final = ("place", "geographic_place")
_TEXTS: Final = ("verb", "who", "dwell", "strategy", "target", "home", "field")
_NAMES: Final = ("stops", "earlier", "covariates")
_NUMBER: Final = ("hours", "until_sd", "until_gain")
_OF_THE_PAGE: Final = frozenset({"robot", "client"})
_KNOWN: Final = frozenset(field.name for field in fields(OperatorRequest))


def request_from_json(content: Any, robots: Mapping[str, Any] | list[str]) -> tuple[str, OperatorRequest]:
    """Robot and request of a page. The planner checks what they mean.

    :param content: what JSON gave
    :param robots: names of the robots
    :raises InputError: if a value has the wrong type or is too long, or the robot is not known
    """
    if not isinstance(content, Mapping):
        raise InputError("a request is an object with a verb", "reload the page")
    robot = content.get("robot", "")
    if robot not in robots:
        raise InputError(f"there is no robot {robot!r:.50}", f"the robots are: {', '.join(robots) or '(one)'}")
    unknown = sorted(str(name) for name in content.keys() - _KNOWN - _OF_THE_PAGE)
    if unknown:
        raise InputError(f"a request has no {unknown[0]:.50}", "reload the page")
    return str(robot), OperatorRequest(**{
        name: _value(name, value) for name, value in content.items() if name not in _OF_THE_PAGE
    } | {"verb": _text("verb", content.get("verb"))})  # fmt: skip


def who_of(content: Any) -> str:
    """Name of the operator of a page; empty if it is none."""
    who = content.get("who", "") if isinstance(content, Mapping) else ""
    return foreign_text(who)[:60] if isinstance(who, str) else ""


def _value(name: str, value: Any) -> Any:
    if name in _TEXTS:
        return _text(name, value)
    if name in _NUMBER:
        return _number(name, value)
    if not isinstance(value, list) or len(value) > MAX_ITEMS:
        raise InputError(f"{name} must be a list of at most {MAX_ITEMS} items", "reload the page")
    if name in _NUMBERS:
        return tuple(_number(name, one) for one in value)
    if name in _NAMES:
        return tuple(_text(name, one) for one in value)
    corners = []
    for corner in value:
        if not isinstance(corner, list) or len(corner) != 2:
            raise InputError(f"{name} must be a list of [x, y]", "reload the page")
        corners.append((_number(name, corner[0]), _number(name, corner[1])))
    return tuple(corners)


def _text(name: str, value: Any) -> str:
    if not isinstance(value, str) or len(value) > MAX_TEXT or not value.isprintable():
        raise InputError(f"{name} must be a text of at most {MAX_TEXT} characters", "change it")
    return value


def _number(name: str, value: Any) -> float:
    number = finite_number(value)
    if number is None:
        raise InputError(f"{name} must be a number", "change it")
    return number

# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""State, events and visits of a mission as plain dictionaries of numbers, texts and lists, fit for strict JSON.

A journal stores them, replays the events, or continues from a stored state.
"""

from __future__ import annotations

from dataclasses import fields
from functools import cache
from typing import Any, get_args

from pydantic import TypeAdapter, ValidationError

from soilmoist_ros.exploration.mission.events import Event
from soilmoist_ros.exploration.mission.state import MissionState
from soilmoist_ros.exploration.mission.visit import Visit
from soilmoist_ros.foundation import InputError, nan_as_text, read_json


def state_to_dict(state: MissionState) -> dict[str, Any]:
    """The state as plain data, fit for JSON."""
    return _plain(state)


def state_from_json(text: str) -> MissionState:
    """The state that a snapshot of a mission holds.

    :raises InputError: if the text is not a snapshot
    """
    try:
        content = read_json(text)
    except ValueError as error:
        raise InputError(f"the mission's state is not valid JSON: {error}", "start without it") from None
    return state_from_dict(content)


def state_from_dict(content: object) -> MissionState:
    """The state that :func:`state_to_dict` wrote.

    :raises InputError: if it is not one
    """
    state = _read("MissionState", content, "a mission state")
    assert isinstance(state, MissionState)
    return state


def event_to_dict(event: Event) -> dict[str, Any]:
    """An event as plain data, fit for JSON; ``event`` holds its kind."""
    return {"event": type(event).__name__, **_plain(event)}


def event_from_dict(content: dict[str, Any]) -> Event:
    """The event that :func:`event_to_dict` wrote.

    :raises InputError: if it is not one
    """
    name = content.get("event")
    if not isinstance(name, str) or name not in _EVENTS:
        raise InputError(f"{name!r} is not a mission event", f"known are {', '.join(_EVENTS)}")
    values = {key: value for key, value in content.items() if key != "event"}
    event: Event = _read(name, values, f"a mission event {name!r}")
    return event


def visit_to_dict(visit: Visit) -> dict[str, Any]:
    """A visit as plain data, fit for JSON."""
    return _plain(visit)


def visit_from_dict(content: object) -> Visit:
    """The visit that :func:`visit_to_dict` wrote.

    :raises InputError: if it is not one
    """
    visit = _read("Visit", content, "a visit")
    assert isinstance(visit, Visit)
    return visit


_EVENTS: dict[str, Any] = {kind.__name__: kind for kind in get_args(Event)}
_KINDS: dict[str, Any] = {"MissionState": MissionState, "Visit": Visit, **_EVENTS}


@cache
def _adapter(name: str) -> TypeAdapter[Any]:
    return TypeAdapter(_KINDS[name])


def _plain(value: Any) -> dict[str, Any]:
    content = nan_as_text(_adapter(type(value).__name__).dump_python(value, mode="json"))
    assert isinstance(content, dict)
    return content


def _read(name: str, content: object, what: str) -> Any:
    remedy = "it was written by another version or has been changed: start without it"
    unknown = set(content) - {field.name for field in fields(_KINDS[name])} if isinstance(content, dict) else set()
    if unknown:
        raise InputError(f"this is not {what}: unknown {', '.join(sorted(map(str, unknown)))}", remedy)
    try:
        return _adapter(name).validate_python(content)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"])
        raise InputError(f"this is not {what}: {where or 'its type'}: {first['msg']}", remedy) from None

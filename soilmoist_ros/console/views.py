# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Views of a field, a mission, a visit, and of health: values that JSON can express."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.exploration import GUIDED, READY, STRATEGIES, MissionEnd, MissionStatus, Phase, Visit
from soilmoist_ros.foundation import Health, read_json
from soilmoist_ros.mapping import Field, Samples
from soilmoist_ros.simulation import PRESETS

Array = NDArray[np.float64]

_PHASES: Final = {
    Phase.IDLE: "Ready",
    Phase.PLANNING: "Choosing the next stop",
    Phase.WAITING: "Waiting to try again",
    Phase.TRAVELLING: "Driving to {stop}",
    Phase.COUNTING: "Counting at {stop}",
    Phase.PAUSED: "Paused",
    Phase.CANCELLING: "Stopping the robot",
    Phase.RETURNING: "Driving home",
    Phase.FINISHED: "Finished",
}
_ENDS: Final = {
    MissionEnd.TIME_UP: "the time is up",
    MissionEnd.NOTHING_LEFT: "no useful stop is left",
    MissionEnd.ABORTED: "ended by the operator",
    MissionEnd.SILENT_SENSOR: "the sensor is silent",
    MissionEnd.RETURNED: "the robot was sent home",
    MissionEnd.FAILSAFE: "a failsafe ended the mission",
    MissionEnd.GOOD_ENOUGH: "the map is good enough",
    MissionEnd.LITTLE_GAIN: "little more is to be gained",
    MissionEnd.NOTHING_VARIES: "the field shows no differences",
}
MOVING: Final = frozenset({Phase.PLANNING, Phase.WAITING, Phase.TRAVELLING, Phase.COUNTING, Phase.RETURNING})
"""Phases in which the robot moves or may move by itself soon."""
RECOMMENDED: Final = PRESETS["recommended"]["strategy"]
PLACE_DIGITS: Final = 2
"""Centimetres are enough for a picture."""


def field_view(field: Field) -> dict[str, Any]:
    """The field: its name, boundary and no-go areas."""
    return {
        "name": field.name,
        "boundary": field.polygon.round(PLACE_DIGITS).tolist(),
        "no_go": [area.round(PLACE_DIGITS).tolist() for area in field.no_go],
        "datum": [field.frame.latitude_deg, field.frame.longitude_deg],
    }


def choices_view() -> dict[str, Any]:
    """Choices of an operator: the strategies, the recommended one first, each with a plain word."""
    names = sorted(
        STRATEGIES.names(), key=lambda name: (name != RECOMMENDED, STRATEGIES.get(name).is_baseline, name)
    )
    kinds = [(name, STRATEGIES.get(name)) for name in names]
    return {"strategies": [[name, kind.label or name, kind.about] for name, kind in kinds]}


def battery_view(charge: float, voltage_v: float) -> dict[str, Any]:
    """A battery: charge [%] and voltage [V], ``None`` if unknown."""
    charge_percent = _whole(100 * charge)
    return {"charge": charge_percent, "voltage": round(voltage_v, 1) if math.isfinite(voltage_v) else None}


def mission_view(status: MissionStatus, values: Mapping[str, str]) -> dict[str, Any]:
    """A mission by its status, and by further values of its message."""
    stop, forecast, over = status.target, status.forecast, status.phase is Phase.FINISHED
    return {
        "phase": str(status.phase),
        "headline": headline(status),
        "ready": status.phase is not Phase.IDLE or status.reason.endswith(READY),
        "reason": f"{_ENDS[status.ended]}: {status.reason}" if over and status.ended else status.reason,
        "moving": status.phase in MOVING,
        "running": status.phase not in (Phase.IDLE, Phase.FINISHED),
        "paused": status.phase is Phase.PAUSED,
        "needs_operator": status.needs_operator,
        "silent": status.silent,
        "emergency": status.emergency,
        "stop_requests": status.stop_requests,
        "stop": None if stop is None else [stop.name, *_place(stop.x_m, stop.y_m)],
        "planned_dwell_s": _whole(status.planned_dwell_s),
        "dwell_s": _whole(status.dwell_s),
        "counts": status.raw_counts,
        "error_percent": count_error_percent(status.raw_counts),
        "used_s": _whole(status.time_used_s),
        "left_s": _whole(status.time_left_s),
        "distance_m": _whole(status.distance_m),
        "stops": status.samples,
        "queue": list(status.queue),
        "forecast": forecast.text if forecast else values.get("forecast", ""),
        "last_command": values.get("last_command", ""),
        "guided": float(values.get(GUIDED, 0.0)),
        "settings": _settings(values.get("settings", "")),
        "home_place": _home(values.get("home_place", "")),
    }


def headline(status: MissionStatus) -> str:
    """The state in a few words."""
    if status.emergency:
        return "Emergency stop: asking the robot to stop" if status.stop_requests else "Emergency stop"
    if status.phase is Phase.IDLE and not status.reason.endswith(READY):
        return "Not ready yet"
    text = _PHASES[status.phase]
    if "{stop}" in text:
        return text.format(stop=status.target.name if status.target else "a stop")
    if status.phase is Phase.FINISHED and status.ended:
        stops = f"{text}: {status.samples} stop{'s' * (status.samples != 1)}"
        return f"{stops}, {status.forecast.now_text}" if status.forecast else stops
    if status.phase is Phase.CANCELLING and status.stop_requests > 1:
        return f"{text}: asked {status.stop_requests} times"
    return f"{text}: the robot needs you" if status.phase is Phase.PAUSED and status.needs_operator else text


def count_error_percent(counts: int) -> float | None:
    """Standard deviation of a count, as a share of it [%]; ``None`` without counts.

    >>> count_error_percent(400)
    5.0
    """
    return round(100 / math.sqrt(counts), 2) if counts > 0 else None


def health_view(parts: Iterable[Health]) -> list[dict[str, Any]]:
    """States of health, the worst first."""
    ordered = sorted(parts, key=lambda part: (-int(part.level), part.name))
    return [{"name": part.name, "level": int(part.level), "message": part.message} for part in ordered]


def sample_views(samples: Samples) -> tuple[list[float], ...]:
    """Samples as [x, y, counts, effective exposure]."""
    return tuple(
        [*_place(float(x_m), float(y_m)), int(counts), round(float(exposure_s), 1)]
        for (x_m, y_m), counts, exposure_s in zip(samples.xy, samples.counts, samples.exposure_s, strict=True)
    )


def place_views(places: Iterable[tuple[float, float]]) -> list[list[float]]:
    """Places on the map [m]; ``ValueError`` if one is not finite."""
    shown = [_place(float(x_m), float(y_m)) for x_m, y_m in places]
    if not all(math.isfinite(value) for place in shown for value in place):
        raise ValueError("a place is not finite")
    return shown


def node_views(names: Iterable[str], xy_m: Array) -> list[list[Any]]:
    """Nodes of the navigation's map as [name, x, y], without those whose place is not finite."""
    places = zip(names, xy_m.tolist(), strict=True)
    return [[name, *_place(x_m, y_m)] for name, (x_m, y_m) in places if math.isfinite(x_m) and math.isfinite(y_m)]


def visit_view(visit: Visit, robot: str) -> dict[str, Any]:
    """A visit."""
    return {
        "robot": robot,
        "stop": visit.name,
        "place": _place(visit.x_m, visit.y_m),
        "dwell_s": _whole(visit.dwell_s),
        "counts": visit.raw_counts,
        "error_percent": count_error_percent(visit.raw_counts),
        "choice": visit.reason,
        "ended": visit.outcome,
    }


def _place(x_m: float, y_m: float) -> list[float]:
    return [round(x_m, PLACE_DIGITS), round(y_m, PLACE_DIGITS)]


def _whole(value: float) -> int | None:
    return round(value) if math.isfinite(value) else None


def _home(text: str) -> list[float] | None:
    """Place of the home of a planner [m]; ``None`` without one."""
    try:
        return place_views([read_json(text)])[0]
    except (TypeError, ValueError):
        return None


def _settings(text: str) -> dict[str, Any]:
    """Settings of a planner, with names of files instead of paths."""
    try:
        found = dict(read_json(text))
        named = {
            name: [Path(one).name for one in found[name]] for name in ("earlier", "covariates") if name in found
        }
        field = {"field": Path(found["field"]).name} if "field" in found else {}
    except (TypeError, ValueError):
        return {}
    return {**found, **named, **field}

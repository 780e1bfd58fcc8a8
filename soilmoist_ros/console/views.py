# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Views of a field, a mission, places, and of health: values that JSON can express."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.exploration import EXPOSURE, GUIDED, LEADS, STRATEGIES, Forecast, MissionStatus, Phase
from soilmoist_ros.foundation import Health, read_json
from soilmoist_ros.mapping import Field
from soilmoist_ros.simulation import PRESETS

Array = NDArray[np.float64]

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
    stop = status.target
    return {
        "phase": str(status.phase),
        "ready": not status.hindered,
        "reason": status.reason,
        "ended": None if status.ended is None else str(status.ended),
        "moving": status.phase in MOVING,
        "running": status.phase not in (Phase.IDLE, Phase.FINISHED),
        "paused": status.phase is Phase.PAUSED,
        "needs_operator": status.needs_operator,
        "emergency": status.emergency,
        "stop_requests": status.stop_requests,
        "stop": None if stop is None else [stop.name, *_place(stop.x_m, stop.y_m)],
        "planned_dwell_s": _whole(status.planned_dwell_s),
        "dwell_s": _whole(status.dwell_s),
        "counts": status.raw_counts,
        "used_s": _whole(status.time_used_s),
        "left_s": _whole(status.time_left_s),
        "distance_m": _whole(status.distance_m),
        "stops": status.samples,
        "queue": list(status.queue),
        "forecast": _forecast(status.forecast),
        "last_command": values.get("last_command", ""),
        "guided": float(values.get(GUIDED, 0.0)),
        "exposure_s": _whole(float(values.get(EXPOSURE, "nan"))),
        "leads": read_json(values.get(LEADS) or "null"),
        "settings": _settings(values.get("settings", "")),
        "home_place": _home(values.get("home_place", "")),
    }


def health_view(parts: Iterable[Health]) -> list[dict[str, Any]]:
    """States of health, the worst first."""
    ordered = sorted(parts, key=lambda part: (-int(part.level), part.name))
    return [{"name": part.name, "level": int(part.level), "message": part.message} for part in ordered]


def place_views(places: Iterable[Any]) -> list[list[float]]:
    """Places [x, y] on the map [m]; ``ValueError`` if one is not finite."""
    shown = [_place(float(x_m), float(y_m)) for x_m, y_m in places]
    if not all(math.isfinite(value) for place in shown for value in place):
        raise ValueError("a place is not finite")
    return shown


def graph_views(names: Iterable[str], xy_m: Array, edges: NDArray[np.int64]) -> tuple[list[Any], list[Any]]:
    """The navigation's map: nodes as [name, x, y], and edges as numbers of these, each once.

    Nodes whose place is not finite are left out.
    """
    shown = np.isfinite(xy_m[:, 0] + xy_m[:, 1])
    places = zip(names, xy_m.tolist(), shown, strict=True)
    numbers = (np.cumsum(shown) - 1)[edges[shown[edges].all(axis=1)]]
    nodes = [[name, *_place(x_m, y_m)] for name, (x_m, y_m), is_shown in places if is_shown]
    return nodes, np.unique(np.sort(numbers, axis=1), axis=0).tolist()


def _place(x_m: float, y_m: float) -> list[float]:
    return [round(x_m, PLACE_DIGITS), round(y_m, PLACE_DIGITS)]


def _whole(value: float) -> int | None:
    return round(value) if math.isfinite(value) else None


def _forecast(one: Forecast | None) -> dict[str, Any] | None:
    """Standard deviations of the map, now and at the end, as [time [s], its value, low and high of the band]."""
    if one is None:
        return None
    end = [one.times_s[-1], one.sd_end, *one.band_end] if one.times_s else None
    wrong = [one.wrong, *(one.wrong_ends or (None,))]
    return {"sd": one.sd, "moisture": one.moisture, "end": end, "wrong": wrong, "aim": _aim(one)}


def _aim(one: Forecast) -> dict[str, Any] | None:
    """Forecast of the aim of the mission as the page shows it, with times in minutes; ``None`` without an aim."""
    if (found := one.reaching) is None:
        return None
    kind, _, value = found.aim.partition("=")
    minutes = [None if time_s is None else round(time_s / 60) for time_s in found.times_s]
    about = {"sd": "mean", "p95-sd": "p95", "zone": "zone"}[kind]
    return {
        "about": about, "moisture": found.moisture, "value": float(value.split()[0]), "met": found.is_met,
        "end": found.end, "minutes": minutes,
    }  # fmt: skip


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
        found.pop("covariates", None)  # paths of this computer
        named = {"earlier": [Path(one).name for one in found["earlier"]]} if "earlier" in found else {}
        field = {"field": Path(found["field"]).name} if "field" in found else {}
    except (TypeError, ValueError):
        return {}
    return {**found, **named, **field}

# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The forecasts of a mission in the order of time, and what became of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from soilmoist_ros.exploration import Forecast, hundredths

SHARES = (0.0, 0.25, 0.5, 0.75)
"""Shares of the mission time at which forecasts are reported."""


class TimedForecast(NamedTuple):
    """A forecast, and the mission time at which it was made [s]."""

    time_s: float
    forecast: Forecast


def reported(forecasts: Sequence[TimedForecast], planned_s: float) -> list[tuple[float, TimedForecast]]:
    """The first forecast at or after each of :data:`SHARES` of the planned time, with the share.

    :param forecasts: in order of time; the last one may be the map at the end
    :param planned_s: planned mission time [s]
    """
    found: list[tuple[float, TimedForecast]] = []
    for share in SHARES:
        made = next((one for one in forecasts if one.time_s >= share * planned_s), None)
        if made is not None and made.forecast.times_s and all(made is not other for _, other in found):
            found.append((share, made))
    return found


def achieved(forecasts: Sequence[TimedForecast]) -> TimedForecast | None:
    """Standard deviation of the last map, ``None`` without a map."""
    return next((one for one in reversed(forecasts) if not one.forecast.is_guess), None)


def forecast_text(forecasts: Sequence[TimedForecast], planned_s: float) -> str:
    """What was forecast for the end and what was reached, in words; empty without a map."""
    end = achieved(forecasts)
    if end is None:
        return ""
    reached = f"±{hundredths(end.forecast.sd)} {end.forecast.unit} reached"
    made = [f"{made.forecast.end_text} {_when(share)}" for share, made in reported(forecasts, planned_s)]
    return "; ".join([reached, f"forecast {', '.join(made)}"] if made else [reached])


def _when(share: float) -> str:
    return f"at {100 * share:.0f} % of the time" if share else "at the start"

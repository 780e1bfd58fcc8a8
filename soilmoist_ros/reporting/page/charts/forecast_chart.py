# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Chart of the map's standard deviation against mission time, as forecast and as reached."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.reporting.page.charts.chart import Area, Chart, Colour, Line, Mark
from soilmoist_ros.simulation import TimedForecast, reported

Array = NDArray[np.float64]

_SHOWN = (0.0, 0.25, 0.5)
_COLOURS: tuple[Colour, ...] = ("soft", "orange", "purple")
_HEADROOM = 4.0


def forecast_chart(forecasts: Sequence[TimedForecast], planned_s: float) -> Chart | None:
    """The chart; ``None`` with fewer than two maps.

    :param forecasts: forecasts of a mission in order of time
    :param planned_s: planned mission time [s]
    """
    known = [one for one in forecasts if not one.forecast.is_guess]
    if len(known) < 2:
        return None
    hours = np.array([one.time_s for one in known]) / 3600
    sd = 100 * np.array([one.forecast.sd for one in known])
    top = min(float(sd.max()), _HEADROOM * float(sd[-1])) * 1.05
    marks: list[Mark] = []
    names = {0.0: "forecast at the start", 0.25: "forecast after a quarter", 0.5: "forecast after half"}
    made = [(share, one) for share, one in reported(forecasts, planned_s) if share in _SHOWN]
    for (share, one), colour in zip(made, _COLOURS, strict=False):
        x = (one.time_s + np.array([0.0, *one.forecast.times_s])) / 3600
        y = 100 * np.array([one.forecast.sd, *one.forecast.sds])
        factor = np.array([1.0, *one.forecast.factors])
        if share:
            marks.append(Area(x, y / factor, np.minimum(y * factor, top), colour))
        marks.append(Line(x, np.where(y <= top, y, np.nan), colour, names[share], dashed=True))
    marks.append(Line(hours, np.where(sd <= top, sd, np.nan), name="reached"))
    end_h = max(float(hours[-1]), planned_s / 3600)
    moisture = known[-1].forecast.moisture
    what = "moisture" if moisture else "rate"
    return Chart(
        "course-sd", "Standard deviation of the map", "Standard deviation of the map against mission time, as "
        "forecast and as reached", marks, (0.0, end_h), (0.0, top), "Mission time [h]",
        f"Standard deviation of the {what} [{'% by volume' if moisture else '% of the mean'}]",
        "Root of the mean variance of the map. In four of five missions it ends within the band of a forecast.",
    )  # fmt: skip

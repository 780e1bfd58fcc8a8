# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Result of a mission: state over time, map errors, visits, forecasts, a map of each property; and its moments."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.exploration import Forecast, MissionStatus, Stop, Visit, hundredths
from soilmoist_ros.mapping import Samples, SoilMap, possible_moisture
from soilmoist_ros.sensing import MoistureCurve

if TYPE_CHECKING:
    from soilmoist_ros.exploration import LearnedMotion, Visit
    from soilmoist_ros.foundation import LocalFrame
    from soilmoist_ros.mapping import Covariates, SoilMap
    from soilmoist_ros.sensing import CountRecord
    from soilmoist_ros.simulation.mission.settings import MissionSettings
    from soilmoist_ros.simulation.mission.simulated_knowledge import SimulatedSurvey

Array = NDArray[np.float64]

_COVERAGE_SD = 1.959964
SHARES = (0.0, 0.25, 0.5, 0.75)  # shares of the mission time at which forecasts are reported


class MapErrors(NamedTuple):
    """Errors of a map over the cells of a field; NaN before the first map, or without a truth.

    :param vwc_rmse: root mean squared error of the moisture [m^3/m^3], estimates kept between 0 and the pore
        volume; NaN without a calibration curve
    """

    mse: float = math.nan  # mean squared error of the rate [(counts/s)^2]
    vwc_rmse: float = math.nan
    coverage95: float = math.nan  # share of the cells whose true rate lies in the 95 % interval


def map_errors(
    rate_cps: Array, rate_sd_cps: Array, true_rate_cps: Array, curve: MoistureCurve | None
) -> MapErrors:
    """Errors over the cells of a field; all arrays of shape (g,) [counts/s]."""
    error = rate_cps - true_rate_cps
    covered = float(np.mean(np.abs(error) <= _COVERAGE_SD * rate_sd_cps))
    vwc_rmse = math.nan
    if curve is not None:
        difference = possible_moisture(curve, rate_cps) - possible_moisture(curve, true_rate_cps)
        vwc_rmse = float(np.sqrt(np.mean(difference**2)))
    return MapErrors(float(np.mean(error**2)), vwc_rmse, covered)


class TimedForecast(NamedTuple):
    """A forecast, and the mission time at which it was made [s]."""

    time_s: float
    forecast: Forecast


def reported(forecasts: Sequence[TimedForecast], planned_s: float) -> list[tuple[float, TimedForecast]]:
    """The first forecast at or after each of :data:`SHARES` of the planned time, with the share."""
    found: list[tuple[float, TimedForecast]] = []
    for share in SHARES:
        made = next((one for one in forecasts if one.time_s >= share * planned_s), None)
        if made is not None and made.forecast.times_s and all(made is not other for _, other in found):
            found.append((share, made))
    return found


def achieved(forecasts: Sequence[TimedForecast]) -> TimedForecast | None:
    """Standard deviation of the last map, ``None`` without a map."""
    return next((one for one in reversed(forecasts) if not one.forecast.is_guess), None)


def forecast_texts(forecasts: Sequence[TimedForecast], planned_s: float) -> list[str]:
    """Standard deviation reached, and its forecast after a quarter of the time, or at the start if there is no
    other, in words; empty without a map.
    """
    end = achieved(forecasts)
    if end is None:
        return []
    reached = f"±{hundredths(end.forecast.sd)} {end.forecast.unit} reached"
    if end.forecast.reaching is not None:
        reached += f"; {end.forecast.reaching.text}"
    early = [(share, one.forecast) for share, one in reported(forecasts, planned_s) if share <= SHARES[1]]
    if not early:
        return [reached]
    share, made = early[-1]
    when = f"at {100 * share:.0f} % of the time" if share else "at the start"
    return [reached, f"{when}: {made.end_text if made.reaching is None else made.reaching.text}"]


@dataclass(frozen=True)
class SeriesRow:
    """The state of a mission at one time.

    :param errors: errors of the map of each property against the truth of its time; the first is that of the
        mission field. Of a strategy that does without the variance of every cell, the entries before the last are
        of some hundred cells, evenly spaced
    """

    time_s: float  # mission time [s]
    distance_m: float  # distance travelled by all robots together [m]
    samples: int  # finished visits
    counting_s: float  # time that all robots together spent counting at stops [s]
    errors: tuple[MapErrors, ...] = (MapErrors(),)

    @property
    def mse(self) -> float:
        """Mean squared error of the rate of the mission field [(counts/s)^2]."""
        return self.errors[0].mse

    @property
    def mse_10s(self) -> float:
        """Mean squared error in the authors' unit [(counts/10 s)^2]."""
        return 100 * self.mse

    @property
    def vwc_rmse(self) -> float:
        """Root mean squared error of the moisture [m^3/m^3]; NaN without a calibration curve."""
        return self.errors[0].vwc_rmse

    @property
    def coverage95(self) -> float:
        """Share of the cells whose true rate lies in the 95 % interval."""
        return self.errors[0].coverage95


def series_columns(series: Sequence[SeriesRow], names: Sequence[str]) -> dict[str, NDArray[Any]]:
    """A series as columns: mission and first property, then error and coverage of each additional property.

    :param names: names of all properties; columns of the first property have no suffix
    :returns: ``time_s``, ``distance_m``, ``samples``, ``mse``, ``mse_10s``, ``vwc_rmse``, ``coverage95``,
        ``counting_s``, and ``mse_NAME`` and ``coverage95_NAME`` of each additional property; with exactly one
        additional property also ``also_mse`` and ``also_coverage95``, the names in earlier releases
    """
    shared = ("time_s", "distance_m", "samples", "mse", "mse_10s", "vwc_rmse", "coverage95", "counting_s")
    columns: dict[str, NDArray[Any]] = {
        name: np.array([getattr(row, name) for row in series], float) for name in shared
    }
    columns["samples"] = np.array([row.samples for row in series], int)
    for number, name in enumerate(names[1:], start=1):
        errors = [row.errors[number] for row in series]
        for metric in ("mse", "coverage95"):
            column = np.array([getattr(error, metric) for error in errors], float)
            if len(names) == 2:
                columns[f"also_{metric}"] = column
            columns[f"{metric}_{name}"] = column
    return columns


@dataclass(frozen=True, eq=False)
class MappedProperty:
    """A property that a mission mapped.

    :param truth_rate: true rate at the end on the map's grid [counts/s], shape (ny, nx), NaN outside and if
        unknown
    """

    name: str  # name in files, see :func:`property_name`
    title: str  # name in reports
    records: Sequence[CountRecord]  # all records of its sensors in order of time
    soil_map: SoilMap | None  # final map of its rate, ``None`` if the mission ended before the first map
    truth_rate: Array
    weight: float = 1.0  # value of a share of its variation to the planner; 0 means mapped, but not planned for
    series: Sequence[SimulatedSurvey] = ()  # simulated earlier surveys that informed the map, the latest first
    covariates: Covariates | None = None  # covariates that informed the map

    @property
    def known_truth(self) -> Array | None:
        """The truth, ``None`` if it is unknown."""
        return self.truth_rate if np.isfinite(self.truth_rate).any() else None


@dataclass(frozen=True, eq=False)
class MissionResult:
    """Result of a mission.
    :param forecasts: forecasts of the map's standard deviation; the last one may be the map at the end
    """

    settings: MissionSettings
    series: Sequence[SeriesRow]  # state over time, in order; the last row is the end of the mission
    visits: Sequence[Visit]  # visits in the order in which they finished
    tracks: Sequence[Array]  # corner points of each robot's path [m], shape (p, 2)
    properties: Sequence[MappedProperty]  # mapped properties; the first belongs to the mission field
    frame: LocalFrame
    ended: str = ""  # reason for the end
    motion: Sequence[LearnedMotion] = ()  # motion of each robot, as its planner has learned it
    log: Sequence[str] = field(default_factory=tuple)  # lines of the mission log
    forecasts: Sequence[TimedForecast] = ()
    certificate: str = ""  # sealed sample of its certificate; empty without one

    @property
    def records(self) -> Sequence[CountRecord]:
        """Records of the mission field."""
        return self.properties[0].records

    @property
    def soil_map(self) -> SoilMap | None:
        """Final map of the mission field, ``None`` if the mission ended before the first map."""
        return self.properties[0].soil_map

    @property
    def truth_rate(self) -> Array:
        """True rate of the mission field on the map's grid [counts/s], shape (ny, nx), NaN outside."""
        return self.properties[0].truth_rate

    @property
    def field_title(self) -> str:
        """Name of the mission field in reports."""
        return self.properties[0].title

    @property
    def columns(self) -> dict[str, NDArray[Any]]:
        """The series as columns, see :func:`series_columns`."""
        return series_columns(self.series, [mapped.name for mapped in self.properties])

    def __repr__(self) -> str:
        end_h = self.series[-1].time_s / 3600 if self.series else 0.0
        names = ", ".join(mapped.name for mapped in self.properties)
        return f"<MissionResult: {names}; {len(self.visits)} visits in {end_h:.2f} h; {self.ended}>"


@dataclass(frozen=True)
class RobotMoment:
    """A robot at one moment."""

    status: MissionStatus  # its mission
    xy: tuple[float, float]  # true place [m]
    ahead: tuple[Stop, ...]  # its stops ahead, the next one first


@dataclass(frozen=True)
class Moment:
    """All robots and the map of the mission field at one moment.

    :param soil_map: makes the map of all cells, ``None`` before there is one; takes some milliseconds to seconds
    """

    time_s: float  # simulated time [s]
    robots: tuple[RobotMoment, ...]  # the robots
    visits: Sequence[Visit]  # visits so far; the list grows with the mission
    samples: Samples  # samples in the map
    soil_map: Callable[[], SoilMap | None]


Watch = Callable[[Moment], bool]  # receives the moments of a mission; false ends the mission as an operator would

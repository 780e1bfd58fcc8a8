"""Collects the messages of a running mission for :mod:`terminal`."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.reporting.live.terminal import LiveBand, LiveView
from soilmoist_ros.reporting.page.numbers import duration, length

Array = NDArray[np.float64]

WETTEST = 0.6
"""Upper limit of plausible soil moisture [m^3/m^3]; early maps exceed it where the rate is uncertain."""


class LiveMap:
    """The latest map of a property.

    :param name: name of the property and namespace of its mapper; empty for the mission's own field
    :param true_rate: true rate on the map's raster, shape (ny, nx) [counts/s], if known
    """

    def __init__(self, name: str = "", true_rate: Array | None = None) -> None:
        self.name = name
        self._true_rate = true_rate
        self.cells: NDArray[np.void] | None = None
        """Cells with fields x, y, rate, rate_sd, vwc, vwc_sd, shape (ny, nx)."""

    @property
    def mse(self) -> float:
        """Mean squared error of the rate map [(counts/s)^2]; NaN without a map or a truth."""
        cells = self.cells
        if cells is None or self._true_rate is None or cells.shape != self._true_rate.shape:
            return math.nan
        error = cells["rate"] - self._true_rate
        return float(np.mean(error[np.isfinite(error)] ** 2)) if np.isfinite(error).any() else math.nan

    @property
    def band(self) -> LiveBand | None:
        """Map of the moisture, else of the rate; ``None`` without a map."""
        cells = self.cells
        if cells is None or not (_inside(cells) & np.isfinite(cells["rate"])).any():
            return None
        field, extent = _field(cells)
        moist = bool(np.isfinite(field["vwc"]).any())
        what = "moisture [m³/m³]" if moist else "rate [counts/s]"
        values = np.asarray(field["vwc" if moist else "rate"], float)
        return LiveBand(f"{self.name} {what}".lstrip(), values, extent, wet_is_high=moist)


class LiveMission:
    """The latest messages of a mission. One thread may set them while another reads the view.

    :param title: first line
    :param maps: maps of the properties; the mission's own field is the first
    """

    def __init__(self, title: str, maps: Sequence[LiveMap] = ()) -> None:
        self._title = title
        self.maps = tuple(maps) or (LiveMap(),)
        self.status: Mapping[str, str] = {}
        self.robot_xy: tuple[float, float] | None = None
        self.samples_xy: Array = np.empty((0, 2))

    @property
    def state(self) -> str:
        """State and reason of the mission."""
        status = self.status
        return f"{status['state']}: {status['reason']}" if status else "waiting for the planner"

    def view(self) -> LiveView:
        """The view now."""
        status, samples = self.status, self.samples_xy  # another thread may replace them
        return LiveView(
            self._title,
            self._facts(status, len(samples)),
            [band for one in self.maps if (band := one.band) is not None],
            samples_xy=samples,
            robot_xy=self.robot_xy,
            target_xy=_target(status),
        )

    def _facts(self, status: Mapping[str, str], n_samples: int) -> dict[str, str]:
        facts = {"state": self.state}
        if not status:
            return facts
        number = {key: float(status[key]) for key in (
            "planned_dwell_s", "elapsed_dwell_s", "time_used_s", "time_left_s", "distance_m",
        )}  # fmt: skip
        if status["target"]:
            facts["target"] = f"{status['target']}, counted {number['elapsed_dwell_s']:.0f} s"
            if math.isfinite(number["planned_dwell_s"]):
                facts["target"] += f" of about {number['planned_dwell_s']:.0f} s"
        value, unit = length(number["distance_m"])
        facts["mission"] = (
            f"{duration(number['time_used_s'])} used, {duration(number['time_left_s'])} left; "
            f"{value} {unit} driven"
        )
        facts["map"] = f"{status['samples']} stops, {n_samples} samples with those on the way"
        errors = [f"{one.name} {mse:.4f}".lstrip() for one in self.maps if math.isfinite(mse := one.mse)]
        if errors:
            facts["map"] += f"; mean squared error {', '.join(errors)} (counts/s)²"
        return facts


def _target(status: Mapping[str, str]) -> tuple[float, float] | None:
    x_m, y_m = (float(status.get(key, "nan")) for key in ("target_x_m", "target_y_m"))
    return (x_m, y_m) if math.isfinite(x_m) and math.isfinite(y_m) else None


def _inside(cells: NDArray[np.void]) -> NDArray[np.bool_]:
    """Cells in the field: cells outside have no place."""
    return np.asarray(np.isfinite(cells["x"]) & np.isfinite(cells["y"]))


def _field(cells: NDArray[np.void]) -> tuple[NDArray[np.void], tuple[float, float, float, float]]:
    """The part of a map that covers the field, and its edges: west, east, south, north [m]."""
    inside = _inside(cells)
    rows, columns = (np.flatnonzero(inside.any(axis=axis)) for axis in (1, 0))
    part = cells[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    west, east = float(np.nanmin(part["x"])), float(np.nanmax(part["x"]))
    south, north = float(np.nanmin(part["y"])), float(np.nanmax(part["y"]))
    steps = max(part.shape) - 1
    half = (max(east - west, north - south) / steps if steps else 1.0) / 2
    return part, (west - half, east + half, south - half, north + half)

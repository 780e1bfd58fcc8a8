"""One simulated mission: what determines it, and what came of it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.mapping.variogram.fit import FitMethod
from soilmoist_ros.mapping.variogram.model import ModelName

if TYPE_CHECKING:
    from soilmoist_ros.exploration.mission.visit import Visit
    from soilmoist_ros.foundation.geodesy import LocalFrame
    from soilmoist_ros.mapping import SoilMap
    from soilmoist_ros.sensing.records import CountRecord

Array = NDArray[np.float64]
Preset = Literal["paper", "authors"]


@dataclass(frozen=True)
class MissionSettings:
    """Everything that determines a simulated mission, bit for bit.

    :param field: name of a built-in surrogate field, or the path of a field file with a truth
    :param strategy: ``greedy``, ``monte_carlo``, ``adaptive_sampling``, ``random``, ``lattice``, ``ivr``
        or ``gcb``
    :param dwell: ``fmi:SECONDS``, ``ami:THRESHOLD`` or ``optimal``
    :param hours: mission time [h]
    :param seed: seed of all randomness
    :param variogram: variogram model
    :param fit: how the variogram is fitted
    :param preset: constants of the exploration: the paper's text, or the authors' experiments
    :param map_from: what is mapped: the ``stops`` only, as published, or all ``records``, those on the way too
    :param target: what is to be known well: the ``rate``, or the moisture ``vwc``, whose error grows in wet soil
    :param travel: ``free`` (straight lines) or ``graph`` (over a travel graph)
    :param graph: topological map with the travel graph, a file; an open lattice of about 300 nodes if ``None``
    :param speed_mps: speed of the robot [m/s]
    :param stop_overhead_s: time lost at each stop [s]
    :param turn_s_per_rad: time for each radian turned on the way [s/rad]
    :param cadence_s: duration of a record [s]
    :param cell_m: cell size of the map [m]; the field's own if ``None``
    :param footprint_m: radius of a Gaussian footprint of the sensor [m], 0 for a point sensor
    :param position_sd_m: GNSS noise of each coordinate [m]
    :param weather: whether the weather changes during the mission (and is corrected for)
    :param series_every_s: time between entries of the series [s]; every map update is entered as well
    :param robots: number of robots; they begin at the same place and share one map
    :param random_field: draw what is random in the field (patches, random fields) from the seed as well: each seed
        has a field of its own
    :param also: a second property that the robots count beside, and map of its own: the field whose rate is its
        truth, on the same ground; none if empty. ``ami`` looks at the counts of the first only
    :param also_weight: what a share of its variation is worth, that of the first property being 1; with 0 it is
        mapped, but not planned for
    """

    field: str = "synthetic-high"
    strategy: str = "greedy"
    dwell: str = "ami:0.03"
    hours: float = 2.0
    seed: int = 1
    variogram: ModelName = "gaussian"
    fit: FitMethod = "soft_l1"
    preset: Preset = "paper"
    map_from: Literal["stops", "records"] = "stops"
    target: Literal["rate", "vwc"] = "rate"
    travel: Literal["free", "graph"] = "free"
    graph: str | None = None
    speed_mps: float = 0.6
    stop_overhead_s: float = 12.0
    turn_s_per_rad: float = 0.0
    cadence_s: float = 10.0
    cell_m: float | None = None
    footprint_m: float = 0.0
    position_sd_m: float = 0.02
    weather: bool = True
    series_every_s: float = 60.0
    robots: int = 1
    random_field: bool = False
    also: str = ""
    also_weight: float = 1.0


class SeriesRow(NamedTuple):
    """The state of a mission at one time; metrics are over the cells inside the polygon.

    :param time_s: mission time [s]
    :param distance_m: distance travelled, of all robots together [m]
    :param samples: places measured
    :param mse: mean squared error of the rate [(counts/s)^2]; NaN before the first map
    :param mse_10s: the same in the authors' unit [(counts/10 s)^2]
    :param vwc_rmse: root mean squared error of the moisture [m^3/m^3], estimates kept between 0 and the pore
        volume; NaN without a calibration curve
    :param coverage95: share of cells whose true rate lies in the 95 % interval of the map
    :param counting_s: time spent counting at stops so far, of all robots together [s]
    :param also_mse: mean squared error of the second property's rate [(counts/s)^2]; NaN without
    :param also_coverage95: share of cells whose true rate of it lies in the 95 % interval
    """

    time_s: float
    distance_m: float
    samples: int
    mse: float
    mse_10s: float
    vwc_rmse: float
    coverage95: float
    counting_s: float
    also_mse: float = math.nan
    also_coverage95: float = math.nan


@dataclass(frozen=True, eq=False)
class Mapped:
    """A property that was mapped beside the first.

    :param name: its name for files, see :func:`property_name`
    :param field_title: its name for reports
    :param records: all records of its sensors in order of time
    :param soil_map: final map of its rate, ``None`` if the mission ended before the first
    :param truth_rate: true rate on the map's grid [counts/s], shape (ny, nx), NaN outside and if unknown
    """

    name: str
    field_title: str
    records: Sequence[CountRecord]
    soil_map: SoilMap | None
    truth_rate: Array

    @property
    def known_truth(self) -> Array | None:
        """The truth, ``None`` if it is unknown."""
        return self.truth_rate if np.isfinite(self.truth_rate).any() else None


@dataclass(frozen=True, eq=False)
class MissionResult:
    """What a simulated mission leaves.

    :param settings: what it was run with
    :param series: state over time, in order; the last row is the end of the mission
    :param visits: measurements in the order in which they were finished
    :param tracks: corner points of each robot's path [m], shape (p, 2)
    :param records: all records of the sensors in order of time, as the drivers would publish them
    :param soil_map: final map, ``None`` if the mission ended before the first
    :param truth_rate: true rate on the map's grid [counts/s], shape (ny, nx), NaN outside
    :param frame: plane of the field
    :param field_title: name of the field for reports
    :param ended: why the mission ended
    :param log: what happened, line by line
    :param also: the second property, if there was one
    """

    settings: MissionSettings
    series: Sequence[SeriesRow]
    visits: Sequence[Visit]
    tracks: Sequence[Array]
    records: Sequence[CountRecord]
    soil_map: SoilMap | None
    truth_rate: Array
    frame: LocalFrame
    field_title: str = ""
    ended: str = ""
    log: Sequence[str] = field(default_factory=tuple)
    also: Mapped | None = None

"""What determines a simulated mission."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from soilmoist_ros.exploration.planning.property_names import property_name
from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.mapping.variogram.correlation import ModelName
from soilmoist_ros.mapping.variogram.fit import FitMethod

Preset = Literal["paper", "authors"]


@dataclass(frozen=True)
class PropertySettings:
    """A further property that the robots count and map.

    :param field: surrogate field whose rate is its truth: a built-in name, or the path of a field file
    :param weight: value of a share of its variation to the planner, that of the mission's own field being 1; with
        0 it is mapped, but not planned for
    """

    field: str
    weight: float = 1.0

    @classmethod
    def parse(cls, text: str) -> PropertySettings:
        """Read ``FIELD`` or ``FIELD:WEIGHT``.

        >>> PropertySettings.parse("rough:0.5")
        PropertySettings(field='rough', weight=0.5)

        :raises InputError: if there is no field, or the weight is not a number from 0
        """
        field, colon, number = text.rpartition(":")
        if not colon or "/" in number or "\\" in number:  # no weight, but a path with a colon
            field, number = text, "1"
        try:
            weight = float(number)
        except ValueError:
            weight = math.nan
        if not field or not (math.isfinite(weight) and weight >= 0):
            raise InputError(
                f"{text!r} is not a property with a weight", "give FIELD or FIELD:WEIGHT with a weight from 0"
            )
        return cls(field, weight)

    @property
    def name(self) -> str:
        """Its name in topics and files."""
        return property_name(self.field)

    def __str__(self) -> str:
        return self.field if self.weight == 1 else f"{self.field}:{self.weight:g}"


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
    :param properties: further properties that the robots count and map, each of them ``FIELD`` or
        ``FIELD:WEIGHT`` or :class:`PropertySettings`; the adaptive dwell rule ``ami`` uses the counts of ``field``
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
    properties: tuple[PropertySettings, ...] = ()

    def __post_init__(self) -> None:
        given: tuple[str | PropertySettings, ...] = self.properties
        parsed = tuple(PropertySettings.parse(one) if isinstance(one, str) else one for one in given)
        object.__setattr__(self, "properties", parsed)

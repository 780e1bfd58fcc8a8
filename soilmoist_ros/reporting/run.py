# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A mapping run: the data that its outputs show."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.foundation import LocalFrame, shown_text
from soilmoist_ros.reporting.geometry import distance_m, inside_boundary, track_xy
from soilmoist_ros.reporting.survey_times import SurveyTimes
from soilmoist_ros.sensing import Consequence, CountRecord, SensedSoil

if TYPE_CHECKING:
    from soilmoist_ros.mapping import Covariates, SoilMap
    from soilmoist_ros.reporting.earlier.earlier_runs import EarlierRun
    from soilmoist_ros.reporting.earlier.run_change import RunChange
    from soilmoist_ros.simulation import MissionResult


@dataclass(frozen=True)
class InputFile:
    """An input file of the run.

    :param name: name or path as the user wrote it
    :param n_records: records read from it, ``None`` if it holds none (a polygon, a configuration)
    :param size_bytes: its size, ``None`` if unknown
    :param sha256: checksum of its bytes in hexadecimal, empty if unknown
    :param role: purpose of the file
    """

    name: str
    n_records: int | None = None
    size_bytes: int | None = None
    sha256: str = ""
    role: str = "logger data"


REFERENCE = "reference sensor"
"""Name of the correction by a stationary sensor."""


@dataclass(frozen=True)
class CorrectionRow:
    """An applied correction factor.

    :param name: quantity corrected for, e.g. ``air pressure``
    :param formula: the formula in plain text
    :param parameters: parameter name (with its unit) -> value
    :param mean_factor: mean of the factor over the records [-]
    :param min_factor: smallest factor [-]
    :param max_factor: largest factor [-]
    :param remark: e.g. where the values came from, or why the correction was not applied
    """

    name: str
    formula: str
    parameters: Mapping[str, float | str] = field(default_factory=dict)
    mean_factor: float = 1.0
    min_factor: float = 1.0
    max_factor: float = 1.0
    remark: str = ""


@dataclass(frozen=True)
class LossRow:
    """A kind of problem in the input.

    :param kind: short name, e.g. ``no position``
    :param count: how often
    :param example: message of one case, with file and line
    :param consequence: ``lost``: these records are not in the map; ``quarantined``: they are not, but they are
        listed and shown; ``kept``: they are in the map, but less reliable
    :param remedy: what the user can do about it
    """

    kind: str
    count: int
    example: str = ""
    consequence: Consequence = "lost"
    remedy: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "example", shown_text(self.example))


@dataclass(frozen=True)
class CalibrationInfo:
    """Origin of the relation between count rate and soil moisture.

    :param n0_cps: count rate over dry soil [counts/s]
    :param bulk_density_gcm3: dry bulk density [g/cm^3]
    :param n0_sd_cps: standard deviation of N0 [counts/s], ``None`` if unknown
    :param lattice_water: gravimetric lattice water [g/g]
    :param organic_water: gravimetric water equivalent of organic matter [g/g]
    :param source: e.g. ``6 soil cores of 2024-05-02``
    :param illustrative: whether N0 is a guess, so that only patterns of the moisture are meaningful
    """

    n0_cps: float
    bulk_density_gcm3: float
    n0_sd_cps: float | None = None
    lattice_water: float = 0.0
    organic_water: float = 0.0
    source: str = ""
    illustrative: bool = False


@dataclass(frozen=True)
class IrrigationLimits:
    """What divides a field into dry and moist zones, and how deep roots reach.

    :param root_depth_mm: depth of the root zone [mm]
    :param wilting_point: moisture at the wilting point [m^3/m^3]
    :param field_capacity: moisture at field capacity [m^3/m^3]
    :param depletion: share of the water between both that plants use before they lack water [0..1]
    :param dry_below: limit of the dry zone given by the user [m^3/m^3]; with the next one it replaces those above
    :param moist_above: limit of the moist zone given by the user [m^3/m^3]
    """

    root_depth_mm: float = 300.0
    wilting_point: float | None = None
    field_capacity: float | None = None
    depletion: float = 0.5
    dry_below: float | None = None
    moist_above: float | None = None


class NoteCode(StrEnum):
    """Topic of a note."""

    NO_MAP = "no_map"
    QUARANTINED = "quarantined"
    BAD_TUBES = "bad_tubes"
    OVERDISPERSED = "overdispersed"
    DOUBTFUL_LOG = "doubtful_log"
    SKIPPED_FILES = "skipped_files"
    OUTSIDE_FIELD = "outside_field"
    FAR_RECORDS = "far_records"
    FAR_FROM_SITE = "far_from_site"
    IMPOSSIBLE_DATE = "impossible_date"
    POSITIONS = "positions"
    NOT_MAPPED = "not_mapped"
    LOST_MESSAGES = "lost_messages"
    OTHER_CORRECTIONS = "other_corrections"
    ILLUSTRATIVE_CALIBRATION = "illustrative_calibration"
    RATE_BELOW_CURVE = "rate_below_curve"
    TILE_ERROR = "tile_error"
    ABOVE_PORE_VOLUME = "above_pore_volume"
    NEGATIVE_MOISTURE = "negative_moisture"
    BEYOND_LIMITS = "beyond_limits"
    FAR_REFERENCE_PRESSURE = "far_reference_pressure"
    UNUSUAL_FACTOR = "unusual_factor"
    OTHER_TIME_OF_N0 = "other_time_of_n0"
    UNKNOWN_CALIBRATION = "unknown_calibration"
    ONE_PLACE = "one_place"
    FEW_SAMPLES = "few_samples"
    NO_BETTER_THAN_MEAN = "no_better_than_mean"
    PRIOR_MATTERED = "prior_mattered"
    NOT_CONVERGED = "not_converged"
    COVARIATE_GAPS = "covariate_gaps"
    DOUBTFUL_EARLIER = "doubtful_earlier"
    RATE_CHANGED = "rate_changed"
    RAIN_LIKELY = "rain_likely"


@dataclass(frozen=True)
class Note:
    """A note to the reader.

    :param code: topic, for programs
    :param message: a plain sentence, for people
    """

    code: NoteCode
    message: str

    def __post_init__(self) -> None:
        object.__setattr__(self, "message", shown_text(self.message))

    def __str__(self) -> str:
        return self.message


@dataclass(frozen=True, repr=False)
class MapRun(SurveyTimes):
    """A finished mapping run: the map of a property with the data needed to judge it.

    :param soil_map: the map
    :param frame: local frame in which the map and the track lie
    :param created_utc: creation time of the outputs, time-zone aware
    :param track: the processed records in order of time, including records without a place
    :param title: title of the report
    :param site: name of the site
    :param field_name: name of the field
    :param inputs: input files
    :param logger_format: name of the logger's format
    :param corrections: corrections as applied
    :param losses: input that was dropped, or kept although less reliable
    :param notes: notes to the reader in addition to the notes on the map, see :func:`notes`
    :param calibration: origin of the calibration; ``None`` if unknown
    :param simulated: the counts come from a simulation; every output says so
    :param version: version of this package
    :param settings: settings of the run, name (with its unit) -> value
    :param truth_rate: true corrected rate on the map's grid [counts/s], shape (ny, nx), if known
    :param footprint_radius_m: radius of the soil seen by the sensor [m], 0 for a point, ``None`` if unknown
    :param mission: the mission that made the map, if any
    :param name: name of the property for files: letters, digits and _
    :param label: name of the property for readers
    :param others: maps of the other properties of this run; they have no mission and no others
    :param uncertain_vwc_sd: standard deviation of VWC from which a place counts as uncertain [m^3/m^3]
    :param uncertain_rate_share: standard deviation of the rate from which a place counts as uncertain, as a
        share of the rate [-]
    :param earlier: earlier surveys that inform the map
    :param change: what has changed since the latest of them
    :param quarantined: records left out of the map, each with its reason, in order of time
    :param irrigation: limits of dry and moist soil
    :param time_zone: name of the field's time zone, for local times next to UTC; empty for UTC alone
    :param sensed: depth and radius that the counts come from, if known
    :param covariates: covariates behind the map, if any
    :raises ValueError: if ``created_utc`` has no time zone
    """

    soil_map: SoilMap
    frame: LocalFrame
    created_utc: datetime
    track: Sequence[CountRecord] = ()
    title: str = "Soil moisture map"
    site: str = ""
    field_name: str = ""
    inputs: Sequence[InputFile] = ()
    logger_format: str = ""
    corrections: Sequence[CorrectionRow] = ()
    losses: Sequence[LossRow] = ()
    notes: Sequence[Note] = ()
    calibration: CalibrationInfo | None = None
    simulated: bool = False
    version: str = ""
    settings: Mapping[str, object] = field(default_factory=dict)
    truth_rate: NDArray[np.float64] | None = None
    footprint_radius_m: float | None = None
    mission: MissionResult | None = None
    name: str = ""
    label: str = ""
    others: Sequence[MapRun] = ()
    uncertain_vwc_sd: float = 0.03
    uncertain_rate_share: float = 0.05
    quarantined: Sequence[CountRecord] = ()
    irrigation: IrrigationLimits = field(default_factory=IrrigationLimits)
    time_zone: str = ""
    sensed: SensedSoil | None = None
    earlier: Sequence[EarlierRun] = ()
    change: RunChange | None = None
    covariates: Covariates | None = None

    def __post_init__(self) -> None:
        if self.created_utc.tzinfo is None:
            raise ValueError("created_utc must have a time zone")

    def __repr__(self) -> str:
        where = self.field_name or self.site or "unnamed field"
        others = f", {len(self.others)} further properties" if self.others else ""
        return f"MapRun({where}: {len(self.track)} records, {len(self.soil_map.samples)} samples{others})"

    @property
    def properties(self) -> list[MapRun]:
        """The runs of all properties, this one first."""
        return [self, *self.others]

    @property
    def inside(self) -> tuple[int, int]:
        """Number of records inside the boundary of the field, and of all records that have a place."""
        xy_m = track_xy([record for record in self.track if not record.quarantine])
        return int(np.count_nonzero(inside_boundary(self.soil_map, xy_m))), len(xy_m)

    @property
    def travelled_m(self) -> float:
        """Distance driven [m]: the mission's distance, else the length of the line through the records' places."""
        if self.mission is not None and self.mission.series:
            return self.mission.series[-1].distance_m
        return distance_m(self.track)

    @property
    def tracks_xy(self) -> list[NDArray[np.float64]]:
        """Track of each robot, shape (n, 2) [m]: records of a single robot, or driven paths of several."""
        mission = self.mission
        return [track_xy(self.track)] if mission is None or len(mission.tracks) < 2 else list(mission.tracks)

    @property
    def all_records(self) -> list[CountRecord]:
        """Records of the map and quarantined ones in order of time."""
        return sorted([*self.track, *self.quarantined], key=lambda record: record.stamp_s)

    @property
    def support_text(self) -> str:
        """The area that each value of the map is of."""
        known_m: float | None = self.soil_map.footprint_radius_m
        if not known_m and not self.simulated:
            known_m = self.footprint_radius_m
        if self.soil_map.deconvolved_m:
            return f"each place: the footprint of {self.soil_map.deconvolved_m:g} m is de-convolved"
        if known_m is None:
            return "mean over the footprint of the sensor around each place"
        return f"mean over {known_m:g} m around each place" if known_m > 0 else "each place"

    @property
    def calibrated(self) -> bool:
        """Whether the map has soil moisture in addition to the count rate."""
        return self.soil_map.curve is not None

# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A run, with or without a map: the data that its outputs show."""

from __future__ import annotations

import math
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.foundation import InputError, LocalFrame, shown_text
from soilmoist_ros.sensing import Consequence, CountRecord, Irrigation, SensedSoil, UncertaintyPart

if TYPE_CHECKING:
    from soilmoist_ros.mapping import Covariates, EarlierSurvey, FieldChange, Persistence, SoilMap, SurveysEstimate
    from soilmoist_ros.simulation import MissionResult

EARLIEST_STAMP_S = 946684800.0
"""Stamps before 2000-01-01 UTC come from a clock without a date, such as that of a simulated mission [s]."""


def local_time(when: datetime, zone: str) -> datetime:
    """A time in a zone by its name; as it is where this computer does not know the zone."""
    from zoneinfo import ZoneInfo

    try:
        return when.astimezone(ZoneInfo(zone))
    except (KeyError, ValueError, OSError):
        return when


class SurveyTimes:
    """Begin, end, duration and distance of the records of a run."""

    track: Sequence[CountRecord]
    created_utc: datetime
    mission: MissionResult | None

    @property
    def created(self) -> str:
        """Time of creation as ISO 8601 in UTC, to the second."""
        return time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime(self.created_utc.timestamp()))

    @property
    def survey_start_utc(self) -> datetime | None:
        """Begin of the first counting interval; ``None`` without records, or if their clock has no date."""
        begin = min((r.stamp_s - r.exposure_s for r in self.track), default=-math.inf)
        return datetime.fromtimestamp(begin, UTC) if begin >= EARLIEST_STAMP_S else None

    @property
    def survey_end_utc(self) -> datetime | None:
        """End of the last counting interval; ``None`` as for the start."""
        end = max((record.stamp_s for record in self.track), default=0.0)
        return None if self.survey_start_utc is None else datetime.fromtimestamp(end, UTC)

    @property
    def survey_duration_s(self) -> float | None:
        """Time from the begin of the first to the end of the last interval [s], with any clock; else ``None``."""
        if not self.track:
            return None
        return max(r.stamp_s for r in self.track) - min(r.stamp_s - r.exposure_s for r in self.track)

    @property
    def travelled_m(self) -> float:
        """Distance driven [m]: the mission's distance, else the length of the line through the records' places."""
        if self.mission is not None and self.mission.series:
            return self.mission.series[-1].distance_m
        return float(np.hypot(*np.diff(track_xy(self.track), axis=0).T).sum())


def inside_boundary(soil_map: SoilMap, xy_m: NDArray[np.float64]) -> NDArray[np.bool_]:
    """True if each point (n, 2) lies within the boundary of the field, its holes and its edge included."""
    from shapely import Polygon, intersects_xy

    area = Polygon(soil_map.grid.polygon)
    return np.asarray(intersects_xy(area, xy_m[:, 0], xy_m[:, 1]), bool)


def track_xy(track: Sequence[CountRecord]) -> NDArray[np.float64]:
    """Places of the records in order, without records that have none, shape (n, 2) [m]."""
    xy = np.array([(r.x_m, r.y_m) for r in track], float).reshape(-1, 2)
    return np.asarray(xy[np.isfinite(xy).all(axis=1)])


@dataclass(frozen=True)
class InputFile:
    """An input file of the run by its path as the user wrote it; ``n_records`` is ``None`` if it holds none."""

    name: str
    n_records: int | None = None
    size_bytes: int | None = None
    sha256: str = ""
    role: str = "logger data"


@dataclass(frozen=True)
class CorrectionRow:
    """An applied correction: formula in plain text, parameters by name with unit, range over the records."""

    name: str
    formula: str
    parameters: Mapping[str, float | str] = field(default_factory=dict)
    mean_factor: float = 1.0
    min_factor: float = 1.0
    max_factor: float = 1.0
    remark: str = ""  # e.g. where the values came from, or why the correction was not applied


@dataclass(frozen=True)
class LossRow:
    """A kind of problem in the input, with the message of one case.

    :param consequence: ``lost``: these records are not in the map; ``quarantined``: they are not, but they are
        listed and shown; ``kept``: they are in the map, but less reliable
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

    :param n0_cps: count rate over dry soil [counts/s]; its standard deviation is ``None`` if unknown
    :param bulk_density_gcm3: dry bulk density [g/cm^3]
    :param lattice_water: gravimetric lattice water [g/g]
    :param organic_water: gravimetric water equivalent of organic matter [g/g]
    :param illustrative: whether N0 is a guess, so that only patterns of the moisture are meaningful
    :param method: where N0 comes from, see :class:`soilmoist_ros.sensing.Calibration`
    :param parts: parts of the uncertainty of N0 and soil, where they are known
    :param reference_hpa: air pressure that N0 was found with, see there; ``None`` if unknown
    """

    n0_cps: float
    bulk_density_gcm3: float
    n0_sd_cps: float | None = None
    lattice_water: float = 0.0
    organic_water: float = 0.0
    source: str = ""
    illustrative: bool = False
    method: str = "cores"
    parts: Sequence[UncertaintyPart] = ()
    reference_hpa: float | None = None


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
    GENERAL_CALIBRATION = "general_calibration"
    UNKNOWN_SENSOR = "unknown_sensor"
    ILLUSTRATIVE_CALIBRATION = "illustrative_calibration"
    RATE_BELOW_CURVE = "rate_below_curve"
    ABOVE_PORE_VOLUME = "above_pore_volume"
    NEGATIVE_MOISTURE = "negative_moisture"
    BEYOND_LIMITS = "beyond_limits"
    FAR_REFERENCE_PRESSURE = "far_reference_pressure"
    SHALLOW_ROOTS = "shallow_roots"
    UNUSUAL_FACTOR = "unusual_factor"
    OTHER_TIME_OF_N0 = "other_time_of_n0"
    UNKNOWN_CALIBRATION = "unknown_calibration"
    ONE_PLACE = "one_place"
    WIDE_FOOTPRINT = "wide_footprint"
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
    """A note to the reader: a plain sentence, with a code for programs."""

    code: NoteCode
    message: str

    def __post_init__(self) -> None:
        object.__setattr__(self, "message", shown_text(self.message))

    def __str__(self) -> str:
        return self.message


@dataclass(frozen=True, eq=False)
class EarlierRun:
    """An earlier survey with its records in the present field, and the run that it comes from.

    :param begin_s: begin of its first record [s since 1970-01-01 UTC]
    :param outside: number of records that lie outside and are left out
    :param scale: rate of its sensor relative to that of the present one over equal soil, by their calibrations;
        divided out
    :param remarks: what the user should know, in sentences
    :param corrections: parameters of each applied correction by its name, ``None`` if unknown
    """

    survey: EarlierSurvey
    path: Path
    begin_s: float
    records: Sequence[CountRecord]
    outside: int = 0
    scale: float = 1.0
    remarks: tuple[str, ...] = ()
    corrections: Mapping[str, Mapping[str, Any]] | None = None

    @property
    def date(self) -> str:
        """Day of its end; empty if its clock has no date."""
        return date_text(self.survey.stamp_s)


def date_text(stamp_s: float) -> str:
    """Day of a time stamp as YYYY-MM-DD; empty for a clock without a date."""
    return f"{datetime.fromtimestamp(stamp_s, UTC):%Y-%m-%d}" if stamp_s >= EARLIEST_STAMP_S else ""


@dataclass(frozen=True, eq=False)
class RunChange:
    """The change of a field since an earlier survey.

    :param means: change of the field's mean rate since each earlier survey [counts/s], by its name
    :param sd: standard deviation of the smooth rate of a cell, typical of the map [counts/s]
    :param sd_alone: what it would be without the earlier surveys [counts/s]
    :param backwards: whether ``since`` is later than the present survey, because none is earlier
    """

    since: EarlierRun
    change: FieldChange
    persistence: Persistence
    means: dict[str, SurveysEstimate]
    sd: float
    sd_alone: float
    backwards: bool = False


@dataclass(frozen=True, repr=False)
class MapRun(SurveyTimes):
    """A finished mapping run: the map of a property with the data needed to judge it.

    :param frame: local frame in which the map and the track lie
    :param created_utc: creation time of the outputs, time-zone aware
    :param track: the processed records in order of time, including records without a place
    :param notes: notes to the reader in addition to the notes on the map, see :func:`notes`
    :param simulated: the counts come from a simulation; every output says so
    :param truth_rate: true corrected rate on the map's grid [counts/s], shape (ny, nx), if known
    :param footprint_radius_m: radius of the soil seen by the sensor [m], 0 for a point, ``None`` if unknown
    :param footprint_range_m: least and largest radius where this one is a default, that of a bare probe [m]
    :param name: name of the property for files: letters, digits and _
    :param label: name of the property for readers
    :param others: maps of the other properties of this run; they have no mission and no others
    :param change: change since the latest of the earlier surveys
    :param quarantined: records left out of the map, each with its reason, in order of time
    :param time_zone: name of the field's time zone, for local times next to UTC; empty for UTC alone
    :param sensed: depth and radius that the counts come from, if known
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
    footprint_range_m: tuple[float, float] | None = None
    mission: MissionResult | None = None
    name: str = ""
    label: str = ""
    others: Sequence[MapRun] = ()
    quarantined: Sequence[CountRecord] = ()
    irrigation: Irrigation = field(default_factory=Irrigation)
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
        text = f"mean over {known_m:g} m around each place" if known_m > 0 else "each place"
        if self.footprint_range_m is None or not known_m:
            return text
        low, high = self.footprint_range_m
        return f"{text} (default of a bare probe, {low:g} to {high:g} m; footprint_radius_m is not given)"

    @property
    def blurred(self) -> str:
        """Sentence about a footprint that is larger than the field; empty if it is not."""
        area_m2 = float(np.count_nonzero(self.soil_map.grid.mask)) * self.soil_map.grid.cell_m**2
        radius_m = 0.0 if self.soil_map.deconvolved_m or self.simulated else self.footprint_radius_m or 0.0
        if math.pi * radius_m**2 <= area_m2:
            return ""
        default = " (default of a bare probe)" if self.footprint_range_m else ""
        return (
            f"The sensor sees {radius_m:g} m around it{default}, more than this field: neighbouring places share "
            "most of their counts, and the ground around the field counts too. The pattern is blurred, its zones "
            "are hints, and one dose for the whole field is what the counts support."
        )

    @property
    def calibrated(self) -> bool:
        """True if the map has soil moisture in addition to the count rate."""
        return self.soil_map.curve is not None


@dataclass(frozen=True)
class Trouble:
    """A fault that a node reported, how often, and whether it is an error or a warning."""

    name: str
    message: str
    count: int
    error: bool


@dataclass(frozen=True, repr=False)
class FailedRun(SurveyTimes):
    """A run that made no map.

    :param why: what happened, in sentences
    :param todo: what the user can do, the most useful first
    :param track: all records in order of time, those without a place and quarantined ones included
    """

    why: str
    todo: Sequence[str]
    created_utc: datetime
    track: Sequence[CountRecord] = ()
    title: str = "Soil moisture survey without a map"
    site: str = ""
    field_name: str = ""
    inputs: Sequence[InputFile] = ()
    losses: Sequence[LossRow] = ()
    troubles: Sequence[Trouble] = ()
    mission: MissionResult | None = None
    simulated: bool = False
    settings: Mapping[str, object] = field(default_factory=dict)

    @property
    def good(self) -> list[CountRecord]:
        """Records that no check has quarantined."""
        return [record for record in self.track if not record.quarantine]

    @property
    def quarantined(self) -> Counter[str]:
        """Number of quarantined records by reason."""
        return Counter(record.quarantine for record in self.track if record.quarantine)


class NoMapError(InputError):
    """A run made no map; the message says why, and ``failed`` has what is known of the run."""

    def __init__(self, failed: FailedRun) -> None:
        self.failed = failed
        super().__init__(f"no map: {failed.why.rstrip('.')}", failed.todo[0].rstrip(".") if failed.todo else "")

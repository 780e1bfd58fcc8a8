# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Logger formats: the meaning and unit of each column.

One YAML file in ``config/loggers`` describes one logger. A new logger needs a new file and no code: copy the
most similar file and rename the columns. Another package adds a format with an entry point of the group
``soilmoist_ros.loggers``: the path of its YAML file, or a function that returns the path.

Comparison of column names ignores case, blanks and punctuation: ``N1ET_sec``, ``N1ETsec`` and `` N1ETsec `` match.
"""

from __future__ import annotations

from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Any, Literal
from zoneinfo import ZoneInfo, available_timezones

from pydantic import AfterValidator, Field, model_validator

from soilmoist_ros.foundation import Registry, Section, did_you_mean, load_model, resource, resource_names
from soilmoist_ros.sensing.formats.log_values import Decimal, Quantity

PressureUnit = Literal["hPa", "mb", "mbar", "Pa", "kPa", "mmHg", "inHg"]
TemperatureUnit = Literal["degC", "degF", "K"]
HumidityUnit = Literal["percent", "fraction"]
DurationUnit = Literal["s", "ms", "min", "h"]
CountUnit = Literal["counts", "counts_per_second", "counts_per_minute", "counts_per_hour"]
RATE_TIME_S = {"counts_per_second": 1.0, "counts_per_minute": 60.0, "counts_per_hour": 3600.0}
"""Time to which a rate refers [s]."""
ROUNDING_TOLERANCE = 0.1
"""Rounding error above which a rate times its live time is reported [counts]; statistics need whole counts."""
DateOrder = Literal["auto", "day_first", "month_first"]
NAMED_TIME_FORMATS = ("iso8601", "unix_s", "unix_ms", "excel_days")
Checksum = Literal["none", "nmea"]


def _increasing(limits: tuple[float, float]) -> tuple[float, float]:
    if not limits[0] < limits[1]:
        raise ValueError("the lower limit must come first and be below the upper one")
    return limits


def _readable_formats(formats: tuple[str, ...]) -> tuple[str, ...]:
    moment = datetime(2024, 5, 17, 13, 14, 15, tzinfo=UTC)
    for name in formats:
        if name in NAMED_TIME_FORMATS:
            continue
        wrong = f"{name!r} is not {', '.join(NAMED_TIME_FORMATS)} or a format of Python's strptime"
        try:
            datetime.strptime(moment.strftime(name), name)
        except ValueError:
            raise ValueError(wrong) from None
        if "%" not in name:
            raise ValueError(wrong)
    return formats


def time_zone_name(name: str | None) -> str | None:
    """A name of a time zone, checked.

    :raises ValueError: if there is no such zone
    """
    if not name or name in available_timezones():
        return name
    if not available_timezones():
        raise ValueError("this computer knows no time zones: install the package tzdata")
    similar = did_you_mean(name, sorted(available_timezones()))
    raise ValueError(f"there is no time zone {name!r}; write it as in Europe/Berlin or America/Denver{similar}")


ZoneName = Annotated[str, AfterValidator(time_zone_name)]


def order_of(name: str) -> DateOrder:
    """Order of day and month in a format of strptime; ``auto`` where it has only one of them."""
    if "%d" not in name or "%m" not in name:
        return "auto"
    return "day_first" if name.index("%d") < name.index("%m") else "month_first"


def _swapped(name: str) -> str:
    """Format with day and month swapped."""
    return name.replace("%d", "\0").replace("%m", "%d").replace("\0", "%m")


TimeFormats = Annotated[tuple[str, ...], AfterValidator(_readable_formats)]
Limits = Annotated[tuple[float, float], AfterValidator(_increasing)]


MISSING = (
    "nan", "na", "n/a", "#n/a", "#value!", "null", "none", "nil", "inf", "-inf", "-", "--", "---", "*", "?",
    "-9999", "-9999.0", "-9999.00", "-999", "-999.0", "-99999",
)  # fmt: skip
"""Texts that mark a missing value in many files."""


class Header(Section):
    """Notation of the column names in the file or stream.

    A header line contains the name of a time column. It may be repeated at any time.
    """

    comment: str = ""
    """Start of every line that is not a record, such as // or #. Empty if there is none."""
    continued_by: tuple[str, ...] = ()
    """First names of header lines that continue the list of columns, such as GpsUTC."""
    columns: tuple[str, ...] = ()
    """Names of all columns in order, for loggers without a header; a header line replaces them."""
    environment: tuple[str, ...] = ()
    """Keys of the values in a line before the names, as in a TOA5 table; the first is its first field."""
    lines_after_names: int = Field(default=0, ge=0, le=10)
    """Number of lines after the names that are not records, such as units and processing."""
    units_line: bool = False
    """True if the first line after the names has the units; they replace the units of this format, with a note."""


class Time(Section):
    """The time stamp of a record."""

    columns: tuple[str, ...] = Field(min_length=1)
    """Alternative names; the first match is used. For date and time in two columns: ``Date + Time``."""
    formats: TimeFormats = Field(min_length=1)
    """Alternatives, each ``iso8601``, ``unix_s``, ``unix_ms``, ``excel_days`` or a format of Python's strptime."""
    date_order: DateOrder = "auto"
    """With formats of both orders: day_first, month_first, or auto, decided once for a file from its stamps."""
    marks: Literal["start", "end"] = "end"
    """Meaning of the stamp: the start or the end of the counting interval."""
    utc_offset_hours: float = Field(default=0.0, ge=-12, le=14)
    """Logger's clock minus UTC [h]. A zone in a stamp has priority."""
    zone: ZoneName = ""
    """Instead, name of the clock's time zone, such as Europe/Berlin, for clocks that change to summer time."""

    @property
    def clock(self) -> float | ZoneInfo:
        """Logger's clock: its distance from UTC [h], or its time zone."""
        return ZoneInfo(self.zone) if self.zone else self.utc_offset_hours

    @property
    def clock_text(self) -> str:
        """Logger's clock in words: what the format or the site states, or that UTC is an assumption."""
        if self.zone:
            return self.zone
        if self.utc_offset_hours:
            return f"UTC{self.utc_offset_hours:+g} h"
        is_unix = all(name.startswith("unix") for name in self.formats)
        if (
            "utc_offset_hours" in self.model_fields_set
            or is_unix
            or all("utc" in one.lower() for one in self.columns)
        ):
            return "UTC"
        return "UTC is assumed where stamps name no zone (else logger_utc_offset_hours of the site)"

    @property
    def rivals(self) -> tuple[str, ...]:
        """Formats that stand in the list in both orders of day and month."""
        return tuple(name for name in self.formats if _swapped(name) != name and _swapped(name) in self.formats)

    @property
    def used_formats(self) -> tuple[str, ...]:
        """Formats of times in use, without formats in the unused order of day and month."""
        if self.date_order == "auto":
            return self.formats
        return tuple(name for name in self.formats if name not in self.rivals or order_of(name) == self.date_order)

    @model_validator(mode="after")
    def _one_clock(self) -> Time:
        if self.zone and self.utc_offset_hours:
            raise ValueError("give 'zone' or 'utc_offset_hours', not both")
        return self


class Counts(Section):
    """The counts of the detector tubes."""

    columns: tuple[str, ...] = Field(min_length=1)
    """Alternative names; ``{tube}`` is the number of a tube, as in ``N{tube}Cts``."""
    unit: CountUnit = "counts"
    """counts, or counts_per_second, counts_per_minute, counts_per_hour; rates are multiplied by the live time."""
    range: Limits = (0, 1_000_000)
    """Limits of the counts of one tube in one record; a line with counts outside is damaged."""
    sentinels: tuple[float, ...] = ()
    """Numbers that mark a tube without counts."""
    left_out: tuple[int, ...] = ()
    """Numbers of unused tubes: dead tubes, or a bare (thermal) detector next to a moderated one."""
    note: str = ""
    """Tubes taken as moderated and mapped, in words, for the user to check: shown with each log."""
    rounding_tolerance: float = Field(default=ROUNDING_TOLERANCE, ge=ROUNDING_TOLERANCE, le=ROUNDING_TOLERANCE)
    """No longer a setting: a file may only have the value that is used."""


class LiveTime(Section):
    """Live time of the tubes in a record. Without it, the record period is used."""

    columns: tuple[str, ...] = ()
    """Alternative names; with ``{tube}`` for one column per tube, without it for one per record."""
    unit: DurationUnit = "s"
    """Unit of these columns."""
    covers: int = Field(default=1, ge=1)
    """Number of neighbouring tubes that share one column: with 2, N1ETsec also applies to tube 2."""
    from_stamps: bool = False
    """True if the live time is the time since the previous record's stamp. After a gap in the record numbers it is
    the period, or else the last time between two records."""
    range: Limits = (0, 90_000)
    """Limits of the live time [s]; a line with a value outside is damaged."""


class RecordPeriod(Section):
    """The nominal duration of a record."""

    header_key: str = ""
    """Key of its header line, as in ``//Recordperiod = 1 minutes.``; empty if there is none."""
    unit: DurationUnit = "min"
    """Unit of the value in that line."""
    default_s: float | None = Field(default=None, gt=0)
    """Period without a header line [s]."""
    minimal_live_fraction: float = Field(default=0.9, ge=0, le=1)
    """Minimum live time as a fraction of the period; records below it are reported and kept."""


class Sensor(Section):
    """One sensor of a quantity."""

    column: str
    """Name of its column."""
    unit: str
    """Unit of its column."""


class PressureSensor(Sensor):
    """One barometer."""

    unit: PressureUnit


class TemperatureSensor(Sensor):
    """One thermometer."""

    unit: TemperatureUnit = "degC"


class HumiditySensor(Sensor):
    """One hygrometer."""

    unit: HumidityUnit = "percent"


class AirQuantity(Section):
    """A quantity of the air, measured by one or more sensors, preferably outside the housing."""

    sensors: tuple[Sensor, ...] = Field(min_length=1)
    """In order of preference: in each record the first one within the range is used."""
    range: Limits
    """Credible values [hPa, degC, or 0..1; hygrometers read slightly above 1 in fog: such values are set to 1]."""
    sentinels: tuple[float, ...] = ()
    """Numbers in the column that mark a missing value."""


class Pressure(AirQuantity):
    """Air pressure."""

    sensors: tuple[PressureSensor, ...] = Field(min_length=1)
    range: Limits = (300, 1085)


class Temperature(AirQuantity):
    """Air temperature."""

    sensors: tuple[TemperatureSensor, ...] = Field(min_length=1)
    range: Limits = (-60, 65)


class Humidity(AirQuantity):
    """Relative humidity of the air."""

    sensors: tuple[HumiditySensor, ...] = Field(min_length=1)
    range: Limits = (0, 1.05)


class LoggedPosition(Section):
    """The position that the logger writes with each record [WGS-84]."""

    latitude: tuple[str, ...] = Field(min_length=1)
    """Alternative names of the latitude column, north positive."""
    longitude: tuple[str, ...] = Field(min_length=1)
    """Alternative names of the longitude column."""
    longitude_signed: bool
    """True if western longitudes are negative. If false, the site file must name the side of Greenwich."""
    notation: Literal["auto", "degrees", "degrees_minutes"] = "auto"
    """degrees, as in 51.35; degrees_minutes, as in 5121.00 of NMEA; auto: decided once for a file."""
    latitude_hemisphere: tuple[str, ...] = ()
    """Alternative names of the column with N or S. Letters within the coordinates are read as well."""
    longitude_hemisphere: tuple[str, ...] = ()
    """Alternative names of the column with E or W."""
    altitude: tuple[str, ...] = ()
    """Alternative names of the column of the altitude above mean sea level [m]."""
    quality: tuple[str, ...] = ()
    """Alternative names of the column of the fix quality (numbers as in NMEA GGA)."""
    hdop: tuple[str, ...] = ()
    """Alternative names of the column of the horizontal dilution of precision."""
    no_fix_quality: tuple[str, ...] = ("0",)
    """Texts in the quality column that mark a missing fix."""
    zero_is_no_fix: Literal[True] = True
    """No longer a setting: latitude and longitude 0 always mark a missing fix."""
    required: bool = True
    """True if a log needs these columns to have this format."""
    time_of_day: tuple[str, ...] = ()
    """Alternative names of the column of the receiver's UTC time of day, for the offset of the logger's clock."""
    time_of_day_format: str = "%H%M%S"
    """Format of the time of day, as in Python's strptime."""


class LoggerFormat(Section):
    """The description of one kind of logger."""

    title: str
    """Title in reports and messages."""
    source: str
    """Source and certainty of this description."""
    delimiter: Literal["comma", "semicolon", "tab", "whitespace"] = "comma"
    """Separator of the columns; a file whose header has another one is read by that."""
    decimal: Decimal = "auto"
    """Decimal separator: point, comma, or auto, decided once for a file. The other one separates thousands."""
    checksum: Checksum = "none"
    """nmea: each line ends with ``*hh``, the hexadecimal exclusive or of all bytes before the star."""
    missing: tuple[str, ...] = MISSING
    """Texts that mark a missing value, in addition to an empty field."""
    serial_key: str = ""
    """Key of the header line with the serial number, as in ``//Logger SerialNum=16100724``."""
    header: Header
    """Notation of the column names."""
    time: Time
    """The time stamp."""
    record_number: tuple[str, ...] = ()
    """Alternative names of the column of the running number."""
    counts: Counts
    """The counts."""
    live_time: LiveTime = LiveTime()
    """Live time of the tubes."""
    record_period: RecordPeriod = RecordPeriod()
    """The nominal duration of a record."""
    pressure: Pressure | None = None
    """Air pressure."""
    temperature: Temperature | None = None
    """Air temperature."""
    humidity: Humidity | None = None
    """Relative humidity of the air."""
    position: LoggedPosition | None = None
    """Position of the logger."""

    def __repr_args__(self) -> Iterator[tuple[str, str]]:
        yield "title", self.title

    @property
    def air(self) -> dict[Quantity, AirQuantity | None]:
        """Sensors of the air, by quantity."""
        return {"pressure": self.pressure, "temperature": self.temperature, "humidity": self.humidity}

    def on_clock(self, clock: float | str | None) -> LoggerFormat:
        """The format for a logger whose clock is ahead of UTC [h] or has a time zone; unchanged if ``None``."""
        if clock is None:
            return self
        zone, offset_h = (clock, 0.0) if isinstance(clock, str) else ("", clock)
        time = self.time.model_copy(update={"utc_offset_hours": offset_h, "zone": zone})
        return self.model_copy(update={"time": time})

    @model_validator(mode="after")
    def _duration_is_known(self) -> LoggerFormat:
        period = self.record_period
        live = self.live_time
        if not (
            live.columns or period.header_key or period.default_s or (live.from_stamps and self.record_number)
        ):
            raise ValueError(
                "nothing says how long a record counts: give live_time.columns, record_period.header_key, "
                "record_period.default_s, or live_time.from_stamps with record_number"
            )
        if self.header.units_line and not self.header.lines_after_names:
            raise ValueError("header.units_line needs header.lines_after_names of 1 or more")
        return self


def _plug_in_path(plug_in: Any) -> Path:
    """Path of a format file from the entry point of another package: a path, or a function that returns it."""
    found = plug_in() if callable(plug_in) else plug_in
    if not isinstance(found, str | Path):
        raise TypeError(f"a logger is the path of a YAML file, or a function that returns one, not {found!r}")
    path = Path(found)
    if not path.is_file():
        raise ValueError(f"there is no file {path}")
    return path


LOGGERS: Registry[Path] = Registry(
    "soilmoist_ros.loggers", "logger",
    lambda: {name: resource("loggers", name) for name in resource_names("loggers")}, _plug_in_path,
    "give the path of a YAML file or",
)  # fmt: skip
"""Files of the logger formats, from this package and from entry points of other packages."""


def logger_names() -> list[str]:
    """Names of the logger formats of this package and of installed packages.

    >>> "hydroinnova_rover" in logger_names()
    True
    """
    return LOGGERS.names()


def logger_path(name_or_path: str | Path) -> Path:
    """Path of the YAML file of a logger format.

    :param name_or_path: name of a format, such as ``hydroinnova_rover``, or path of a YAML file
    :raises InputError: if there is no such format
    """
    path = Path(name_or_path)
    return path if path.is_file() else LOGGERS.get(str(name_or_path))


def load_logger_format(name_or_path: str | Path) -> LoggerFormat:
    """Read a logger format.

    >>> load_logger_format("thorvald_crs").time.columns
    ('stamp_utc',)

    :param name_or_path: name of a format, such as ``hydroinnova_rover``, or path of a YAML file
    :raises InputError: if there is no such format, or with every mistake in the file
    """
    return load_model(logger_path(name_or_path), LoggerFormat)

# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The driver of a sensor: reads its links, and converts their lines to records."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from soilmoist_ros.foundation import Health, Level, LocalFrame
from soilmoist_ros.sensing.formats.log_header import Header
from soilmoist_ros.sensing.formats.logger_reader import RecordParser
from soilmoist_ros.sensing.gnss import Fix
from soilmoist_ros.sensing.links.line_reader import LineReader
from soilmoist_ros.sensing.links.line_source import LineSource
from soilmoist_ros.sensing.links.open_source import open_source
from soilmoist_ros.sensing.links.reconnecting import Retry
from soilmoist_ros.sensing.links.recording import PlaybackClock
from soilmoist_ros.sensing.moisture.site import Site
from soilmoist_ros.sensing.position.lever_arms import NO_ARMS, LeverArms
from soilmoist_ros.sensing.position.nmea import NmeaParser
from soilmoist_ros.sensing.position.place_doubt import Doubts
from soilmoist_ros.sensing.records import NAN, CountRecord, LoggerRecord
from soilmoist_ros.sensing.survey.driver_health import fix_health, link_health, records_health
from soilmoist_ros.sensing.survey.stream import SensorStream

LINES_PER_STEP = 500
"""Maximum number of lines per step; a backlog must not block other work."""
LOGGER, GNSS = "logger", "GNSS"


@dataclass(frozen=True)
class DriverSettings:
    """Addresses and limits of a driver.

    :param logger_uri: address of the logger
    :param logger_format: name of a logger format, or path of a YAML file
    :param gnss_uri: address of the GNSS receiver; empty if the fixes have another source
    :param silence_limit_s: time without a byte after which a link reconnects [s]; for the logger 3.5 record
        periods if these are longer
    :param fix_wait_s: maximum time that a record waits for a fix [s]
    :param arms: where antenna and sensor sit on the robot
    """

    logger_uri: str
    logger_format: str
    gnss_uri: str = ""
    silence_limit_s: float = 35.0
    fix_wait_s: float = 2.0
    arms: LeverArms = NO_ARMS


@dataclass(frozen=True)
class Batch:
    """Data since the last step, in order of arrival.

    :param logger_lines: lines of the logger
    :param gnss_lines: lines of the receiver
    :param fixes: epochs of the receiver, with and without a fix
    :param readings: raw records, for their weather
    :param records: corrected, geo-tagged records
    :param more: whether more lines are waiting
    :param header: header of the readings, if the logger has sent it
    """

    logger_lines: Sequence[bytes]
    gnss_lines: Sequence[bytes]
    fixes: Sequence[Fix]
    readings: Sequence[LoggerRecord]
    records: Sequence[CountRecord]
    more: bool
    header: Header | None = None


class Driver:
    """Reads the devices in background threads; all other work runs in the caller's thread.

    :param frame: plane of the coordinates
    :param now_s: time, if known [s since 1970 UTC]; dates the recordings of receivers that send no date
    :raises InputError: if a setting is invalid
    """

    def __init__(self, settings: DriverSettings, site: Site, frame: LocalFrame, now_s: float = NAN) -> None:
        self._settings = settings
        self._site = site
        self._reference_stamp_s = now_s if now_s > 0 else NAN
        self.stream = SensorStream(site, frame, settings.logger_format, settings.fix_wait_s, settings.arms)
        self._open_all()  # checks the addresses without connecting
        self._readers: dict[str, LineReader] = {}
        self._awake = threading.Event()
        self.doubts = Doubts()
        """What a planner doubts about the place; records of that time are quarantined."""
        self._heard_s = math.inf  # monotonic time at which bytes of the logger were seen first

    def start(self, wake: Callable[[], None]) -> None:
        """Start reading.

        :param wake: called from threads when lines wait for :meth:`step`
        :raises InputError: if a recording cannot be read
        """

        def on_line() -> None:
            if not self._awake.is_set():  # a wake-up costs more than a line
                self._awake.set()
                wake()

        self._heard_s = math.inf
        self._readers = {name: LineReader(source, on_line) for name, source in self._open_all().items()}

    def stop(self) -> None:
        """Stop reading; :meth:`start` starts again."""
        for reader in self._readers.values():
            reader.stop()
        self._readers = {}

    def step(self, now_s: float) -> Batch:
        """Process the lines that have arrived.

        :param now_s: time, zero if unknown [s since 1970 UTC]
        """
        self._awake.clear()
        # Waits use monotonic time, because simulated time jumps before all lines have arrived.
        steady_s = time.monotonic()
        # All fixes first, so that a record that arrives with its fix does not wait.
        gnss_lines = self._lines(GNSS)
        date_s = now_s if now_s > 0 else NAN
        fixes = [fix for line in gnss_lines if (fix := self.stream.take_nmea_line(line, date_s)) is not None]
        jammed = len(gnss_lines) == LINES_PER_STEP
        logger_lines = [] if jammed else self._lines(LOGGER)
        readings = []
        for line in logger_lines:
            reading = self.stream.take_logger_line(line, steady_s)
            if reading is not None:
                readings.append(reading)
                if now_s > 0:
                    self.stream.compare_clocks(reading.stamp_s, now_s)
        more = jammed or len(logger_lines) == LINES_PER_STEP
        ready, header = self._ready(steady_s), self.stream.parser.header if readings else None
        return Batch(logger_lines, gnss_lines, fixes, readings, ready, more, header)

    def _ready(self, steady_s: float) -> list[CountRecord]:
        """Records that are ready. One of a doubt that has ended stays as it is: the mapper places it."""
        ready = self.stream.take_ready(steady_s)
        return [placed if (placed := self.doubts.placed(record)).quarantine else record for record in ready]

    def health(self, now_s: float) -> list[Health]:
        """State of all parts.

        :param now_s: time [s since 1970 UTC]
        """
        if not self._readers:
            return [Health("driver", Level.STALE, "not active: nothing is read")]
        links = {name: reader.status for name, reader in self._readers.items()}
        n_bytes, steady_s = links[LOGGER].n_bytes, time.monotonic()
        if n_bytes:
            self._heard_s = min(self._heard_s, steady_s)
        records = records_health(self.stream, now_s, n_bytes, max(0.0, steady_s - self._heard_s))
        parts = [link_health(f"{name} link", status) for name, status in links.items()]
        return [*parts, records, fix_health(self.stream, now_s)]

    def _lines(self, name: str) -> list[bytes]:
        reader = self._readers.get(name)
        return [] if reader is None else reader.take(LINES_PER_STEP)

    def _open_all(self) -> dict[str, LineSource]:
        settings, playback = self._settings, PlaybackClock()
        retry = Retry(silence_s=settings.silence_limit_s)
        logger_retry = Retry(silence_s=settings.silence_limit_s, period_s=lambda: self.stream.record_period_s)
        parser = RecordParser(self.stream.parser.format, self._site.longitude, on_problem=lambda problem: None)

        def logger_stamp(line: bytes) -> float | None:
            record = parser.feed(line)
            return None if record is None else record.stamp_s

        sources = {LOGGER: open_source(settings.logger_uri, logger_retry, logger_stamp, playback)}
        if settings.gnss_uri:
            nmea = NmeaParser(reference_stamp_s=self._reference_stamp_s, on_problem=lambda problem: None)

            def fix_stamp(line: bytes) -> float | None:
                fix = nmea.feed(line)
                return None if fix is None or math.isnan(fix.stamp_s) else fix.stamp_s

            sources[GNSS] = open_source(settings.gnss_uri, retry, fix_stamp, playback)
        return sources

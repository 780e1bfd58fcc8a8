# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The driver of a sensor: reads its links, converts their lines to records, and states its health."""

from __future__ import annotations

import math
import threading
import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime

from soilmoist_ros.foundation import Health, Level, LocalFrame
from soilmoist_ros.sensing.connections import MAX_SILENT_PERIODS, ReconnectingSource, Retry, open_source
from soilmoist_ros.sensing.formats.log_layout import LogHeader
from soilmoist_ros.sensing.gnss import EARLIEST_DATE_S, SIMULATED, Fix, FixStatus, clock_words
from soilmoist_ros.sensing.lines import LineReader, LineSource, LinkState, LinkStatus
from soilmoist_ros.sensing.moisture.site import Site
from soilmoist_ros.sensing.position.place_doubt import Doubts
from soilmoist_ros.sensing.problems import Kind, reason_text
from soilmoist_ros.sensing.records import NAN, CountRecord, LoggerRecord, utc_text
from soilmoist_ros.sensing.survey.stream import LAST_RECORDS, SensorStream

LINES_PER_STEP = 500  # maximum number of lines per step; a backlog must not block other work
LOGGER, GNSS = "logger", "GNSS"
CLOCK_TOLERANCE_S = 5.0  # maximum difference of the clocks without a warning [s]
STALE_FIX_S = 5.0  # maximum age of the last fix without a warning [s]
NO_RECORD_S = 30.0
"""Time from the first byte of a logger to its first record after which faulty lines are an error [s]."""
MAX_LOSSES = 1  # maximum number of recently lost records without a warning
MIN_JUDGED = 3  # number of records from which more than half in quarantine are an error
_LINK_LEVELS = {
    LinkState.CONNECTED: Level.OK, LinkState.CONNECTING: Level.ERROR,
    LinkState.SILENT: Level.ERROR, LinkState.CLOSED: Level.STALE,
}  # fmt: skip


@dataclass(frozen=True)
class DriverSettings:
    """Addresses and limits of a driver.

    :param gnss_uri: address of the GNSS receiver; empty if the fixes have another source
    :param silence_limit_s: time without a byte after which a link reconnects [s]; for the logger 3.5 record
        periods if these are longer
    :param fix_wait_s: maximum time that a record waits for a fix [s]
    """

    logger_uri: str
    logger_format: str
    gnss_uri: str = ""
    silence_limit_s: float = 35.0
    fix_wait_s: float = 2.0


@dataclass(frozen=True)
class Batch:
    """Data since the last step, in order of arrival.

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
    header: LogHeader | None = None


class Driver:
    """Reads the devices in background threads; all other work runs in the caller's thread.

    :param receiver: GNSS receiver; ``None`` for the one at the address in the settings
    :raises InputError: if a setting is invalid
    """

    def __init__(
        self, settings: DriverSettings, site: Site, frame: LocalFrame, receiver: LineSource | None = None
    ) -> None:
        self._settings, self._receiver = settings, receiver
        self.stream = SensorStream(site, frame, settings.logger_format, settings.fix_wait_s)
        self._open_all()  # checks the addresses without connecting
        self._readers: dict[str, LineReader] = {}
        self._awake = threading.Event()
        self.doubts = Doubts()
        """Doubts of a planner about the place; records of that time are quarantined."""
        self._heard_s = math.inf  # monotonic time at which bytes of the logger were seen first

    def refuse_taken(self) -> None:
        """Check the ports of this computer before the start.

        :raises InputError: if another program uses one
        """
        for source in self._open_all().values():
            if isinstance(source, ReconnectingSource):
                source.refuse_taken()

    def start(self, wake: Callable[[], None]) -> None:
        """Start reading; ``wake`` is called from threads when lines wait for :meth:`step`."""

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
        """Process the lines that have arrived until a time [s since 1970 UTC], zero if unknown."""
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
        # A record of a doubt that has ended stays as it is: the mapper places it.
        ready = [
            placed if (placed := self.doubts.placed(record)).quarantine else record
            for record in self.stream.take_ready(steady_s)
        ]
        header = self.stream.parser.header if readings else None
        return Batch(logger_lines, gnss_lines, fixes, readings, ready, more, header)

    def health(self, now_s: float) -> list[Health]:
        """State of all parts at a time [s since 1970 UTC]."""
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
        settings = self._settings
        retry = Retry(silence_s=settings.silence_limit_s)
        logger_retry = Retry(silence_s=settings.silence_limit_s, period_s=lambda: self.stream.record_period_s)
        sources = {LOGGER: open_source(settings.logger_uri, logger_retry)}
        if self._receiver is not None:
            sources[GNSS] = self._receiver
        elif settings.gnss_uri:
            sources[GNSS] = open_source(settings.gnss_uri, retry)
        return sources


# State of the links, the logger and the GNSS receiver, for diagnostics ------------------------------------------


def link_health(name: str, status: LinkStatus) -> Health:
    """State of a link."""
    level = _LINK_LEVELS[status.state]
    message = status.state.value
    if level is Level.ERROR and status.last_error:
        remedy = status.remedy or f"check the cable, the power and the address {status.uri}"
        message += f": {status.last_error}; {remedy}"
    elif status.refused:
        level = max(level, Level.WARN)
        message += f": lines of {status.sender} are used, those of {status.refused} dropped; give one another port"
    values = {
        "address": status.uri, "connections": str(status.connections), "failed attempts": str(status.attempts),
        "last error": status.last_error or "none", "lines": str(status.n_lines), "bytes": str(status.n_bytes),
        "lines too long": str(status.n_oversized), "sender": status.sender or "unknown",
        "datagrams refused": str(status.n_refused), "refused sender": status.refused or "none",
        "silent [s]": f"{status.silent_s:.1f}",
        "silence limit [s]": f"{status.silence_limit_s:.1f}" if math.isfinite(status.silence_limit_s) else "none",
    }  # fmt: skip
    return Health(name, level, message, values)


def records_health(stream: SensorStream, now_s: float, n_bytes: int = 0, heard_s: float = 0.0) -> Health:
    """State of the records."""
    problems, last = stream.logger_problems, stream.last_record
    difference_s = stream.clock_difference_s
    values = {
        "logger": stream.parser.format.title, "serial number": stream.parser.serial or "unknown",
        "records": str(stream.records_out), "records waiting for a fix": str(stream.survey.waiting),
        "records without a position": str(problems.noted[Kind.NO_POSITION]),
        "records per minute": _number(stream.records_per_minute, 2),
        "records and lines lost": str(problems.lost.total() - problems.lost[Kind.DUPLICATE]),
        "records quarantined": str(stream.quarantined.total()), "masked tubes": _masked(stream) or "none",
        "index of dispersion": _number(stream.survey.checks.totals.dispersion.index, 2),
        "logger clock minus ours [s]": _number(difference_s, 1), **_by_kind("dropped", problems.lost),
        **_by_kind("noted", problems.noted),
        **{f"quarantined: {reason_text(code)}": str(count) for code, count in sorted(stream.quarantined.items())},
    }  # fmt: skip
    if problems.last_loss is not None:
        values["last loss"] = str(problems.last_loss)
    if problems.last_quarantined is not None:
        values["last quarantine"] = str(problems.last_quarantined)
    values |= stream.faulty.examples
    doubt = _doubt(stream)
    level, message = Level.OK, "counting"
    none_yet = not (stream.records_out or stream.survey.waiting)
    if last is None or (none_yet and stream.faulty.lost):
        level, message = _no_record_yet(stream, n_bytes, heard_s)
    else:
        offset_s = 0.0 if math.isnan(difference_s) else difference_s
        silent_s = now_s + offset_s - last.stamp_s
        values["age of the last record [s]"] = f"{silent_s:.1f}"
        if silent_s > MAX_SILENT_PERIODS * (stream.record_period_s or math.inf):
            faults = _faults(stream) or "check the logger"
            level, message = Level.ERROR, f"no record for {silent_s:.0f} s: {faults}"
        elif doubt is not None and doubt[0] is Level.ERROR:
            level, message = doubt
        elif (losses := stream.recent_good.count(False)) > MAX_LOSSES:
            example = problems.last_loss.mistake.message if problems.last_loss else ""
            message = f"{losses} of the last {LAST_RECORDS} records are lost ({example})"
            level = Level.WARN
        elif doubt is not None:
            level, message = doubt
        elif fault := _header_fault(stream):
            level, message = Level.WARN, fault
        elif abs(offset_s) > CLOCK_TOLERANCE_S:
            level, message = Level.WARN, f"the logger's clock differs by {offset_s:+.0f} s from ours: set it"
    return Health("records", level, message, values)


def _no_record_yet(stream: SensorStream, n_bytes: int, heard_s: float) -> tuple[Level, str]:
    """Verdict on a logger that has not sent one record that can be used."""
    faults = _faults(stream)
    # A logger that sends nothing but its header may be in its first counting interval.
    limit_s = NO_RECORD_S if faults else max(NO_RECORD_S, MAX_SILENT_PERIODS * stream.record_period_s)
    if not n_bytes or heard_s <= limit_s:
        return (Level.WARN, f"no record yet: {faults}") if faults else (Level.STALE, "no record yet")
    remedy = faults or stream.faulty.remedy(stream.parser.format)
    came = f"{n_bytes} bytes in {heard_s:.0f} s"
    return Level.ERROR, f"the logger has not sent one valid record ({came}): {remedy}"


def _masked(stream: SensorStream) -> str:
    """Tubes that are masked now, with the reasons; empty if none is."""
    masked = stream.survey.checks.masked
    return ", ".join(f"tube {tube + 1} ({kind.text})" for tube, kind in sorted(masked.items()))


def _doubt(stream: SensorStream) -> tuple[Level, str] | None:
    """Level and reason of a doubt about the counts of the last records; ``None`` without one."""
    bad, recent = stream.recent_bad.count(True), len(stream.recent_bad)
    masked, last = _masked(stream), stream.logger_problems.last_quarantined
    if not bad:
        return (Level.WARN, f"not used: {masked}; check its high voltage and its cable") if masked else None
    reason = f" ({last})" if last is not None else ""
    message = f"{bad} of the last {recent} records are quarantined{reason}"
    grave = recent >= MIN_JUDGED and 2 * bad > recent
    return (Level.ERROR, f"the counts cannot be trusted: {message}") if grave else (Level.WARN, message)


def _header_fault(stream: SensorStream) -> str:
    """Remedy for a header that may be out of date: lines whose columns were exchanged fit it, too; else empty."""
    header = stream.parser.earlier_header
    if header is None:
        return ""
    known = math.isfinite(header.stored_s)
    date = f" of {datetime.fromtimestamp(header.stored_s, UTC):%Y-%m-%d %H:%M} UTC" if known else ""
    return (
        f"the columns are those of a stored header{date}: if the logger or its program was changed since then, "
        "switch the logger off and on, or delete header.json in record_dir and start again"
    )


def _faults(stream: SensorStream) -> str:
    """Faults of the lines since the last record and their remedy; empty if no line was dropped."""
    faulty = stream.faulty
    if not faulty.lost:
        return ""
    return f"{faulty.reasons} in {faulty.lines} lines; {faulty.remedy(stream.parser.format)}"


def fix_health(stream: SensorStream, now_s: float) -> Health:
    """State of the positions."""
    fix = stream.last_fix
    values = _by_kind("dropped", stream.gnss_problems.lost)
    heard = stream.survey.heard
    if fix is None:
        sentences = stream.nmea.sentences_read
        came = f": {sentences} sentences, none with a position (GGA, GNS, RMC or GLL)" if sentences else ""
        came = f": {heard.other_type}" if heard.other_type else came
        dropped = stream.gnss_problems.lost.total()
        came += (
            f": {dropped} lines could not be read; check the baud rate in gnss_uri" if dropped and not came else ""
        )
        return Health("GNSS", Level.WARN if came else Level.STALE, f"no fix yet{came}", values)
    age_s = now_s - fix.stamp_s
    values |= {
        "status": fix.status.name.lower(), "satellites": str(fix.satellites) if fix.satellites >= 0 else "unknown",
        "hdop": _number(fix.hdop, 1), "standard deviation [m]": _number(fix.position.horizontal_sd_m, 3),
        "age [s]": _number(age_s, 1),
    }  # fmt: skip
    if fix.status is FixStatus.NO_FIX:
        said = f" ({fix.said})" if fix.said else ""
        why = fix.no_place.text if fix.no_place else "no fix"
        message = f"the receiver has {why}{said}: records are not placed"
        if heard.why_none() is not None and fix.no_place is not None:
            message += f"; {fix.no_place.remedy}"
        return Health("GNSS", Level.ERROR, message, values)
    if not abs(age_s) <= STALE_FIX_S:
        message = f"the last fix is {age_s:.0f} s old"
        if math.isnan(age_s):
            none = heard.why_none()
            message = f"the receiver {none.message}; {none.remedy}" if none else "the last fix has no time"
        elif fix.stamp_s < EARLIEST_DATE_S or (words := clock_words(-age_s)):
            words = SIMULATED if fix.stamp_s < EARLIEST_DATE_S else words
            times = f"{utc_text(fix.stamp_s)}, and by this computer {utc_text(now_s)} (UTC)"
            message = f"the last fix is of {times}: {words}"
        return Health("GNSS", Level.WARN, message, values)
    return Health("GNSS", Level.OK, f"fix ({fix.status.name})", values)


def _by_kind(what: str, counted: Counter[Kind]) -> dict[str, str]:
    return {f"{what}: {kind.text}": str(number) for kind, number in sorted(counted.items())}


def _number(value: float, digits: int) -> str:
    return "unknown" if math.isnan(value) else f"{value:.{digits}f}"

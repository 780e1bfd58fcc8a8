# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The checks of one probe: tube against tube, record against record, and the weather.

At a stop all records see the same soil, so given the total of two counts one of them is binomial. Rain, irrigation
and snow change the rate at one place slowly; while driving it changes with the soil. The tests allow for both.
"""

from __future__ import annotations

import math
import statistics
from collections import deque
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.sensing.checks.tails import binomial_tails, chi_square_tail, poisson_tails
from soilmoist_ros.sensing.checks.tubes import BadTube, TubeChecks, alarm_probability, tube_shares
from soilmoist_ros.sensing.corrections.factors import SEA_LEVEL_HPA as STANDARD_HPA
from soilmoist_ros.sensing.corrections.factors import standard_pressure_hpa
from soilmoist_ros.sensing.formats.log_values import Quantity, remedy_of_unit
from soilmoist_ros.sensing.problems import Finding, Kind
from soilmoist_ros.sensing.records import NAN, CountRecord, LoggerRecord

STOP_RADIUS_M = 3.0  # places closer than this to the first record of a stop belong to the stop [m]
STOP_CHANGE = (2.0, 1.5)
"""Factors by which the rate at one place may fall and rise between records: snow or a flood, and drying."""
DRIVING_CHANGE = (3.0, 3.0)  # such factors while driving: from dry soil to water
LAST_RECORDS = 30  # number of last good records with which a record is compared
MIN_AT_STOP = 3  # number of records at a stop from which a record is compared with them alone
MAX_AGE_S = 86400.0  # age up to which records are compared [s]
RECORDS_TO_BELIEVE = 10, 100
"""Number of successive odd records from which their rate counts as true: as many as the good ones before, within
these limits."""
MAX_N0_FACTOR = 2.0
"""Rates above this multiple of N0 are impossible: dry soil reaches 1.08 N0 (Desilets et al. 2010)."""
MIN_PAIRS = 20  # number of pairs from which a dispersion is reported
HIGH_DISPERSION = 1.5  # index of dispersion from which intervals of a map are clearly too narrow: by a fifth
LOW_DISPERSION = 0.5  # index of dispersion below which numbers are no counts, but smoothed or repeated
SIGNIFICANCE = 1e-4
MAX_TUBE_RATE_CPS = 1000.0
"""Rate that no tube for environmental neutrons reaches, by orders of magnitude [counts/s]."""
N0_KEY = "'n0_cps' in the site file"


@dataclass(frozen=True)
class Checked:
    """A record after the checks; impossible weather and counts of bad tubes are NaN, unless no tube is left."""

    record: LoggerRecord
    findings: tuple[Finding, ...] = ()

    @property
    def quarantine(self) -> str:
        """Reason code of a bad record, empty for a usable one."""
        return next((finding.kind.value for finding in self.findings if finding.bad), "")


class RecordChecks:
    """Checks the records of one probe in order of time; only earlier records are known, unless they are learned.

    A bad tube is masked: its counts become NaN, and the exposure covers the other tubes. A record without a good
    tube, or with counts that do not fit the records before, is bad as a whole.

    :param n0_cps: count rate over dry soil [counts/s], NaN if unknown
    :param n0_from: where N0 comes from, for remedies
    :param altitude_of: altitude of the probe at a record [m], NaN if unknown

    >>> checks = RecordChecks()
    >>> checks.check(LoggerRecord(10.0, (1_200_000.0,), (10.0,))).quarantine
    'impossible_count'
    """

    def __init__(
        self,
        n0_cps: float = NAN,
        altitude_of: Callable[[LoggerRecord], float] = lambda record: NAN,
        n0_from: str = N0_KEY,
    ) -> None:
        self.totals = TotalChecks(n0_cps, n0_from=n0_from)
        """Record against record, for corrected and placed records."""
        self.masked: dict[int, Kind] = {}
        """Tubes that were left out of the last record, by index, and why."""
        self._altitude_of = altitude_of
        self._weather = WeatherChecks()
        self._tubes: TubeChecks | None = None

    def learn(self, records: Sequence[LoggerRecord]) -> list[Checked]:
        """Learn the shares of the tubes and their bad periods from a whole log, before its first record."""
        first = RecordChecks(altitude_of=self._altitude_of)
        found = [first.check(record) for record in records]
        good = [checked.record for checked in found if not checked.quarantine]
        if good and (tubes := first._tubes) is not None:
            self._tubes = TubeChecks(tubes.tubes, tube_shares(good), (), tubes.rate_cps, tubes.spans)
        return found

    @property
    def shares(self) -> NDArray[np.float64]:
        """Share of each tube in the rate of the whole sensor as learned so far, shape (tubes,)."""
        return np.empty(0) if self._tubes is None else np.asarray(self._tubes.shares)

    def check(self, record: LoggerRecord, unused_tubes: Collection[int] = ()) -> Checked:
        """Check the next record."""
        tubes = len(record.tube_counts)
        if self._tubes is None or self._tubes.tubes != tubes:
            self._tubes = TubeChecks(tubes, unused=unused_tubes)
        record, findings = self._weather.check(record, self._altitude_of(record))
        counts, live_s = np.array(record.tube_counts, float), np.array(record.tube_live_s, float)
        present = np.isfinite(counts) & (live_s > 0)
        present[list(unused_tubes)] = False
        wild = present & (counts > MAX_TUBE_RATE_CPS * live_s)
        bad = [BadTube(int(tube), Kind.IMPOSSIBLE_COUNT, counts[tube], NAN) for tube in np.flatnonzero(wild)]
        bad += self._tubes.check(record, present & ~wild)
        self.masked = {one.tube: one.kind for one in bad}
        if not bad:
            return Checked(record, tuple(findings))
        none_left = len(bad) == present.sum()
        findings += [_finding(one, float(live_s[one.tube]), none_left) for one in bad]
        if not none_left:
            left = (NAN if tube in self.masked else count for tube, count in enumerate(record.tube_counts))
            record = replace(record, tube_counts=tuple(left))
        return Checked(record, tuple(findings))


def _finding(bad: BadTube, live_s: float, none_left: bool) -> Finding:
    message = f"tube {bad.tube + 1} has {bad.counts:.0f} counts in {live_s:g} s"
    if bad.kind is Kind.IMPOSSIBLE_COUNT:
        message += ", which no tube can count"
    elif bad.expected == bad.expected:
        message += f", the other tubes expect {bad.expected:.0f}"
    else:
        message += ", and the tubes do not agree"
    return Finding(bad.kind, message, "check the tube, its high voltage and its cable", none_left)


class Dispersion:
    """Index of dispersion of successive records at one place; 1 for pure counting statistics.

    It is the mean of the squared standardised differences over disjoint pairs: given the total of two records, the
    first is binomial. Slow changes of the soil do not matter.
    """

    def __init__(self) -> None:
        self.pairs = 0
        self._sum = 0.0
        self._last: CountRecord | None = None

    @property
    def index(self) -> float:
        """Index of dispersion [-], NaN without a pair."""
        return self._sum / self.pairs if self.pairs else math.nan

    @property
    def is_high(self) -> bool:
        """True if the scatter is higher than counting statistics, clearly and significantly."""
        enough = self.pairs >= MIN_PAIRS and self.index > HIGH_DISPERSION
        return enough and chi_square_tail(self.pairs, self._sum) < SIGNIFICANCE

    @property
    def is_low(self) -> bool:
        """True if the scatter is lower than counting statistics, clearly and significantly."""
        enough = self.pairs >= MIN_PAIRS and self.index < LOW_DISPERSION
        return enough and 1 - chi_square_tail(self.pairs, self._sum) < SIGNIFICANCE

    def add(self, record: CountRecord) -> None:
        """Add a record in order of time."""
        last, self._last = self._last, record
        if last is None or not _same_place(last, record) or record.stamp_s - last.stamp_s > MAX_AGE_S:
            return
        total = last.raw_counts + record.raw_counts
        if total > 0:
            share = last.effective_exposure_s / (last.effective_exposure_s + record.effective_exposure_s)
            self._sum += (last.raw_counts - share * total) ** 2 / (total * share * (1 - share))
            self.pairs += 1
            self._last = None  # disjoint pairs are independent


class _Counted(NamedTuple):
    stamp_s: float
    counts: int
    exposure_s: float


class TotalChecks:
    """Compares the records of one probe with each other, record by record.

    :param n0_cps: count rate over dry soil [counts/s], NaN if unknown
    :param typical_cps: typical corrected rate, known from the whole log [counts/s]; NaN if unknown
    """

    def __init__(self, n0_cps: float = math.nan, typical_cps: float = math.nan, n0_from: str = N0_KEY) -> None:
        self.recorded, self.dispersion = Dispersion(), Dispersion()
        """Dispersion of all records as they came, and of the records in use."""
        self._n0_cps, self.typical_cps, self._n0_from = n0_cps, typical_cps, n0_from
        self._recent: deque[_Counted] = deque(maxlen=LAST_RECORDS)
        self._stop: deque[_Counted] = deque(maxlen=LAST_RECORDS)
        self._anchor: CountRecord | None = None
        self._odd = self._good = 0

    def check(self, record: CountRecord, recorded: CountRecord | None = None) -> list[Finding]:
        """Faults of the next record; a record that is quarantined already only counts for the dispersion."""
        self.recorded.add(record if recorded is None else recorded)
        if record.quarantine or not (record.effective_exposure_s > 0 and record.exposure_s > 0):
            return []
        counted = _Counted(record.stamp_s, record.raw_counts, record.effective_exposure_s)
        level = alarm_probability(record.exposure_s) / 2
        if _are_above(counted.counts, MAX_N0_FACTOR * self._n0_cps * counted.exposure_s, level):
            message = f"{record.corrected_rate:.1f} counts/s are impossible with N0 = {self._n0_cps:g} counts/s"
            remedy = f"check the detector, and {self._n0_from}"
            return [Finding(Kind.IMPOSSIBLE_COUNT, message, remedy, bad=True)]
        at_stop = self._anchor is not None and _same_place(self._anchor, record)
        if not at_stop:
            self._stop.clear()
            self._anchor = record
        near = _young(self._stop, record.stamp_s)
        change = STOP_CHANGE
        if len(near) < MIN_AT_STOP:
            near, change = _young(self._recent, record.stamp_s), DRIVING_CHANGE
        expected_cps, chance = self._chance(counted, near, change)
        low, high = RECORDS_TO_BELIEVE
        if chance < level and self._odd < min(max(self._good, low), high):
            self._odd += 1
            message = (
                f"{record.corrected_rate:.2f} counts/s after {expected_cps:.2f} counts/s in {len(near)} records"
            )
            return [Finding(Kind.RATE_JUMP, message, "check the detector and its supply", bad=True)]
        if chance < level:  # enough records agree: those before were wrong
            self._recent.clear()
            self._stop.clear()
            self._good = 0
        self._odd = 0
        self._good += 1
        self._recent.append(counted)
        self._stop.append(counted)
        self.dispersion.add(record)
        return []

    def _chance(self, counted: _Counted, near: list[_Counted], change: tuple[float, float]) -> tuple[float, float]:
        """Expected rate [counts/s], and the probability of a count so far from it if the rate is possible."""
        fall, rise = change
        if not near:
            mean = self.typical_cps * counted.exposure_s
            if math.isnan(mean):
                return math.nan, 1.0
            above = poisson_tails(counted.counts, rise * mean)[1]
            return self.typical_cps, min(above, poisson_tails(counted.counts, mean / fall)[0])
        counts, exposure_s = sum(one.counts for one in near), math.fsum(one.exposure_s for one in near)
        total, ratio = counts + counted.counts, counted.exposure_s / exposure_s
        largest, smallest = ratio * rise / (ratio * rise + 1), ratio / fall / (ratio / fall + 1)
        above = binomial_tails(counted.counts, total, largest)[1]
        below = binomial_tails(counted.counts, total, smallest)[0]
        return counts / exposure_s, min(above, below)

    @property
    def findings(self) -> list[Finding]:
        """Faults of the log as a whole so far."""
        message = (
            f"the index of dispersion is {self.recorded.index:.4g} as recorded and {self.dispersion.index:.3g} "
            f"without bad tubes and quarantined records; counting statistics have 1"
        )
        if self.recorded.is_high or self.dispersion.is_high:
            remedy = (
                "check the detector for noise; intervals of the map are too narrow if the records in use scatter"
            )
            return [Finding(Kind.OVERDISPERSED, message, remedy)]
        if self.dispersion.is_low:
            remedy = "take raw counts, not smoothed ones; check if the counter repeats a number"
            return [Finding(Kind.NOT_COUNTS, message, remedy)]
        return []


def _young(records: Iterable[_Counted], stamp_s: float) -> list[_Counted]:
    return [one for one in records if abs(stamp_s - one.stamp_s) <= MAX_AGE_S]


def _same_place(one: CountRecord, other: CountRecord) -> bool:
    """True if two records were counted at one place; unknown places count as different."""
    return math.hypot(one.x_m - other.x_m, one.y_m - other.y_m) <= STOP_RADIUS_M


def _are_above(counts: int, mean: float, level: float) -> bool:
    """True if so many counts have a probability below a level, which is below 1/2."""
    return counts > mean and poisson_tails(counts, mean)[1] < level


# Weather that the air cannot have, pressures that jump, and units that a whole log makes doubtful ---------------

SEA_LEVEL_HPA = (870.0, 1085.0)
"""Lowest and highest air pressures ever observed, reduced to sea level [hPa] (World Meteorological Organization,
World Weather and Climate Extremes Archive)."""
ALTITUDES_M = (-430.0, 5500.0)
"""Range of altitudes if that of the site is unknown: shore of the Dead Sea to the highest fields [m]."""
ALTITUDE_TOLERANCE_M = 100.0  # altitudes of receivers and site files may be wrong by this much [m]
AIR: dict[str, tuple[float, float, str, float, Quantity]] = {
    "temperature_degc": (-70.0, 60.0, "degC", 1.0, "temperature"),
    "relative_humidity": (0.0, 1.05, "%", 100.0, "humidity"),  # sensors read up to 5 % too high in fog
}
"""Lowest and highest values near inhabited ground, with some margin; unit and scale in messages, and quantity."""
JUMP_HPA = 15.0  # change of pressure at once that no front or thunderstorm causes [hPa]
WEATHER_HPA_PER_S = 10.0 / 3600  # highest change of pressure by weather over longer times [hPa/s]
HPA_PER_M = 0.13  # highest change of pressure with altitude [hPa/m]
CLIMB_HPA_PER_S = 0.4  # highest change of pressure of a vehicle on a road: 28 m/s on a slope of 12 % [hPa/s]
JUMPS_TO_BELIEVE = 5, 100
"""Number of successive jumps from which the new pressure counts as true: as many as the good values before, within
these limits."""
MIN_RECORDS = 10  # number of records from which the units of a log can be doubted
MAX_FRACTION = 0.0101  # humidity that no air stays below; fractions that were read as per cent do [-]
MIN_MEDIAN_HUMIDITY = 0.2  # median humidity that hardly any survey has; dry housings have it [-]
MAX_MEDIAN_DEGC = 42.0  # median temperature that no survey exceeds; temperatures in Fahrenheit do [degC]
_REMEDY = "check the sensor; without a value the nearest records give it"


def pressure_limits_hpa(altitude_m: float) -> tuple[float, float]:
    """Lowest and highest possible air pressure [hPa]."""
    low_m, high_m = ALTITUDES_M
    if math.isfinite(altitude_m):
        low_m, high_m = altitude_m - ALTITUDE_TOLERANCE_M, altitude_m + ALTITUDE_TOLERANCE_M
    low, high = SEA_LEVEL_HPA
    lowest, highest = (standard_pressure_hpa(45.0, min(max(each, -500.0), 9000.0)) for each in (high_m, low_m))
    return low / STANDARD_HPA * lowest, high / STANDARD_HPA * highest


def unlikely_weather(records: Sequence[LoggerRecord]) -> list[Finding]:
    """Doubts about the units of a whole log, whose values are possible one by one."""
    humidity = [record.relative_humidity for record in records if math.isfinite(record.relative_humidity)]
    warmth = [record.temperature_degc for record in records if math.isfinite(record.temperature_degc)]
    found = []
    if len(humidity) >= MIN_RECORDS:
        low, middle, high = min(humidity), statistics.median(humidity), max(humidity)
        if 0 < high <= MAX_FRACTION:
            remedy = "if it is a fraction, write 'unit: fraction' into the logger format"
            found.append((f"the relative humidity is {100 * low:.2f} to {100 * high:.2f} %", remedy))
        elif MAX_FRACTION < middle < MIN_MEDIAN_HUMIDITY:
            remedy = "if it is absolute humidity [g/m3], or of the air in a housing, leave its column out"
            found.append((f"the relative humidity is {100 * middle:.0f} % in the middle of the records", remedy))
    if len(warmth) >= MIN_RECORDS and statistics.median(warmth) > MAX_MEDIAN_DEGC:
        message = f"the air temperature is {statistics.median(warmth):.0f} degC in the middle of the records"
        found.append((message, "if it is in Fahrenheit, write 'unit: degF' into the logger format"))
    return [Finding(Kind.IMPOSSIBLE_WEATHER, *each) for each in found]


class WeatherChecks:
    """Checks the weather of one probe, record by record."""

    def __init__(self) -> None:
        self._last: tuple[float, float, float] | None = None  # time, pressure and altitude
        self._jumps = self._believed = 0

    def check(self, record: LoggerRecord, altitude_m: float = NAN) -> tuple[LoggerRecord, list[Finding]]:
        """The record without impossible values, which become NaN, and its faults."""
        wrong: dict[str, tuple[str, str]] = {}
        limits = AIR | {"pressure_hpa": (*pressure_limits_hpa(altitude_m), "hPa", 1.0, "pressure")}
        for name, (low, high, unit, scale, quantity) in limits.items():
            value = float(getattr(record, name))
            if not (math.isnan(value) or low <= value <= high):
                what = name.removesuffix("_hpa").removesuffix("_degc").replace("_", " ")
                span = f"{low * scale:.0f}..{high * scale:.0f} {unit}"
                message = f"the {what} {value * scale:.1f} {unit} is impossible here ({span})"
                wrong[name] = message, remedy_of_unit(quantity, value, low, high, _REMEDY)
        if "pressure_hpa" not in wrong and (jump_hpa := self._jump_hpa(record, altitude_m)):
            wrong["pressure_hpa"] = (
                f"the pressure {record.pressure_hpa:.1f} hPa is a jump of {jump_hpa:+.1f} hPa", _REMEDY,
            )  # fmt: skip
        if wrong:
            record = replace(record, **dict.fromkeys(wrong, NAN))  # type: ignore[arg-type]
        return record, [Finding(Kind.IMPOSSIBLE_WEATHER, *each) for each in wrong.values()]

    def _jump_hpa(self, record: LoggerRecord, altitude_m: float) -> float:
        """Change since the last believed pressure if it is impossible, else 0 [hPa]."""
        if math.isnan(record.pressure_hpa):
            return 0.0
        if self._last is not None:
            since_s, change_hpa = abs(record.stamp_s - self._last[0]), record.pressure_hpa - self._last[1]
            climbed_hpa = HPA_PER_M * abs(altitude_m - self._last[2])
            if math.isnan(climbed_hpa):  # unknown altitude
                climbed_hpa = CLIMB_HPA_PER_S * since_s
            least, most = JUMPS_TO_BELIEVE
            if abs(change_hpa) > JUMP_HPA + WEATHER_HPA_PER_S * since_s + climbed_hpa:
                if self._jumps < min(max(self._believed, least), most):
                    self._jumps += 1
                    return change_hpa
                self._believed = 0
        self._last, self._jumps = (record.stamp_s, record.pressure_hpa, altitude_m), 0
        self._believed += 1
        return 0.0

# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The sensitivity of a sensor from counts next to another one.

Two sensors at one place see the same soil, air and incoming neutrons, so the ratio of their corrected rates is
that of their sensitivities. Only time that both counted is used.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.foundation import InputError
from soilmoist_ros.sensing.formats.logger_reader import LogFile
from soilmoist_ros.sensing.moisture.general import Sensitivity
from soilmoist_ros.sensing.moisture.site import Site
from soilmoist_ros.sensing.records import CountRecord, utc_text
from soilmoist_ros.sensing.survey.logs import stationary_records

Array = NDArray[np.float64]
MAX_RATIO_SD = 0.05
"""Relative standard deviation of the ratio above which it is of no use."""
MIN_SCATTER, MAX_SCATTER, SAME_CHANCE = 0.3, 1.5, 1e-6
"""Scatter of pairs, relative to counting, below which both are of one sensor, and above which there is doubt."""
_OTHERS_LOG = "give the log of the station with --beside, that of your own sensor with --log"
MIN_COVERAGE = 0.9
"""Share of an interval of the slower logger that the faster one must have counted."""


@dataclass(frozen=True)
class SideBySide:
    """Corrected counts of two sensors over the time that both counted.

    :param ratio: rate of the own sensor divided by that of the other one [-]
    :param ratio_sd: standard deviation of the ratio from the counts of both
    :param counted_s: time that both counted [s]
    :param first_s: begin of the first common interval [s since 1970-01-01 UTC]; ``last_s`` end of the last one
    """

    ratio: float
    ratio_sd: float
    own_counts: int
    other_counts: int
    counted_s: float
    first_s: float
    last_s: float
    scatter: float = 1.0
    """Scatter of both about one ratio in units of that of counting; above 1 if the ratio changed."""

    def doubts(self, value: float, sd: float, known: Sensitivity | None) -> Iterator[str]:
        """Doubts about the ratio, and about a sensitivity that contradicts the known one of the own sensor."""
        if self.scatter > MAX_SCATTER:
            what = f"the ratio scatters {self.scatter:.1f} times more than counting explains"
            yield f"{what}: did one sensor move, or is a tube noisy? The error of the ratio is larger than said"
        if known is not None and abs(value - known.value) > 3 * math.hypot(sd, known.sd):
            had = f"{known.value:.3g} +- {known.sd:.2g}"
            what = f"the sensitivity {value:.3g} contradicts that of the site file, {had}"
            yield f"{what}: did both stand side by side, with all tubes counted?"

    def sensitivity(self, other: float, other_sd: float = 0.0) -> tuple[float, float]:
        """Sensitivity of the own sensor and its standard deviation, from those of the other one."""
        own = self.ratio * other
        return own, own * math.hypot(self.ratio_sd / self.ratio, other_sd / other)


def compare_side_by_side(
    own: Sequence[LogFile], site: Site, other: Sequence[LogFile], other_site: Site
) -> SideBySide:
    """Compare two sensors that stood side by side.

    :param own: logs of the own sensor, ``other`` of the other one; each corrected by its site
    :raises InputError: if both do not overlap, or there are too few counts
    """
    ours, theirs = (stationary_records(logs, of) for logs, of in ((own, site), (other, other_site)))
    if not ours or not theirs:
        path = (own if not ours else other)[0].path
        raise InputError("has no good record", "soilmoist check says what is wrong with the log", path)
    swapped = _interval_s(ours) > _interval_s(theirs)
    slow, fast = (ours, theirs) if swapped else (theirs, ours)
    kept, of_frame = _common(slow, fast)
    if not kept.any():
        spans = (f"{utc_text(float(_begins(r)[0]))} to {utc_text(r[-1].stamp_s)}" for r in (ours, theirs))
        message = "has no time that both sensors counted: here {}, the other one {} UTC".format(*spans)
        raise InputError(message, "give logs of the same time; check the clock of both loggers", own[0].path)
    slow_used = [record for record, use in zip(slow, kept, strict=True) if use]
    fast_used = [record for record, frame in zip(fast, of_frame, strict=True) if frame >= 0 and kept[frame]]
    (own_counts, own_s), (other_counts, other_s) = (
        (sum(r.raw_counts for r in used), math.fsum(r.effective_exposure_s for r in used))
        for used in ((slow_used, fast_used) if swapped else (fast_used, slow_used))
    )
    begins = _begins(slow)[kept]
    counted_s = math.fsum(r.stamp_s - begin for r, begin in zip(slow_used, begins, strict=True))
    for counts, logs in ((own_counts, own), (other_counts, other)):
        if not counts:
            raise InputError("has no counts in the time that both counted", "check the detector", logs[0].path)
    ratio, relative = own_counts / own_s / (other_counts / other_s), math.sqrt(1 / own_counts + 1 / other_counts)
    if relative > MAX_RATIO_SD:
        wanted_h = counted_s / 3600 * (relative / MAX_RATIO_SD) ** 2
        message = f"has {own_counts} counts, the other sensor {other_counts}: a ratio +- {100 * relative:.0f} %"
        raise InputError(message, f"count for {math.ceil(wanted_h)} h: more than 5 % is of no use", own[0].path)
    summed = np.zeros(len(slow) + 1)  # the last one of the records of no interval
    np.add.at(summed, of_frame, [record.raw_counts for record in fast])
    pair = np.array([[record.raw_counts for record in slow_used], summed[:-1][kept]])
    scatter, chance = _scatter(pair)
    if scatter < MIN_SCATTER and chance < SAME_CHANCE:
        what = f"counts as {other[0].path.name} does, record by record: they are of one sensor"
        raise InputError(what, _OTHERS_LOG, own[0].path)
    first_s, last_s = float(begins[0]), slow_used[-1].stamp_s
    return SideBySide(ratio, ratio * relative, own_counts, other_counts, counted_s, first_s, last_s, scatter)


def _scatter(counts: Array) -> tuple[float, float]:
    """Scatter of two series of counts, shape (2, n), and the chance that those of two sensors differ so little.

    Given the sum of a pair, each count is binomial. Two sensors give 1; one that is compared with itself gives 0.
    """
    from scipy.special import chdtr

    counts = counts[:, counts.sum(axis=0) > 0]
    total, share = counts.sum(axis=0), counts[0].sum() / counts.sum()
    if len(total) < 3:
        return 1.0, 1.0
    squares = float(((counts[0] - share * total) ** 2 / (total * share * (1 - share))).sum())
    return math.sqrt(squares / (len(total) - 1)), float(chdtr(len(total) - 1, squares))


def _interval_s(records: Sequence[CountRecord]) -> float:
    """Usual time from record to record [s]."""
    steps = np.diff([record.stamp_s for record in records])
    return float(np.median(steps)) if len(steps) else records[0].exposure_s


def _begins(records: Sequence[CountRecord]) -> Array:
    """Begin of each interval: the usual interval before its end, or the previous end [s]."""
    ends = np.array([record.stamp_s for record in records])
    begins = ends - _interval_s(records)
    begins[1:] = np.maximum(begins[1:], ends[:-1])
    return begins


def _common(
    slow: Sequence[CountRecord], fast: Sequence[CountRecord]
) -> tuple[NDArray[np.bool_], NDArray[np.intp]]:
    """Intervals of the slower logger that the faster one counted, and that of each fast record (-1: none)."""
    begins, ends = _begins(slow), np.array([record.stamp_s for record in slow])
    fast_begins, fast_ends = _begins(fast), np.array([record.stamp_s for record in fast])
    middle = (fast_begins + fast_ends) / 2
    frame = np.searchsorted(ends, middle)
    inside = frame < len(ends)
    inside[inside] = middle[inside] > begins[frame[inside]]
    frame = np.where(inside, frame, -1)
    length = np.bincount(frame[inside], (fast_ends - fast_begins)[inside], len(ends))
    return length >= MIN_COVERAGE * (ends - begins), np.asarray(frame, np.intp)

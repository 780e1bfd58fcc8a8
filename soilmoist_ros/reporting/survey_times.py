# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Times of a run: when it was surveyed, and when its outputs were made."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from datetime import UTC, datetime

from soilmoist_ros.sensing import CountRecord

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
    """Begin, end and duration of the records of a run."""

    track: Sequence[CountRecord]
    created_utc: datetime

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
        if self.survey_start_utc is None:
            return None
        return datetime.fromtimestamp(max(record.stamp_s for record in self.track), UTC)

    @property
    def survey_duration_s(self) -> float | None:
        """Time from the begin of the first to the end of the last counting interval [s]; ``None`` without records.

        With a clock that has no date, too.
        """
        if not self.track:
            return None
        return max(r.stamp_s for r in self.track) - min(r.stamp_s - r.exposure_s for r in self.track)

# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What the checks find in a record."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from soilmoist_ros.sensing.problems import Kind
from soilmoist_ros.sensing.records import LoggerRecord


@dataclass(frozen=True)
class Finding:
    """A fault of a record.

    :param kind: reason code
    :param message: what is wrong, with values
    :param remedy: what the user can do about it
    :param bad: whether the record is bad as a whole
    """

    kind: Kind
    message: str
    remedy: str
    bad: bool = False


@dataclass(frozen=True)
class Checked:
    """A record after the checks.

    :param record: the record; impossible weather and the counts of bad tubes are NaN, unless no tube is left
    :param findings: its faults
    :param bad_since_s: tubes that have just been found bad: index -> stamp of the first bad record [s since 1970]
    """

    record: LoggerRecord
    findings: tuple[Finding, ...] = ()
    bad_since_s: Mapping[int, float] = field(default_factory=dict)

    @property
    def quarantine(self) -> str:
        """Reason code of a bad record, empty for a usable one."""
        return next((finding.kind.value for finding in self.findings if finding.bad), "")

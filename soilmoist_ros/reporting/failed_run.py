# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A run that made no map: why, when, what was counted, and what to do."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from typing import TYPE_CHECKING

from soilmoist_ros.foundation import InputError
from soilmoist_ros.reporting.geometry import distance_m
from soilmoist_ros.reporting.run import InputFile, LossRow
from soilmoist_ros.reporting.survey_times import SurveyTimes
from soilmoist_ros.sensing import CountRecord

if TYPE_CHECKING:
    from soilmoist_ros.simulation import MissionResult


@dataclass(frozen=True)
class Trouble:
    """A fault that a node reported.

    :param name: what reported it
    :param message: the fault in words
    :param count: how often
    :param error: an error; otherwise a warning
    """

    name: str
    message: str
    count: int
    error: bool


@dataclass(frozen=True, repr=False)
class FailedRun(SurveyTimes):
    """A run that made no map.

    :param why: what happened, in sentences
    :param todo: what the user can do, the most useful first
    :param created_utc: creation time of the outputs, time-zone aware
    :param track: all records in order of time, those without a place and quarantined ones included
    :param title: title of the report
    :param site: name of the site
    :param field_name: name of the field
    :param inputs: input files
    :param losses: why records are not in a map
    :param troubles: faults that nodes reported
    :param mission: the mission, if any
    :param simulated: the counts come from a simulation; every output says so
    :param settings: settings of the run, name (with its unit) -> value
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

    @property
    def travelled_m(self) -> float:
        """Distance driven [m]: the mission's distance, else the length of the line through the records' places."""
        if self.mission is not None and self.mission.series:
            return self.mission.series[-1].distance_m
        return distance_m(self.track)


class NoMapError(InputError):
    """A run made no map; the message says why.

    :param failed: what is known of the run
    """

    def __init__(self, failed: FailedRun) -> None:
        self.failed = failed
        super().__init__(f"no map: {failed.why.rstrip('.')}", failed.todo[0].rstrip(".") if failed.todo else "")

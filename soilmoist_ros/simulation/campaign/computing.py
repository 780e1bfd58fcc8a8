# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Compute one mission, in whatever process, and return what the campaign stores of it."""

from __future__ import annotations

import time
import traceback
from collections.abc import Callable, Generator
from dataclasses import dataclass

from soilmoist_ros.foundation import SoilmoistError
from soilmoist_ros.simulation.campaign.campaign_file import Mission
from soilmoist_ros.simulation.campaign.mission_store import pack
from soilmoist_ros.simulation.mission.result import MissionResult
from soilmoist_ros.simulation.mission.settings import MissionSettings

MissionProgress = Callable[[float], None]
Simulate = Callable[[MissionSettings, MissionProgress | None], MissionResult]


class WorkersLostError(SoilmoistError):
    """No worker can be reached any more; the missions that have not finished are to be computed another time."""


@dataclass(frozen=True)
class Failure:
    """A failed mission.

    :param mission: the mission
    :param error: error message in one line
    :param details: traceback; may be empty
    """

    mission: Mission
    error: str
    details: str = ""

    def __str__(self) -> str:
        return f"{self.mission.settings}: {self.error}"


@dataclass(frozen=True)
class Finished:
    """A mission that has come to its end.

    :param mission: the mission
    :param content: the bytes of its file, or why it failed
    :param time_s: time that it took its worker [s]; NaN if unknown
    """

    mission: Mission
    content: bytes | Failure
    time_s: float


Flow = Generator[Finished, None, None]
"""Missions in the order in which they finish; closing it stops the workers."""


def compute(mission: Mission, simulate: Simulate, progress: MissionProgress | None = None) -> Finished:
    """Simulate one mission; errors are returned, not raised."""
    begin_s = time.monotonic()
    content: bytes | Failure
    try:
        content = pack(simulate(mission.settings, progress), mission.key)
    except Exception as error:
        text = " ".join(str(error).split()) or "no message"
        content = Failure(mission, f"{type(error).__name__}: {text}", traceback.format_exc())
    return Finished(mission, content, time.monotonic() - begin_s)

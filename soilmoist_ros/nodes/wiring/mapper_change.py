# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The change of the field since an earlier survey, while the map grows: the topic ``change`` of a mapper."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Final

from rclpy.node import Node
from sensor_msgs.msg import PointCloud2

from msg_adapters import change_to_message
from soilmoist_ros.foundation import Batches, Health, Level
from soilmoist_ros.mapping import SoilMap
from soilmoist_ros.nodes.runtime.qos import LATCHED
from soilmoist_ros.pipeline import FieldSurvey, run_change
from soilmoist_ros.reporting import change_summary

PAUSE_S: Final = 5.0
"""Shortest time from one change to the next [s]."""
SHARE: Final = 20
"""The pause is at least this multiple of the time that a change takes."""
PART: Final = "change"
_Queued = tuple[FieldSurvey, SoilMap | None, float]
"""A map, the field that it is of, and the end of its last record [s since 1970-01-01 UTC]."""

WAITING: Final = Health(PART, Level.OK, "waiting for enough samples for a map")


class ChangeOutput:
    """Computes the change of the newest map in a thread, and publishes it.

    :param node: the mapper
    :param survey: the field; without an earlier survey nothing is published
    :param frame: frame of the message
    """

    def __init__(self, node: Node, survey: FieldSurvey, frame: str) -> None:
        self._survey, self._frame = survey, frame
        self._publisher = node.create_publisher(PointCloud2, "change", LATCHED)
        self._said = WAITING
        self._closing = False
        self._maps: Batches[_Queued] = Batches(self._compute, PART)

    @property
    def health(self) -> list[Health]:
        """What has changed, in words; nothing without an earlier survey."""
        return [self._said] if self._survey.earlier else []

    def use(self, survey: FieldSurvey) -> None:
        """The maps to come are of another field, or have other earlier surveys."""
        if self._survey.earlier and not survey.earlier:
            self._publisher.publish(change_to_message(survey.map.grid, None, 0.0, self._frame))
        self._survey, self._said = survey, WAITING

    def put(self, soil_map: SoilMap | None, stamp_s: float) -> None:
        """Compute the change of a map soon; never waits.

        :param soil_map: ``None`` if there is no map any more
        :param stamp_s: end of its last record [s since 1970-01-01 UTC]
        """
        if self._survey.earlier:
            self._maps.put((self._survey, soil_map, stamp_s))

    def close(self) -> None:
        """Publish the change of the last map, then end."""
        self._closing = True
        self._maps.close()

    def _compute(self, maps: Sequence[_Queued]) -> None:
        survey, soil_map, stamp_s = maps[-1]
        began_s = time.monotonic()
        found = None if soil_map is None else run_change(soil_map, stamp_s, survey.earlier)
        change = None if found is None else found.change
        if survey is not self._survey:  # the field was left while the map waited, or meanwhile
            return
        self._publisher.publish(change_to_message(survey.map.grid, change, stamp_s, self._frame))
        if found is not None:
            self._said = Health(PART, Level.OK, change_summary(found))
        elif soil_map is not None:
            self._said = Health(PART, Level.OK, "not computed: the surveys have too many samples")
        until_s = time.monotonic() + max(PAUSE_S, SHARE * (time.monotonic() - began_s))
        while time.monotonic() < until_s and not self._closing:
            time.sleep(0.1)

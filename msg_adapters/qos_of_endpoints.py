# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Quality of service of publishers <-> what a recorder stores and requests."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

from soilmoist_ros.recording import Qos, Request

_KEEP: Final = 100
"""Depth of a publisher if the recorded depth is unknown."""


def offered_qos(profile: QoSProfile) -> Qos:
    """The offer of a publisher, in the terms of rosbag2."""
    return Qos(
        profile.history.name.lower(),
        int(profile.depth),
        profile.reliability.name.lower(),
        profile.durability.name.lower(),
        profile.deadline.nanoseconds,
        profile.lifespan.nanoseconds,
        profile.liveliness.name.lower(),
        profile.liveliness_lease_duration.nanoseconds,
    )


def requested_qos(request: Request) -> QoSProfile:
    """Profile of a subscription."""
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=request.depth,
        reliability=ReliabilityPolicy.RELIABLE if request.reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if request.latched else DurabilityPolicy.VOLATILE,
    )


def published_qos(recorded: Sequence[Qos]) -> QoSProfile:
    """Profile of a publisher that serves all subscriptions of the recorded publishers.

    :param recorded: offer of each publisher; reliable if empty
    """
    latched = any(qos.durability == "transient_local" for qos in recorded)
    reliable = latched or not recorded or any(qos.reliability != "best_effort" for qos in recorded)
    # Fast DDS hides the depth of other publishers. A late subscription needs a latched topic's last message.
    depth = max((qos.depth for qos in recorded), default=0) or (1 if latched else _KEEP)
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
    )

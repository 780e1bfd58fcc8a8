"""Quality of service of publishers <-> what a recorder stores and asks for."""

from __future__ import annotations

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

from soilmoist_ros.recording.metadata import Qos, Request


def offered_qos(profile: QoSProfile) -> Qos:
    """What a publisher offers, in the words of rosbag2."""
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

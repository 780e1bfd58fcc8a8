# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Quality of service of the topics, with the reason for each profile."""

from __future__ import annotations

from typing import Final

from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

RECORDS: Final = QoSProfile(history=HistoryPolicy.KEEP_LAST, depth=100, reliability=ReliabilityPolicy.RELIABLE)
"""Records: none may be lost, even if a receiver is busy for a quarter of an hour."""

SENSOR: Final = QoSProfile(history=HistoryPolicy.KEEP_LAST, depth=5, reliability=ReliabilityPolicy.BEST_EFFORT)
"""Fixes and weather: only the latest matters, and drivers of other makers use this profile."""

LATCHED: Final = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=1,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)
"""Maps, plans and states: a late receiver gets the last one."""

VISITS: Final = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=100,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)
"""Visits: a late receiver gets the visits of the last hours."""

DEFAULT: Final = QoSProfile(history=HistoryPolicy.KEEP_LAST, depth=10, reliability=ReliabilityPolicy.RELIABLE)
"""``/diagnostics`` and goal poses: other tools expect this profile."""

TF: Final = QoSProfile(history=HistoryPolicy.KEEP_LAST, depth=100, reliability=ReliabilityPolicy.RELIABLE)
"""``/tf``: the profile of tf2; several nodes publish parts of the tree at high rates."""

TF_STATIC: Final = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=100,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)
"""``/tf_static``: each publisher sends its transforms once."""

CLOCK: Final = QoSProfile(history=HistoryPolicy.KEEP_LAST, depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
"""Simulated time: only the latest matters."""

NO_EVENTS: Final = SubscriptionEventCallbacks(use_default_callbacks=False)
"""For subscriptions whose publishers may offer less: no warning, and none of the callbacks with which the executor
may crash when the subscription is destroyed."""

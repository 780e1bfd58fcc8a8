# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""State of the battery <-> message."""

import math

import pytest

pytest.importorskip("rclpy")
from sensor_msgs.msg import BatteryState

from msg_adapters.battery import battery_from_message, battery_to_message


@pytest.mark.parametrize(("charge", "voltage_v"), [(0.5, 48.0), (math.nan, 24.0), (0.25, math.nan), (0.0, 40.0)])
def test_there_and_back(charge, voltage_v):
    found = battery_from_message(battery_to_message(charge, voltage_v, 1.0))
    assert found == pytest.approx((charge, voltage_v), nan_ok=True)


@pytest.mark.parametrize(
    ("percentage", "voltage", "found"),
    [
        (0.5, 0.0, (0.5, math.nan)),
        (87.0, 48.0, (0.87, 48.0)),
        (1.0, 48.0, (1.0, 48.0)),
        (math.nan, 48.0, (math.nan, 48.0)),
        (-1.0, 48.0, (math.nan, 48.0)),
        (250.0, 48.0, (math.nan, 48.0)),
        (0.0, 0.0, None),
        (0.0, math.nan, None),
    ],
)
def test_what_drivers_publish(percentage, voltage, found):
    message = BatteryState(present=True, percentage=percentage, voltage=voltage)
    assert battery_from_message(message) == (found and pytest.approx(found, nan_ok=True))


def test_no_battery():
    assert battery_from_message(BatteryState(present=False, percentage=0.1, voltage=40.0)) is None

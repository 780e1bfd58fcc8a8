# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""State of the battery <-> sensor_msgs/BatteryState."""

from __future__ import annotations

import math

from sensor_msgs.msg import BatteryState

from msg_adapters.stamps import to_time

_PERCENT = 100.0


def battery_from_message(message: BatteryState) -> tuple[float, float] | None:
    """Charge [0..1] and voltage [V] of a message, NaN if unknown; ``None`` without a battery.

    Percent are accepted as well. A charge and a voltage of zero together mean that neither is known.
    """
    charge, voltage_v = float(message.percentage), float(message.voltage)
    if not message.present or (charge == 0 and not voltage_v > 0):
        return None
    if not 0 <= charge <= _PERCENT:
        charge = math.nan
    if not voltage_v > 0:
        voltage_v = math.nan
    return (charge / _PERCENT if charge > 1 else charge), voltage_v


def battery_to_message(charge: float, voltage_v: float, stamp_s: float) -> BatteryState:
    """Message of a battery that is discharging.

    :param charge: charge [0..1], NaN if unknown
    :param voltage_v: voltage [V], NaN if unknown
    :param stamp_s: time [s]
    """
    message = BatteryState(present=True, percentage=float(charge), voltage=float(voltage_v))
    message.header.stamp = to_time(stamp_s)
    message.power_supply_status = BatteryState.POWER_SUPPLY_STATUS_DISCHARGING
    for name in ("temperature", "current", "charge", "capacity", "design_capacity"):
        setattr(message, name, math.nan)
    return message

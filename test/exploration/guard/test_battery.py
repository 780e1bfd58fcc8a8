# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What a battery's messages show, whatever each of them leaves out. Its alarms are in test_watch."""

import math

from hypothesis import given
from hypothesis import strategies as st

from soilmoist_ros.exploration.guard.signals import MIN_BATTERY, Battery, BatteryLimit


def faults(messages):
    limit, found = BatteryLimit(0.25, 0.0), []
    for charge, voltage_v in messages:
        limit.take(charge, voltage_v)
        found.append(limit.fault)
    return found


@given(st.lists(st.tuples(st.floats(0.0, 1.0), st.integers(0, 3))))
def test_messages_without_a_charge_change_nothing(sent):
    whole = faults([(charge, math.nan) for charge, _ in sent])
    mixed = [one for charge, between in sent for one in [(charge, math.nan), *[(math.nan, 48.0)] * between]]
    expected = [fault for fault, (_, between) in zip(whole, sent, strict=True) for _ in range(1 + between)]
    assert faults(mixed) == expected


def test_a_battery_is_low_after_some_messages_and_until_it_is_recharged():
    low = [0.24] * MIN_BATTERY
    assert [bool(fault) for fault in faults((charge, math.nan) for charge in [*low, 0.29, 0.31])] == [
        *[False] * (MIN_BATTERY - 1), True, True, False,
    ]  # fmt: skip


def test_charges_of_a_silent_battery():
    battery = Battery()
    assert not battery.take(0.0, math.nan, math.nan)
    assert all(math.isnan(charge) for charge in battery.charges(1.0, 1.0))
    battery.take(0.0, 0.7, math.nan)
    battery.take(1000.0, 0.6, math.nan)
    now, later = battery.charges(3000.0, 2500.0)
    assert math.isclose(now, 0.4)
    assert math.isclose(later, 0.15)
    assert battery.charges(30_000.0, 1.0) == (0.0, 0.0)

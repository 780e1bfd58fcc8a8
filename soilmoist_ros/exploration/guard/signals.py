# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Judges of single signals: the battery, the counts and logger of a sensor, and an emergency stop."""

from __future__ import annotations

import math
from collections import Counter, deque
from collections.abc import Iterable
from typing import Final

from soilmoist_ros.foundation import Health, Level
from soilmoist_ros.sensing import Kind, reason_text

# Battery: whether it is low, and what is left of its charge after the way home ----------------------------------

MIN_BATTERY: Final = 3  # number of messages in a row that must report a low battery: a peak load does not empty it
RECHARGED: Final = 0.05
"""A battery is no longer low this far above the limit: charge [-], or share of the voltage [-]."""
MIN_USE: Final = 0.02  # charge that must have been used before its mean use is known [-]


class Battery:
    """State of a battery by its messages. What a message leaves out stays as it was."""

    def __init__(self) -> None:
        self.charge = self.voltage_v = math.nan  # last known charge [0..1] and voltage [V]
        self._charge_s = math.nan
        self._start: tuple[float, float] | None = None  # time and charge

    def take(self, now_s: float, charge: float, voltage_v: float) -> bool:
        """A message has come; whether it knows anything."""
        if math.isfinite(charge):
            self.charge, self._charge_s = charge, now_s
            self._start = self._start or (now_s, charge)
        if math.isfinite(voltage_v):
            self.voltage_v = voltage_v
        return math.isfinite(charge) or math.isfinite(voltage_v)

    def start(self, now_s: float) -> None:
        """A mission starts: its mean use counts from now on [s]."""
        if math.isfinite(self.charge):
            self._start = now_s, self.charge

    def charges(self, now_s: float, later_s: float) -> tuple[float, float]:
        """Charge now and some time later at the mean use [0..1], also of a silent battery; NaN while unknown."""
        if self._start is None:
            return math.nan, math.nan
        start_s, charge = self._start
        used = charge - self.charge
        if used < MIN_USE or self._charge_s <= start_s:
            return math.nan, math.nan
        use_per_s = used / (self._charge_s - start_s)
        now = max(0.0, self.charge - use_per_s * (now_s - self._charge_s))
        return now, max(0.0, now - use_per_s * later_s)

    def __str__(self) -> str:
        return f"{self.charge:.0%}" if math.isfinite(self.charge) else f"{self.voltage_v:.1f} V"


class BatteryLimit:
    """Judges the messages of a battery by a limit of its charge and one of its voltage.

    :param charge: charge below which it is low [0..1]; 0 for no limit
    :param voltage_v: voltage below which it is low [V]; 0 for no limit
    """

    def __init__(self, charge: float, voltage_v: float) -> None:
        self._limits = (charge, charge + RECHARGED), (voltage_v, voltage_v * (1 + RECHARGED))
        self._times = [0, 0]  # messages in a row below each of the two
        self.fault = ""
        """Reason why the battery is low; empty if it is not."""

    def take(self, charge: float, voltage_v: float) -> None:
        """A message has come, with NaN for what it leaves out; that stays as it was."""
        texts = f"{charge:.0%}", f"{voltage_v:.1f} V"
        low = ""
        for number, (value, (limit, recharged)) in enumerate(zip((charge, voltage_v), self._limits, strict=True)):
            if limit > 0 and math.isfinite(value):
                is_low = value < (recharged if self.fault else limit)
                self._times[number] = self._times[number] + 1 if is_low else 0
                if self._times[number] >= MIN_BATTERY:
                    low = low or f"the battery is at {texts[number]}"
        self.fault = low or (self.fault if any(self._times) else "")


# Counts: how many of the last records were quarantined, and why -------------------------------------------------

MIN_RECORDS: Final = 3
"""Minimum number of last records by which counts are judged, however few a sensor sends."""
MAX_RECORDS: Final = 200  # number of records that are remembered
FORGOTTEN: Final = 3.0  # multiple of the time after which records without a successor are no longer judged
OF_PLACE: Final = frozenset((Kind.PLACE_JUMP.value, Kind.PLACE_DOUBT.value, Kind.CLOCK_DRIFT.value))
"""Reasons that say nothing about the counts; the causes ``jump``, ``fix_old`` and ``counts_stamp`` are theirs."""


class CountTrust:
    """Judges the records of the last time.

    :param last_s: how far back records are looked at [s]
    """

    def __init__(self, last_s: float) -> None:
        self._last_s = last_s
        self._records: deque[tuple[float, str]] = deque(maxlen=MAX_RECORDS)

    def take(self, now_s: float, reason: str = "") -> None:
        """A record has come."""
        if reason not in OF_PLACE:
            self._records.append((now_s, reason))

    def fault(self, now_s: float) -> str:
        """Reason why the counts cannot be trusted: more than half of them are quarantined; empty if they can."""
        newest_s = self._records[-1][0] if self._records else -math.inf
        if now_s - newest_s > FORGOTTEN * self._last_s:
            return ""
        judged = [reason for time_s, reason in self._records if now_s - time_s <= self._last_s]
        if len(judged) < MIN_RECORDS:
            judged = [reason for _, reason in list(self._records)[-MIN_RECORDS:]]
        bad = [reason for reason in judged if reason]
        if len(judged) < MIN_RECORDS or 2 * len(bad) <= len(judged):
            return ""
        [(reason, _)] = Counter(bad).most_common(1)
        return f"{len(bad)} of the last {len(judged)} records are quarantined ({reason_text(reason)})"


# Presses and releases of an emergency stop that several nodes may publish on one topic --------------------------

QUIET_S = 2.0  # time without a press after which a release counts, where several nodes publish [s]


class EmergencyTopic:
    """Finds out when a stop is pressed or released; a release counts only when nobody presses any more.

    Messages do not name their publisher. Where several nodes publish, one that repeats "released" must not
    outvote one that repeats "pressed", so a release counts after :data:`QUIET_S` without a press.
    """

    def __init__(self) -> None:
        self._pressed: bool | None = None
        self._pressed_s = -math.inf
        self._released = False

    def hear(self, pressed: bool, publishers: int, now_s: float) -> bool | None:
        """Take in a message; whether the stop is pressed now if that has changed, else ``None``.

        :param publishers: number of nodes that publish on the topic
        """
        if pressed:
            self._pressed_s, self._released = now_s, False
            return self._become(True)
        self._released = True
        return self._become(False) if publishers < 2 else self.tick(now_s)

    def tick(self, now_s: float) -> bool | None:
        """Time has passed; as :meth:`hear`."""
        quiet = now_s - self._pressed_s >= QUIET_S
        return self._become(False) if self._released and quiet else None

    def _become(self, pressed: bool) -> bool | None:
        if pressed == self._pressed:
            return None
        self._pressed = pressed
        return pressed


# Logger: what its driver reports ---------------------------------------------------------------------------------


def logger_fault(parts: Iterable[Health], namespace: str) -> str | None:
    """Report of the driver in a namespace about its logger; empty if nothing is wrong, ``None`` without a driver.

    :param parts: states of health with the full names of their nodes
    """
    wanted = [
        part
        for part in parts
        if part.name.endswith((": records", ": logger link"))
        and (part.name.rpartition(": ")[0].rpartition("/")[0] or "/") == namespace
    ]
    if not wanted:
        return None
    worst_part = max(wanted, key=lambda part: (part.level is Level.ERROR, part.level))
    return worst_part.message if worst_part.level is not Level.OK else ""

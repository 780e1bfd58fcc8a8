# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Presses and releases of an emergency stop that several nodes may publish on one topic."""

from __future__ import annotations

import math

QUIET_S = 2.0
"""Time without a press after which a release counts, where several nodes publish [s]."""


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

        :param pressed: what the message says
        :param publishers: number of nodes that publish on the topic
        :param now_s: steady time [s]
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

# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Whether the time of day is right: a robot without a battery for its clock starts in the past."""

from __future__ import annotations

import ctypes
import math
from typing import Final

_STEP_S: Final = 60.0
"""Change between the time of day and a steady clock from which the clock was set [s]."""
_SETTLED_S: Final = 3600.0
_TIMEX_BYTES: Final = 512
"""More than the size of ``struct timex`` on any machine; zeros ask without setting anything."""
_TIME_ERROR: Final = 5


class ClockWatch:
    """Compares the time of day with a steady clock.

    Attributes
    ----------
    right : bool
        whether the clock was synchronised since it was last set
    settled : bool
        whether it is right, and was not set for an hour
    """

    def __init__(self) -> None:
        self.right = self.settled = False
        self._offset_s = math.nan
        self._since_s = 0.0

    def look(self, now_s: float, steady_s: float, synchronised: bool) -> None:
        """Compare now; call it every minute or so.

        >>> watch = ClockWatch()
        >>> watch.look(1000.0, 5.0, synchronised=False)
        >>> watch.right
        False
        >>> watch.look(1.8e9, 65.0, synchronised=True)
        >>> watch.right, watch.settled
        (True, False)

        :param now_s: time of day [s since 1970-01-01 UTC]
        :param steady_s: time of a clock that nobody sets [s]
        :param synchronised: whether NTP or GNSS keeps the clock right now
        """
        offset_s = now_s - steady_s
        if not abs(offset_s - self._offset_s) <= _STEP_S:  # the first offset is not a number
            self._since_s, self.right = steady_s, False
        self._offset_s = offset_s
        self.right = self.right or synchronised
        self.settled = self.right and steady_s - self._since_s >= _SETTLED_S


def is_synchronised() -> bool:
    """Whether the kernel knows of something that keeps the clock of this computer right, such as NTP or GNSS."""
    state = getattr(ctypes.CDLL(None), "adjtimex", None)
    return state is not None and 0 <= state(ctypes.create_string_buffer(_TIMEX_BYTES)) < _TIME_ERROR

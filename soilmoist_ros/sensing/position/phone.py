# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A phone as the GNSS receiver: what its browser says becomes NMEA, which is checked and recorded as any other."""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from collections.abc import Mapping
from typing import Any, Final

from soilmoist_ros.foundation import InputError, finite_number
from soilmoist_ros.sensing.gnss import is_place
from soilmoist_ros.sensing.lines import LinkState, LinkStatus
from soilmoist_ros.sensing.position.nmea import nmea_sentences
from soilmoist_ros.sensing.records import NAN, Position

PHONE: Final = "phone:"
"""Address of the receiver in a phone that shows the page."""
MAX_ACCURACY_M: Final = 20.0
"""Radius from which on a position is not of satellites, but of Wi-Fi or the mobile network [m]."""
MAX_AGE_S: Final = 5.0  # age from which a position is not where the phone is [s]
SILENT_S: Final = 10.0  # time without a position after which the phone counts as silent [s]
_SDS: Final = math.sqrt(2)
"""Stated radius over the standard deviation of each coordinate. Apple states the root mean square error, Android
the radius of 68 % (1.51), the standard of browsers asks for 95 % (2.45): the smallest is the cautious one."""
_WAITING: Final = 600  # lines that wait at most: a minute and more of positions


class PhoneReceiver:
    """A :class:`LineSource` of positions that a page sends; used from several threads."""

    def __init__(self) -> None:
        self._lines: deque[bytes] = deque(maxlen=_WAITING)
        self._came = threading.Condition()
        self._closed = False
        self._heard_s, self._stamp_s = -math.inf, -math.inf
        self._n_lines = 0
        self._refused = "no position has come"

    def take(self, said: Mapping[str, Any], now_s: float) -> None:
        """Take in a position.

        :param said: ``latitude`` and ``longitude`` [deg]; ``accuracy``: radius [m]; ``age_s``: time since it was
            measured [s] by the phone's own clock, which need not be right; ``altitude`` above the ellipsoid [m]
            and ``speed`` [m/s], if known
        :param now_s: present time [s since 1970 UTC]
        :raises InputError: if it cannot be used
        """
        names = ("latitude", "longitude", "accuracy", "age_s", "altitude", "speed")
        numbers = (finite_number(said.get(name)) for name in names)
        latitude_deg, longitude_deg, accuracy_m, age_s, altitude_m, speed_mps = (
            NAN if one is None else one for one in numbers
        )
        try:
            if not (is_place(latitude_deg, longitude_deg) and accuracy_m > 0 and math.isfinite(age_s)):
                raise InputError("the phone has sent no position", "reload the page")
            if age_s > MAX_AGE_S:
                remedy = "if it stays, let the phone set its clock by itself"
                raise InputError(f"the phone's position is {age_s:.0f} s old", remedy)
            if accuracy_m > MAX_ACCURACY_M:
                remedy = "wait under open sky, and allow the exact position in the phone's settings"
                raise InputError(f"the phone knows its position within {accuracy_m:.0f} m only", remedy)
        except InputError as error:
            self._refused = str(error)
            raise
        stamp_s = now_s - max(0.0, age_s)
        position = Position(latitude_deg, longitude_deg, altitude_m, accuracy_m / _SDS)
        with self._came:
            if stamp_s > self._stamp_s:
                lines = [line.encode() for line in nmea_sentences(stamp_s, position, speed_mps, rtk=False)]
                self._lines += lines
                self._n_lines += len(lines)
            self._stamp_s = stamp_s
            self._heard_s, self._refused = time.monotonic(), "no position has come"
            self._came.notify_all()

    @property
    def status(self) -> LinkStatus:
        """State of the link."""
        silent_s = time.monotonic() - self._heard_s
        state = LinkState.SILENT if silent_s > SILENT_S else LinkState.CONNECTED
        return LinkStatus(
            uri=PHONE, state=LinkState.CLOSED if self._closed else state, last_error=self._refused,
            n_lines=self._n_lines, silent_s=silent_s, silence_limit_s=SILENT_S,
            remedy="keep the page open on the phone that has the controls, with the screen on",
        )  # fmt: skip

    def read_line(self, timeout_s: float) -> bytes | None:
        """The next line, ``None`` after the timeout."""
        with self._came:
            self._came.wait_for(lambda: self._lines or self._closed, timeout_s)
            return self._lines.popleft() if self._lines else None

    def close(self) -> None:
        """Wake a reader in another thread."""
        with self._came:
            self._closed = True
            self._came.notify_all()

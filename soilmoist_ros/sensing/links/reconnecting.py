# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A link that reconnects when it breaks or falls silent."""

from __future__ import annotations

import random
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from soilmoist_ros.sensing.links.line_buffer import LineBuffer
from soilmoist_ros.sensing.links.line_source import LinkState, LinkStatus
from soilmoist_ros.sensing.links.networks import Senders

MAX_SILENT_PERIODS = 3.5
"""Maximum time without a record before an error, as a multiple of the record period."""


class Connection(Protocol):
    """One connection over some transport."""

    datagrams: bool
    """Whether each piece contains whole lines; silence then does not indicate a broken connection."""

    def receive(self, timeout_s: float) -> bytes | None:
        """Some bytes, ``None`` after the timeout.

        :raises OSError: if the connection broke or the other side closed it
        """

    def close(self) -> None:
        """Close the connection; never raises."""


@dataclass(frozen=True)
class Retry:
    """Pauses between attempts to connect.

    :param first_s: pause before the second attempt [s]; each later pause doubles
    :param max_s: maximum pause [s]
    :param silence_s: least time without a byte after which the link reconnects [s]
    :param period_s: usual time between lines, as far as it is known now, else zero [s]; called from any thread
    """

    first_s: float = 0.5
    max_s: float = 15.0
    silence_s: float = 35.0
    period_s: Callable[[], float] = float

    @property
    def silence_limit_s(self) -> float:
        """Time without a byte after which the link reconnects, at present [s]."""
        return max(self.silence_s, MAX_SILENT_PERIODS * self.period_s())

    def pause_s(self, attempts: int, rng: random.Random) -> float:
        """Pause after a number of failed attempts [s].

        Up to half of the pause is random, so that many readers do not reconnect simultaneously.
        """
        pause_s = min(self.max_s, self.first_s * 2.0 ** min(attempts - 1, 60))
        return pause_s * rng.uniform(0.5, 1.0)


class ReconnectingSource:
    """A :class:`LineSource` over connections that may break.

    :param uri: name of the link, for messages
    :param connect: returns a new connection, or raises ``OSError``
    :param retry: pauses between attempts
    :param clock: monotonic time [s]
    :param rng: randomness of the pauses
    :param senders: whose datagrams the connections accept; ``None`` if they have a single sender
    """

    def __init__(
        self,
        uri: str,
        connect: Callable[[], Connection],
        retry: Retry | None = None,
        clock: Callable[[], float] = time.monotonic,
        rng: random.Random | None = None,
        senders: Senders | None = None,
    ) -> None:
        self._uri = uri
        self._connect = connect
        self._retry = retry or Retry()
        self._clock = clock
        self._rng = rng or random.Random()
        self._senders = senders
        self._buffer = LineBuffer()
        self._connection: Connection | None = None
        self._closed = threading.Event()
        self._retry_at_s = self._heard_at_s = clock()
        self._attempts = self._connections = self._n_bytes = self._n_lines = 0
        self._last_error = ""
        self._silent = False

    @property
    def status(self) -> LinkStatus:
        """State of the link."""
        silent_s, limit_s = self._clock() - self._heard_at_s, self._retry.silence_limit_s
        if self._closed.is_set():
            state = LinkState.CLOSED
        elif self._silent or (self._connection is not None and silent_s > limit_s):
            state = LinkState.SILENT
        else:
            state = LinkState.CONNECTING if self._connection is None else LinkState.CONNECTED
        senders = self._senders or Senders()
        return LinkStatus(
            uri=self._uri,
            state=state,
            attempts=self._attempts,
            connections=self._connections,
            last_error=self._last_error,
            n_bytes=self._n_bytes,
            n_lines=self._n_lines,
            n_oversized=self._buffer.n_oversized,
            n_refused=senders.n_refused,
            last_refused=senders.last_refused,
            senders=senders.recent,
            is_open=self._senders is not None and not senders.allowed,
            silent_s=silent_s,
            silence_limit_s=limit_s,
        )

    def read_line(self, timeout_s: float) -> bytes | None:
        """The next line, ``None`` after the timeout."""
        deadline_s = self._clock() + timeout_s
        while not self._closed.is_set():
            line = self._buffer.pop()
            if line is not None:
                self._n_lines += 1
                return line
            left_s = deadline_s - self._clock()
            if left_s <= 0:
                return None
            if self._connection is None:
                self._reconnect(left_s)
            else:
                self._receive(self._connection, left_s)
        return None

    def close(self) -> None:
        """Close the link."""
        self._closed.set()
        connection = self._connection
        if connection is not None:
            connection.close()

    def _reconnect(self, left_s: float) -> None:
        pause_s = self._retry_at_s - self._clock()
        if pause_s > 0:
            self._closed.wait(min(pause_s, left_s))
            return
        self._attempts += 1
        try:
            self._connection = self._connect()
        except OSError as error:
            self._fail(error)
            return
        self._connections += 1
        self._heard_at_s = self._clock()
        if self._closed.is_set():  # during the attempt
            self._connection.close()

    def _receive(self, connection: Connection, left_s: float) -> None:
        quiet_s, limit_s = self._clock() - self._heard_at_s, self._retry.silence_limit_s
        if quiet_s > limit_s and not connection.datagrams:
            self._silent = True
            self._attempts = 0  # the device was there: a longer pause would only miss its next line
            self._fail(TimeoutError(f"no bytes for {quiet_s:.0f} s"))
            return
        try:
            data = connection.receive(min(left_s, max(limit_s - quiet_s, 0.05)))
        except (OSError, ValueError) as error:  # ValueError: closed by another thread
            self._fail(error)
            return
        if not data:
            return
        self._silent = False
        self._heard_at_s = self._clock()
        self._n_bytes += len(data)
        lines = self._buffer.feed(data)
        if connection.datagrams:
            self._buffer.end_line()
        if lines or connection.datagrams:
            # Only a line proves that the link works: pauses grow for a server that accepts and hangs up.
            self._attempts = 0

    def _fail(self, error: Exception) -> None:
        if self._connection is not None:
            self._connection.close()
            self._connection = None
        self._buffer.drop_rest()
        if self._closed.is_set():
            return
        self._last_error = str(error) or type(error).__name__
        self._retry_at_s = self._clock() + self._retry.pause_s(max(self._attempts, 1), self._rng)

# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Interface and state of line sources."""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass
from typing import Protocol


class LinkState(enum.Enum):
    """State of a link."""

    CONNECTING = "connecting"
    """Not connected; retries."""
    CONNECTED = "connected"
    SILENT = "silent"
    """Connected, but no bytes arrive."""
    ENDED = "ended"
    """The end of a file was reached."""
    CLOSED = "closed"
    """Closed from this side."""


@dataclass(frozen=True)
class LinkStatus:
    """State and counts of a link.

    :param uri: address of the source
    :param state: state of the link
    :param attempts: attempts to connect since the last line, or since the link fell silent
    :param connections: number of connections so far
    :param last_error: reason of the last failed or broken connection, empty if there is none
    :param n_bytes: bytes received
    :param n_lines: lines received
    :param n_oversized: lines dropped because they were too long
    :param n_refused: datagrams refused for their sender
    :param last_refused: address of the last refused sender, empty if there is none
    :param senders: addresses of the last few senders whose datagrams were accepted in the last minute
    :param is_open: whether datagrams of anybody are accepted
    :param silent_s: time since the last byte or connection [s]
    :param silence_limit_s: such a time after which the link reconnects [s]
    """

    uri: str
    state: LinkState
    attempts: int = 0
    connections: int = 0
    last_error: str = ""
    n_bytes: int = 0
    n_lines: int = 0
    n_oversized: int = 0
    n_refused: int = 0
    last_refused: str = ""
    senders: tuple[str, ...] = ()
    is_open: bool = False
    silent_s: float = 0.0
    silence_limit_s: float = math.inf


class LineSource(Protocol):
    """A stream of lines that never ends and never raises."""

    @property
    def status(self) -> LinkStatus:
        """State of the link; may be read from any thread."""

    def read_line(self, timeout_s: float) -> bytes | None:
        """The next line without its line end, ``None`` after the timeout.

        Connects first if necessary; connecting may take longer than the timeout.

        :param timeout_s: maximum wait [s]
        """

    def close(self) -> None:
        """Close the link; wakes a reader in another thread."""

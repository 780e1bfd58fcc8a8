"""What every source of lines is, and the state it tells of."""

from __future__ import annotations

import enum
from dataclasses import dataclass
from typing import Protocol


class LinkState(enum.Enum):
    """State of a link."""

    CONNECTING = "connecting"
    """Not connected; tries again and again."""
    CONNECTED = "connected"
    SILENT = "silent"
    """Connected as far as one can tell, but nothing comes."""
    ENDED = "ended"
    """A file was read to its end."""
    CLOSED = "closed"
    """Closed from this side."""


@dataclass(frozen=True)
class LinkStatus:
    """What a link has been through.

    :param uri: where the lines come from
    :param state: state of the link
    :param attempts: attempts to connect since the last line
    :param connections: connections made so far
    :param last_error: why the link was not made or broke, empty if it never happened
    :param n_bytes: bytes received
    :param n_lines: lines received
    :param n_oversized: lines thrown away because they had no end
    :param silent_s: time since the last byte or connection [s]
    """

    uri: str
    state: LinkState
    attempts: int = 0
    connections: int = 0
    last_error: str = ""
    n_bytes: int = 0
    n_lines: int = 0
    n_oversized: int = 0
    silent_s: float = 0.0


class LineSource(Protocol):
    """A stream of lines that never ends by itself and never raises."""

    @property
    def status(self) -> LinkStatus:
        """What the link has been through; may be asked for from any thread."""

    def read_line(self, timeout_s: float) -> bytes | None:
        """The next line without its end, ``None`` if none came in time.

        Connects first where needed; making a connection may take longer than the time given.

        :param timeout_s: how long to wait [s]
        """

    def close(self) -> None:
        """Close the link for good; wakes a reader in another thread."""

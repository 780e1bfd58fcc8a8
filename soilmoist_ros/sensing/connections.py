# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Opens line sources by address: TCP, UDP and serial links, which reconnect when they break."""

from __future__ import annotations

import contextlib
import errno
import logging
import math
import os
import random
import select
import socket
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial
from urllib.parse import parse_qsl, unquote, urlsplit

from soilmoist_ros.foundation import InputError, did_you_mean
from soilmoist_ros.sensing.lines import LineBuffer, LineSource, LinkState, LinkStatus

EXAMPLES = {
    "tcp": "tcp://192.168.1.20:5000", "udp": "udp://0.0.0.0:5000", "serial": "serial:///dev/ttyUSB0?baud=115200",
}  # fmt: skip
"""An example of each kind of address."""
DEFAULT_BAUD = 115_200
CHUNK = 65_536  # maximum number of bytes of one read; no datagram is larger
RECEIVE_BUFFER = 1 << 20
CONNECT_S = 3.0  # maximum time of an attempt to connect [s]
RECENT_S = 60.0  # time without a datagram after which another sender is accepted [s]
MAX_SILENT_PERIODS = 3.5  # maximum time without a record before an error, as a multiple of the record period
_IN_USE = "end the other program that uses it, such as a second survey, a terminal, gpsd or ModemManager"
_TAKEN = {
    **dict.fromkeys((errno.EADDRINUSE, errno.EBUSY, errno.EAGAIN), _IN_USE),
    errno.EACCES: "let this user: sudo usermod -a -G dialout $USER, then log in again; UDP needs a port from 1024",
}
"""What to do about a port that cannot be opened, by the error number."""
_log = logging.getLogger(__name__)


def open_source(uri: str, retry: Retry | None = None) -> LineSource:
    """Line source at an address; it connects at the first read.

    * ``tcp://host:port`` connects to a server,
    * ``udp://0.0.0.0:port`` listens for datagrams of one sender, see :class:`Senders`,
    * ``serial:///dev/ttyUSB0?baud=115200`` opens a port.

    :raises InputError: if the address is invalid
    """
    try:
        parts = urlsplit(uri.strip())
        port = parts.port
    except ValueError as error:
        raise _bad(uri, str(error)) from None
    kind = parts.scheme
    if kind == "file":
        remedy = "map a log with 'soilmoist map LOG', play a recording with 'soilmoist bag play'"
        raise InputError(f"the address {uri!r} is of a file, not of a device", remedy)
    if kind not in EXAMPLES:
        kinds = f"{', '.join(EXAMPLES)}{did_you_mean(kind, EXAMPLES)}"
        raise _bad(uri, f"must begin with one of: {kinds}" if kind else "has no kind before '://'")
    options = dict(parse_qsl(parts.query, keep_blank_values=True))
    known = ["baud"] if kind == "serial" else []
    for name in options:
        if kind != "serial" and name in ("interface", "from"):
            _warn_of_option(uri, name)
        elif name not in known:
            raise _bad(uri, f"has an unknown option {name!r}; there is: {', '.join(known) or 'none'}", kind)
    if kind in ("tcp", "udp"):
        if not parts.hostname or not port:
            raise _bad(uri, "lacks the host" if port else "lacks the port", kind)
        if parts.path not in ("", "/"):
            raise _bad(uri, f"has a path {parts.path!r}, which this kind does not have", kind)
        if kind == "tcp":
            return ReconnectingSource(uri, partial(connect_tcp, parts.hostname, port), retry)
        senders = Senders()
        return ReconnectingSource(uri, partial(bind_udp, parts.hostname, port, senders), retry, senders=senders)
    if parts.netloc or not parts.path.startswith("/") or len(parts.path) < 2:
        raise _bad(uri, "lacks the absolute path: mind the three slashes", kind)
    try:
        baud = int(float(options.get("baud", DEFAULT_BAUD)))
    except (ValueError, OverflowError):
        baud = 0
    if not 50 <= baud < 10**7:
        raise _bad(uri, f"baud={options['baud']!r} is not a number of at least 50", kind)
    return ReconnectingSource(uri, partial(open_serial, unquote(parts.path), baud), retry)


@cache
def _warn_of_option(uri: str, name: str) -> None:
    """Warn once of an option of earlier releases; a driver opens an address several times."""
    remedy = "a udp address takes the lines of one sender, and a firewall limits who may send"
    _log.warning("%s= of the address %r is not used any more: %s", name, uri, remedy)


def _bad(uri: str, message: str, kind: str = "") -> InputError:
    examples = [EXAMPLES[kind]] if kind else EXAMPLES.values()
    return InputError(f"the address {uri!r} {message}", f"write it like {' or '.join(examples)}")


class Senders:
    """Accepts datagrams of one sender until it has fallen silent: lines of two would be mixed.

    :attr:`sender` is its address, :attr:`n_refused` the number of datagrams of others.
    """

    def __init__(self) -> None:
        self.sender, self.n_refused = "", 0
        self._heard_s = self._refused_s = -math.inf
        self._other = ""

    @property
    def refused(self) -> str:
        """Address of another sender of the last minute; empty without one."""
        return self._other if time.monotonic() - self._refused_s <= RECENT_S else ""

    def accepts(self, sender: str) -> bool:
        """True if a datagram is accepted."""
        now_s = time.monotonic()
        if sender != self.sender and now_s - self._heard_s <= RECENT_S:
            self.n_refused += 1
            self._other, self._refused_s = sender, now_s
            return False
        self.sender, self._heard_s = sender, now_s
        return True


@dataclass(frozen=True)
class Connection:
    """One connection over some transport.

    :param receive: some bytes, ``None`` after a timeout [s]; raises ``OSError`` if the connection broke
    :param close: closes it, and wakes a reader in another thread
    :param datagrams: whether each piece contains whole lines; silence then does not indicate a broken connection
    """

    receive: Callable[[float], bytes | None]
    close: Callable[[], None]
    datagrams: bool = False


def open_serial(device: str, baud: int) -> Connection:
    """Open a port, 8 data bits, no parity, one stop bit.

    :raises OSError: if there is no such device, or another program uses it
    """
    import serial  # only serial ports need this library

    port = serial.Serial(device, baud, timeout=0, exclusive=True)

    def receive(timeout_s: float) -> bytes | None:
        descriptor = port.fileno()
        ready, _, _ = select.select([descriptor], [], [], min(timeout_s, 0.5))  # closing does not wake it
        if not ready:
            return None
        try:
            data = os.read(descriptor, CHUNK)
        except BlockingIOError:
            return None
        if not data:
            raise ConnectionResetError("the device is gone: check the cable")
        return data

    return Connection(receive, port.close)


def connect_tcp(host: str, port: int) -> Connection:
    """Connect to a server.

    :raises OSError: if the name is unknown, or the server refuses or does not answer
    """
    link = socket.create_connection((host, port), CONNECT_S)
    link.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    if sys.platform == "linux":
        # Detects a peer without power within about 15 s, regardless of the silence limit.
        for option, value in ((socket.TCP_KEEPIDLE, 6), (socket.TCP_KEEPINTVL, 3), (socket.TCP_KEEPCNT, 3)):
            link.setsockopt(socket.IPPROTO_TCP, option, value)
    return Connection(partial(_receive_tcp, link), partial(_close_socket, link))


def _receive_tcp(link: socket.socket, timeout_s: float) -> bytes | None:
    try:
        link.settimeout(timeout_s)
        data = link.recv(CHUNK)
    except (TimeoutError, BlockingIOError):
        return None
    if not data:
        raise ConnectionResetError("the other side closed the connection")
    return data


def bind_udp(host: str, port: int, senders: Senders) -> Connection:
    """Listen for datagrams of one or more whole lines on an address of this machine, ``0.0.0.0`` for all.

    :raises OSError: if the address is not this machine's, or the port is in use
    """
    family, kind, protocol, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
    bound = socket.socket(family, kind, protocol)
    try:
        bound.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER)
        bound.bind(address)
    except OSError:
        bound.close()
        raise

    def receive(timeout_s: float) -> bytes | None:
        try:
            bound.settimeout(timeout_s)
            data, sender = bound.recvfrom(CHUNK)
        except (TimeoutError, BlockingIOError):
            return None
        return data if senders.accepts(str(sender[0])) else None

    return Connection(receive, partial(_close_socket, bound), datagrams=True)


def _close_socket(link: socket.socket) -> None:
    with contextlib.suppress(OSError):  # only this wakes a reader in another thread
        link.shutdown(socket.SHUT_RDWR)
    link.close()


@dataclass(frozen=True)
class Retry:
    """Pauses between attempts to connect.

    :param first_s: pause before the second attempt [s]; each later pause doubles, up to ``max_s`` [s]
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

    def pause_s(self, attempts: int) -> float:
        """Pause after failed attempts [s]; half of it is random, so that readers do not all reconnect at once."""
        pause_s = min(self.max_s, self.first_s * 2.0 ** min(attempts - 1, 60))
        return pause_s * random.uniform(0.5, 1.0)


class ReconnectingSource:
    """A :class:`LineSource` over connections that may break.

    :param connect: returns a new connection, or raises ``OSError``
    :param senders: decides whose datagrams the connections accept
    """

    def __init__(
        self,
        uri: str,
        connect: Callable[[], Connection],
        retry: Retry | None = None,
        senders: Senders | None = None,
    ) -> None:
        self._uri = uri
        self._connect = connect
        self._retry = retry or Retry()
        self._senders = senders or Senders()
        self._buffer = LineBuffer()
        self._connection: Connection | None = None
        self._closed = threading.Event()
        self._retry_at_s = self._heard_at_s = time.monotonic()
        self._attempts = self._connections = self._n_bytes = self._n_lines = 0
        self._last_error = ""
        self._silent = False

    @property
    def status(self) -> LinkStatus:
        """State of the link."""
        silent_s, limit_s = time.monotonic() - self._heard_at_s, self._retry.silence_limit_s
        if self._closed.is_set():
            state = LinkState.CLOSED
        elif self._silent or (self._connection is not None and silent_s > limit_s):
            state = LinkState.SILENT
        else:
            state = LinkState.CONNECTING if self._connection is None else LinkState.CONNECTED
        senders = self._senders
        return LinkStatus(
            uri=self._uri, state=state, attempts=self._attempts, connections=self._connections,
            last_error=self._last_error, n_bytes=self._n_bytes, n_lines=self._n_lines,
            n_oversized=self._buffer.n_oversized, n_refused=senders.n_refused, refused=senders.refused,
            sender=senders.sender, silent_s=silent_s, silence_limit_s=limit_s,
        )  # fmt: skip

    def refuse_taken(self) -> None:
        """Try a port of this computer, which no retry frees; a server elsewhere may come later.

        :raises InputError: if another program uses it, or this user must not
        """
        if self._uri.startswith("tcp"):
            return
        try:
            self._connect().close()
        except OSError as error:
            if error.errno in _TAKEN:
                raise InputError(
                    f"{self._uri} cannot be used: {error.strerror or error}", _TAKEN[error.errno]
                ) from None

    def read_line(self, timeout_s: float) -> bytes | None:
        """The next line, ``None`` after the timeout."""
        deadline_s = time.monotonic() + timeout_s
        while not self._closed.is_set():
            line = self._buffer.pop()
            if line is not None:
                self._n_lines += 1
                return line
            left_s = deadline_s - time.monotonic()
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
        self._close_connection()

    def _close_connection(self) -> None:
        if (connection := self._connection) is not None:
            with contextlib.suppress(OSError):  # of an adapter that was unplugged
                connection.close()

    def _reconnect(self, left_s: float) -> None:
        pause_s = self._retry_at_s - time.monotonic()
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
        self._heard_at_s = time.monotonic()
        if self._closed.is_set():  # during the attempt
            self._close_connection()

    def _receive(self, connection: Connection, left_s: float) -> None:
        quiet_s, limit_s = time.monotonic() - self._heard_at_s, self._retry.silence_limit_s
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
        self._heard_at_s = time.monotonic()
        self._n_bytes += len(data)
        lines = self._buffer.feed(data)
        if connection.datagrams:
            self._buffer.end_line()
        if lines or connection.datagrams:
            # Only a line proves that the link works: pauses grow for a server that accepts and hangs up.
            self._attempts = 0

    def _fail(self, error: Exception) -> None:
        self._close_connection()
        self._connection = None
        self._buffer.drop_rest()
        if self._closed.is_set():
            return
        refused = isinstance(error, ConnectionRefusedError)
        self._last_error = "the connection is refused" if refused else str(error) or type(error).__name__
        self._retry_at_s = time.monotonic() + self._retry.pause_s(max(self._attempts, 1))

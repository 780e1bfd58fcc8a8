"""Connections to a TCP server."""

from __future__ import annotations

import contextlib
import socket
import sys

CONNECT_S = 3.0
"""Maximum time of an attempt to connect [s]."""
CHUNK = 65_536


class SocketConnection:
    """A connected TCP socket, or a bound UDP socket.

    :param connected: the socket
    :param datagrams: whether it is a UDP socket
    """

    def __init__(self, connected: socket.socket, datagrams: bool) -> None:
        self.datagrams = datagrams
        self._socket = connected

    def receive(self, timeout_s: float) -> bytes | None:
        """Some bytes, ``None`` after the timeout."""
        try:
            self._socket.settimeout(timeout_s)
            data = self._socket.recv(CHUNK)
        except (TimeoutError, BlockingIOError):
            return None
        if not data and not self.datagrams:
            raise ConnectionResetError("the other side closed the connection")
        return data

    def close(self) -> None:
        """Close the socket."""
        with contextlib.suppress(OSError):  # only this wakes a reader in another thread
            self._socket.shutdown(socket.SHUT_RDWR)
        self._socket.close()


def connect_tcp(host: str, port: int) -> SocketConnection:
    """Connect to a server.

    :raises OSError: if the name is unknown, the server refuses or does not answer
    """
    connected = socket.create_connection((host, port), timeout=CONNECT_S)
    connected.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    if sys.platform == "linux":
        # Detects a peer without power within about 15 s, regardless of the silence limit.
        for option, value in ((socket.TCP_KEEPIDLE, 6), (socket.TCP_KEEPINTVL, 3), (socket.TCP_KEEPCNT, 3)):
            connected.setsockopt(socket.IPPROTO_TCP, option, value)
    return SocketConnection(connected, datagrams=False)

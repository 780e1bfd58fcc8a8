# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Connections to a TCP server."""

from __future__ import annotations

import contextlib
import socket
import sys

from soilmoist_ros.sensing.links.networks import bind_to_interface

CONNECT_S = 3.0
"""Maximum time of an attempt to connect [s]."""
CHUNK = 65_536


class SocketConnection:
    """A connected TCP socket.

    :param connected: the socket
    """

    datagrams = False

    def __init__(self, connected: socket.socket) -> None:
        self._socket = connected

    def receive(self, timeout_s: float) -> bytes | None:
        """Some bytes, ``None`` after the timeout."""
        try:
            self._socket.settimeout(timeout_s)
            data = self._socket.recv(CHUNK)
        except (TimeoutError, BlockingIOError):
            return None
        if not data:
            raise ConnectionResetError("the other side closed the connection")
        return data

    def close(self) -> None:
        """Close the socket."""
        with contextlib.suppress(OSError):  # only this wakes a reader in another thread
            self._socket.shutdown(socket.SHUT_RDWR)
        self._socket.close()


def connect_tcp(host: str, port: int, interface: str = "") -> SocketConnection:
    """Connect to a server.

    :param interface: network interface of the connection; empty for the one that the routes of the system choose
    :raises OSError: if the name is unknown, the server refuses or does not answer, or there is no such interface
    """
    connected = _connected(host, port, interface)
    connected.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    if sys.platform == "linux":
        # Detects a peer without power within about 15 s, regardless of the silence limit.
        for option, value in ((socket.TCP_KEEPIDLE, 6), (socket.TCP_KEEPINTVL, 3), (socket.TCP_KEEPCNT, 3)):
            connected.setsockopt(socket.IPPROTO_TCP, option, value)
    return SocketConnection(connected)


def _connected(host: str, port: int, interface: str) -> socket.socket:
    error = OSError("the name has no address")
    for family, kind, protocol, _, address in socket.getaddrinfo(host, port, type=socket.SOCK_STREAM):
        connected = socket.socket(family, kind, protocol)
        try:
            bind_to_interface(connected, interface)
            connected.settimeout(CONNECT_S)
            connected.connect(address)
        except OSError as fault:
            connected.close()
            error = fault
        else:
            return connected
    raise error

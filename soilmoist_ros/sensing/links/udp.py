# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Lines that arrive as UDP datagrams."""

from __future__ import annotations

import contextlib
import socket

from soilmoist_ros.sensing.links.networks import Senders, bind_to_interface, is_same_interface

RECEIVE_BUFFER = 1 << 20
CHUNK = 65_536


class DatagramConnection:
    """A bound UDP socket.

    :param bound: the socket
    :param senders: whose datagrams are accepted
    :param interface: network interface that it is bound to; empty for all
    :param index: index of the interface
    """

    datagrams = True

    def __init__(self, bound: socket.socket, senders: Senders, interface: str = "", index: int = 0) -> None:
        self._socket = bound
        self._senders = senders
        self._interface, self._index = interface, index

    def receive(self, timeout_s: float) -> bytes | None:
        """A datagram, ``None`` after the timeout, or if it is refused for its sender.

        :raises OSError: if the socket was closed, or its network interface is gone
        """
        try:
            self._socket.settimeout(timeout_s)
            data, sender = self._socket.recvfrom(CHUNK)
        except (TimeoutError, BlockingIOError):
            # The socket stays bound to an adapter that was unplugged, also when it is plugged in again.
            if self._interface and not is_same_interface(self._interface, self._index):
                raise ConnectionResetError(f"the network interface {self._interface!r} was unplugged") from None
            return None
        return data if self._senders.accepts(str(sender[0])) else None

    def close(self) -> None:
        """Close the socket."""
        with contextlib.suppress(OSError):  # only this wakes a reader in another thread
            self._socket.shutdown(socket.SHUT_RDWR)
        self._socket.close()


def bind_udp(host: str, port: int, interface: str = "", senders: Senders | None = None) -> DatagramConnection:
    """Listen for datagrams of one or more whole lines.

    :param host: address of this machine to listen on, ``0.0.0.0`` for all
    :param interface: network interface to listen on; empty for all
    :param senders: whose datagrams are accepted; anybody's if ``None``
    :raises OSError: if the address or interface is not this machine's, or the port is in use
    """
    family, kind, protocol, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
    bound = socket.socket(family, kind, protocol)
    try:
        index = bind_to_interface(bound, interface)
        bound.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER)
        bound.bind(address)
    except OSError:
        bound.close()
        raise
    return DatagramConnection(bound, senders or Senders(), interface, index)

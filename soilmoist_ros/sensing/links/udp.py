"""Lines that arrive as UDP datagrams."""

from __future__ import annotations

import socket

from soilmoist_ros.sensing.links.tcp import SocketConnection

RECEIVE_BUFFER = 1 << 20


def bind_udp(host: str, port: int) -> SocketConnection:
    """Listen for datagrams of one or more whole lines.

    :param host: address of this machine to listen on, ``0.0.0.0`` for all
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
    return SocketConnection(bound, datagrams=True)

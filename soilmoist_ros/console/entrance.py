# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Lets connections in, a limited number of each address, and each with its first bytes."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any, Final

MAX_CONNECTIONS: Final = 256
"""Connections of one address at the same time: a browser has seven for each page, and a tunnel is one address."""
FIRST_BYTES_S: Final = 10.0
"""Longest wait for the first bytes of a connection [s]."""


class Entrance:
    """Makes the protocol of each new connection of a server. Only the thread of the server uses it.

    :param inside: makes the protocol of a connection that is let in
    :param is_limited: whether the connections of an address are limited
    """

    def __init__(self, inside: Callable[[], Any], is_limited: bool) -> None:
        self.inside, self._is_limited = inside, is_limited
        self._open: list[asyncio.Transport] = []

    def __call__(self) -> asyncio.Protocol:
        """The protocol of a new connection."""
        return _Gate(self)

    def admits(self, transport: asyncio.Transport) -> bool:
        """Note a new connection, and whether its address may have one more."""
        self._open = [one for one in self._open if one.get_extra_info("socket").fileno() >= 0]
        self._open.append(transport)
        same = sum(_address(one) == _address(transport) for one in self._open)
        return same <= MAX_CONNECTIONS or not self._is_limited

    def close(self) -> None:
        """End all connections."""
        for transport in self._open:
            transport.abort()


class _Gate(asyncio.Protocol):
    """The protocol of a connection until its first bytes."""

    def __init__(self, entrance: Entrance) -> None:
        self._entrance = entrance
        self._transport: asyncio.Transport
        self._end: asyncio.TimerHandle | None = None

    def connection_made(self, transport: Any) -> None:
        self._transport = transport
        if self._entrance.admits(transport):
            self._end = asyncio.get_running_loop().call_later(FIRST_BYTES_S, transport.abort)
        else:
            transport.abort()

    def data_received(self, data: bytes) -> None:
        self._cancel()
        inside = self._entrance.inside()
        self._transport.set_protocol(inside)
        inside.connection_made(self._transport)
        inside.data_received(data)

    def connection_lost(self, exc: Exception | None) -> None:
        self._cancel()

    def _cancel(self) -> None:
        if self._end is not None:
            self._end.cancel()


def _address(transport: asyncio.Transport) -> str:
    return str((transport.get_extra_info("peername") or ("",))[0])

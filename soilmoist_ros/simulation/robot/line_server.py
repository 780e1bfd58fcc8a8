# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A TCP server that sends the same bytes to all clients, like a serial device server."""

from __future__ import annotations

import contextlib
import json
import logging
import os
import socket
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from soilmoist_ros.foundation import InputError

LOG = logging.getLogger(__name__)
LARGEST_BACKLOG = 1 << 20
"""Maximum bytes that may wait for a client; a client with more is disconnected."""


@dataclass(eq=False)
class _Client:
    socket: socket.socket
    waiting: bytearray = field(default_factory=bytearray)


class LineServer:
    """Serves any number of clients; no client can block it. It has no thread: call :meth:`poll` often.

    :param name: device that it serves, for messages
    :param host: address to listen on
    :param port: port to listen on; 0 for a free one
    :param greeting: bytes that each client receives first
    :raises InputError: if it cannot listen on this address
    """

    def __init__(self, name: str, host: str, port: int, greeting: bytes = b"") -> None:
        self.name = name
        self._greeting = greeting
        self._clients: list[_Client] = []
        self._reachable = True
        try:
            self._listener = socket.create_server((host, port), backlog=16)
        except (OSError, OverflowError) as error:
            raise InputError(
                f"the {name} cannot listen on {host}:{port}: {error}", "choose another port, or 0 for a free one"
            ) from None
        self._listener.setblocking(False)

    @property
    def address(self) -> tuple[str, int]:
        """Host and port on which it listens."""
        host, port = self._listener.getsockname()[:2]
        return str(host), int(port)

    @property
    def clients(self) -> int:
        """Number of connected clients at the last poll."""
        return len(self._clients)

    def poll(self) -> None:
        """Accept and drop clients, and send waiting bytes."""
        with contextlib.suppress(OSError):  # no client waits, or it has disconnected already
            while True:
                connection, _ = self._listener.accept()
                self._take_in(connection)
        for client in list(self._clients):
            self._look_after(client)

    def send(self, data: bytes) -> None:
        """Send to all clients."""
        for client in list(self._clients):
            client.waiting += data
            self._look_after(client)

    def set_reachable(self, reachable: bool) -> None:
        """Open or close the server; closing disconnects all clients."""
        self._reachable = reachable
        if not reachable:
            for client in list(self._clients):
                self._drop(client, "the connection is cut")

    def close(self) -> None:
        """Disconnect all clients and stop listening."""
        self.set_reachable(False)
        self._listener.close()

    def _take_in(self, connection: socket.socket) -> None:
        if not self._reachable:
            connection.close()
            return
        connection.setblocking(False)
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._clients.append(_Client(connection, bytearray(self._greeting)))

    def _look_after(self, client: _Client) -> None:
        try:
            if not client.socket.recv(4096):  # input from clients is ignored
                self._drop(client, "the client closed the connection")
                return
        except BlockingIOError:
            pass
        except OSError as error:
            self._drop(client, str(error))
            return
        try:
            while client.waiting:
                del client.waiting[: client.socket.send(client.waiting)]
        except BlockingIOError:
            if len(client.waiting) > LARGEST_BACKLOG:
                self._drop(client, "the client does not read its data")
        except OSError as error:
            self._drop(client, str(error))

    def _drop(self, client: _Client, reason: str) -> None:
        LOG.info("disconnected a client of the %s: %s", self.name, reason)
        self._clients.remove(client)
        client.socket.close()


def write_ports_file(addresses: Mapping[str, tuple[str, int]], path: Path) -> None:
    """Write the addresses of servers as JSON: ``{"logger": {"host": "127.0.0.1", "port": 4001}, ...}``.

    The file appears with its whole content at once, so a waiting process never reads a part of it.

    :param addresses: host and port of each server
    :param path: file to write
    :raises InputError: if it cannot be written
    """
    content = {name: {"host": host, "port": port} for name, (host, port) in addresses.items()}
    unfinished = path.with_name(f".{path.name}.writing")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        unfinished.write_text(json.dumps(content) + "\n", encoding="utf-8")
        os.replace(unfinished, path)
    except OSError as error:
        raise InputError(f"cannot be written: {error.strerror}", "choose another ports_file", path) from None

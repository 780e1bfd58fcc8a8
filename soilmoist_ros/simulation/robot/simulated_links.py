# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Simulated connections: one that loses, damages and delays messages, and a TCP server that serves its bytes."""

from __future__ import annotations

import contextlib
import json
import logging
import math
import os
import re
import socket
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from soilmoist_ros.foundation import InputError
from soilmoist_ros.simulation.robot.scenario import Damage, LinkFaults

SPLIT_DELAY_S = 0.5
GARBAGE_BYTES = 40
_LINE_END = "\r\n"
LOG = logging.getLogger(__name__)
LARGEST_BACKLOG = 1 << 20  # maximum bytes that may wait for a client; a client with more is disconnected


@dataclass(frozen=True, slots=True)
class Sent:
    """Bytes that arrive at the receiving end of a connection."""

    link: str
    data: bytes


@dataclass(frozen=True, slots=True)
class Reachable:
    """The link becomes reachable or unreachable. An unreachable link closes and refuses connections."""

    link: str
    reachable: bool


class FaultyLink:
    """One connection with outages and damages. Times count from the start of the simulation."""

    def __init__(self, name: str, faults: LinkFaults, rng: np.random.Generator) -> None:
        self.name = name
        self._faults = faults
        self._rng = rng
        self._messages = 0
        self._on_the_way: deque[tuple[float, bytes]] = deque()
        cuts = [outage for outage in faults.outages if outage.kind == "cut"]
        self._turns = deque(sorted({end for cut in cuts for end in cut.ends}))
        self._reachable = True

    @property
    def next_s(self) -> float:
        """Time of the next arrival, or of the next change of reachability [s]; inf if none."""
        due = self._on_the_way[0][0] if self._on_the_way else math.inf
        return min(due, self._turns[0] if self._turns else math.inf)

    def send(self, now_s: float, lines: Sequence[str], spoilt: int = -1) -> bool:
        """Send a message of lines; returns whether it arrives whole and at once.

        :param spoilt: index of the line that a damage affects
        """
        self._messages += 1
        packets = whole = [(0.0, _encoded(lines))]
        for damage in self._faults.damages:
            if damage.hits(self._messages):
                packets = self._damaged(list(lines), spoilt % len(lines), damage)
                break
        kinds = {outage.kind for outage in self._faults.outages if outage.covers(now_s)}
        if kinds & {"cut", "silence"}:
            return False
        held = [o.ends[1] for o in self._faults.outages if o.kind == "stall" and o.covers(now_s)]
        # Messages keep their order.
        earliest_s = max([now_s, *held, *(due_s for due_s, _ in self._on_the_way)])
        self._on_the_way += [(earliest_s + delay_s, data) for delay_s, data in packets]
        return packets is whole and earliest_s == now_s

    def receive(self, now_s: float) -> list[Sent | Reachable]:
        """Arrivals up to now, in order."""
        out: list[Sent | Reachable] = []
        while self.next_s <= now_s:
            if self._turns and self._turns[0] <= self.next_s:
                turn_s = self._turns.popleft()
                reachable = not any(o.covers(turn_s) for o in self._faults.outages if o.kind == "cut")
                if reachable != self._reachable:
                    self._reachable = reachable
                    self._on_the_way.clear()
                    out.append(Reachable(self.name, reachable))
            else:
                out.append(Sent(self.name, self._on_the_way.popleft()[1]))
        return out

    def _damaged(self, lines: list[str], index: int, damage: Damage) -> list[tuple[float, bytes]]:
        """Packets of a damaged message: delays [s] and bytes."""
        line = lines[index]
        before, after = _encoded(lines[:index]), _encoded(lines[index + 1 :])
        half = len(line) // 2
        if damage.kind == "missing":
            return []
        if damage.kind == "twice":
            return [(0.0, 2 * _encoded(lines))]
        if damage.kind == "split":
            return [(0.0, before + line[:half].encode()), (SPLIT_DELAY_S, _encoded([line[half:]]) + after)]
        if damage.kind == "wrong_checksum":
            spoilt = _encoded([self._with_another_digit(line)])
        elif damage.kind == "no_checksum":
            spoilt = _encoded([line.rpartition("*")[0]])
        elif damage.kind == "cut_short":
            spoilt = line[:half].encode()
        else:
            garbage = self._rng.integers(0, 256, GARBAGE_BYTES, np.uint8).tobytes()
            spoilt = garbage + (_LINE_END + line + _LINE_END).encode()
        return [(0.0, before + spoilt + after)]

    def _with_another_digit(self, line: str) -> str:
        digits = [match.start() for match in re.finditer(r"\d", line.rpartition("*")[0])]
        place = int(self._rng.choice(digits))
        return f"{line[:place]}{(int(line[place]) + 1) % 10}{line[place + 1 :]}"


def _encoded(lines: Sequence[str]) -> bytes:
    return "".join(line + _LINE_END for line in lines).encode("ascii")


@dataclass(eq=False)
class _Client:
    socket: socket.socket
    waiting: bytearray = field(default_factory=bytearray)


class LineServer:
    """Serves any number of clients; no client can block it. It has no thread: call :meth:`poll` often.

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

# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A simulated person with a cart: logger and receiver on real sockets, and legs that follow advice, or do not."""

from __future__ import annotations

import contextlib
import json
import math
import threading
import time
import urllib.request
from collections.abc import Callable
from dataclasses import dataclass, field

from soilmoist_ros.simulation import MissionSettings
from soilmoist_ros.simulation.robot.simulated_links import LineServer, Sent
from soilmoist_ros.simulation.system import GNSS, LOGGER, VirtualSystem

TICK_S = 0.05


@dataclass
class SimulatedPerson:
    """Walks over a surrogate field in real time, from a thread.

    :param advice: place to go to now, ``None`` without one; asked ten times a second
    :param ignores: number of the advice (from 0) that is ignored: the person stands at ``elsewhere`` instead
    :param wrong_turn: number of the advice at which the person first walks to ``elsewhere`` without standing
    """

    settings: MissionSettings
    advice: Callable[[], tuple[float, float] | None]
    ignores: int = -1
    wrong_turn: int = -1
    elsewhere: tuple[float, float] = (10.0, 10.0)
    gnss_period_s: float = 0.2
    done: threading.Event = field(default_factory=threading.Event)
    advised: list[tuple[float, float]] = field(default_factory=list)
    records: int = 0

    def __post_init__(self) -> None:
        self._system = VirtualSystem(self.settings, time.time(), self.gnss_period_s)
        self._walker = self._system.robots[0]
        greeting = "".join(f"{line}\r\n" for line in self._walker.logger.header).encode()
        self.servers = {
            LOGGER: LineServer(LOGGER, "127.0.0.1", 0, greeting),
            GNSS: LineServer(GNSS, "127.0.0.1", 0),
        }
        self._target: tuple[float, float] | None = None
        self._back: tuple[float, float] | None = None
        self._thread = threading.Thread(target=self._live, daemon=True)

    def uri(self, device: str) -> str:
        host, port = self.servers[device].address
        return f"tcp://{host}:{port}"

    @property
    def place(self) -> tuple[float, float]:
        """True place of the person [m]."""
        return self._walker.body.at(self._system.now_s)

    def __enter__(self) -> SimulatedPerson:
        self._thread.start()
        return self

    def __exit__(self, *_error: object) -> None:
        self.done.set()
        self._thread.join()
        for server in self.servers.values():
            server.close()

    def _live(self) -> None:
        began_s, looked_s = time.monotonic(), 0.0
        while not self.done.is_set():
            now_s = time.monotonic() - began_s
            for output in self._system.advance(now_s)[0]:
                if isinstance(output, Sent):
                    self.servers[output.link].send(output.data)
                    self.records += output.link == LOGGER
            for server in self.servers.values():
                server.poll()
            if now_s - looked_s > 2 * TICK_S:
                looked_s = now_s
                self._decide()
            time.sleep(TICK_S)

    def _decide(self) -> None:
        advised = self.advice()
        if self._back is not None and math.dist(self.place, self.elsewhere) < 0.5:
            self._walker.drive_to(self._back)
            self._back = None
        if not advised or advised == self._target:
            return
        self._target = advised
        self.advised.append(advised)
        number = len(self.advised) - 1
        if number == self.wrong_turn:
            self._back = advised
        self._walker.drive_to(self.elsewhere if number in (self.ignores, self.wrong_turn) else advised)


class PageAdvice:
    """Reads the advice as a page does, from the messages of the server; ``sections`` has the newest values."""

    def __init__(self, address: str) -> None:
        self.address, self.sections = address, {}
        self._stops: dict[int, int] = {}
        self._thread = threading.Thread(target=self._listen, daemon=True)
        self._thread.start()

    def _listen(self) -> None:
        import asyncio

        import aiohttp

        async def listen() -> None:
            async with (
                aiohttp.ClientSession() as session,
                session.ws_connect(f"{self.address}live", ssl=False) as socket,
            ):
                async for message in socket:
                    if message.type is aiohttp.WSMsgType.TEXT:
                        self.sections.update(json.loads(message.data).get("set", {}))
                        mission = self.sections.get("mission/", {})
                        self._stops[mission.get("stops", 0)] = mission.get("counts", 0)

        with contextlib.suppress(OSError, aiohttp.ClientError):  # the process has ended
            asyncio.run(listen())

    @property
    def counted(self) -> int:
        """Counts at all stops, as the page has shown them since the process began."""
        return sum(self._stops.values())

    def __call__(self) -> tuple[float, float] | None:
        mission = self.sections.get("mission/")
        if not mission or mission["phase"] != "travelling" or mission["stop"] is None:
            return None
        return tuple(mission["stop"][1:])

    def ask(self, verb: str, **details: object) -> dict[str, object]:
        content = json.dumps({"robot": "", "verb": verb, "who": "Anna", "client": "test", **details}).encode()
        request = urllib.request.Request(
            f"{self.address}command", content, {"Content-Type": "application/json"}, method="POST"
        )
        with urllib.request.urlopen(request, timeout=10) as reply:
            return json.loads(reply.read())

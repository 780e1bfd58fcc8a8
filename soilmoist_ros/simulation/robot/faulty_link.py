# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A connection that loses, damages and delays messages as a scenario defines."""

from __future__ import annotations

import math
import re
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from soilmoist_ros.simulation.robot.scenario import Damage, LinkFaults

SPLIT_DELAY_S = 0.5
GARBAGE_BYTES = 40
_LINE_END = "\r\n"


@dataclass(frozen=True, slots=True)
class Sent:
    """Bytes that arrive at the receiving end.

    :param link: name of the connection
    :param data: the bytes
    """

    link: str
    data: bytes


@dataclass(frozen=True, slots=True)
class Reachable:
    """The link becomes reachable or unreachable. An unreachable link closes and refuses connections.

    :param link: name of the connection
    :param reachable: whether clients can connect
    """

    link: str
    reachable: bool


class FaultyLink:
    """One connection with faults. Times count from the start of the simulation.

    :param name: name of the connection
    :param faults: outages and damages to simulate
    :param rng: source of all randomness
    """

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
        """Send a message; returns whether it arrives whole and at once.

        :param now_s: time [s]
        :param lines: lines of the message, without line ends
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
        match damage.kind:
            case "missing":
                return []
            case "twice":
                return [(0.0, 2 * _encoded(lines))]
            case "wrong_checksum":
                return [(0.0, before + _encoded([self._with_another_digit(line)]) + after)]
            case "no_checksum":
                return [(0.0, before + _encoded([line.rpartition("*")[0]]) + after)]
            case "cut_short":
                return [(0.0, before + line[:half].encode() + after)]
            case "split":
                rest = _encoded([line[half:]]) + after
                return [(0.0, before + line[:half].encode()), (SPLIT_DELAY_S, rest)]
            case "garbage":
                garbage = self._rng.integers(0, 256, GARBAGE_BYTES, np.uint8).tobytes()
                return [(0.0, before + garbage + _LINE_END.encode() + _encoded(lines[index:]))]

    def _with_another_digit(self, line: str) -> str:
        digits = [match.start() for match in re.finditer(r"\d", line.rpartition("*")[0])]
        place = int(self._rng.choice(digits))
        return f"{line[:place]}{(int(line[place]) + 1) % 10}{line[place + 1 :]}"


def _encoded(lines: Sequence[str]) -> bytes:
    return "".join(line + _LINE_END for line in lines).encode("ascii")

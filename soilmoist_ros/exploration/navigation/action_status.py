# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Goals that the server of an action lists on its status topic, and which of them are those of other clients.

The server publishes its list whenever a goal changes, latched. So a list counts only while the server that sent it
is there: the last words of one that has died say nothing. A server that never had a goal has published no list.

The identities of goals begin with a mark of the client, then one of its process. So a client that was started
again knows the goals of its earlier life.
"""

from __future__ import annotations

import hashlib
import uuid
from collections.abc import Mapping
from typing import Final

ACTIVE: Final = frozenset((1, 2, 3))
"""States of a goal that is accepted, executing or being cancelled, as action_msgs numbers them."""
ENDED: Final = frozenset((4, 5, 6))
"""States of a goal that has succeeded, was cancelled or was aborted."""
_MARK, _PROCESS = 8, 12


class ActionStatus:
    """Goals that the servers of an action list, by client.

    :param client: name of the client, which stays the same when it is started again
    """

    def __init__(self, client: str) -> None:
        self._mark = hashlib.sha256(f"soilmoist_ros {client}".encode()).digest()[:_MARK]
        self._own = self._mark + uuid.uuid4().bytes[: _PROCESS - _MARK]
        self._sent = 0
        self._goals: dict[bytes, int] = {}
        self.known = False
        """True if a list of a server that is there has come."""
        self.servers: frozenset[bytes] = frozenset()
        """Names of the publishers of lists; a server that is started again has another one."""

    def new_identity(self) -> bytes:
        """The identity of a goal to send: 16 bytes, never the same."""
        self._sent += 1
        return self._own + self._sent.to_bytes(16 - _PROCESS, "big")

    def take(self, goals: Mapping[bytes, int]) -> None:
        """A list has come: states of goals by identity. It is the whole of one server."""
        self._goals = {**(self._goals if len(self.servers) > 1 else {}), **goals}
        self.known = True

    def serve(self, servers: frozenset[bytes]) -> bool:
        """Which servers are there now; whether to fetch their lists anew, as one has gone and others are there."""
        lost, self.servers = self.servers - servers, servers
        if lost:
            self._goals, self.known = {}, False
        return bool(lost and servers)

    def state(self, identity: bytes) -> int:
        """State of a goal; 0 if it is not listed."""
        return self._goals.get(identity, 0)

    @property
    def before(self) -> tuple[bytes, ...]:
        """Active goals of this client from before it was started again."""
        return tuple(goal for goal in self._active if goal.startswith(self._mark))

    @property
    def others(self) -> tuple[bytes, ...]:
        """Active goals of other clients."""
        return tuple(goal for goal in self._active if not goal.startswith(self._mark))

    @property
    def _active(self) -> list[bytes]:
        """Active goals that this process has not sent."""
        return [goal for goal, state in self._goals.items() if state in ACTIVE and not goal.startswith(self._own)]

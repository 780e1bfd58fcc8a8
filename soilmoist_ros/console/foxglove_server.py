# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A WebSocket server for the viewer Foxglove, which passes ROS messages on as they are, and takes none."""

from __future__ import annotations

from collections import deque
from typing import Any, Final

from soilmoist_ros.foundation import InputError, optional_module
from soilmoist_ros.recording import Definition

BACKLOG: Final = 32
"""Messages that wait for a slow viewer at most; the oldest are dropped. This bounds the memory: a map of 70,000
cells has 2.5 MB."""


class FoxgloveServer:
    """Offers topics to viewers, and says which of them a viewer wants.

    Viewers can only look: they cannot publish, call services or set parameters, because the protocol does not ask
    who they are.

    :param name: name of the server in the viewer
    :param host: address to listen on
    :param port: TCP port; 0 for a free one
    :raises InputError: if foxglove-sdk is missing, or the address cannot be listened on

    Attributes
    ----------
    address : str
        what to open in the viewer
    """

    def __init__(self, name: str, host: str, port: int) -> None:
        self._sdk: Any = optional_module("foxglove")
        self._context = self._sdk.Context()
        self._channels: dict[str, Any] = {}
        self._changes: deque[tuple[str, int]] = deque()
        self._viewers: dict[str, int] = {}
        try:
            self._server = self._sdk.start_server(
                name=name,
                host=host,
                port=port,
                capabilities=[],
                server_listener=_Listener(self._changes),
                context=self._context,
                message_backlog_size=BACKLOG,
            )
        except Exception as error:  # the SDK raises exceptions of several kinds
            raise InputError(
                f"the Foxglove server cannot listen on {host}:{port}: {error}",
                "choose another foxglove_port, or end what uses it",
            ) from None
        shown = f"[{host}]" if ":" in host else host
        self.address = f"ws://{shown}:{self._server.port}"

    def offer(self, topic: str, definition: Definition) -> None:
        """Offer a topic.

        :param topic: its full name
        :param definition: its message type
        """
        package, _, kind = definition.type_name.split("/")
        schema = self._sdk.Schema(
            name=f"{package}/msg/{kind}", encoding=definition.encoding, data=definition.text.encode()
        )
        self._channels[topic] = self._sdk.Channel(
            topic, schema=schema, message_encoding="cdr", context=self._context
        )

    def wanted(self) -> dict[str, bool]:
        """Topics whose viewers have changed since the last call: whether a new one wants the topic.

        A topic that is ``False`` has viewers no longer.
        """
        found: dict[str, bool] = {}
        while self._changes:
            topic, change = self._changes.popleft()
            self._viewers[topic] = max(0, self._viewers.get(topic, 0) + change)
            found[topic] = self._viewers[topic] > 0 and (change > 0 or found.get(topic, False))
        return {topic: new for topic, new in found.items() if new or not self._viewers[topic]}

    def send(self, topic: str, data: bytes, time_ns: int) -> None:
        """Send a message to the viewers of a topic.

        :param topic: an offered topic
        :param data: the message as CDR
        :param time_ns: time of the message [ns since 1970-01-01 UTC]
        """
        self._channels[topic].log(data, log_time=time_ns)

    def close(self) -> None:
        """End the server."""
        self._server.stop()


class _Listener:
    """Called by threads of the SDK."""

    def __init__(self, changes: deque[tuple[str, int]]) -> None:
        self._changes = changes

    def on_subscribe(self, _client: Any, channel: Any) -> None:
        self._changes.append((channel.topic, 1))

    def on_unsubscribe(self, _client: Any, channel: Any) -> None:
        self._changes.append((channel.topic, -1))

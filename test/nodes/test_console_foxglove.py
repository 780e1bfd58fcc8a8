# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The live view of the console for Foxglove, with viewers that speak its protocol (console_foxglove.py)."""

from __future__ import annotations

import asyncio
import json
import re
import socket
import struct

import numpy as np
import pytest

pytest.importorskip("rclpy")
pytest.importorskip("foxglove")
from aiohttp import ClientSession
from mcap_ros2._dynamic import generate_dynamic
from ros_system import LIMIT_S
from sensor_msgs.msg import NavSatFix, PointCloud2
from std_msgs.msg import String

from msg_adapters.point_cloud import points_to_message
from soilmoist_ros.mapping.soil_map import CELL
from soilmoist_ros.nodes.runtime.qos import LATCHED, SENSOR, VISITS

MESSAGE = 1


class Viewer:
    """Decodes messages by the definitions that the server sends, as viewers do."""

    def __init__(self, connection):
        self.connection, self.channels, self.topics, self.got = connection, {}, {}, []

    async def until(self, condition):
        """Receive until a condition holds."""
        async with asyncio.timeout(LIMIT_S):
            while not condition():
                message = await self.connection.receive()
                if isinstance(message.data, str):
                    said = json.loads(message.data)
                    for one in said.get("channels", []):
                        self.channels[one["topic"]] = one
                    if unknown := re.fullmatch(r"Unknown channel ID: (\d+)", said.get("message", "")):
                        await self.ask(int(unknown[1]))  # told a moment before it is known
                    continue
                kind, number, _time_ns = struct.unpack("<BIQ", message.data[:13])
                assert kind == MESSAGE
                topic = self.topics[number]
                name = self.channels[topic]["schemaName"]
                decode = generate_dynamic(name, self.channels[topic]["schema"])[name]
                self.got.append((topic, decode(message.data[13:])))

    async def subscribe(self, *topics):
        await self.until(lambda: set(topics) <= set(self.channels))
        first = len(self.topics)
        self.topics |= dict(enumerate(topics, first))
        for topic in topics:
            await self.ask(self.channels[topic]["id"])

    async def ask(self, channel):
        """Subscribe to a channel."""
        (number,) = (number for number, topic in self.topics.items() if self.channels[topic]["id"] == channel)
        wanted = [{"id": number, "channelId": channel}]
        await self.connection.send_json({"op": "subscribe", "subscriptions": wanted})

    def of(self, topic):
        return [message for name, message in self.got if name == topic]


@pytest.fixture
def served(ros, tmp_path):
    """Address of the live view of a console."""
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        port = one.getsockname()[1]
    params = {"field": "example", "port": 0, "foxglove_port": port, "runs": str(tmp_path)}
    process = ros.start("console", params=params)
    found = ros.wait_for(lambda: re.search(r"live view for Foxglove: (ws://127\.0\.0\.1:\d+)", process.output()))
    yield found[1]
    assert process.stop() == 0


@pytest.mark.slow
@pytest.mark.process
def test_viewers_get_maps_late_and_records_as_they_come(ros, served):
    cells = np.zeros((3, 4), CELL)
    cells["x"], cells["rate"] = np.arange(4.0), 5.5
    maps = ros.node.create_publisher(PointCloud2, "soil_map", LATCHED)
    maps.publish(points_to_message(cells, 1.0, "map"))
    texts = ros.node.create_publisher(String, "/r1/visits", VISITS)
    for number in range(60):
        texts.publish(String(data=str(number)))
    fixes = ros.node.create_publisher(NavSatFix, "fix", SENSOR)

    async def look():
        async with ClientSession() as session:
            first, late = [
                Viewer(await session.ws_connect(served, protocols=["foxglove.sdk.v1"])) for _ in range(2)
            ]
            await first.subscribe("/soil_map", "/fix")
            await first.until(lambda: first.of("/soil_map"))
            assert (first.of("/soil_map")[0].width, first.of("/soil_map")[0].height) == (4, 3)
            ros.wait_for(lambda: fixes.get_subscription_count() == 2, message="the page and the viewer")
            again = ros.node.create_timer(0.2, lambda: fixes.publish(NavSatFix(latitude=53.25)))
            await first.until(lambda: first.of("/fix"))
            ros.node.destroy_timer(again)
            assert first.of("/fix")[0].latitude == 53.25
            await late.subscribe("/soil_map", "/r1/visits")
            await late.until(lambda: late.of("/soil_map") and len(late.of("/r1/visits")) == 60)
            assert bytes(late.of("/soil_map")[0].data) == cells.tobytes()
            assert [one.data for one in late.of("/r1/visits")] == [str(number) for number in range(60)]
            await first.connection.close()
            ros.wait_for(lambda: fixes.get_subscription_count() == 1, message="nobody looks any more")
            await late.connection.close()

    asyncio.run(look())


@pytest.mark.slow
@pytest.mark.process
def test_nobody_steers_through_the_live_view(ros, served):
    stops = ros.collect(String, "/emergency_stop")

    async def look():
        async with ClientSession() as session:
            viewer = Viewer(await session.ws_connect(served, protocols=["foxglove.sdk.v1"]))
            await viewer.until(lambda: viewer.channels)
            channel = {"id": 1, "topic": "/emergency_stop", "encoding": "cdr", "schemaName": "std_msgs/msg/String"}
            await viewer.connection.send_json({"op": "advertise", "channels": [channel]})
            await viewer.connection.send_bytes(struct.pack("<BI", 1, 1) + b"\0\1\0\0\1\0\0\0\0")
            reply = {"op": ""}
            while reply["op"] != "status":  # channels that are new may be told of first
                reply = await viewer.connection.receive_json(timeout=LIMIT_S)
            assert reply["level"] == 2
            assert stops == []

    asyncio.run(look())


@pytest.mark.slow
@pytest.mark.process
def test_a_console_without_foxglove_says_how_to_install_it(ros, tmp_path):
    (tmp_path / "foxglove").mkdir()
    (tmp_path / "foxglove" / "__init__.py").write_text("raise ModuleNotFoundError(name=__name__)")
    ros.environment["PYTHONPATH"] = str(tmp_path)
    params = {"field": "example", "port": 0, "foxglove_port": 9, "runs": str(tmp_path)}
    process = ros.start("console", params=params)
    assert process.wait() == 2
    assert "pip install 'soilmoist_ros[console]'" in process.output()

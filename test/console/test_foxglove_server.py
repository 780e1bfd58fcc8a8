# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The server for Foxglove, with clients that speak its protocol over a real connection."""

from __future__ import annotations

import asyncio
import json
import struct
import time
from pathlib import Path

import pytest

pytest.importorskip("foxglove")
from aiohttp import ClientSession

from soilmoist_ros.console.foxglove_server import BACKLOG, FoxgloveServer
from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.recording.bag.metadata import Definition

PROTOCOL = "foxglove.sdk.v1"
TEXT = Definition("std_msgs/msg/String", "string data")
LIMIT_S = 60.0


@pytest.fixture
def server():
    one = FoxgloveServer("robot", "127.0.0.1", 0)
    yield one
    one.close()


async def greeting(connection):
    """What a server says first: about itself, and its topics."""
    return [json.loads((await connection.receive(LIMIT_S)).data) for _ in range(2)]


async def until(condition):
    end_s = time.monotonic() + LIMIT_S
    while not (found := condition()):
        assert time.monotonic() < end_s
        await asyncio.sleep(0.01)
    return found


def rss_mb():
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096 / 1e6


def test_a_viewer_gets_the_schema_and_the_bytes_of_what_it_wants(server):
    server.offer("/text", TEXT)
    server.offer("/other", TEXT)

    async def look():
        async with ClientSession() as session, session.ws_connect(server.address, protocols=[PROTOCOL]) as viewer:
            about, topics = await greeting(viewer)
            assert (about["name"], about["capabilities"]) == ("robot", []), "a viewer can only look"
            channels = {one["topic"]: one for one in topics["channels"]}
            assert {
                key: channels["/text"][key] for key in ("encoding", "schemaName", "schemaEncoding", "schema")
            } == {
                "encoding": "cdr",
                "schemaName": "std_msgs/msg/String",
                "schemaEncoding": "ros2msg",
                "schema": "string data",
            }
            await viewer.send_json(
                {"op": "subscribe", "subscriptions": [{"id": 7, "channelId": channels["/text"]["id"]}]}
            )
            assert await until(server.wanted) == {"/text": True}
            server.send("/other", b"not wanted", 1)
            server.send("/text", b"\x00\x01", 12)
            data = (await viewer.receive(LIMIT_S)).data
            assert struct.unpack("<BIQ", data[:13]) == (1, 7, 12)
            assert data[13:] == b"\x00\x01"
        assert await until(server.wanted) == {"/text": False}
        assert server.wanted() == {}

    asyncio.run(look())


def test_a_second_viewer_is_new_and_one_of_two_may_leave(server):
    server.offer("/text", TEXT)

    async def look():
        async with ClientSession() as session:
            viewers = [await session.ws_connect(server.address, protocols=[PROTOCOL]) for _ in range(2)]
            for viewer in viewers:
                number = (await greeting(viewer))[1]["channels"][0]["id"]
                await viewer.send_json({"op": "subscribe", "subscriptions": [{"id": 1, "channelId": number}]})
                assert await until(server.wanted) == {"/text": True}
            await viewers[0].close()
            await asyncio.sleep(0.2)
            assert server.wanted() == {}, "the other one still looks"
            await viewers[1].close()
            assert await until(server.wanted) == {"/text": False}

    asyncio.run(look())


@pytest.mark.slow
def test_a_viewer_that_stops_reading_costs_a_bounded_number_of_messages(server):
    server.offer("/text", TEXT)
    big = bytes(1_000_000)

    async def look():
        async with ClientSession() as session:
            stuck = await session.ws_connect(server.address, protocols=[PROTOCOL], max_msg_size=0)
            number = (await greeting(stuck))[1]["channels"][0]["id"]
            await stuck.send_json({"op": "subscribe", "subscriptions": [{"id": 1, "channelId": number}]})
            await until(server.wanted)
            transport = stuck._response.connection.transport
            transport.pause_reading()
            before_mb = rss_mb()
            for _ in range(8 * BACKLOG):
                server.send("/text", big, 0)
                await asyncio.sleep(0.001)
            assert rss_mb() - before_mb < 2 * BACKLOG, "256 MB were sent"
            transport.abort()

    asyncio.run(look())


def test_a_port_in_use_is_named(server):
    port = int(server.address.rpartition(":")[2])
    with pytest.raises(InputError, match=f"cannot listen on 127.0.0.1:{port}"):
        FoxgloveServer("second", "127.0.0.1", port)

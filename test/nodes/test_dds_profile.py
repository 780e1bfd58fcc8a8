# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The DDS profile of tests, demos and simulations blocks all traffic from and to other machines."""

from __future__ import annotations

import ipaddress
import os
import socket
import struct
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads /proc")
LOOPBACK = ipaddress.IPv4Address("127.0.0.1")


def udp_addresses():
    """Local addresses of the UDP sockets of this process."""
    own = set()
    for descriptor in Path("/proc/self/fd").iterdir():
        try:
            own.add(os.readlink(descriptor).removeprefix("socket:[").rstrip("]"))
        except OSError:
            continue  # closed meanwhile
    rows = [line.split() for line in Path("/proc/net/udp").read_text().splitlines()[1:]]
    return {
        ipaddress.IPv4Address(socket.inet_ntoa(struct.pack("=I", int(row[1].partition(":")[0], 16))))
        for row in rows
        if row[9] in own
    }


def test_a_node_listens_on_loopback_only(ros):
    ros.wait_for(lambda: LOOPBACK in udp_addresses(), message="sockets on 127.0.0.1")
    assert {address for address in udp_addresses() if address != LOOPBACK and not address.is_multicast} == set()


def test_two_processes_talk_without_shared_memory_that_a_crash_would_leave(ros):
    from std_msgs.msg import String

    from soilmoist_ros.nodes.topics import LATCHED

    script = ros.folder / "talker"
    code = """
import sys, rclpy
from rclpy.node import Node
from std_msgs.msg import String
from soilmoist_ros.nodes.topics import LATCHED
rclpy.init(args=sys.argv)
node = Node("talker")
publisher = node.create_publisher(String, "greeting", LATCHED)
publisher.publish(String(data="hello"))
rclpy.spin(node)
"""
    script.write_text(f"#!{sys.executable}\n{code}")
    script.chmod(0o755)
    received = ros.collect(String, "greeting", LATCHED)
    talker = ros.start(str(script))
    ros.wait_for(lambda: received, message="a message of the other process")
    assert received[0].data == "hello"
    assert "/dev/shm/fastrtps" not in Path(f"/proc/{talker.process.pid}/maps").read_text()

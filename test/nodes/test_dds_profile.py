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


def test_a_node_listens_on_loopback_only_and_without_shared_memory_that_a_crash_would_leave(ros):
    ros.wait_for(lambda: LOOPBACK in udp_addresses(), message="sockets on 127.0.0.1")
    assert {address for address in udp_addresses() if address != LOOPBACK and not address.is_multicast} == set()
    assert "/dev/shm/fastrtps" not in Path("/proc/self/maps").read_text()

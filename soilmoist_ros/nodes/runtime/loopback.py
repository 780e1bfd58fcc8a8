# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A private ROS domain on the loopback interface, which no other machine can join."""

from __future__ import annotations

import contextlib
import socket
from collections.abc import Iterator

from soilmoist_ros.foundation import InputError, config_folder

DOMAINS = range(100, 0, -1)
"""Domains whose ports are below the ephemeral ports of Linux; people choose low ones."""
PORTS_EACH = 250
"""Number of ports of a domain."""
FIRST_PORT = 7400
LAST_PORT = FIRST_PORT + PORTS_EACH - 1
"""The first and the last port of domain 0."""


@contextlib.contextmanager
def free_domain() -> Iterator[int]:
    """Reserve a domain on this machine among the callers of this function until the context ends.

    The reservation is a TCP port of the domain, which DDS does not use. It also holds against containers that
    share the network, but no files.

    :raises InputError: if all domains are in use
    """
    for domain in DOMAINS:
        with socket.socket() as reservation:
            try:
                reservation.bind(("127.0.0.1", LAST_PORT + PORTS_EACH * domain))
            except OSError:
                continue
            yield domain
            return
    raise InputError("all ROS domains of this machine are in use", "end other simulations first")


def loopback_environment(domain: int) -> dict[str, str]:
    """Environment variables that restrict processes to the loopback interface.

    :param domain: number of the ROS domain
    """
    return {
        "ROS_DOMAIN_ID": str(domain),
        # These override the settings of a robot's shell.
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET",
        "ROS_STATIC_PEERS": "",
        "ROS_DISCOVERY_SERVER": "",
        # This Fast DDS ignores the newer name of the variable.
        "FASTRTPS_DEFAULT_PROFILES_FILE": str(config_folder() / "dds" / "loopback.xml"),
        "RMW_IMPLEMENTATION": "rmw_fastrtps_cpp",
        "ROS_SECURITY_ENABLE": "false",  # keys hold in one domain, and nobody else reaches this one
    }

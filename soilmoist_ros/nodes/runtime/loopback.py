# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A private ROS domain on the loopback interface, which no other machine can join."""

from __future__ import annotations

import contextlib
import fcntl
import tempfile
from collections.abc import Iterator
from pathlib import Path

from soilmoist_ros.foundation.configuration import config_folder
from soilmoist_ros.foundation.errors import InputError

DOMAINS = range(1, 101)
"""Domains whose ports are below the ephemeral ports of Linux."""


@contextlib.contextmanager
def free_domain() -> Iterator[int]:
    """Reserve a domain on this machine among the callers of this function until the context ends.

    :raises InputError: if all domains are in use, or no lock can be made
    """
    for domain in DOMAINS:
        path = Path(tempfile.gettempdir()) / f"soilmoist_domain_{domain}.lock"
        with contextlib.ExitStack() as stack:
            try:
                lock = stack.enter_context(path.open("w"))
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except (BlockingIOError, PermissionError):  # locked, or made by another user
                continue
            except OSError as error:
                raise InputError(
                    f"no lock can be made: {error.strerror}", "free the disk, or set TMPDIR to a folder", path
                ) from None
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
    }

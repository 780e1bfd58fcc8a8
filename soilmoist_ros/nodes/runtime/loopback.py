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
    """A domain that no other caller of this function on this machine uses until it is released.

    :raises InputError: if all are in use, or no lock can be made
    """
    for domain in DOMAINS:
        path = Path(tempfile.gettempdir()) / f"soilmoist_domain_{domain}.lock"
        with contextlib.ExitStack() as stack:
            try:
                lock = stack.enter_context(path.open("w"))
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except (BlockingIOError, PermissionError):  # held by us, or made by another user
                continue
            except OSError as error:
                raise InputError(
                    f"no lock can be made: {error.strerror}", "free the disk, or set TMPDIR to a folder", path
                ) from None
            yield domain
            return
    raise InputError("all ROS domains of this machine are in use", "end other simulations first")


def loopback_environment(domain: int) -> dict[str, str]:
    """Environment variables of processes that communicate on the loopback interface only.

    :param domain: number of the ROS domain
    """
    return {
        "ROS_DOMAIN_ID": str(domain),
        # Settings of a robot's shell must not apply here.
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET",
        "ROS_STATIC_PEERS": "",
        "ROS_DISCOVERY_SERVER": "",
        # The variable of this Fast DDS; its newer name is ignored.
        "FASTRTPS_DEFAULT_PROFILES_FILE": str(config_folder() / "dds" / "loopback.xml"),
        "RMW_IMPLEMENTATION": "rmw_fastrtps_cpp",
    }

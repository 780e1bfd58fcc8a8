"""A ROS domain of one's own on the loopback interface: nothing outside this machine takes part."""

from __future__ import annotations

import contextlib
import fcntl
import tempfile
from collections.abc import Iterator
from pathlib import Path

from soilmoist_ros.foundation.configuration import config_folder
from soilmoist_ros.foundation.errors import InputError

DOMAINS = range(1, 101)
"""Domains whose ports lie below those that Linux hands out to programs."""


@contextlib.contextmanager
def free_domain() -> Iterator[int]:
    """A domain that no other system started like this uses on this machine, for as long as it is held.

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
    """Environment variables of processes that shall meet on the loopback interface only.

    :param domain: number of the ROS domain
    """
    return {
        "ROS_DOMAIN_ID": str(domain),
        # What a robot's shell may have set would lead elsewhere, or nowhere.
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET",
        "ROS_STATIC_PEERS": "",
        "ROS_DISCOVERY_SERVER": "",
        # The variable of this Fast DDS; its newer name is ignored.
        "FASTRTPS_DEFAULT_PROFILES_FILE": str(config_folder() / "dds" / "loopback.xml"),
        "RMW_IMPLEMENTATION": "rmw_fastrtps_cpp",
    }

# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Nodes as processes that start and end together, on a private ROS domain of this machine."""

from __future__ import annotations

import contextlib
import ctypes
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType

from soilmoist_ros.foundation import InputError, config_folder

_PR_SET_PDEATHSIG = 1
_POLL_S = 0.02
# Loaded here: between fork and exec a process must not load a library.
_prctl = ctypes.CDLL(None).prctl if sys.platform == "linux" else None
DOMAINS = range(100, 0, -1)  # domains whose ports are below the ephemeral ports of Linux; people choose low ones
PORTS_EACH = 250  # number of ports of a domain
FIRST_PORT = 7400
LAST_PORT = FIRST_PORT + PORTS_EACH - 1  # the first and the last port of domain 0


class ProcessGroup:
    """Context manager of node processes; no process outlives the group.

    On Linux the processes receive SIGTERM even if this process is killed. The kernel sends SIGTERM when the
    *thread* that started them ends, so start them in a thread that lasts.
    """

    def __init__(self, environment: Mapping[str, str], log_folder: Path) -> None:
        self._environment = {**os.environ, **environment, "ROS_LOG_DIR": str(log_folder), "PYTHONUNBUFFERED": "1"}
        self._log_folder = log_folder
        self._processes: dict[str, subprocess.Popen[bytes]] = {}

    def __enter__(self) -> ProcessGroup:
        self._log_folder.mkdir(parents=True, exist_ok=True)
        return self

    def __exit__(self, *error: object) -> None:
        self.stop()

    def start(
        self,
        name: str,
        parameters_file: Path,
        remaps: Mapping[str, str] = MappingProxyType({}),
        program: Sequence[str] = (),
    ) -> None:
        """Start a node."""
        if name in self._processes:
            raise ValueError(f"{name} was started before")
        namespace, _, node = name.rpartition("/")
        command = [sys.executable, *(program or ("-m", f"soilmoist_ros.nodes.{node}"))]
        command += ["--ros-args", "-r", f"__ns:=/{namespace}", "--params-file", str(parameters_file)]
        command += [word for old, new in remaps.items() for word in ("-r", f"{old}:={new}")]
        parent = os.getpid()
        with self.log(name).open("ab") as log:
            self._processes[name] = subprocess.Popen(
                command,
                env=self._environment,
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=subprocess.STDOUT,
                start_new_session=True,  # Ctrl-C on the terminal must end the nodes in the right order
                preexec_fn=lambda: end_with_parent(parent),
            )

    def kill(self, name: str) -> None:
        """Kill a node without warning; it can be started again then."""
        process = self._processes.pop(name)
        _kill_group(process)
        process.wait()

    def pid(self, name: str) -> int:
        """Process number of a node that was started."""
        return self._processes[name].pid

    def log(self, name: str) -> Path:
        """File with the output of a node."""
        return self._log_folder / f"{name.replace('/', '_')}.log"

    def ended(self) -> dict[str, int]:
        """Exit codes of the nodes that have ended, by name; negative for a signal."""
        return {name: process.returncode for name, process in self._processes.items() if _has_ended(process)}

    def stop(self, limit_s: float = 60.0) -> None:
        """End all nodes, the last started first. Kill a node that does not end in time."""
        try:
            for process in reversed(self._processes.values()):
                if not _has_ended(process):
                    process.send_signal(signal.SIGINT)
                deadline = time.monotonic() + limit_s
                while not _has_ended(process) and time.monotonic() < deadline:
                    time.sleep(_POLL_S)
        finally:  # even if the user interrupts the wait
            for process in self._processes.values():
                if process.returncode is None:
                    _kill_group(process)
                    process.wait()
            self._processes.clear()


def _has_ended(process: subprocess.Popen[bytes]) -> bool:
    """True if a process has ended; if so, the processes that it started are killed."""
    if process.returncode is None and process.poll() is not None:
        _kill_group(process)  # at once, since another process may get the number later
    return process.returncode is not None


def _kill_group(process: subprocess.Popen[bytes]) -> None:
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(process.pid, signal.SIGKILL)


def end_with_parent(parent: int) -> None:
    """Make the kernel end this process when the parent is killed; called between fork and exec."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    if _prctl is not None:
        _prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)
        if os.getppid() != parent:  # the parent was killed in the meantime
            os._exit(1)


# A private ROS domain on the loopback interface, which no other machine can join --------------------------------


@contextlib.contextmanager
def free_domain() -> Iterator[int]:
    """Reserve a domain on this machine among the callers of this function until the context ends.

    The reservation is a TCP port of the domain, which DDS does not use. It also holds against containers that
    share the network, but no files.
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


def _profiles_variable() -> str:
    """Variable for a profile: Fast DDS 3, since ROS 2 Kilted, warns of the old name; 2 ignores the new one."""
    prefixes = (sys.prefix, *os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep))
    newer = any(Path(prefix, "share", "fastdds").is_dir() for prefix in prefixes)
    return f"{'FASTDDS' if newer else 'FASTRTPS'}_DEFAULT_PROFILES_FILE"


def loopback_environment(domain: int) -> dict[str, str]:
    """Environment variables that restrict processes to the loopback interface."""
    return {
        "ROS_DOMAIN_ID": str(domain),
        # These override the settings of a robot's shell.
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET",
        "ROS_STATIC_PEERS": "",
        "ROS_DISCOVERY_SERVER": "",
        _profiles_variable(): str(config_folder() / "dds" / "loopback.xml"),
        "RMW_IMPLEMENTATION": "rmw_fastrtps_cpp",
        "ROS_SECURITY_ENABLE": "false",  # keys hold in one domain, and nobody else reaches this one
    }

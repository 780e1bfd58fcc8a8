"""Nodes as processes that start and end together."""

from __future__ import annotations

import contextlib
import ctypes
import os
import signal
import subprocess
import sys
import time
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType

_PR_SET_PDEATHSIG = 1
_POLL_S = 0.02
# Looked up here: between fork and exec a process may do little, least of all load a library.
_prctl = ctypes.CDLL(None).prctl if sys.platform == "linux" else None


class ProcessGroup:
    """Processes of nodes; none outlives the group, however that ends. Use as a context manager.

    On Linux they are asked to end (SIGTERM) even when this process is killed. For the kernel that is when the
    *thread* ends which started them: start them in one that lasts.

    :param environment: environment variables beside those of this process
    :param log_folder: each node's output goes to ``NAME.log`` in it, with _ for /; made if missing
    """

    def __init__(self, environment: Mapping[str, str], log_folder: Path) -> None:
        self._environment = {**os.environ, **environment, "ROS_LOG_DIR": str(log_folder), "PYTHONUNBUFFERED": "1"}
        self._log_folder = log_folder
        self._processes: dict[str, subprocess.Popen[bytes]] = {}

    def __enter__(self) -> ProcessGroup:
        self._log_folder.mkdir(parents=True, exist_ok=True)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()

    def start(self, name: str, parameters_file: Path) -> None:
        """Start a node.

        :param name: name of the node, after its namespace if it is in one: ``compaction/mapper``
        :param parameters_file: its parameters
        :raises ValueError: if it was started before
        """
        if name in self._processes:
            raise ValueError(f"{name} was started before")
        namespace, _, node = name.rpartition("/")
        command = [sys.executable, "-m", f"soilmoist_ros.nodes.{node}"]
        command += ["--ros-args", "-r", f"__ns:=/{namespace}", "--params-file", str(parameters_file)]
        parent = os.getpid()
        with self.log(name).open("wb") as log:
            self._processes[name] = subprocess.Popen(
                command,
                env=self._environment,
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=subprocess.STDOUT,
                start_new_session=True,  # Ctrl-C on the terminal is ours to pass on, in the right order
                preexec_fn=lambda: _end_with_parent(parent),
            )

    def log(self, name: str) -> Path:
        """File with the output of a node."""
        return self._log_folder / f"{name.replace('/', '_')}.log"

    def ended(self) -> dict[str, int]:
        """Exit codes of the nodes that have ended, by name; negative for a signal."""
        return {name: process.returncode for name, process in self._processes.items() if _has_ended(process)}

    def stop(self, limit_s: float = 15.0) -> None:
        """End all nodes, the last started first; one that does not end in time is killed.

        :param limit_s: time that each node gets [s]
        """
        try:
            for process in reversed(self._processes.values()):
                _interrupt(process, limit_s)
        finally:  # also when the user does not want to wait
            for process in self._processes.values():
                if process.returncode is None:
                    _kill_group(process)
                    process.wait()
            self._processes.clear()


def _interrupt(process: subprocess.Popen[bytes], limit_s: float) -> None:
    """Ask a process to end, and see that it does."""
    if _has_ended(process):
        return
    process.send_signal(signal.SIGINT)
    deadline = time.monotonic() + limit_s
    while not _has_ended(process) and time.monotonic() < deadline:
        time.sleep(_POLL_S)


def _has_ended(process: subprocess.Popen[bytes]) -> bool:
    """Whether a process has ended; what it has started then ends with it."""
    if process.returncode is None and process.poll() is not None:
        _kill_group(process)  # at once: later on the number may be another's
    return process.returncode is not None


def _kill_group(process: subprocess.Popen[bytes]) -> None:
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(process.pid, signal.SIGKILL)


def _end_with_parent(parent: int) -> None:
    """Let the kernel end this process when the one that started it is killed; called between fork and exec."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    if _prctl is not None:
        _prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)
        if os.getppid() != parent:  # it was killed meanwhile
            os._exit(1)

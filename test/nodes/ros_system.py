# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A private ROS system for one test: a private domain on loopback, real processes, an observer."""

from __future__ import annotations

import contextlib
import importlib
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any
from unittest.mock import patch

import rclpy
import yaml
from rclpy.action import ActionClient
from rclpy.context import Context
from rclpy.executors import MultiThreadedExecutor
from rclpy.node import Node

from soilmoist_ros.nodes.process_group import end_with_parent, free_domain, loopback_environment

LIMIT_S = 180.0
"""Longest wait for an immediate event [s]; machines that run tests are busy."""

ENCLAVES = "/soilmoist"
"""Folder of all enclaves in a keystore."""
SECURITY = ("ROS_SECURITY_KEYSTORE", "ROS_SECURITY_ENABLE", "ROS_SECURITY_STRATEGY")


def security_environment(keystore: Path) -> dict[str, str]:
    return dict(zip(SECURITY, (str(keystore), "true", "Enforce"), strict=True))


PUBLISHER = """#!{}
import rclpy
from rclpy.node import Node
from {} import {} as Kind
rclpy.init()
node = Node("other")
publisher = node.create_publisher(Kind, "{}", 10)
rclpy.spin(node)
"""


@contextlib.contextmanager
def ros_in_this_process(arguments: Sequence[str], folder: Path) -> Iterator[None]:
    """Initialise the usual context in a free domain. The caller destroys its nodes."""
    environment = loopback_environment(0) | {"ROS_LOG_DIR": str(folder)}
    with free_domain() as domain, patch.dict(os.environ, environment | {"ROS_DOMAIN_ID": str(domain)}):
        rclpy.init(args=list(arguments))
        try:
            yield
        finally:
            rclpy.try_shutdown()


def construct(module: str, name: str, parameters: Path, folder: Path) -> None:
    """Construct a node; for another process.

    :param parameters: its file
    """
    made = getattr(importlib.import_module(module), name)
    with ros_in_this_process(["node", "--ros-args", "--params-file", str(parameters)], folder):
        made()


class RosSystem:
    """Processes and an observer on an isolated domain. Use as a context manager.

    :param make_keystore: makes the keystore of a domain for SROS 2. Every node then runs in the enclave of its
        name, and the observer in that of the operator.
    """

    def __init__(self, folder: Path, make_keystore: Callable[[int], Path] | None = None) -> None:
        self.folder = folder
        self.secured = make_keystore is not None
        self._make_keystore = make_keystore
        self.processes: list[NodeProcess] = []
        self._clients: dict[tuple[type, str], Any] = {}

    def __enter__(self) -> RosSystem:
        with contextlib.ExitStack() as made:
            self.domain = made.enter_context(free_domain())
            self.environment = {
                **os.environ,
                **loopback_environment(self.domain),
                "ROS_LOG_DIR": str(self.folder / "log"),
                "ROS_PYTHON_CHECK_FIELDS": "1",
                "PYTHONUNBUFFERED": "1",
                "PYTHONFAULTHANDLER": "1",
                "PYTHONWARNINGS": "always:failed to send response",  # each time, and not the first one only
                "OPENBLAS_NUM_THREADS": "1",
            }
            if self._make_keystore is not None:
                self.environment |= security_environment(self._make_keystore(self.domain))
            names = ("ROS_LOG_DIR", *SECURITY, *(name for name in self.environment if "_PROFILES_" in name))
            its = {name: self.environment[name] for name in names if name in self.environment}
            made.enter_context(patch.dict(os.environ, its))
            self.context = Context()
            arguments = ["--ros-args", "--enclave", f"{ENCLAVES}/operator"] if self.secured else None
            rclpy.init(args=arguments, context=self.context, domain_id=self.domain)
            made.callback(self.context.try_shutdown)
            self.node = Node("observer", context=self.context)
            self._stack = made.pop_all()
        self._executor = MultiThreadedExecutor(2, context=self.context)
        self._executor.add_node(self.node)
        self._spinner = threading.Thread(target=self._spin, daemon=True)
        self._spinning = True
        self._spinner.start()
        return self

    def __exit__(self, *exception: object) -> None:
        for process in self.processes:
            process.kill()
        self._spinning = False
        self._executor.wake()
        self._spinner.join(5)
        self._executor.shutdown(timeout_sec=2)
        # They keep the node, which does not destroy them: it would hear the next tests as well.
        for client in [one for one in self.node.waitables if isinstance(one, ActionClient)]:
            client.destroy()
        self.node.destroy_node()
        self._stack.close()

    def _spin(self) -> None:
        while self._spinning and self.context.ok():
            with contextlib.suppress(Exception):  # a test may destroy an entity meanwhile
                self._executor.spin_once(timeout_sec=0.2)

    def start(
        self,
        executable: str,
        *,
        params: dict[str, Any] | None = None,
        namespace: str = "",
        remaps: Sequence[str] = (),
        extra: Sequence[str] = (),
    ) -> NodeProcess:
        """Start a node as a process.

        :param executable: name of the node, or a path to start unchanged
        :param params: parameters, written to a file
        """
        command = [sys.executable, "-m", f"soilmoist_ros.nodes.{executable}"]
        if os.sep in executable:
            command = [executable]
        enclave = f"{ENCLAVES}{namespace}/{executable}"
        command += ["--ros-args", *(["--enclave", enclave] if self.secured else []), *extra]
        if namespace:
            command += ["-r", f"__ns:={namespace}"]
        for remap in remaps:
            command += ["-r", remap]
        if params:
            path = self.folder / f"params{len(self.processes)}.yaml"
            path.write_text(yaml.safe_dump({"/**": {"ros__parameters": params}}))
            command += ["--params-file", str(path)]
        process = NodeProcess(command, self.environment, self.folder / f"output{len(self.processes)}.txt")
        self.processes.append(process)
        return process

    def start_publisher(self, kind: type, topic: str) -> NodeProcess:
        path = self.folder / "publisher"
        path.write_text(PUBLISHER.format(sys.executable, kind.__module__, kind.__name__, topic))
        path.chmod(0o755)
        return self.start(str(path))

    def collect(self, kind: type, topic: str, qos: Any = 10) -> list[Any]:
        found: list[Any] = []
        self.node.create_subscription(kind, topic, found.append, qos)
        return found

    def call(self, kind: type, name: str, request: Any = None, timeout: float = LIMIT_S) -> Any:
        """Call a service and wait for its answer; ask again if the server's middleware says that it is lost."""
        if (kind, name) not in self._clients:  # each new one may be unknown to the server when it answers
            self._clients[kind, name] = self.node.create_client(kind, name)
        client = self._clients[kind, name]
        question = kind.Request() if request is None else request
        assert client.wait_for_service(timeout), f"no service {name}"
        lost, asked = self._lost_answers(), [client.call_async(question)]

        def answer() -> bool:
            if any(future.done() for future in asked):
                return True
            if self._lost_answers() > lost + len(asked) - 1:
                asked.append(client.call_async(question))
            return False

        self.wait_for(answer, timeout, f"an answer of {name}", every=0.05)
        return next(future.result() for future in asked if future.done())

    def _lost_answers(self) -> int:
        """How many answers had a server that did not know its client's receiver yet (Fast DDS waits 0.1 s)."""
        return sum(process.output().count("client will not receive response") for process in self.processes)

    def wait_for(
        self, condition: Callable[[], Any], timeout: float = LIMIT_S, message: str = "", every: float = 0.01
    ) -> Any:
        """Wait until a condition holds, and return its value; a failure shows the output of the processes."""
        deadline = time.monotonic() + timeout
        while time.monotonic() < deadline:
            found = condition()
            if found:
                return found
            time.sleep(every)
        said = "\n".join(f"--- {' '.join(process.command[:3])}\n{process.output()}" for process in self.processes)
        raise AssertionError(f"waited {timeout} s for {message or condition}\n{said}")


class NodeProcess:
    """A node in a separate process."""

    def __init__(self, command: list[str], environment: dict[str, str], output: Path) -> None:
        self.command = command
        self._output = output
        with output.open("wb") as file:
            self.process = subprocess.Popen(
                command, env=environment, cwd=output.parent, stdout=file, stderr=subprocess.STDOUT,
                stdin=subprocess.DEVNULL, start_new_session=True,
                preexec_fn=partial(end_with_parent, os.getpid()),  # else it answers in the domain of a later test
            )  # fmt: skip

    def output(self) -> str:
        return self._output.read_text(errors="replace")

    @property
    def running(self) -> bool:
        return self.process.poll() is None

    def stop(self, number: int = signal.SIGINT, timeout: float = LIMIT_S) -> int:
        """Send the signal, and return the exit code."""
        if self.running:
            self.process.send_signal(number)
        return self.wait(timeout)

    def wait(self, timeout: float = LIMIT_S) -> int:
        """Wait until the process ends, and return the exit code."""
        try:
            return self.process.wait(timeout)
        except subprocess.TimeoutExpired:
            self.process.send_signal(signal.SIGABRT)  # Python writes where each thread is
            self.process.wait(LIMIT_S)
            raise AssertionError(f"{self.command[:3]} does not end\n{self.output()}") from None

    def kill(self) -> None:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self.process.pid, signal.SIGKILL)
        self.process.wait()

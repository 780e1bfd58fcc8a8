# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A node as a process: its command line, its log, its memory, and a clean end."""

from __future__ import annotations

import ctypes
import logging
import os
import signal
import sys
import time
import traceback
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import takewhile
from pathlib import Path
from types import FrameType
from typing import Any, Final

import rclpy
from rclpy.duration import Duration
from rclpy.executors import Executor, ExternalShutdownException, SingleThreadedExecutor
from rclpy.logging import get_logger
from rclpy.node import Node
from rclpy.qos import ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions

from soilmoist_ros.foundation import InputError, SoilmoistError, printable
from soilmoist_ros.nodes.parameter_tables import table_of
from soilmoist_ros.nodes.parameters import NODES

try:
    from rclpy.experimental import EventsExecutor
except ImportError:  # rclpy promises only the others, which take twice the time of the processor
    EventsExecutor = SingleThreadedExecutor

_SWITCH_S: Final = 5e-4
"""Longest wait of a callback for Python's lock while another thread computes [s]; each takes it several times, and
Python's own 5 ms would add up to a late abort."""
_LAST_ORDERS_S: Final = 2.0  # longest time for what a node drives to hear that it is to stop [s]
_LAST_MESSAGES_S: Final = 3.0
"""Longest wait for the receivers of the last messages; launch files end a node by force after 5 s more [s]."""
BAD_INPUT: Final = 2
_SECURITY: Final = (
    "start the node with its enclave (--ros-args --enclave /soilmoist/NODE, or enclaves:=/soilmoist in the launch "
    "file), from a keystore that scripts/keystore has made; the ROS 2 packages of PyPI have no security"
)
_PERMISSIONS: Final = (
    "if Fast DDS names a topic above, the permissions of this node's enclave lack it: add it to the policy, and "
    "make the keystore again (docs/safety.md)"
)
_TRIM_THRESHOLD, _MMAP_THRESHOLD = -1, -3  # names in malloc.h of the limits below
_KEPT_BYTES: Final = 2 << 20  # free memory at the end of a heap above which it goes back to the system [bytes]
_MAPPED_BYTES: Final = 1 << 20
"""Size from which an array has memory of its own, which goes back when it is freed [bytes]."""


def _secured() -> bool:
    return os.environ.get("ROS_SECURITY_ENABLE") == "true"


def _without_ros(error: Exception) -> int:
    """Report why ROS does not start, and return the exit code: nothing may run without the security asked for."""
    text = " ".join(str(error).split())
    remedy = _SECURITY if "security" in text.lower() else _PERMISSIONS if _secured() else ""
    print(f"ROS cannot start the node: {text}{remedy and f' -> {remedy}'}", file=sys.stderr, flush=True)
    return BAD_INPUT


def _spin(node: Node, executor: Executor, timeout_s: float) -> None:
    try:
        executor.spin_once(timeout_sec=timeout_s)
    except ExternalShutdownException:
        pass  # rclpy is not ok any more
    except Exception:  # a bug in one callback must not end a mission
        node.get_logger().error(f"a callback failed; the node continues\n{traceback.format_exc()}")


def _leave(node: Node, executor: Executor) -> None:
    """Let a node stop what it drives, and go on until that has heard of it: a lost request is asked again."""
    leave = getattr(node, "leave", None)
    if leave is None:
        return
    heard = leave()
    deadline = time.monotonic() + _LAST_ORDERS_S
    while not heard() and rclpy.ok() and time.monotonic() < deadline:
        _spin(node, executor, 0.05)


def _deliver(node: Node) -> None:
    """Wait until the receivers have the last messages: with the process, those under way would be lost."""
    deadline = time.monotonic() + _LAST_MESSAGES_S
    for publisher in node.publishers:
        if publisher.qos_profile.reliability == ReliabilityPolicy.RELIABLE:
            publisher.wait_for_all_acked(Duration(seconds=max(deadline - time.monotonic(), 0.0)))


def run(make_node: Callable[[], Node], make_executor: Callable[[], Executor] = EventsExecutor) -> None:
    """Run a node until it is interrupted; every ``main`` calls this function.

    One thread calls the callbacks as events arrive; longer work has threads of its own (:class:`.Aside`). Other
    executors of rclpy look at all entities at each message, which costs more than the callbacks. The executor of
    events is experimental, and nodes must not do what it cannot:

    * guard conditions are refused; :class:`.Soon` takes their place
    * coroutines fail as callbacks of services and subscriptions (ros2/rclpy#1473)
    * a publisher or subscription with callbacks for its events must not be destroyed while the executor spins: the
      process may crash (ros2/rclpy#1644)
    * an action server must not be destroyed while the executor spins: a request that comes at that moment crashes
      the process. The simulator, whose navigation can disappear, has another executor
    * an action client must not send goals to two servers of one name: both answer, and the process crashes
    * a signal ends the process after the present callback, or after half a second without one

    A node may have a method ``close()``, called at the end, and a flag ``finished``, which ends the process.
    Before, ``leave()`` may stop what the node drives; callbacks go on until the function that it returns is true,
    at most 2 s. The process lasts until reliable receivers have its last messages, at most 3 s.
    Exit codes: 0 after SIGINT or SIGTERM, or when the node has finished, 2 for bad input.
    """
    module = sys.modules[make_node.__module__]
    name = (Path(sys.argv[0]).stem if module.__name__ == "__main__" else module.__name__).rpartition(".")[2]
    sys.setswitchinterval(_SWITCH_S)
    return_memory()
    try:
        rclpy.init(args=sys.argv, signal_handler_options=SignalHandlerOptions.NO)
    except RuntimeError as error:  # rclpy's own are its children
        sys.exit(_without_ros(error))
    executor = make_executor()
    stopping = False

    def stop(_signal: int, _frame: FrameType | None) -> None:
        nonlocal stopping
        stopping = True
        executor.wake()

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, stop)
    node = None
    code = 0
    log = CoreLog()
    try:
        if name in NODES:
            check_arguments(sys.argv, name)
        node = make_node()
        log.follow(node)
        executor.add_node(node)
        while not stopping and rclpy.ok() and not getattr(node, "finished", False):
            _spin(node, executor, 0.5)
        _leave(node, executor)
    except SoilmoistError as error:
        print(printable(str(error)), file=sys.stderr, flush=True)
        code = BAD_INPUT
    except (RuntimeError, ValueError) as error:
        # What rclpy raises for an action without permission is a ValueError; its other class is private.
        of_rclpy = any(kind.__name__ == "RCLError" for kind in type(error).__mro__)
        if not (of_rclpy or (isinstance(error, ValueError) and _secured())):
            raise
        code = _without_ros(error)
    finally:
        close = getattr(node, "close", None)
        if close is not None:
            close()
        log.close()
        if node is not None and rclpy.ok():
            _deliver(node)
        executor.shutdown(timeout_sec=2.0)
        if node is not None:
            node.destroy_node()
        rclpy.try_shutdown()
    sys.exit(code)


# Command line ----------------------------------------------------------------------------------------------------


def check_arguments(arguments: Sequence[str], node: str) -> None:
    """Refuse arguments before ``--ros-args``, which ROS ignores, or takes for old rules of names."""
    names = {row.name for row in table_of(node)}
    for word in takewhile(lambda word: word != "--ros-args", arguments[1:]):
        if ":=" in word and word.partition(":=")[0] not in names:
            continue
        example = f"-p {word}" if ":=" in word else "-p NAME:=VALUE"
        raise InputError(
            f"{node} has no argument {word!r}",
            f"a parameter is given as: {node} --ros-args {example}; config/{node}.yaml lists them",
        )


# Log and memory --------------------------------------------------------------------------------------------------


class CoreLog(logging.Handler):
    """Passes what this package says through :mod:`logging` to the logger of a node."""

    def __init__(self) -> None:
        super().__init__(logging.INFO)
        self._ros = get_logger("soilmoist_ros")
        self._core = logging.getLogger("soilmoist_ros")
        self._core.setLevel(logging.INFO)
        self._core.addHandler(self)

    def follow(self, node: Node) -> None:
        """Use the logger of a node, once it is made."""
        self._ros = node.get_logger()

    def emit(self, record: logging.LogRecord) -> None:
        """Log a message, with its traceback if it has one."""
        text = printable(self.format(record))
        if record.levelno >= logging.ERROR:
            self._ros.error(text)
        elif record.levelno >= logging.WARNING:
            self._ros.warning(text)
        else:
            self._ros.info(text)

    def close(self) -> None:
        """Stop."""
        self._core.removeHandler(self)
        super().close()


def return_memory() -> bool:
    """Return memory that was freed to the system; returns whether the C library can.

    The GNU C library raises both limits with each large array that is freed, up to 32 and 64 MB. Each thread has a
    heap of its own, so a process whose threads compute maps and draw reports would grow by up to 64 MB for each.
    """
    change = getattr(ctypes.CDLL(None), "mallopt", lambda *_: 0)
    return bool(change(_TRIM_THRESHOLD, _KEPT_BYTES) and change(_MMAP_THRESHOLD, _MAPPED_BYTES))


# Work outside the callbacks: services that take long, and what other threads ask for ----------------------------


class Aside:
    """Does long work in a thread, one piece after the other.

    Executors of one thread send the answer of a service when its callback returns. Here the answer waits for the
    work. Work that fails is logged; the next piece follows.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self._thread = ThreadPoolExecutor(1, "aside")

    def offer(self, kind: Any, name: str, work: Callable[[Any, Any], Any]) -> None:
        """Offer a service.

        :param work: called in the thread with request and response; returns the response. If it fails, the answer
            is an empty response, with ``success`` false and the error as ``message`` if the class has these fields
        """
        service = self._node.create_service(kind, name, lambda request, response: (request, response))
        send = service.send_response

        def reply(both: tuple[Any, Any], header: Any) -> None:
            try:
                response = work(*both)
            except Exception as error:  # the client gets an answer
                self._log_failure(name)
                response = kind.Response()
                if hasattr(response, "success") and hasattr(response, "message"):
                    response.success, response.message = False, f"{type(error).__name__}: {error}"
            send(response, header)

        service.send_response = lambda both, header: self.do(lambda: reply(both, header), name)

    def do(self, work: Callable[[], object], name: str = "work") -> None:
        """Do something that nobody waits for."""
        self._thread.submit(self._attempt, work, name)

    def close(self) -> None:
        """Wait for what is being done; the rest is left out."""
        self._thread.shutdown(cancel_futures=True)

    def _attempt(self, work: Callable[[], object], name: str) -> None:
        try:
            work()
        except Exception:  # nobody looks at the result of the thread
            self._log_failure(name)

    def _log_failure(self, name: str) -> None:
        self._node.get_logger().error(f"{name} failed; the node continues\n{traceback.format_exc()}")


# Callbacks that other threads ask for ---------------------------------------------------------------------------


class Soon:
    """Has the executor of a node call a function once soon, however often it was asked meanwhile.

    It replaces a guard condition, which the executor of events does not know. Before the node has an executor,
    :meth:`ask` does nothing.
    """

    def __init__(self, node: Node, callback: Callable[[], object]) -> None:
        self._node = node
        self._callback = callback
        self._asked = False

    def ask(self) -> None:
        """Have the function called; from any thread."""
        executor = self._node.executor
        if executor is not None and not self._asked:
            self._asked = True
            executor.create_task(self._call)

    def _call(self) -> None:
        self._asked = False
        self._callback()

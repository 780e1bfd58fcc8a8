# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Work outside the callbacks: services that take long, and what other threads ask for."""

from __future__ import annotations

import traceback
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

from rclpy.node import Node


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
                response = _failure(kind.Response(), error)
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


def _failure(response: Any, error: Exception) -> Any:
    if hasattr(response, "success") and hasattr(response, "message"):
        response.success, response.message = False, f"{type(error).__name__}: {error}"
    return response


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

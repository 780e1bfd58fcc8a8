"""Services whose work takes long, such as saving files: the node's callbacks go on meanwhile."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

from rclpy.node import Node


class Aside:
    """Does long work in a thread, one piece after the other.

    Executors of one thread send the answer of a service when its callback returns. Here the answer waits for the
    work.

    :param node: the node that offers the services
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self._thread = ThreadPoolExecutor(1, "aside")

    def offer(self, kind: Any, name: str, work: Callable[[Any, Any], Any]) -> None:
        """Offer a service.

        :param kind: class of the service
        :param name: its name
        :param work: called in the thread with request and response; returns the response
        """
        service = self._node.create_service(kind, name, lambda request, response: (request, response))
        send = service.send_response

        def answer(both: tuple[Any, Any], header: Any) -> None:
            self._thread.submit(lambda: send(work(*both), header))

        service.send_response = answer

    def do(self, work: Callable[[], object]) -> None:
        """Do something that nobody waits for; it raises nothing."""
        self._thread.submit(work)

    def close(self) -> None:
        """Wait for what is being done; the rest is left out."""
        self._thread.shutdown(cancel_futures=True)

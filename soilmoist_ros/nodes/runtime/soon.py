# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Callbacks that other threads ask for."""

from __future__ import annotations

from collections.abc import Callable

from rclpy.node import Node


class Soon:
    """Has the executor of a node call a function once soon, however often it was asked meanwhile.

    It replaces a guard condition, which the executor of events does not know. Before the node has an executor,
    :meth:`ask` does nothing.

    :param node: the node
    :param callback: the function
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

# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Messages of the folders without ROS in the log of a node: on the terminal, in ``/rosout`` and in recordings."""

from __future__ import annotations

import logging

from rclpy.logging import get_logger
from rclpy.node import Node

from soilmoist_ros.foundation import printable


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

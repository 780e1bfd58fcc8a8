# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Reacts to the space bar while a command runs in a terminal."""

from __future__ import annotations

import os
import select
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def on_space(call: Callable[[], None]) -> Iterator[None]:
    """Call a function in a thread each time the space bar is pressed; without a terminal, do nothing."""
    if sys.stdin is None or not sys.stdin.isatty():
        yield
        return
    import termios
    import tty

    descriptor = sys.stdin.fileno()
    before = termios.tcgetattr(descriptor)
    ending = threading.Event()

    def listen() -> None:
        while not ending.is_set():
            if select.select([descriptor], [], [], 0.1)[0]:
                pressed = os.read(descriptor, 1)
                if pressed == b" ":
                    call()
                elif not pressed:  # the terminal is closed
                    return

    thread = threading.Thread(target=listen, daemon=True)
    tty.setcbreak(descriptor)
    thread.start()
    try:
        yield
    finally:
        ending.set()
        thread.join()
        termios.tcsetattr(descriptor, termios.TCSADRAIN, before)

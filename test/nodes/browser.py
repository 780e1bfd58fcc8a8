# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A real browser for tests of the operator's page: Debian's Chromium, without window and internet."""

from __future__ import annotations

import contextlib
import shutil
import socket
import threading
import time
from collections.abc import Iterator
from typing import Any

import pytest

FLAGS = ("--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking")
SLIDE_S = 180.0
"""Longest time for a slide [s]; on a busy machine a try takes seconds, and the page is drawn anew meanwhile."""
UNDER_FINGER = """([x, y]) => {
    const there = document.elementFromPoint(x, y), state = document.getElementById("state");
    return `${there?.outerHTML.slice(0, 200)} at (${x}, ${y}); ${state?.innerText}`;
}"""
STATE = """knob => {
    const {x, y} = knob.getBoundingClientRect(), focus = document.activeElement;
    const name = focus === knob ? "it" : focus?.outerHTML.slice(0, 80);
    return `now at (${x}, ${y}) with value ${knob.value}, and ${name} has the focus`;
}"""
PHONE, DESK = {"width": 390, "height": 844}, {"width": 1280, "height": 800}


@contextlib.contextmanager
def chromium() -> Iterator[Any]:
    """The browser; the test is skipped where there is none, and says so."""
    path = shutil.which("chromium")
    if path is None:
        pytest.skip("there is no chromium: apt-get install chromium")
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=[*FLAGS])
        try:
            yield browser
        finally:
            browser.close()


def tap(page: Any, x_m: float, y_m: float) -> None:
    """Tap a place of the field [m]."""
    canvas = page.locator("#map")
    east_m, north_m, scale = map(float, canvas.get_attribute("data-view").split())
    box = canvas.bounding_box()
    x, y = box["width"] / 2 + (x_m - east_m) * scale, box["height"] / 2 - (y_m - north_m) * scale
    canvas.click(position={"x": x, "y": y})


class Link:
    """A link to a server on this machine that can be lost and found again. Use as a context manager.

    :param port: port of the server
    """

    def __init__(self, port: int) -> None:
        self._target = port
        self._server = socket.create_server(("127.0.0.1", 0))
        self.port = self._server.getsockname()[1]
        self.is_lost = self._ended = False
        self._open: set[socket.socket] = set()

    def __enter__(self) -> Link:
        threading.Thread(target=self._accept, daemon=True).start()
        return self

    def __exit__(self, *exception: object) -> None:
        self._ended = True
        self.lose()
        with contextlib.suppress(OSError):
            self._server.shutdown(socket.SHUT_RDWR)
        self._server.close()

    def lose(self) -> None:
        self.is_lost = True
        for one in tuple(self._open):
            with contextlib.suppress(OSError):
                one.shutdown(socket.SHUT_RDWR)

    def find(self) -> None:
        self.is_lost = False

    def _accept(self) -> None:
        while True:
            try:
                near, _ = self._server.accept()
                far = socket.create_connection(("127.0.0.1", self._target))
            except OSError:
                if self._ended:
                    return
                continue
            if self.is_lost:
                near.close(), far.close()
                continue
            self._open |= {near, far}
            for one, other in ((near, far), (far, near)):
                threading.Thread(target=self._pass, args=(one, other), daemon=True).start()

    def _pass(self, one: socket.socket, other: socket.socket) -> None:
        with contextlib.suppress(OSError):
            while data := one.recv(65536):
                other.sendall(data)
        for each in (one, other):
            with contextlib.suppress(OSError):
                each.shutdown(socket.SHUT_RDWR)
            each.close()
            self._open.discard(each)


def slide(page: Any, text: str) -> None:
    """Move a slide to its end, as a finger does that tries again when the page has moved under it."""
    from playwright.sync_api import Error

    knob = page.locator(f'.slide[data-slide^="{text}"] input:visible')
    deadline, tries, missed = time.monotonic() + SLIDE_S, 0, ""
    while time.monotonic() < deadline:
        tries += 1
        try:
            knob.evaluate("knob => knob.scrollIntoView({block: 'center'})")  # STOP covers the edge of a phone
            if (box := knob.bounding_box()) is not None:
                x, y = box["x"] + 28, box["y"] + box["height"] / 2
                page.mouse.move(x, y)
                page.mouse.down()
                if knob.evaluate("knob => knob === document.activeElement"):
                    page.mouse.move(box["x"] + box["width"] / 2, y)
                    page.mouse.move(box["x"] + box["width"] - 4, y)
                    if knob.evaluate("knob => Number(knob.value)") >= 95:
                        page.mouse.up()
                        return
                what = f"{box} when it was pressed, {knob.evaluate(STATE, timeout=1000)}"
                missed = f"{what}, {page.evaluate(UNDER_FINGER, [x, y])}"
        except Error as error:  # the page has just been drawn anew, with another slide
            missed = str(error)
        page.mouse.move(1, 1)  # what the finger came upon is not clicked
        page.mouse.up()
        page.wait_for_timeout(100)
    raise AssertionError(
        f"no finger moves the slide {text!r} to its end in {tries} tries, at last because of: {missed}"
    )

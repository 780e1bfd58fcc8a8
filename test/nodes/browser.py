"""A real browser for tests of the operator's page: Debian's Chromium, without window and internet."""

from __future__ import annotations

import contextlib
import shutil
from collections.abc import Iterator
from typing import Any

import pytest

FLAGS = (
    "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
)  # fmt: skip
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


def slide(page: Any, text: str) -> None:
    """Move a slide to its end, as a finger does."""
    from playwright.sync_api import Error

    knob = page.locator(f'.slide[data-slide^="{text}"] input')
    for _ in range(5):
        try:
            knob.scroll_into_view_if_needed()
            if (box := knob.bounding_box()) is not None:
                break
        except Error:  # the page has just been drawn anew, with another slide
            continue
    y = box["y"] + box["height"] / 2
    page.mouse.move(box["x"] + 28, y)
    page.mouse.down()
    page.mouse.move(box["x"] + box["width"] / 2, y)
    page.mouse.move(box["x"] + box["width"] - 4, y)
    page.mouse.up()

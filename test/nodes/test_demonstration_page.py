# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A whole demonstration, as its operators see it: the command on a terminal, real nodes, a real browser."""

from __future__ import annotations

import contextlib
import os
import pty
import re
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

pytest.importorskip("rclpy")
sys.path.insert(0, str(Path(__file__).resolve().parent))
from browser import DESK, PHONE, Link, chromium, slide, tap
from playwright.sync_api import expect

from soilmoist_ros.recording.bag.reader import BagReader

pytestmark = [pytest.mark.slow, pytest.mark.process]
LIMIT_S = 180.0


class Terminal:
    """A command on a terminal. Use as a context manager; its processes end with it."""

    def __init__(self, command):
        self._here, there = pty.openpty()
        self.process = subprocess.Popen(
            command, stdin=there, stdout=there, stderr=there, start_new_session=True,
            env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
        )  # fmt: skip
        os.close(there)
        self.output = ""
        threading.Thread(target=self._read, daemon=True).start()

    def __enter__(self):
        return self

    def __exit__(self, *exception):
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)
            with contextlib.suppress(subprocess.TimeoutExpired):
                self.process.wait(LIMIT_S)
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self.process.pid, signal.SIGKILL)
        os.close(self._here)

    def _read(self):
        with contextlib.suppress(OSError):
            while data := os.read(self._here, 65536):
                self.output += data.decode(errors="replace")

    def wait_for(self, pattern):
        deadline = time.monotonic() + LIMIT_S
        while time.monotonic() < deadline:
            if found := re.search(pattern, self.output):
                return found
            assert self.process.poll() is None, self.output
            time.sleep(0.05)
        raise AssertionError(f"waited for {pattern}:\n{self.output[-3000:]}")


@pytest.fixture(scope="module")
def browser():
    with chromium() as made:
        yield made


class Seen:
    """A page."""

    def __init__(self, browser, port, size=PHONE, name=""):
        context = browser.new_context(viewport=size, accept_downloads=True)
        context.set_default_timeout(LIMIT_S * 1000)
        self.page, self.errors = context.new_page(), []
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))
        self.page.goto(f"http://127.0.0.1:{port}/")
        if name:
            self.page.get_by_label("Your name, for the journal").fill(name)
            self.page.keyboard.press("Tab")

    def shows(self, name, text):
        expect(self.page.locator(f"#{name}")).to_contain_text(text, timeout=LIMIT_S * 1000)

    def open(self, tab):
        self.page.get_by_role("button", name=tab, exact=True).click()

    def stops(self):
        return int(self.page.locator("#stops").inner_text())

    def wait(self, condition):
        deadline = time.monotonic() + LIMIT_S
        while not condition():
            assert time.monotonic() < deadline
            self.page.wait_for_timeout(100)

    def slide_until(self, text):
        """Slide until it is done, and return what is said: thirty seconds without a place pass in one.

        A busy machine may be without a place for that long, and a planner without a place refuses.
        """
        deadline, said = time.monotonic() + LIMIT_S, "Not done"
        while "Not done" in said:
            assert time.monotonic() < deadline, said
            self.page.evaluate("document.getElementById('notice').textContent = ''")
            slide(self.page, text)
            self.wait(lambda: self.page.locator("#notice").inner_text())
            said = self.page.locator("#notice").inner_text()
            if "Not done" in said:
                self.page.wait_for_timeout(1000)
        return said

    def download(self, name, folder):
        with self.page.expect_download() as found:
            self.page.get_by_role("link", name=name, exact=True).first.click()
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        found.value.save_as(path)
        return path


def test_a_demonstration_from_start_to_download(tmp_path, browser):
    out = tmp_path / "runs" / "run"
    command = [sys.executable, "-m", "soilmoist_ros.cli.main", "demo", "--no-autostart", "--strategy", "ivr"]
    with Terminal([*command, "--hours", "4", "--time-factor", "30", "--out", str(out)]) as demo:
        port = int(demo.wait_for(r"console +http://127\.0\.0\.1:(\d+)/")[1])
        with Link(port) as link:
            ada, bo = Seen(browser, link.port, PHONE, "Ada"), Seen(browser, port, DESK, "Bo")
            start_and_redirect(ada, bo)
            lose_the_link(ada, bo, link)
            pause_and_resume(ada, bo)
            stop_without_a_link(ada, bo, link)
            go_home(ada)
            bo.shows("headline", "Finished: ")
            bo.shows("reason", "the robot was sent home")
            bo.shows("actions", "Open the report")
            demo.wait_for("stays until Ctrl-C")
            bag, summary = take_home(ada, tmp_path / "home")
            assert [ada.errors, bo.errors] == [[], []]
    assert demo.process.returncode == 0
    assert summary.stat().st_size > 1000
    with BagReader(bag.parent) as reader:
        said = [reader.decode(message).message for message in reader.messages(["/mission"])]
    assert any("Ada" in text for text in said), "the bag says who gave commands"
    left = subprocess.run(["ps", "-o", "args=", "-s", str(demo.process.pid)], capture_output=True, text=True)
    assert left.stdout.strip() == "", "no process is left"


def start_and_redirect(ada, bo):
    ada.shows("headline", "Ready")
    ada.slide_until("Slide to start")
    bo.shows("actions", "Ada has the controls")
    ada.shows("legend", "Soil moisture")
    tap(ada.page, 30.0, 25.0)
    ada.shows("place-value", "% by volume")
    slide(ada.page, "Slide: measure at ")
    ada.shows("last-command", "measure by Ada")
    bo.shows("last-command", "measure by Ada")


def lose_the_link(ada, bo, link):
    """The mission goes on without the operator, who sees where it is when the link is back, and after a reload."""
    link.lose()
    ada.shows("link", "connection lost")
    ada.shows("alarm", "The robot goes on by itself")
    before = bo.stops()
    bo.wait(lambda: bo.stops() > before)
    link.find()
    ada.shows("link", "live")
    ada.wait(lambda: ada.stops() > before)
    ada.page.reload()
    ada.shows("link", "live")
    expect(ada.page.get_by_role("button", name="Pause")).to_be_visible(timeout=LIMIT_S * 1000)


def pause_and_resume(ada, bo):
    ada.page.get_by_role("button", name="Pause").click()
    bo.shows("headline", "Paused")
    bo.shows("reason", "Ada")
    ada.slide_until("Slide to resume")
    expect(ada.page.get_by_role("button", name="Pause")).to_be_visible(timeout=LIMIT_S * 1000)


def stop_without_a_link(ada, bo, link):
    """The page says loudly that the stop has not arrived, and presses it when the link is back."""
    link.lose()
    ada.page.locator("#stop").click()
    ada.shows("alarm", "STOP WAS NOT ACKNOWLEDGED")
    expect(bo.page.locator("#stop")).to_have_text("STOP", timeout=LIMIT_S * 1000)
    link.find()
    bo.shows("stop", "STOP is pressed")
    ada.shows("reason", "The robot stands")
    expect(ada.page.locator("#alarm")).to_be_hidden(timeout=LIMIT_S * 1000)
    slide(ada.page, "Slide to release STOP")
    ada.slide_until("Slide to resume")
    expect(ada.page.get_by_role("button", name="Pause")).to_be_visible(timeout=LIMIT_S * 1000)


def go_home(ada):
    ada.shows("actions", "there is no home")
    ada.page.get_by_role("button", name="Home is where it started").click()
    ada.shows("last-command", "home r")
    ada.wait(lambda: "changed" in ada.page.locator("#notice").inner_text())
    assert "sent home by Ada" in ada.slide_until("Slide to drive home and end")


def take_home(ada, folder):
    ada.open("Results")
    ada.page.get_by_role("button", name="Reload").click()
    expect(ada.page.get_by_role("link", name="Open the map page")).to_be_visible(timeout=LIMIT_S * 1000)
    ada.page.locator("#runs summary").first.click()
    bag = ada.download("bag/bag_0.mcap", folder)
    ada.download("bag/metadata.yaml", folder)
    ada.download("map.tif", folder)
    return bag, ada.download("summary.json", folder)

#!/usr/bin/env python3
# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Cost of the operator's page: bytes and time until the first map on a slow link, CPU and memory of its node.

A demonstration runs; Chromium (apt-get install chromium) looks on. The link has 1 Mbit/s and a latency of 100 ms.

usage: .venv/bin/python scripts/bench_console.py [--time-factor 1] [--viewers 3] [--seconds 30]
       [--save]
"""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any

import psutil
import results
from playwright.sync_api import sync_playwright

FLAGS = ("--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking")
LINK = {"offline": False, "latency": 100, "downloadThroughput": 125_000, "uploadThroughput": 125_000}
LIMIT_S = 180.0


@contextmanager
def demo(time_factor: float) -> Iterator[tuple[str, psutil.Process]]:
    """Address of the page, and the process of the console, of a demonstration with a map."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "soilmoist_ros.cli.main", "demo", "--exit", "--hours", "8"]
        process = subprocess.Popen(
            [*command, "--time-factor", str(time_factor), "--out", f"{folder}/run"],
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, start_new_session=True,
            env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
        )  # fmt: skip
        assert process.stdout is not None
        try:
            address = process.stdout.readline().removeprefix("console").strip()
            deadline = time.monotonic() + LIMIT_S
            while True:
                with suppress(OSError), urllib.request.urlopen(f"{address}map/rate.png", timeout=10):
                    break
                if time.monotonic() > deadline:
                    raise SystemExit("there is no map")
                time.sleep(1.0)
            children = psutil.Process(process.pid).children(recursive=True)
            yield address, next(child for child in children if "soilmoist_ros.nodes.console" in child.cmdline())
        finally:
            process.send_signal(signal.SIGINT)
            process.communicate(timeout=120)


def first_map(browser: Any, address: str) -> tuple[float, int]:
    """Time until the first map is shown on the slow link [s], and bytes received by then."""
    page = browser.new_context().new_page()
    session = page.context.new_cdp_session(page)
    received: list[int] = []
    session.on("Network.loadingFinished", lambda event: received.append(event["encodedDataLength"]))
    session.on(
        "Network.webSocketFrameReceived", lambda event: received.append(len(event["response"]["payloadData"]))
    )
    session.send("Network.enable")
    session.send("Network.emulateNetworkConditions", LINK)
    began = time.perf_counter()
    with page.expect_event("requestfinished", lambda request: "/map/" in request.url, timeout=60_000):
        page.goto(address)
    taken_s = time.perf_counter() - began
    page.context.close()
    return taken_s, int(sum(received))


def main() -> None:
    parser = results.parser(__doc__)
    parser.add_argument("--time-factor", type=float, default=1.0)
    parser.add_argument("--viewers", type=int, default=3)
    parser.add_argument("--seconds", type=float, default=30.0)
    given = parser.parse_args()
    path = shutil.which("chromium")
    if path is None:
        raise SystemExit("there is no chromium: apt-get install chromium")
    with demo(given.time_factor) as (address, node), sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=[*FLAGS])
        taken_s, size = first_map(browser, address)
        rows = [("time to the first map", f"{taken_s:.1f} s"), ("bytes to the first map", f"{size / 1e3:.0f} kB")]
        pages = []
        for number in range(given.viewers + 1):
            before, began = sum(node.cpu_times()[:2]), time.monotonic()
            time.sleep(given.seconds)
            share = (sum(node.cpu_times()[:2]) - before) / (time.monotonic() - began)
            rows.append(
                (f"{number} viewers", f"{100 * share:.1f} % of a core, {node.memory_info().rss / 1e6:.0f} MB")
            )
            pages.append(browser.new_context().new_page())
            pages[-1].goto(address)
        browser.close()
    settings = "a link of 1 Mbit/s with a latency of 100 ms to the first map, frames of the socket uncompressed"
    columns = ("the operator's page", f"{given.time_factor:g} times real time")
    results.publish(f"console_{given.time_factor:g}", columns, rows, settings, given.save)


if __name__ == "__main__":
    main()

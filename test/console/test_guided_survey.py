# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``soilmoist guide`` as a process (guide_page.py), with real sockets: a person follows the page; kill -9."""

from __future__ import annotations

import json
import os
import random
import re
import signal
import subprocess
import sys
import time
from contextlib import contextmanager

import numpy as np
import pytest

pytest.importorskip("aiohttp")
from browser import PHONE, chromium
from simulated_person import PageAdvice, SimulatedPerson

from soilmoist_ros.console.guided_survey import elsewhere
from soilmoist_ros.mapping import load_field
from soilmoist_ros.recording import BagReader, read_records
from soilmoist_ros.simulation import MissionSettings, surrogate_field

SETTINGS = MissionSettings(
    "patches", speed_mps=6.0, stop_overhead_s=0.5, cadence_s=1.0, position_sd_m=0.05, seed=3
)
COMMAND = (sys.executable, "-m", "soilmoist_ros.cli.main")
LIMIT_S = 240.0
KILLS = int(os.environ.get("GUIDE_KILLS", "1"))
pytestmark = [pytest.mark.slow, pytest.mark.process]


@contextmanager
def guided(person, out, *more, field=("--field", "patches")):
    process = subprocess.Popen(
        [*COMMAND, "guide", *field, "--logger-uri", person.uri("logger"), "--gnss-uri",
         person.uri("gnss"), "--dwell", "fmi:3", "--min-dwell", "1", "--speed", "6", "--stop-overhead", "1",
         "--exit", "--port", "0", "--out", str(out), *more],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    try:
        yield process, PageAdvice(process.stdout.readline().split()[1])
    finally:
        process.kill()
        process.communicate()


def until(what):
    end_s = time.monotonic() + LIMIT_S
    while not what():
        assert time.monotonic() < end_s
        time.sleep(0.1)


def raster(path):
    import rasterio

    with rasterio.open(path) as file:
        return file.read()


def test_a_killed_survey_goes_on_and_its_map_holds_every_record(tmp_path):
    """Killed at random moments, ``GUIDE_KILLS`` times; the counts that the page had shown are stored by then."""
    pages, out, moment = [], tmp_path / "out", random.Random(KILLS)
    hours = str(0.02 + 0.001 * (KILLS - 1))
    asked = ("--hours", hours, "--autostart", "--sensor", "10", "--target", "decision", "--threshold", "0.15")
    with SimulatedPerson(SETTINGS, lambda: pages and pages[-1]()) as person:
        for kill in range(KILLS):
            with guided(person, out, *asked) as (process, page):
                pages.append(page)
                if not kill:
                    until(lambda page=page: page.sections.get("mission/", {}).get("stops", 0) >= 1)
                    assert page.sections["mission/"]["settings"]["targets"] == ["rate", "vwc", "decision"]
                time.sleep(moment.uniform(0.0, 4.0) if kill else 0.0)
                shown = page.counted
                process.kill()
                process.wait()
            journal = (out / "records" / "sensor_driver" / "journal.jsonl").read_text()
            kept = sum(map(int, re.findall(r'"raw_counts":(\d+)', journal)))
            assert shown <= kept
        with guided(person, out, *asked) as (process, page):
            pages.append(page)
            until(lambda: process.poll() is not None)
            said, errors = process.communicate()
            assert process.returncode == 0, errors
    assert "bit for bit" in said
    about = json.loads((out / "summary.json").read_text())
    assert about["calibration"]["method"] == "general", "by the sensor of the option"
    assert about["decision"]["thresholds"] == [0.15]
    stored = (out / "records" / "sensor_driver" / "journal.jsonl").read_text().count('"record"')
    with BagReader(out / "bag") as reader:
        assert len(reader.read_counts()) == stored == len(read_records(out / "records.csv"))
        used_s = [float({v.key: v.value for v in reader.decode(m).values}["time_used_s"])
                  for m in reader.messages(["/mission"])]  # fmt: skip
    assert max(used_s) >= 72.0
    assert sorted(used_s) == used_s, "one mission"


def test_a_border_is_refused_walked_and_surveyed_also_after_a_restart(tmp_path):
    """On a phone, without a field file; the walk is a square of 20 m."""
    out, corners = tmp_path / "out", [(20.0, 20.0), (40.0, 20.0), (40.0, 40.0), (20.0, 40.0), (20.0, 20.0)]
    ways, pages, frame = [corners[0]], [], surrogate_field("patches").field.frame

    def target():
        if pages:  # in metres about another datum
            stop, drawn = pages[0](), load_field(out / "field.yaml").frame
            place = stop and frame.to_local(*drawn.to_geographic(np.array(stop))[0])[0]
            return stop and tuple(place.tolist())
        if len(ways) > 1 and np.hypot(*np.subtract(person.place, ways[0])) < 0.5:
            ways.pop(0)
        return ways[0]

    with chromium() as browser, SimulatedPerson(SETTINGS, target) as person:
        with guided(person, out, "--hours", "0.02", field=()) as (process, advice):
            page = browser.new_page(viewport=PHONE)
            page.set_default_timeout(1000 * LIMIT_S)
            page.goto(advice.address)
            until(lambda: np.hypot(*np.subtract(person.place, corners[0])) < 0.5)
            page.get_by_role("button", name="Tap the corners").click()
            box = page.locator("#map").bounding_box()
            for x, y in ((0.2, 0.2), (0.7, 0.6), (0.7, 0.2), (0.2, 0.6)):
                page.locator("#map").click(position={"x": x * box["width"], "y": y * box["height"]})
            page.screenshot(path=tmp_path / "tapped.png")
            page.get_by_role("button", name="Done", exact=True).click()
            page.locator("#notice", has_text="without crossing lines").wait_for()
            assert page.get_by_role("button", name="Use this border").count() == 0
            page.locator("#guide").get_by_role("button", name="Clear").click()
            page.get_by_role("button", name="Walk the border").click()
            ways.extend(corners[1:])
            page.locator("#guide-big", has_text="places").wait_for()
            until(lambda: len(ways) == 1 and np.hypot(*np.subtract(person.place, corners[0])) < 0.5)
            page.screenshot(path=tmp_path / "walk.png")
            page.get_by_role("button", name="Finish the walk").click()
            page.locator("#guide-big", has_text="0.04 ha").wait_for()
            page.screenshot(path=tmp_path / "drawn.png")
            page.get_by_role("button", name="Use this border").click()
            page.get_by_role("button", name="Start the survey").wait_for()
            page.screenshot(path=tmp_path / "ready.png")
            process.kill()
        with guided(person, out, "--hours", "0.02", "--autostart", field=()) as (process, advice):
            pages.append(advice)
            until(lambda: process.poll() is not None)
            said, errors = process.communicate()
            assert process.returncode == 0, errors
    assert "report.html" in said
    assert (out / "visits.csv").read_text().count("\n") > 2, "stops were reached"
    x, y = load_field(out / "field.yaml").polygon.T
    area = 0.5 * abs(np.dot(x, np.roll(y, 1)) - np.dot(y, np.roll(x, 1)))
    assert area == pytest.approx(400.0, rel=0.05)


def test_ctrl_c_before_the_first_record_says_how_to_go_on(tmp_path):
    nobody = "tcp://127.0.0.1:1"
    process = subprocess.Popen(
        [*COMMAND, "guide", "--field", "patches", "--logger-uri", nobody, "--gnss-uri", nobody, "--port", "0",
         "--out", str(tmp_path / "out")],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    page = PageAdvice(process.stdout.readline().split()[1])
    answer = page.ask("start")
    assert (answer["accepted"], answer["message"].split(":")[1]) == (False, " the logger does not answer")
    field = surrogate_field("patches").field
    latitude, longitude = field.centre
    assert elsewhere(field, (latitude, longitude)) == ""
    assert elsewhere(field, (longitude, latitude)).endswith("field; latitude and longitude may be swapped")
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=LIMIT_S)
    assert process.returncode == 130, errors
    assert "no record has a place yet: the same command continues the survey" in errors
    assert "error" not in errors
    assert page.sections["over"], "the page hears of it"


def test_a_phone_is_the_receiver_and_shows_arrow_ring_and_report(tmp_path, monkeypatch):
    """By https, with the certificate that the command makes, without WebSockets: Safari refuses them for it."""
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    pages, faults, asked = [], [], []
    frame = surrogate_field("patches").field.frame
    with (
        chromium() as browser,
        SimulatedPerson(SETTINGS, lambda: pages and pages[0](), ignores=1, wrong_turn=2) as person,
        guided(person, tmp_path / "out", "--hours", "0.025", "--dwell", "fmi:8", "--gnss-uri", "phone:", "--host",
               "127.0.0.2") as (process, advice),
    ):  # fmt: skip
        assert advice.address.startswith("https://127.0.0.2:")
        phone, other = (
            browser.new_context(viewport=PHONE, ignore_https_errors=True, permissions=["geolocation"])
            for _ in range(2)
        )

        def carry(context, accuracy_m=2.0, away_m=0.0):
            place = frame.to_geographic(np.array(person.place) + away_m)[0].tolist()
            context.set_geolocation({"latitude": place[0], "longitude": place[1], "accuracy": accuracy_m})
            page.wait_for_timeout(200)

        def seen(what):
            until(lambda: carry(phone) or what())

        phone.add_init_script("window.WebSocket = class { constructor() { throw new DOMException('no'); } }")
        page = phone.new_page()
        page.on("pageerror", lambda error: faults.append(str(error)))
        page.on("request", lambda request: asked.append(request.url))
        page.goto(advice.address)
        carry(phone, accuracy_m=65.0)
        page.get_by_role("button", name="Use this phone's position").click(timeout=1000 * LIMIT_S)
        page.locator("#guide-alarm", has_text="the phone knows its position within 65 m only").wait_for(
            timeout=1000 * LIMIT_S
        )
        start = page.get_by_role("button", name="Start the survey")
        seen(start.is_visible)
        page.screenshot(path=tmp_path / "ready.png")
        start.click()
        seen(page.locator("#guide .arrow").is_visible)
        assert page.locator("#guide-big").inner_text().endswith(" m")
        assert page.locator("#stop").is_hidden(), "nothing but the person drives"
        second = other.new_page()
        carry(other, away_m=500.0)
        second.goto(advice.address)
        answer = second.evaluate(
            """async () => (await fetch("position", {method: "POST", headers: {"Content-Type": "application/json"},
            body: JSON.stringify({latitude: 1, longitude: 1, accuracy: 1, age_s: 0, client: "b"})})).json()"""
        )
        assert "another phone gives the position" in answer["error"]
        pages.append(advice)
        seen(page.locator("#guide .ring").is_visible)
        seen(page.get_by_text("more: ±").is_visible)
        page.screenshot(path=tmp_path / "ring.png")
        box = page.get_by_role("button", name="Go on now").bounding_box()
        assert box["height"] >= 64, "for a thumb"
        assert box["y"] + box["height"] <= PHONE["height"], "in sight"
        page.get_by_role("button", name="Go on now").click()
        seen(page.locator("#guide .arrow").is_visible)
        seen(lambda: process.poll() is not None)
        said, errors = process.communicate()
        assert process.returncode == 0, errors
        assert not faults
        assert {url.split("/")[2] for url in asked} == {advice.address.split("/")[2]}, "no network but the cart's"
    assert "equals the robot's last one, bit for bit" in said
    assert "the browser warns of the certificate" in errors
    assert (tmp_path / "out" / "report.html").is_file()
    with BagReader(tmp_path / "out" / "bag") as reader:
        lines = [reader.decode(message).data for message in reader.messages(["/raw/gnss"])]
    assert any(line.startswith("$GNGST") and ",1.414," in line for line in lines)
    assert "\nx" in (tmp_path / "out" / "visits.csv").read_text(), "a stop of their own choice"
    again = subprocess.run(
        [*COMMAND, "replay", str(tmp_path / "out"), "--out", str(tmp_path / "again")],
        capture_output=True,
        text=True,
    )
    assert again.returncode == 0, again.stderr
    np.testing.assert_array_equal(raster(tmp_path / "out" / "map.tif"), raster(tmp_path / "again" / "map.tif"))

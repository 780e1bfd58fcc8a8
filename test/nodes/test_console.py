# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The operator's page in a real browser, with the real console and planner."""

from __future__ import annotations

import json
import re
import signal
import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rclpy")
pytest.importorskip("topological_navigation_msgs")
from browser import PHONE, chromium, slide
from playwright.sync_api import expect
from rcl_interfaces.msg import Log
from ros_system import NodeProcess
from sensor_msgs.msg import BatteryState, PointCloud2
from soilmoist_msgs.msg import Mission
from std_msgs.msg import String
from test_commands import Commanded
from virtual_navigation import STOPS, VirtualNavigation, World

from console.test_map_layers import SITE, meadow
from msg_adapters.counts import counts_to_message
from soilmoist_ros.foundation.geodesy import LocalFrame
from soilmoist_ros.nodes.topics import LATCHED, RECORDS, SENSOR
from soilmoist_ros.nodes.topics import VISITS as ROSOUT
from soilmoist_ros.reporting import irrigation

pytestmark = pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
LIMIT_MS = 30_000


class Page:
    """A console process and a page of it."""

    def __init__(self, ros, folder, browser):
        folders = {"field_dir": "fields", "runs": "runs"}
        params = {name: str(folder / its) for name, its in folders.items()}
        self.process = ros.start("console", params={"field": str(folder / "field.yaml"), "port": 0, **params})
        said = ros.wait_for(lambda: re.search(r"console: http://127\.0\.0\.1:(\d+)/", self.process.output()))
        self.port = int(said[1])
        context = browser.new_context(viewport=PHONE)
        context.set_default_timeout(LIMIT_MS)
        self.page = context.new_page()
        self.hosts, self.errors = set(), []
        self.page.on("request", lambda request: self.hosts.add(re.sub(r"^\w+://([^/]*)/.*", r"\1", request.url)))
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))
        self.page.goto(f"http://127.0.0.1:{self.port}/")
        self.page.get_by_label("Your name, for the journal").fill("Ada")
        self.page.keyboard.press("Tab")

    def shows(self, name, text):
        expect(self.page.locator(f"#{name}")).to_contain_text(text, timeout=LIMIT_MS)


@pytest.fixture(scope="module")
def browser():
    with chromium() as made:
        yield made


def test_an_imported_field_is_explored_and_a_stop_without_an_answer_is_said_loudly(ros, tmp_path, browser):
    batteries = ros.node.create_publisher(BatteryState, "battery_state", SENSOR)
    west = LocalFrame(53.268, -0.5245).to_geographic(np.array([[0, 0], [20, 0], [20, 30], [0, 30.0]]))[:, ::-1]
    outline = {"type": "Polygon", "coordinates": [[*west.tolist(), west[0].tolist()]]}
    with World(ros, rate=4.0) as world, VirtualNavigation(ros, world) as navigation:
        planning = Commanded(ros, tmp_path, fix_frozen_s=0.0, hours=1.5)
        planning.wait(lambda status: status.reason == "waiting for start")
        seen = Page(ros, tmp_path, browser)
        page = seen.page
        seen.shows("headline", "Ready")
        page.get_by_role("button", name="Plan").click()
        expect(page.locator("#plan-hours")).to_have_value("1.5", timeout=LIMIT_MS)
        expect(page.locator("#plan-dwell-by")).to_have_value("600", timeout=LIMIT_MS)

        def charged():
            batteries.publish(BatteryState(present=True, percentage=0.8, voltage=48.0))
            page.wait_for_timeout(100)
            return "80 %, 48.0 V" in page.locator("#checks").inner_text()

        ros.wait_for(charged, message="the battery")
        page.locator("#import").set_input_files(
            {"name": "west.geojson", "mimeType": "application/json", "buffer": json.dumps(outline).encode()}
        )
        seen.shows("draft-about", "Drawn: a boundary with 0 no-go areas, 0.06 ha")
        page.locator("#plan-strategy").select_option("random")
        slide(page, "Slide to start with this plan")
        planning.wait_state(lambda state: state.phase == Mission.PHASE_TRAVELLING, "driving")
        assert Path(planning.state.field).parent == tmp_path / "fields"
        assert planning.state.strategy == "random"
        seen.shows("field", "drawn field")
        assert "by Ada" in Path(planning.state.field).read_text()
        ros.wait_for(lambda: len(navigation.goals) > 0)
        assert {stop.name: stop.x_m for stop in STOPS}[navigation.goals[0]] <= 20.1
        page.get_by_role("button", name="Plan", exact=True).click()  # a start leads to the survey
        seen.shows("plan-start", "A mission is under way")
        page.locator("#field-file").select_option("(start)")
        page.get_by_role("button", name="Change the mission to this plan").click()
        seen.shows("notice", "a mission is under way: end it before field can change")
        assert seen.hosts == {f"127.0.0.1:{seen.port}"}, "nothing comes from elsewhere"
        planning.process.stop(signal.SIGKILL)
        seen.shows("link", "last heard")
        page.locator("#stop").click()
        seen.shows("alarm", "no answer from the planner")
        assert seen.errors == []
    assert planning.journalled()[0] == ("start", "Ada")


def test_a_terminal_watches_too(ros, tmp_path):
    with World(ros, rate=4.0) as world, VirtualNavigation(ros, world):
        planning = Commanded(ros, tmp_path)
        module = [sys.executable, "-m", "soilmoist_ros.cli.main"]
        command = [*module, "watch"]
        watching = NodeProcess(command, ros.environment, tmp_path / "watch.txt")
        ros.processes.append(watching)
        ros.wait_for(lambda: "idle: waiting for start" in watching.output())
        planning.accepted("start")
        ros.wait_for(lambda: "travelling: " in watching.output())
    assert watching.stop() == 0


def test_the_token_is_not_published_and_a_map_of_elsewhere_is_named(ros, tmp_path):
    outline = {"datum": {"latitude_deg": -35.0, "longitude_deg": 149.0}, "polygon": [[0, 0], [9, 0], [9, 9]]}
    (tmp_path / "field.yaml").write_text(json.dumps({"name": "far field", **outline}))
    said = ros.collect(Log, "/rosout", ROSOUT)
    params = {"field": str(tmp_path / "field.yaml"), "port": 0, "host": "0.0.0.0"}
    process = ros.start("console", params={**params, "runs": str(tmp_path)})
    token = ros.wait_for(lambda: re.search(r"\?token=([\w-]+) \(once\)", process.output()), message="the token")[1]
    node = {"name": "n1", "pose": {"position": {"x": 1.0, "y": 2.0}}, "edges": []}
    datum = {"datum_latitude": 35.0, "datum_longitude": -31.0}  # on the other side of the earth
    maps = ros.node.create_publisher(String, "/topological_map_2", LATCHED)
    maps.publish(String(data=json.dumps({"meta": datum, "nodes": [{"node": node}]})))
    text = "1 of 1 nodes are on the other side of the earth"
    ros.wait_for(lambda: any(text in one.msg for one in said), message="a later message")
    assert any(one.msg.startswith("console: http://") for one in said)
    assert not any(token in one.msg for one in said), "whoever may look could read it in a recording"
    assert process.stop() == 0


def test_the_page_leads_with_the_dose_of_the_newest_map(ros, tmp_path, browser):
    survey = meadow(tmp_path, SITE)
    files = {name: str(tmp_path / f"{name}.json") for name in ("field", "site")}
    ros.start("mapper", params={**files, "use_sim_time": True, "save_dir": str(tmp_path / "saved")})
    (tmp_path / "field.yaml").write_text((tmp_path / "field.json").read_text())
    seen = Page(ros, tmp_path, browser)
    counts = ros.node.create_publisher(PointCloud2, "counts", RECORDS)
    ros.wait_for(counts.get_subscription_count, message="the mapper")
    expect(seen.page.locator("#dose")).to_be_hidden()
    counts.publish(counts_to_message(survey.map.track))
    run = survey.run(survey.map.snapshot())
    seen.shows("dose", irrigation(run).steps[0])
    seen.page.evaluate("scrollTo(0, 0)")
    seen.page.screenshot(path=str(tmp_path / "dose.png"))
    inside = "e => e.getBoundingClientRect().right <= innerWidth && document.body.scrollWidth <= innerWidth"
    assert seen.page.locator("#dose").evaluate(inside)
    seen.page.get_by_role("button", name="Results").click()
    expect(seen.page.locator("#dose")).to_be_hidden()
    assert seen.errors == []

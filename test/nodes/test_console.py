# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The operator's page in a real browser, with the real console and planner (console.py, console_steering.py)."""

from __future__ import annotations

import asyncio
import json
import re
import signal
import sys
from concurrent.futures import ThreadPoolExecutor
from itertools import groupby
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rclpy")
pytest.importorskip("topological_navigation_msgs")
from aiohttp import ClientSession
from browser import DESK, PHONE, chromium, slide, tap
from playwright.sync_api import expect
from rcl_interfaces.msg import Log
from ros_system import NodeProcess
from sensor_msgs.msg import BatteryState, PointCloud2
from std_msgs.msg import String
from test_commands import Commanded
from virtual_navigation import START_S, STOPS, VirtualNavigation, World

from msg_adapters.environment import battery_to_message
from msg_adapters.point_cloud import points_to_message
from soilmoist_ros.exploration.mission.types import Phase
from soilmoist_ros.foundation.geodesy import LocalFrame
from soilmoist_ros.mapping.soil_map import CELL
from soilmoist_ros.nodes.topics import LATCHED, SENSOR
from soilmoist_ros.nodes.topics import VISITS as ROSOUT

pytestmark = pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
LIMIT_MS = 30_000


class Page:
    """A console process and a page of it."""

    def __init__(self, ros, folder, browser, size=PHONE):
        self.ros, self.field = ros, str(folder / "field.yaml")
        self.port = self.start(0)
        context = browser.new_context(viewport=size)
        context.set_default_timeout(LIMIT_MS)
        self.page = context.new_page()
        self.hosts, self.errors, self.pictures = set(), [], []
        self.page.on("request", lambda request: self.hosts.add(re.sub(r"^\w+://([^/]*)/.*", r"\1", request.url)))
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))
        self.page.on(
            "response", lambda answer: self.pictures.append(answer.status) if "/map/" in answer.url else 0
        )
        self.page.goto(f"http://127.0.0.1:{self.port}/")
        self.page.get_by_label("Your name, for the journal").fill("Ada")
        self.page.keyboard.press("Tab")

    def start(self, port):
        names = {"field_dir": "fields", "covariate_dir": "covariates", "runs": "runs"}
        folders = {name: str(Path(self.field).parent / folder) for name, folder in names.items()}
        self.process = self.ros.start("console", params={"field": self.field, "port": port, **folders})
        said = self.ros.wait_for(lambda: re.search(r"console: http://127\.0\.0\.1:(\d+)/", self.process.output()))
        return int(said[1])

    def shows(self, name, text):
        expect(self.page.locator(f"#{name}")).to_contain_text(text, timeout=LIMIT_MS)


@pytest.fixture(scope="module")
def browser():
    with chromium() as made:
        yield made


def publish_map(ros):
    cells = np.zeros((15, 20), CELL)
    cells["x"], cells["y"] = np.meshgrid(np.arange(1.0, 40.0, 2.0), np.arange(1.0, 30.0, 2.0))
    cells["rate"], cells["rate_sd"] = 4.0 + cells["x"] / 40, 0.25
    for name in ("vwc", "vwc_sd", "vwc_p05", "vwc_p95"):
        cells[name] = np.nan
    publisher = ros.node.create_publisher(PointCloud2, "soil_map", LATCHED)
    publisher.publish(points_to_message(cells, START_S, "map"))
    return publisher


def test_a_mission_is_started_redirected_stopped_and_resumed_on_a_phone(ros, tmp_path, browser):
    with World(ros, rate=4.0) as world, VirtualNavigation(ros, world) as navigation:
        planning = Commanded(ros, tmp_path, fix_frozen_s=0.0)
        maps = publish_map(ros)
        seen = Page(ros, tmp_path, browser)
        page = seen.page
        seen.shows("field", "test field")
        seen.shows("headline", "Ready")
        seen.shows("legend", "Neutron rate")
        ros.wait_for(lambda: (page.wait_for_timeout(50), 200 in seen.pictures)[1], message="the first map")

        slide(page, "Slide to start")
        seen.shows("headline", "Driving to")
        world.rate = 0.5  # it is still on the way when all has been clicked
        tap(page, 15.0, 15.0)
        seen.shows("place-value", "± 0.25 counts/s")
        slide(page, "Slide: measure at n11")
        seen.shows("queue", "n11")
        planning.wait_state(lambda state: state.queue == ("n11",) and world.goal is not None, "the queue")

        world.rate = 4.0
        page.locator("#stop").click()
        seen.shows("headline", "Emergency stop")
        planning.wait_state(lambda state: state.emergency and state.phase is Phase.PAUSED, "the stop")
        ros.wait_for(lambda: world.goal is None, message="the robot to stand")
        seen.shows("reason", "The robot stands")
        goals = len(navigation.goals)

        page.reload()
        seen.shows("headline", "Emergency stop")
        seen.shows("queue", "n11")
        seen.shows("stop", "STOP is pressed")
        assert page.get_by_label("Your name, for the journal").input_value() == "Ada"
        slide(page, "Slide to release STOP")
        seen.shows("headline", "Paused")
        assert (world.goal, len(navigation.goals)) == (None, goals), "a release moves nothing"
        slide(page, "Slide to resume")
        planning.wait_state(lambda state: state.phase is Phase.TRAVELLING, "resumed")
        page.get_by_role("button", name="Pause").click()
        planning.wait_state(lambda state: state.phase is Phase.PAUSED, "paused")
        seen.shows("reason", "Ada")
        assert seen.hosts == {f"127.0.0.1:{seen.port}"}, "nothing comes from elsewhere"
        assert seen.errors == []
        assert maps is not None
    assert seen.process.stop() == 0
    assert planning.process.stop() == 0
    assert [command for command, _ in groupby(planning.journalled())] == [
        (verb, "Ada") for verb in ("start", "measure", "pause", "resume", "pause")
    ]


def test_an_imported_field_is_explored_from_the_next_start_on(ros, tmp_path, browser):
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
            batteries.publish(battery_to_message(0.8, 48.0, START_S))
            page.wait_for_timeout(100)
            return "80 %, 48 V" in page.locator("#checks").inner_text()

        ros.wait_for(charged, message="the battery")
        page.locator("#import").set_input_files(
            {"name": "west.geojson", "mimeType": "application/json", "buffer": json.dumps(outline).encode()}
        )
        seen.shows("draft-about", "Drawn: a boundary with 0 no-go areas, 0.06 ha")
        page.locator("#plan-strategy").select_option("random")
        slide(page, "Slide to start with this plan")
        planning.wait_state(lambda state: state.phase is Phase.TRAVELLING, "driving")
        assert Path(planning.state.field).parent == tmp_path / "fields"
        assert planning.state.strategy == "random"
        seen.shows("field", "drawn field")
        assert "by Ada" in Path(planning.state.field).read_text()
        ros.wait_for(lambda: len(navigation.goals) > 0)
        assert {stop.name: stop.x_m for stop in STOPS}[navigation.goals[0]] <= 20.1
        seen.shows("plan-start", "A mission is under way")
        page.locator("#field-file").select_option("(start)")
        page.get_by_role("button", name="Change the mission to this plan").click()
        seen.shows("notice", "a mission is under way: end it before field can change")
        assert seen.errors == []
    assert planning.process.stop() == 0
    assert planning.journalled()[:2] == [("change", "Ada"), ("start", "Ada")]


def test_a_terminal_watches_too(ros, tmp_path):
    with World(ros, rate=4.0) as world, VirtualNavigation(ros, world):
        planning = Commanded(ros, tmp_path)
        command = [
            sys.executable,
            "-m",
            "soilmoist_ros.cli.main",
            "watch",
            "--field",
            str(tmp_path / "field.yaml"),
        ]
        watching = NodeProcess(command, ros.environment, tmp_path / "watch.txt")
        program = NodeProcess([*command, "--json"], ros.environment, tmp_path / "watch.json")
        ros.processes += [watching, program]
        ros.wait_for(lambda: "idle: waiting for start" in watching.output())
        ros.wait_for(lambda: '"state": "idle"' in program.output())
        planning.accepted("start")
        ros.wait_for(lambda: "travelling: " in watching.output())
        ros.wait_for(lambda: '"state": "travelling"' in program.output())
    assert [watching.stop(), program.stop()] == [0, 0]
    states = [json.loads(line)["robots"][0]["state"] for line in program.output().splitlines()]
    assert [state for state in dict.fromkeys(states) if state][:1] == ["idle"]


def test_a_stop_that_is_not_acknowledged_is_said_loudly_and_tried_until_it_is(ros, tmp_path, browser):
    with World(ros, rate=1.0) as world, VirtualNavigation(ros, world):
        planning = Commanded(ros, tmp_path, autostart=True)
        seen = Page(ros, tmp_path, browser, DESK)
        seen.shows("headline", "Driving to")  # for half a minute
        world.rate = 4.0
        seen.process.stop(signal.SIGKILL)
        seen.shows("link", "connection lost")
        seen.page.locator("#stop").click()
        seen.shows("alarm", "STOP WAS NOT ACKNOWLEDGED")
        assert planning.state.phase in (Phase.TRAVELLING, Phase.COUNTING), "a lost link changes nothing"

        assert seen.start(seen.port) == seen.port
        planning.wait_state(lambda state: state.emergency, "the stop that was tried again")
        seen.shows("headline", "Emergency stop")
        expect(seen.page.locator("#alarm")).to_be_hidden(timeout=LIMIT_MS)
        ros.wait_for(lambda: world.goal is None, message="the robot to stand")

        planning.process.stop(signal.SIGKILL)  # now the planner is lost, and the console is there
        seen.shows("link", "last heard")
        seen.page.locator("#stop").click()
        seen.shows("alarm", "no answer from the planner")
        assert seen.errors == []


def test_the_token_is_printed_and_not_published(ros, tmp_path):
    said = ros.collect(Log, "/rosout", ROSOUT)
    params = {"field": "example", "port": 0, "address": "http://robot.example/", "runs": str(tmp_path)}
    process = ros.start("console", params=params)
    token = ros.wait_for(lambda: re.search(r"\?token=([\w-]+) \(once\)", process.output()), message="the token")[1]
    maps = ros.node.create_publisher(String, "/topological_map_2", LATCHED)
    maps.publish(String(data="no map"))
    ros.wait_for(lambda: any("the map of the navigation" in one.msg for one in said), message="a later message")
    assert any(one.msg == "console: http://robot.example/" for one in said)
    assert not any(token in one.msg for one in said), "whoever may look could read it in a recording"


def test_a_map_of_the_other_side_of_the_earth_is_named_and_the_page_goes_on(ros, tmp_path):
    outline = {"datum": {"latitude_deg": -35.0, "longitude_deg": 149.0}, "polygon": [[0, 0], [9, 0], [9, 9]]}
    (tmp_path / "field.yaml").write_text(json.dumps({"name": "far field", **outline}))
    process = ros.start("console", params={"field": str(tmp_path / "field.yaml"), "port": 0, "runs": "."})
    address = ros.wait_for(lambda: re.search(r"console: (http://\S+)", process.output()))[1]
    node = {"name": "n1", "pose": {"position": {"x": 1.0, "y": 2.0}}, "edges": []}
    datum = {"datum_latitude": 35.0, "datum_longitude": -31.0}
    maps = ros.node.create_publisher(String, "/topological_map_2", LATCHED)
    maps.publish(String(data=json.dumps({"meta": datum, "nodes": [{"node": node}]})))
    ros.wait_for(lambda: "1 of 1 nodes of the navigation's map cannot be used" in process.output())

    async def look():
        async with ClientSession() as session, session.ws_connect(f"{address}live") as viewer:
            shown = (await viewer.receive_json(timeout=LIMIT_MS / 1000))["set"]
            while "nodes" not in shown:  # the log has it before the page
                shown |= (await viewer.receive_json(timeout=LIMIT_MS / 1000))["set"]
            return shown

    with ThreadPoolExecutor(1) as pool:  # a browser of another test has an event loop in this thread
        shown = pool.submit(asyncio.run, look()).result()
    assert (shown["field"]["name"], shown["nodes"]) == ("far field", [])

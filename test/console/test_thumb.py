# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The page under a thumb: what matters is in sight on a phone, and what cannot work says why; without robots."""

from __future__ import annotations

import gzip
import time

import pytest
from browser import DESK, PHONE, Link, slide, tap
from playwright.sync_api import expect
from test_pages import IDLE, LIMIT_MS, barriers, browser, opened, served, shows, wait_for  # noqa: F401

from soilmoist_ros.console import server as module
from soilmoist_ros.exploration.control.operator_request import ReplyCode

pytestmark = [pytest.mark.process, pytest.mark.usefixtures("urgent_jobs")]
UNDER_WAY = IDLE | {
    "reason": "r3c4 is reached", "phase": "counting", "running": True,
    "moving": True, "stop": ["r3c4", 20.0, 20.0], "counts": 900, "error_percent": 3.33, "planned_dwell_s": 90,
    "dwell_s": 60, "used_s": 600, "left_s": 6600, "stops": 7, "distance_m": 410, "ready": True,
    "forecast": {"sd": 0.044, "moisture": False, "end": [6600, 0.028, 0.023, 0.034], "hidden": None},
    "last_command": "", "home_place": None,
}  # fmt: skip
IN_SIGHT = """name => {
    const box = document.getElementById(name).getBoundingClientRect(), stop = innerWidth < 760 ? 72 : 0;
    const beside = box.left >= 0 && box.right <= innerWidth;
    return beside && box.height > 20 && box.top >= 0 && box.bottom < innerHeight - stop + 1;
}"""


def everywhere(page, name):
    """Tabs and scroll positions at which an element is out of sight."""
    hidden = []
    for tab in ("Plan", "Survey", "Results"):
        page.get_by_role("button", name=tab, exact=True).click()
        for share in (0, 0.5, 1):
            page.evaluate("share => scrollTo(0, share * document.documentElement.scrollHeight)", share)
            if not page.evaluate(IN_SIGHT, name):
                hidden.append((tab, share))
        page.evaluate("scrollTo(0, 0)")
    return hidden


@pytest.mark.parametrize("size", [PHONE, DESK], ids=["phone", "desk"])
def test_alarms_are_in_sight_everywhere_and_nothing_is_well_without_a_link(browser, served, size):  # noqa: F811
    served.board.put("mission/r1", UNDER_WAY)
    served.board.put("health", [{"name": "/recorder: disk", "level": 0, "message": "900 GB free"}])
    with Link(served.port) as link:
        page = opened(browser, type("Linked", (), {"port": link.port, "board": served.board}), size)
        shows(page, "well-about", "All well")
        link.lose()
        shows(page, "alarm", "Connection to the console lost")
        assert everywhere(page, "alarm") == []
        page.get_by_role("button", name="Plan", exact=True).click()
        assert page.locator("#checks li[data-level='0']").count() == 0
        page.get_by_role("button", name="Survey", exact=True).click()
        shows(page, "headline", "No connection. Last known: Counting at r3c4")
        expect(page.locator("#state")).to_have_attribute("data-kind", "unknown")
        shows(page, "well-about", "Not known now")
        shows(page, "actions", "No connection: nothing can be asked for")
        assert barriers(page) == ""
        page.locator("#stop").click()
        shows(page, "alarm", "STOP WAS NOT ACKNOWLEDGED")
        shows(page, "alarm", "Use the button on the robot")
        assert everywhere(page, "alarm") == []


def test_a_refusal_is_in_sight_and_what_cannot_work_is_disabled_and_says_why(browser, served):  # noqa: F811
    page = opened(browser, served, PHONE)
    slide(page, "Slide to start")
    shows(page, "notice", "Not done: not now")
    assert everywhere(page, "notice") == []
    page.get_by_role("button", name="Survey", exact=True).click()
    served.board.put("mission/r1", IDLE | {"reason": "waiting for a fix", "ready": False})
    shows(page, "actions", "Slide to start: waiting for a fix")
    expect(page.locator("#actions [data-slide='Slide to start'] input")).to_be_disabled()
    served.board.put("mission/r1", UNDER_WAY | {"stop": None, "phase": "planning"})
    shows(page, "actions", "Slide to drive home and end: there is no home, set it below")
    expect(page.get_by_role("button", name="Skip this stop: no stop is chosen yet")).to_be_disabled()
    expect(page.get_by_role("button", name="Home is where it started: not seen by this page")).to_be_disabled()
    tap(page, -4.0, 20.0)
    shows(page, "place-actions", "measure here: outside the field")
    assert page.locator("#place-actions .slide:not(.off), #place-actions button:enabled").count() == 0
    assert barriers(page) == ""


def test_an_area_is_ruled_out_listed_and_lifted_and_home_is_set(browser, served):  # noqa: F811
    served.robots.code = ReplyCode.ACCEPTED
    served.board.put("mission/r1", UNDER_WAY)
    served.board.put("start/r1", [3.0, 4.0])
    page = opened(browser, served, PHONE)
    page.evaluate("scrollTo(0, 0)")
    tap(page, 20.0, 20.0)
    slide(page, "Slide: rule this area out")
    page.get_by_role("button", name="Undo").click()
    asked = wait_for(lambda: [one for one in served.robots.requests if one.verb == "lift"])
    (ruled,) = (one for one in served.robots.requests if one.verb == "rule_out")
    assert asked[0].polygon == ruled.polygon
    served.board.put("ruled_out/r1", [[[10, 10], [22, 10], [22, 20]]])
    shows(page, "ruled", "1: 12 m across")
    page.get_by_role("button", name="Lift").click()
    wait_for(lambda: served.robots.requests[-1].polygon == ((10.0, 10.0), (22.0, 10.0), (22.0, 20.0)))
    page.get_by_role("button", name="Home is where it started").click()
    wait_for(lambda: served.robots.requests[-1].place == (3.0, 4.0))
    page.get_by_role("button", name="Tap home on the map").click()
    assert [page.evaluate(IN_SIGHT, name) for name in ("map", "mapbar")] == [True, True]
    tap(page, 30.0, 20.0)
    wait_for(lambda: served.robots.requests[-1].place and abs(served.robots.requests[-1].place[0] - 30.0) < 1.0)
    expect(page.locator("#mapbar")).to_be_hidden()
    tap(page, 15.0, 15.0)
    assert [page.evaluate(IN_SIGHT, name) for name in ("mapview", "place-value")] == [True, True], (
        "this place and where it is"
    )
    page.get_by_role("button", name="Make this place home").click()
    wait_for(lambda: abs(served.robots.requests[-1].place[0] - 15.0) < 1.0)


def test_the_map_stays_in_view_while_corners_are_tapped(browser, served):  # noqa: F811
    page = opened(browser, served, PHONE, "#plan")
    page.get_by_role("button", name="Draw boundary").click()
    expect(page.get_by_role("button", name="Done: 3 more")).to_be_disabled()
    assert [page.evaluate(IN_SIGHT, name) for name in ("map", "mapbar")] == [True, True]
    box = page.locator("#map").bounding_box()
    assert box["height"] > 0.6 * PHONE["height"]
    for x, y in ((0.2, 0.2), (0.7, 0.2), (0.7, 0.6), (0.5, 0.5)):
        page.locator("#map").click(position={"x": x * box["width"], "y": y * box["height"]})
    shows(page, "mapbar-text", "4 so far")
    page.get_by_role("button", name="Undo").click()
    shows(page, "mapbar-text", "3 so far")
    assert barriers(page) == ""
    page.get_by_role("button", name="Done", exact=True).click()
    shows(page, "draft-about", "Drawn: a boundary")
    page.get_by_role("button", name="Draw boundary").click()
    page.get_by_role("button", name="Cancel").click()
    shows(page, "draft-about", "Drawn: a boundary")


def test_the_first_view_is_small():
    files = [path for path in module.PAGE.iterdir() if path.suffix in module._KINDS]
    assert sum(len(gzip.compress(path.read_bytes(), 9)) for path in files) <= 60_000


def test_the_end_leads_to_the_report_and_nothing_is_red(browser, served, tmp_path):  # noqa: F811
    over = {"phase": "finished", "running": False, "moving": False, "ended": "time_up", "reason": "as planned"}
    served.board.put("mission/r1", UNDER_WAY | over | {"stops": 51})
    served.board.put("ended/r1", round(time.time()))
    with Link(served.port) as link:
        page = opened(browser, type("Linked", (), {"port": link.port, "board": served.board}), PHONE)
        shows(page, "headline", "Finished: 51 stops, ±4.4 % of the rate")
        shows(page, "reason", "the time is up: as planned")
        expect(page.get_by_role("button", name="No report yet: go to the results")).to_be_visible()
        (tmp_path / "run").mkdir()
        (tmp_path / "run" / "summary.json").write_text("{}")
        (tmp_path / "run" / "report.html").write_text("<h1>Map</h1>")
        with page.expect_popup() as popup:
            page.get_by_role("link", name="Open the report (run)").click()
        expect(popup.value.locator("h1")).to_have_text("Map", timeout=LIMIT_MS)
        assert barriers(page) == ""
        link.lose()
        shows(page, "alarm", "The connection has ended, after the mission.")
        shows(page, "link", "finished")
        assert (
            page.locator("#link[data-kind=lost], .alarm:not(.calm), [data-kind=old], [data-kind=danger]").count()
            == 0
        )


def test_one_forecast_lists_of_sentences_and_a_release_that_is_told(browser, served):  # noqa: F811
    served.board.put("mission/r1", UNDER_WAY)
    page = opened(browser, served, PHONE)
    forecast = page.locator("#forecast").inner_text()
    assert forecast == "Forecast of the map: ±4.4 % of the rate now, ±2.8 % (2.3 to 3.4) in 110 min"
    page.get_by_text("Change the mission").click()
    lists = {
        name: page.locator(f"#set-{name} option").all_inner_texts() for name in ("dwell", "strategy", "target")
    }
    assert (lists["dwell"][0], lists["target"][0]) == ("as it is: as long as it pays", "as it is: neutron rate")
    assert all(" " in one for one in (*lists["dwell"], *lists["target"]))
    assert len(lists["strategy"]) > 3
    page.get_by_role("button", name="Plan", exact=True).click()
    expect(page.locator("#plan-forecast")).to_have_text(forecast)
    served.board.put("mission/r1", UNDER_WAY | {"emergency": True})
    shows(page, "stop", "STOP is pressed")
    served.board.put("mission/r1", UNDER_WAY | {"paused": True})
    shows(page, "notice", "STOP is released. Nothing moves before somebody resumes.")

# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The page under a thumb: what matters is in sight on a phone, and what cannot work says why; without robots."""

from __future__ import annotations

import itertools
import re
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
    "moving": True, "stop": ["r3c4", 20.0, 20.0], "counts": 900, "planned_dwell_s": 90,
    "dwell_s": 60, "used_s": 600, "left_s": 6600, "stops": 7, "distance_m": 410, "ready": True,
    "forecast": {"sd": 0.044, "moisture": False, "end": [6600, 0.028, 0.023, 0.034],
                 "wrong": [None, None]},
    "last_command": "", "home_place": None,
}  # fmt: skip
REMEDY = "drive the robot back in by hand, or check the field file"
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


PIXEL = """([x, y, atEdge]) => {
    const map = document.getElementById("map"), [east, north, scale] = map.dataset.view.split(" ").map(Number);
    const at = [map.clientWidth / 2 + (x - east) * scale, map.clientHeight / 2 - (y - north) * scale];
    const [left, top] = at.map(one => Math.max(one, atEdge));
    return {at, colour: [...map.getContext("2d").getImageData(left, top, 1, 1).data]};
}"""


def test_the_map_has_the_ways_and_shows_who_is_outside(browser, served):  # noqa: F811
    served.board.put("mission/r1", UNDER_WAY)
    served.board.put("place/r1", [-30.0, 20.0, None, 0.1])
    served.board.put("plan/r1", [[20.0, 20.0]])
    page = opened(browser, served, PHONE)
    shown = wait_for(lambda: page.evaluate(PIXEL, [-30, 20, 0]))
    assert 0 < shown["at"][0] < PHONE["width"]
    ground = page.evaluate(PIXEL, [30, 40, 0])["colour"]
    served.board.put("nodes", [["a", 10, 40], ["b", 50, 40]])
    served.board.put("edges", [[0, 1]])
    wait_for(lambda: page.evaluate(PIXEL, [30, 40, 0])["colour"] != ground)
    served.board.put("place/r1", [-900.0, 20.0, None, 0.1])
    wait_for(lambda: page.evaluate(PIXEL, [-900, 20, 24])["colour"][:3] == [168, 0, 24])


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


NO_WEBSOCKET = """window.WebSocket = class {
    constructor() { setTimeout(() => { this.onerror?.(); this.onclose?.(); }, 20); }
    close() {}
}"""


def test_a_browser_that_opens_no_websocket_follows_steers_and_stops(browser, served):  # noqa: F811
    """As Safari with a certificate that the computer has made; one part of the page fails on top of it."""
    with Link(served.port) as link:
        context = browser.new_context(viewport=PHONE)
        context.add_init_script(NO_WEBSOCKET)
        page = context.new_page()
        page.goto(f"http://127.0.0.1:{link.port}/")
        shows(page, "link", "live")
        served.board.put("mission/r1", UNDER_WAY | {"stops": 8})
        shows(page, "stops", "8")
        slide(page, "Slide to end the mission")
        shows(page, "notice", "not now")
        link.lose()
        shows(page, "alarm", "Connection to the console lost")
        link.find()
        shows(page, "link", "live")
        served.board.put("visits", [[1.0, 2.0], 7])  # the map fails
        served.board.put("health", [7])
        shows(page, "faults", "A part of this page has failed: map (TypeError")
        shows(page, "faults", "A part of this page has failed: Health (TypeError")
        page.locator("#stop").click()
        shows(page, "stop", "STOP is pressed")
        served.board.put("visits", [])
        served.board.put("health", [])
        expect(page.locator("#faults")).to_be_hidden(timeout=LIMIT_MS)
        assert [verb for _, verb, *_ in served.robots.asked if verb == "abort"] == ["abort"]


def test_the_first_view_is_small():
    later = re.compile(r"guide\.|.*\.rare\.json")
    sizes = {name: len(content) for name, (content, _) in module._files().items() if not later.match(name)}
    languages = [sizes.pop(name) for name in list(sizes) if name.endswith(".json")]
    assert sum(sizes.values()) + max(languages) <= 60_000


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
        red = "#link[data-kind=lost], .alarm:not(.calm, [hidden]), [data-kind=danger]"
        assert page.locator(red).count() == 0


CUT = """() => [...document.querySelectorAll("body :not(h1)")].filter((one) => {
    const box = one.getBoundingClientRect(), text = one.children.length === 0 && one.tagName !== "CANVAS";
    const slid = one.matches(".slide label") && one.scrollHeight > one.clientHeight + 1;
    return box.width && (slid || box.right > innerWidth + 1 || text && one.scrollWidth > one.clientWidth + 1);
}).map((one) => one.outerHTML)"""


def flawless(page, avoided="$^"):
    """Nothing on any tab is cut off, hinders people, or has words that are to be avoided."""
    for tab in ("results", "plan", "survey"):
        page.evaluate("tab => { location.hash = tab; }", tab)
        page.locator(f"main[data-tab={tab}]").wait_for()
        page.evaluate("document.querySelectorAll('details').forEach(one => { one.open = true; })")
        words = re.findall(avoided, page.locator("body").inner_text())
        assert (page.evaluate(CUT), barriers(page), words) == ([], "", [])
    return True


def test_the_page_speaks_german_and_remembers_when_it_is_to_speak_english(browser, served):  # noqa: F811
    reason = "no plausible position for 12 s; check the robot, then resume or abort"
    served.board.put("mission/r1", UNDER_WAY | {"reason": reason, "phase": "paused", "paused": True, "stops": 1})
    wrong = "jump: the last 5 positions are wrong: the newest is 7 m from where the sensor can be (GNSS; off)"
    alarm = f"{wrong}; wait under open sky; if it stays, check the GNSS receiver and its corrections"
    served.board.put("health", [{"name": "guard", "level": 2, "message": alarm}])
    page = opened(browser, served, PHONE, locale="de-AT")
    shows(page, "headline", "Pause")
    shows(page, "reason", "seit 12 s keine glaubhafte Position; Roboter prüfen, dann fortsetzen oder beenden")
    shows(page, "forecast", "±4,4 % der Zählrate jetzt, ±2,8 % (2,3 bis 3,4) in 110 min")
    expect(page.locator("#stops + span")).to_have_text("Halt")
    assert page.locator("html").get_attribute("lang") == "de"
    assert flawless(page)
    told = "Wächter: Sprung: die letzten 5 Positionen sind falsch: die neueste ist 7 m von dort, wo der Sensor"
    shows(page, "health", f"{told} sein kann (GNSS; off); unter freiem Himmel warten")
    served.board.put(
        "mission/r1", UNDER_WAY | {"reason": "the Route Server has gone away", "phase": "paused", "paused": True}
    )
    shows(page, "reason", "der Route Server ist verschwunden")  # of the file that comes later
    page.locator("#language").select_option("en")
    shows(page, "headline", "Paused")
    page.reload()
    shows(page, "headline", "Paused")


@pytest.mark.parametrize("language", ["en", "de"])
def test_a_person_is_told_of_no_robot(browser, served, language):  # noqa: F811
    view = {"guided": 5.0, "phase": "travelling", "home_place": [3.0, 4.0], "stop_requests": 1}
    served.board.put("health", [
        {"name": "navigation", "level": 0, "message": "13 m to r10c10"},
        {"name": "guard", "level": 1, "message": f"outside: the robot is 20 m outside the field; {REMEDY}"},
    ])  # fmt: skip
    page = opened(browser, served, PHONE, locale=language)
    for reason, place in (
        ("the robot is home", [20, 20, 0, 0.1]),
        ("waiting for the robot to stop", [900, 0, 0, 1]),
    ):
        served.board.put("place/r1", place)
        served.board.put("mission/r1", UNDER_WAY | view | {"reason": reason, "paused": place[0] == 900})
        page.locator(".guided #guide").wait_for()
        shows(
            page, "guide-title", {"en": ("Go to the", "Paused"), "de": ("Zum", "Pause")}[language][place[0] == 900]
        )
        assert flawless(page, r"(?i).*(?:robo|\bgoal|\bZiel|navigation).*")


def test_a_person_gets_no_promise_without_records_and_hears_that_nothing_is_stored(browser, served):  # noqa: F811
    view = UNDER_WAY | {"guided": 5.0, "dwell_s": 90, "exposure_s": 30}
    silent = {"level": 2, "message": "silent: no bytes for 40 s"}
    served.board.put("phone", False)
    served.board.put("mission/r1", view)
    served.board.put("health", [])
    served.board.put("place/r1", [-25, 20, None, 0.1])
    with Link(served.port) as link:
        page = opened(browser, type("Linked", (), {"port": link.port, "board": served.board}), PHONE)
        shows(page, "guide-big", "60 s")
        shows(page, "guide-line", "stay 60 s more: ±3.3 % → ±1.92 %")
        served.board.put("health", [{"name": name, **silent} for name in ("logger link", "GNSS link")])
        shows(page, "guide-title", "Nothing is counted now")
        shows(page, "guide-line", "")
        assert page.locator("#guide[data-edge=bad] #guide-alarm p").count() == 2
        served.board.put("mission/r1", view | {"phase": "travelling"})
        shows(page, "guide-title", "Back to the field")
        shows(page, "guide-big", "25 m")
        link.lose()
        shows(page, "alarm", "Nothing may be recorded now: look at the computer, and start the same command again")


def test_one_forecast_lists_of_words_and_a_release_that_is_told(browser, served):  # noqa: F811
    served.board.put("mission/r1", UNDER_WAY)
    page = opened(browser, served, PHONE)
    shows(page, "error", "± 3.3 %")
    forecast = page.locator("#forecast").inner_text()
    assert forecast == "Forecast of the map: ±4.4 % of the rate now, ±2.8 % (2.3 to 3.4) in 110 min"
    page.get_by_role("button", name="Plan", exact=True).click()
    lists = {
        name: page.locator(f"#plan-{name} option").all_inner_texts() for name in ("dwell", "strategy", "target")
    }
    assert (lists["dwell"][0], lists["target"]) == ("As long as it pays", ["neutron rate", "soil moisture"])
    assert all(" " in one for one in lists["dwell"])
    assert len(lists["strategy"]) > 3
    expect(page.locator("#plan-forecast")).to_have_text(forecast)
    served.board.put("mission/r1", UNDER_WAY | {"emergency": True})
    shows(page, "stop", "STOP is pressed")
    served.board.put("mission/r1", UNDER_WAY | {"paused": True})
    shows(page, "notice", "STOP is released. Nothing moves before somebody resumes.")


def test_a_phone_that_was_hidden_or_without_network_says_so_and_goes_on(browser, served):  # noqa: F811
    served.board.put("mission/r1", UNDER_WAY | {"guided": 5.0})
    served.board.put("phone", True)
    page = opened(browser, served, PHONE)
    page.context.grant_permissions(["geolocation"])
    page.context.set_geolocation({"latitude": 53.268, "longitude": -0.524, "accuracy": 2.0})
    devtools, sent = page.context.new_cdp_session(page), []
    page.on("request", lambda request: sent.append(request.url) if request.url.endswith("/position") else None)
    page.get_by_role("button", name="Use this phone's position").click()
    wait_for(lambda: page.wait_for_timeout(100) or sent)
    devtools.send("Debugger.enable")
    devtools.send("Debugger.pause")  # a page without a window is never hidden, and not frozen by its life cycle
    time.sleep(8.0)
    devtools.send("Debugger.disable")
    before = len(sent)
    shows(page, "guide-alarm", "The page was hidden for")
    wait_for(lambda: page.wait_for_timeout(100) or len(sent) > before)
    conditions = {"latency": 0, "downloadThroughput": -1, "uploadThroughput": -1}
    devtools.send("Network.enable")
    devtools.send("Network.emulateNetworkConditions", {"offline": True, **conditions})
    shows(page, "alarm", "Nothing may be recorded now")
    devtools.send("Network.emulateNetworkConditions", {"offline": False, **conditions})
    expect(page.locator("#alarm")).to_be_hidden(timeout=LIMIT_MS)
    walk = itertools.count(1)

    def well():
        place = {"latitude": 53.268 + 1e-6 * next(walk), "longitude": -0.524, "accuracy": 2.0}
        page.context.set_geolocation(place)
        page.wait_for_timeout(200)
        return " s old" not in page.locator("#guide-alarm").inner_text()

    wait_for(well)
    served.server._controls.__init__()  # as a command that was started again
    wait_for(lambda: well() and served.server._controls.who)

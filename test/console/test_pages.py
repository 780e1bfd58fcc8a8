# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The pages Plan and Results, and several operators, in a real browser; without robots."""

from __future__ import annotations

import json
import threading
import time
from pathlib import Path

import pytest
import shapely
from axe_playwright_python.sync_playwright import Axe
from browser import DESK, PHONE, chromium, slide
from playwright.sync_api import expect
from test_plan_work import CORNERS, along
from test_server import Served

from soilmoist_ros.console.views import battery_view, choices_view, field_view, health_view
from soilmoist_ros.console.visitors import Access
from soilmoist_ros.exploration.control.operator_request import ReplyCode
from soilmoist_ros.foundation.errors import Health, Level
from soilmoist_ros.mapping.field import load_field
from soilmoist_ros.simulation.fields.catalogue import surrogate_field

pytestmark = [pytest.mark.process, pytest.mark.usefixtures("urgent_jobs")]
LIMIT_MS = 180_000
RULES = {
    "runOnly": {"type": "tag", "values": ["wcag2a", "wcag2aa", "wcag2aaa", "wcag21a", "wcag21aa", "best-practice"]}
}
IDLE = {
    "reason": "waiting for start", "phase": "idle", "forecast": None, "stops": 0, "running": False,
    "paused": False, "moving": False, "emergency": False, "needs_operator": False, "stop_requests": 0,
    "counts": 0, "queue": [],
    "settings": {
        "hours": 2.0, "dwell": "optimal", "strategy": "gcb", "target": "rate", "home": "", "until_sd": 0.0,
        "targets": ["rate", "vwc"],
    },
}  # fmt: skip


@pytest.fixture
def served(tmp_path, browser):
    """A server that hears a planner every second: after 30 s of silence the page has no slides."""
    made, ended = Served(Access(), tmp_path), threading.Event()
    made.board.put("field", field_view(surrogate_field("half-wet").field))
    made.board.put("health", health_view([Health("/sensor_driver: GNSS", Level.WARN, "no RTK: wait")]))
    made.board.put("choices", choices_view())
    made.board.put("mission/r1", IDLE)
    planner = threading.Thread(target=hear_until, args=(ended, made.board))
    planner.start()
    yield made
    ended.set()
    planner.join()
    for context in browser.contexts:  # its pages would look for their server for ever
        context.close()
    made.server.close()


def hear_until(ended, board):
    while True:
        board.hear("mission/r1")
        if ended.wait(1.0):
            return


@pytest.fixture(scope="module")
def browser():
    with chromium() as made:
        yield made


def opened(browser, served, size, page="", bypass_csp=True, locale="en-GB"):
    context = browser.new_context(
        viewport=size, bypass_csp=bypass_csp, locale=locale
    )  # for axe, which is put into the page
    context.set_default_timeout(LIMIT_MS)
    shown = context.new_page()
    shown.goto(f"http://127.0.0.1:{served.port}/{page}")
    expect(shown.locator("#field")).to_have_text(served.board.get("field")["name"], timeout=LIMIT_MS)
    return shown


def shows(page, name, text):
    expect(page.locator(f"#{name}")).to_contain_text(text, timeout=LIMIT_MS)


def barriers(page):
    found = Axe().run(page, options=RULES)
    return found.generate_report() if found.violations_count else ""


def test_a_mission_is_planned(browser, served):
    page = opened(browser, served, DESK, "#plan")
    shows(page, "checks", "Sensor: not heardTo do: start the sensor driver.")
    shows(page, "checks", "GNSS: no RTK")
    shows(page, "checks", "Battery: not known")
    served.board.put("battery/r1", battery_view(0.12, float("nan")))
    served.board.hear("battery/r1")
    shows(page, "checks", "Battery: 12 %To do: charge it or change it")
    assert page.locator("#checks li:not([data-level='0']) .remedy").count() >= 7
    page.get_by_role("button", name="Draw boundary").click()
    box = page.locator("#map").bounding_box()
    for x, y in ((0.3, 0.3), (0.6, 0.3), (0.6, 0.6), (0.3, 0.6)):
        page.locator("#map").click(position={"x": x * box["width"], "y": y * box["height"]})
    page.get_by_role("button", name="Done").click()
    shows(page, "draft-about", "Drawn: a boundary with 0 no-go areas, 0.")
    ring = [[-0.5245, 53.268], [-0.524, 53.268], [-0.524, 53.2683]]
    content = json.dumps({"type": "Polygon", "coordinates": [[*ring, ring[0]]]}).encode()
    page.locator("#import").set_input_files(
        {"name": "f.geojson", "mimeType": "application/json", "buffer": content}
    )
    expect(page.locator("#draft-about")).to_contain_text("0.06 ha", timeout=LIMIT_MS)
    assert barriers(page) == ""


def test_a_walk_a_strategy_and_earlier_runs_are_in_the_plan_that_is_started(browser, served, tmp_path):
    served.robots.code = ReplyCode.ACCEPTED
    for name in ("may", "june"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "summary.json").write_text(json.dumps({"field": "North"}))
    page = opened(browser, served, PHONE, "#results")
    page.locator("#who").evaluate("box => { box.value = 'Ada'; box.dispatchEvent(new Event('change')); }")
    page.locator("#choose-may").check()
    page.get_by_role("button", name="Start the next survey with what this one knows").click()
    shows(page, "known-about", "Earlier surveys: may.")
    page.get_by_role("button", name="Walk boundary").click()
    shows(page, "draft-about", "Ada walks the boundary with the robot: 0 places")
    for x_m, y_m in along(CORNERS):
        served.walk.place(x_m, y_m, 0.02)
    shows(page, "draft-about", "receiver ± 0.02 m at worst")
    page.reload()  # the console records the walk, not the page
    page.get_by_role("button", name="Finish the walk").click()
    shows(page, "notice", "Receiver ± 0.02 m at worst")
    shows(page, "draft-about", "Drawn: a boundary with 0 no-go areas, 0.2")
    page.locator("#known summary").click()
    page.get_by_label("june").check()
    page.locator("#plan-strategy").select_option("lattice")
    shows(page, "plan-strategy-about", "Evenly spread stops")
    page.locator("#plan-dwell").select_option("ami")
    page.locator("#plan-dwell-by").fill("2.5")
    page.get_by_text("End early").click()
    page.locator("#plan-good").fill("5")
    expect(page.get_by_label("± [% of the rate]")).to_have_value("5")
    page.locator("#plan-target").select_option("vwc")
    expect(page.get_by_label("± [% by volume]")).to_have_value("")  # 5 had another meaning
    page.locator("#plan-good").fill("3")
    assert barriers(page) == ""
    slide(page, "Slide to start with this plan")
    expect(page.locator("#draft-about")).to_contain_text("The next mission explores this field", timeout=LIMIT_MS)
    start = wait_for(lambda: [one for one in served.robots.requests if one.verb == "start"])
    (change,) = (one for one in served.robots.requests if one.verb == "change")
    assert (change.who, start[0].who) == ("Ada", "Ada")
    assert (change.strategy, change.dwell, change.until_sd, change.home) == ("lattice", "ami:2.5%", 0.03, "")
    assert change.target == "vwc"
    assert change.hours == 0.0, "the planner has them"
    assert change.earlier == (str(tmp_path / "june"),)
    field = load_field(Path(change.field))
    assert change.field.startswith(str(tmp_path / "fields" / "drawn-field-"))
    assert shapely.Polygon(field.polygon).symmetric_difference(shapely.Polygon(CORNERS)).area < 60


def wait_for(found):
    deadline = time.monotonic() + LIMIT_MS / 1000
    while not (answer := found()):
        assert time.monotonic() < deadline
        time.sleep(0.05)
    return answer


def test_results_are_taken_home(browser, served, tmp_path):
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "summary.json").write_text(json.dumps({"field": "North"}))
        (tmp_path / name / "report.html").write_text("<h1>Map</h1><script>document.title = origin</script>")
    page = opened(browser, served, PHONE, "#results", bypass_csp=False)
    shows(page, "runs", "one")
    with page.expect_popup() as popup:
        page.get_by_role("link", name="Open the map page").first.click()
    expect(popup.value).to_have_title("null", timeout=LIMIT_MS)  # a report has no power over the page
    page.locator("#runs summary").first.click()
    with page.expect_download() as download:
        page.get_by_role("link", name="summary.json").first.click()
    assert json.loads(download.value.path().read_text()) == {"field": "North"}
    for name in ("one", "two"):
        page.locator(f"#choose-{name}").check()
    shows(page, "runs-actions", f"earlier:=[{tmp_path}/one, {tmp_path}/two]")
    page.get_by_role("button", name="Compare 2 surveys").click()
    shows(page, "jobs", "compare: ")
    assert barriers(opened(browser, served, PHONE, "#results")) == ""


def test_two_operators_and_ten_viewers(browser, served):
    ada, bo = (opened(browser, served, size) for size in (DESK, PHONE))
    viewers = [opened(browser, served, PHONE) for _ in range(8)]
    for page, name in ((ada, "Ada"), (bo, "Bo")):
        page.locator("#who").fill(name)
        page.keyboard.press("Tab")
    slide(ada, "Slide to start")
    shows(ada, "notice", "Not done: not now")
    shows(bo, "actions", "Ada has the controls")
    for page in viewers:
        shows(page, "actions", "Ada has the controls")
    bo.locator("#stop").click()
    for page in (ada, bo):  # what is slid must not be drawn anew meanwhile
        shows(page, "stop", "STOP is pressed")
    for page, holder, tab in ((bo, "Ada", "Survey"), (ada, "Bo", "Plan"), (bo, "Ada", "Results")):
        page.get_by_role("button", name=tab, exact=True).click()
        shows(page, "steer", f"{holder} has the controls")
        slide(page, "Slide to take over")
        expect(page.locator("#steer")).to_be_hidden(timeout=LIMIT_MS)
    shows(ada, "actions", "Bo has the controls")
    assert [barriers(ada), barriers(bo)] == ["", ""]
    assert served.robots.asked == [("r1", "start", "Ada"), (True, "Bo")]


def test_a_slide_stays_under_the_finger_while_the_page_changes(browser, served):
    page = opened(browser, served, PHONE)
    page.locator("#who").fill("Ada")
    page.keyboard.press("Tab")
    slider = page.locator("#actions [data-slide='Slide to start'] input")
    slider.hover(timeout=LIMIT_MS)  # waits, also where the page draws its buttons anew meanwhile
    box = slider.bounding_box()
    y = box["y"] + box["height"] / 2
    page.mouse.move(box["x"] + 12, y)
    page.mouse.down()
    page.mouse.move(box["x"] + box["width"] / 2, y)
    served.board.put("mission/r1", IDLE | {"running": True, "phase": "travelling"})
    shows(page, "headline", "Driving to a stop")
    page.mouse.move(box["x"] + box["width"], y)
    page.mouse.up()
    shows(page, "notice", "Not done: not now")
    assert served.robots.asked == [("r1", "start", "Ada")]
    shows(page, "actions", "Skip this stop")

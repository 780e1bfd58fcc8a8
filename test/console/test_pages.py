"""The pages Plan and Results, and several operators, in a real browser; without robots."""

from __future__ import annotations

import json

import pytest
from axe_playwright_python.sync_playwright import Axe
from browser import DESK, PHONE, chromium, slide
from playwright.sync_api import expect
from test_server import Served

from soilmoist_ros.console.access import Access
from soilmoist_ros.console.views import field_view, health_view
from soilmoist_ros.foundation.health import Health, Level
from soilmoist_ros.simulation.fields.catalogue import surrogate_field

pytestmark = pytest.mark.process
LIMIT_MS = 60_000
RULES = {
    "runOnly": {"type": "tag", "values": ["wcag2a", "wcag2aa", "wcag2aaa", "wcag21a", "wcag21aa", "best-practice"]}
}
IDLE = {
    "headline": "Ready", "reason": "waiting for start", "phase": "idle", "running": False, "paused": False,
    "moving": False, "emergency": False, "needs_operator": False, "stop_requests": 0, "counts": 0, "queue": [],
}  # fmt: skip


@pytest.fixture
def served(tmp_path):
    made = Served(Access(), tmp_path)
    made.board.put("field", field_view(surrogate_field("half-wet").field))
    made.board.put("health", health_view([Health("/sensor_driver: GNSS", Level.WARN, "no RTK: wait")]))
    made.board.put("mission/r1", IDLE)
    made.board.hear("mission/r1")
    yield made
    made.server.close()


@pytest.fixture(scope="module")
def browser():
    with chromium() as made:
        yield made


def opened(browser, served, size, page="", bypass_csp=True):
    context = browser.new_context(viewport=size, bypass_csp=bypass_csp)  # for axe, which is put into the page
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
    shows(page, "checks", "Sensor: not heard: start the sensor driver")
    shows(page, "checks", "GNSS: no RTK: wait")
    page.get_by_role("button", name="Draw boundary").click()
    box = page.locator("#map").bounding_box()
    for x, y in ((0.3, 0.3), (0.6, 0.3), (0.6, 0.6), (0.3, 0.6)):
        page.locator("#map").click(position={"x": x * box["width"], "y": y * box["height"]})
    page.get_by_role("button", name="Done").click()
    shows(page, "draft-about", "Drawn: boundary with 0 no-go areas, 0.")
    page.locator("#plan-hours").fill("0.1")
    page.locator("#plan-wanted").fill("90")
    page.locator("#plan-run").click()
    shows(page, "forecast-text", "After 6 min: ±")
    shows(page, "forecast-text", "For ±90 % you need")
    with page.expect_download() as download:
        page.get_by_role("button", name="Download field file").click()
    assert "polygon: [[" in download.value.path().read_text()
    ring = [[-0.5245, 53.268], [-0.524, 53.268], [-0.524, 53.2683]]
    content = json.dumps({"type": "Polygon", "coordinates": [[*ring, ring[0]]]}).encode()
    page.locator("#import").set_input_files(
        {"name": "f.geojson", "mimeType": "application/json", "buffer": content}
    )
    expect(page.locator("#draft-about")).to_contain_text("0.06 ha", timeout=LIMIT_MS)
    assert barriers(page) == ""


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
    page.locator("summary").first.click()
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
    shows(ada, "stop", "STOP is pressed")
    slide(bo, "Slide to take over")
    shows(ada, "actions", "Bo has the controls")
    assert [barriers(ada), barriers(bo)] == ["", ""]
    assert served.robots.asked == [("r1", "start", "Ada"), (True, "Bo")]

"""The page: report.py with its maps.py, survey_charts.py, wording.py and style.py."""

from __future__ import annotations

import base64
import dataclasses
import json
import re
from datetime import datetime
from html.parser import HTMLParser

import numpy as np
import pytest

from soilmoist_ros.mapping import Variogram, make_soil_map
from soilmoist_ros.mapping.variogram.fit import estimate_variogram
from soilmoist_ros.reporting.page import report
from soilmoist_ros.reporting.page.report import readout, render_report
from soilmoist_ros.reporting.page.style import Picture
from soilmoist_ros.reporting.run import InputFile, LossRow, Note, NoteCode
from soilmoist_ros.sensing.moisture.curve import CalibrationCurve


class Page(HTMLParser):
    """Content for a browser: tags with their attributes, and the visible text."""

    def __init__(self, html):
        super().__init__()
        self.tags, self.text, self._open = [], "", []
        self.feed(html)

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))
        self._open.append(tag)

    def handle_endtag(self, tag):
        while self._open and self._open.pop() != tag:
            pass

    def handle_data(self, data):
        if not {"script", "style"} & set(self._open):
            self.text += data

    def all(self, tag):
        return [attributes for name, attributes in self.tags if name == tag]


@pytest.fixture(scope="module")
def html(make_run):
    return render_report(make_run())


@pytest.fixture(scope="module")
def page(html):
    return Page(html)


@pytest.fixture
def words_only(monkeypatch):
    """Figures are drawn but not rendered."""
    blank = Picture("data:image/png;base64,", "a figure", 5.0, (0.1, 0.1, 0.8, 0.8))
    monkeypatch.setattr(report, "picture", lambda *_: blank)


def ids(page):
    return [attributes["id"] for attributes in page.all("figure")]


def test_nothing_is_fetched(html, page):
    for _, attributes in page.tags:
        for name in ("src", "href", "srcset", "action", "data"):
            assert not attributes.get(name) or attributes[name].startswith(("data:image/", "#"))
    assert not page.all("link")
    assert "url(" not in html
    assert "@import" not in html
    assert "http://" not in html
    assert "https://" not in html
    assert len(html) < 4_000_000


def test_figures_are_complete_and_described(page):
    assert ids(page)[:2] == ["vwc", "vwc-sd"]
    assert {"rate", "rate-sd", "samples", "variogram", "validation", "histogram", "rate-series", "factors"} <= set(
        ids(page)
    )
    assert len(page.all("img")) == len(ids(page))
    for image in page.all("img"):
        assert len(image["alt"]) > 20
        kind, content = image["src"].split(";base64,")
        start = base64.b64decode(content)[:8]
        assert start == b"\x89PNG\r\n\x1a\n" if kind.endswith("png") else start.startswith(b"<?xml")


def test_date_and_duration_come_first(page):
    assert page.text.index("14 November 2023") < page.text.index("report made") < page.text.index("On average")


def test_key_numbers_are_there(page, the_map):
    assert f"{100 * np.nanmean(the_map.vwc):.1f}" in page.text
    low, high = (f"{100 * q:.1f}" for q in np.nanpercentile(the_map.vwc, (5, 95)))
    assert f"{low} to {high}" in page.text
    for text in ("0.11 ha", "places measured", "matern32", "hydroinnova_rover", "6 cores", "7.00 ± 0.10"):
        assert text.replace("0.11 ha", "0.11") in page.text
    for text in ("air pressure", "wait for a fix", "salt is not mapped", "ab" * 32):
        assert text in page.text
    assert "nan" not in page.text.lower()


def test_the_page_says_how_deep_the_sensor_sees(page):
    assert "to a depth of about 19 cm (16 cm in the wettest to 24 cm in the driest soil)" in page.text


def test_page_is_accessible(html, page):
    assert html.startswith("<!DOCTYPE html>")
    assert page.all("html") == [{"lang": "en"}]
    assert all("scope" in attributes for attributes in page.all("th"))
    assert len(page.all("h1")) == 1


@pytest.mark.usefixtures("words_only")
def test_text_of_the_user_is_escaped(make_run):
    evil = "<script>alert('x')</script>"
    run = make_run(
        title=evil, field_name=evil, site=evil, notes=[Note(NoteCode.NOT_MAPPED, evil)], logger_format=evil,
        inputs=[InputFile(evil)], losses=[LossRow(evil, 1, evil, "lost", evil)], settings={evil: evil},
    )  # fmt: skip
    html = render_report(run)
    assert evil not in html
    assert "alert('x')" not in "".join(re.findall(r"<script.*?</script>", html, re.S))
    assert len(Page(html).all("script")) == 2


@pytest.mark.usefixtures("words_only")
def test_simulated_data_say_so(make_run, page):
    assert "SIMULATED DATA" not in page.text
    assert "SIMULATED DATA" in Page(render_report(make_run(simulated=True))).text


@pytest.mark.slow
def test_without_calibration(make_run, uncalibrated):
    page = Page(render_report(make_run(soil_map=uncalibrated, calibration=None)))
    assert ids(page)[0] == "rate"
    assert "vwc" not in ids(page)
    assert "soilmoist calibrate" in page.text
    assert "not calibrated" in page.text


@pytest.mark.slow
@pytest.mark.usefixtures("words_only")
def test_undefined_and_impossible_moisture_is_named(make_run, steep):
    text = Page(render_report(make_run(soil_map=steep))).text
    assert "impossible or not defined" in text
    assert "On average" not in text
    assert "pores of this soil" in text


@pytest.mark.usefixtures("words_only")
def test_a_little_undefined_moisture_is_named(make_run, the_map):
    rate = the_map.rate.copy()
    rate[tuple(np.argwhere(the_map.grid.mask)[0])] = 0.9 * the_map.curve.lowest_rate_cps
    text = Page(render_report(make_run(soil_map=dataclasses.replace(the_map, rate=rate)))).text
    assert "On average" in text
    assert "below the calibration curve" in text


@pytest.mark.slow
def test_moisture_undefined_everywhere(make_run, map_of):
    run = make_run(soil_map=map_of(curve=CalibrationCurve(30.0, 1.4)))
    page = Page(render_report(run))
    assert "no soil moisture could be computed" in page.text
    assert ids(page)[0] == "vwc"


@pytest.mark.slow
def test_one_sample_and_nothing_else(make_run, map_of):
    run = make_run(soil_map=map_of(n=1), track=(), inputs=(), corrections=(), losses=(), settings={}, notes=())
    page = Page(render_report(run))
    assert "1 place measured" in page.text
    assert "every record read is in the map" in page.text
    assert "rate-series" not in ids(page)


@pytest.mark.slow
@pytest.mark.usefixtures("words_only")
def test_fitted_variogram_and_truth(make_run, the_map):
    s = the_map.samples
    soil = make_soil_map(s, the_map.grid, estimate_variogram(s.xy, s.counts, s.exposure_s), the_map.curve)
    page = Page(render_report(make_run(soil_map=soil, truth_rate=soil.rate)))
    assert "truth" in ids(page)
    assert "restricted maximum likelihood" in page.text
    assert "×/÷" in page.text


@pytest.mark.slow
@pytest.mark.usefixtures("words_only")
def test_a_direction_is_told(make_run, the_map):
    s = the_map.samples
    fit = dataclasses.replace(
        estimate_variogram(s.xy, s.counts, s.exposure_s, anisotropy=False),
        variogram=Variogram("spherical", 0.0, 20.0, 0.3, 4.0, 90.0),
    )
    soil = make_soil_map(s, the_map.grid, fit, the_map.curve)
    page = Page(render_report(make_run(soil_map=soil)))
    assert "40.0 m along 90° (anticlockwise from east) and 10.0 m across" in page.text
    assert "depends on the direction" not in Page(render_report(make_run())).text


def test_readout_shows_the_map(make_run, the_map, html):
    found = readout(make_run())
    embedded = json.loads(re.search(r'id="cells">(.*?)</script>', html, re.S)[1])
    assert embedded == found
    row, column = (int(i) for i in np.argwhere(the_map.grid.mask)[7])
    assert found["value"][row][column] * found["factor"] == pytest.approx(100 * the_map.vwc[row, column], abs=0.01)
    x = found["x0"] + column * found["step"]
    assert x == pytest.approx(the_map.grid.x_m[column])
    assert found["value"][1][-1] is not None
    assert found["value"][-1][-1] is None, "outside the field"


def test_readout_is_thinned(make_run, map_of):
    soil = map_of(cell_m=0.1)
    found = readout(make_run(soil_map=soil))
    assert len(found["value"]) <= 150
    assert len(found["value"][0]) <= 150
    assert found["x0"] == pytest.approx(soil.grid.x_m[1])
    assert found["step"] == pytest.approx(0.3)


def test_time_of_creation_needs_a_zone(make_run):
    with pytest.raises(ValueError, match="time zone"):
        make_run(created_utc=datetime(2026, 5, 3))

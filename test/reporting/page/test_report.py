# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The page of a run, and its parts on earlier surveys."""

from __future__ import annotations

import dataclasses
import itertools
import json
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from reporting.packed import unpack
from soilmoist_ros.mapping import EarlierSurvey, Samples, Variogram, estimate_variogram, make_soil_map
from soilmoist_ros.mapping.drift import Change, Changing, Drift, TimedSamples
from soilmoist_ros.pipeline.earlier_runs import run_change
from soilmoist_ros.pipeline.field_survey import input_file
from soilmoist_ros.pipeline.run import EarlierRun, InputFile, LossRow, Note, NoteCode
from soilmoist_ros.reporting import irrigation, mean_moisture, notes, summary, write_outputs
from soilmoist_ros.reporting.page.frame import _text
from soilmoist_ros.reporting.page.report import earlier_part, render_report
from soilmoist_ros.reporting.page.viewer import viewer_data
from soilmoist_ros.reporting.page.wording import survey_time

VOID = {"meta", "img", "input", "br", "link", "path"}
MIN_TEXT_PX = 12


class Page(HTMLParser):
    """Content for a browser: tags with their attributes, the visible text, and tags that are closed wrongly."""

    def __init__(self, html):
        super().__init__()
        self.tags, self.text, self.wrong, self._open = [], "", [], []
        self.feed(html)
        self.wrong += self._open

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))
        if tag not in VOID:
            self._open.append(tag)

    def handle_endtag(self, tag):
        if not self._open or self._open.pop() != tag:
            self.wrong.append(f"</{tag}> at {self.getpos()}")

    def handle_startendtag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))

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


def embedded(html):
    return json.loads(re.search(r'id="map-data">(.*?)</script>', html, re.S)[1])


def ids(page):
    return [attributes["id"] for _, attributes in page.tags if "id" in attributes]


def test_nothing_is_fetched(html, page):
    for _, attributes in page.tags:
        for name in ("src", "href", "srcset", "action", "data"):
            assert not attributes.get(name) or attributes[name].startswith(("data:image/", "#"))
    assert not page.all("link")
    for way in ("url(", "@import", "http://", "https://", "fetch(", "XMLHttpRequest", "import("):
        assert way not in html
    assert len(html) < 1_000_000


def test_page_is_well_formed(html, page):
    assert html.startswith("<!DOCTYPE html>")
    assert page.wrong == []
    assert sorted(ids(page)) == sorted(set(ids(page)))
    assert page.all("html") == [{"lang": "en"}]
    assert len(page.all("h1")) == 1
    levels = [int(tag[1]) for tag, _ in page.tags if re.fullmatch("h[1-6]", tag)]
    assert all(after <= before + 1 for before, after in itertools.pairwise(levels))


def test_page_is_accessible(html, page):
    assert all("scope" in attributes for attributes in page.all("th"))
    assert all(len(image["alt"]) > 20 for image in page.all("img"))
    assert all(
        attributes.get("aria-label") for _, attributes in page.tags if attributes.get("role") in ("img", "region")
    )
    assert all(attributes.get("aria-label") for attributes in page.all("button") if "id" in attributes)
    labelled = re.findall(r"<label[^>]*>\s*<input", html)
    assert len(labelled) == len(page.all("input"))
    for _, attributes in page.tags:
        assert attributes.get("aria-describedby", "map-help") in ids(page)


def test_no_text_is_small():
    style = _text("page.css")
    sizes = re.findall(r"font(?:-size)?:\s*(?:\d+ )?([\d.]+)(px|rem|em|pt)", style)
    assert len(sizes) > 10
    for value, unit in sizes:
        px = float(value) * {"px": 1, "rem": 16, "em": 14, "pt": 96 / 72}[unit]
        assert px >= MIN_TEXT_PX, f"{value}{unit}"
    drawn = [int(px) for px in re.findall(r"(\d+)px[ \"]", _text("viewer.js"))]
    assert min(drawn) >= MIN_TEXT_PX


def test_the_farmers_part_comes_before_the_scientists(page):
    places = [
        page.text.index(text) for text in ("irrigation?", "Next: ", "The map", "For the scientist", "Semivariance")
    ]
    assert places == sorted(places)


def test_key_numbers_are_there(page, the_map):
    assert f"{100 * mean_moisture(the_map).value:.1f}" in page.text
    assert "Each value is a mean over the footprint of the sensor around each place. " in page.text
    assert "m are not resolved." in page.text
    low, high = (f"{100 * q:.1f}" for q in np.nanpercentile(the_map.vwc, (5, 95)))
    assert f"{low} to {high}" in page.text
    for text in ("0.11", "places measured", "matern32", "hydroinnova_rover", "6 cores", "7.00 ± 0.10"):
        assert text in page.text
    for text in ("air pressure", "wait for a fix", "salt is not mapped", "ab" * 32, "How to cite"):
        assert text in page.text
    assert "nan" not in page.text.lower()


def test_embedded_map_is_the_map(html, the_map):
    data = embedded(html)
    grid, layers = data["grids"][0], {layer["key"]: layer for layer in data["layers"]}
    assert (grid["ny"], grid["nx"]) == the_map.rate.shape
    assert (grid["x0"], grid["y0"], grid["cell"]) == (
        the_map.grid.x_m[0], the_map.grid.y_m[0], the_map.grid.cell_m,
    )  # fmt: skip
    bands = {
        "vwc": 100 * the_map.vwc, "p05": 100 * the_map.vwc_p05, "p95": 100 * the_map.vwc_p95,
        "rate": the_map.rate, "rate_sd": the_map.rate_sd,
    }  # fmt: skip
    for key, band in bands.items():
        shown = np.where(the_map.grid.mask, band, np.nan)
        np.testing.assert_allclose(
            unpack(layers[key], shown.shape), shown, rtol=0, atol=np.ptp(band[the_map.grid.mask]) / 1e5
        )


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


@pytest.mark.slow
def test_without_calibration(make_run, uncalibrated):
    html = render_report(make_run(soil_map=uncalibrated, calibration=None))
    page = Page(html)
    assert [layer["key"] for layer in embedded(html)["layers"]] == ["rate", "zone", "rate_sd"]
    assert "soilmoist calibrate" in page.text
    assert "not calibrated" in page.text
    assert len(page.all("img")) == 2


@pytest.mark.slow
def test_undefined_and_impossible_moisture_is_named(make_run, steep):
    text = Page(render_report(make_run(soil_map=steep))).text
    assert "do not use the percentages" in text
    assert "of the area: N0 does not fit the rate" in text


@pytest.mark.slow
def test_one_sample_and_nothing_else(make_run, map_of):
    run = make_run(soil_map=map_of(n=1), track=(), inputs=(), corrections=(), losses=(), settings={}, notes=())
    page = Page(render_report(run))
    assert "1 place measured" in page.text
    assert "every record read is in the map" in page.text
    assert {"rate-series", "variogram"}.isdisjoint(ids(page))


@pytest.mark.slow
def test_fitted_variogram_and_truth(make_run, the_map):
    s = the_map.samples
    soil = make_soil_map(s, the_map.grid, estimate_variogram(s.xy, s.counts, s.exposure_s), the_map.curve)
    html = render_report(make_run(soil_map=soil, truth_rate=soil.rate))
    assert {"truth", "error"} <= {layer["key"] for layer in embedded(html)["layers"]}
    page = Page(html)
    for text in ("restricted maximum likelihood", "×/÷", "influence of the prior", "most likely (fitted)"):
        assert text in page.text


def test_an_anisotropic_model_has_its_range_in_both_directions(make_run, the_map):
    variogram = Variogram("spherical", 0.0, 20.0, 0.3, 4.0, 90.0)
    soil = make_soil_map(the_map.samples, the_map.grid, variogram, the_map.curve)
    page = Page(render_report(make_run(soil_map=soil)))
    assert "variogram" in ids(page)
    assert "40.0 along 90°, 10.0 across" in page.text


def test_quarantined_records_are_shown_and_listed(make_run):
    run = make_run()
    bad = dataclasses.replace(run.track[3], quarantine="noisy_tube")
    losses = [LossRow("noisy tube", 1, "run.KSU:5", "quarantined", "look at the tube")]
    html = render_report(dataclasses.replace(run, quarantined=[bad], losses=losses))
    assert embedded(html)["quarantined"] == [[round(bad.x_m, 1), round(bad.y_m, 1), "noisy tube"]]
    text = Page(html).text
    assert "1 record is not in the map" in text
    assert "in quarantine" in text
    assert "records left out" in text


def test_local_time_stands_next_to_utc_where_the_site_names_its_zone(make_run):
    run = make_run(track=make_run().track[:2], time_zone="Asia/Kolkata")  # half an hour off, and the next day
    assert survey_time(run) == (
        "14 November 2023, 22:07 to 22:18 UTC, local time 15 November 2023, 03:37 to 03:48 (Asia/Kolkata) (11 min)"
    )
    assert "local time" not in survey_time(make_run())


def test_no_folder_of_this_computer_is_in_report_and_summary(make_run, tmp_path):
    log = tmp_path / "run.csv"
    log.write_text("1")
    example = f"{log}:17: no fix"
    run = make_run(
        inputs=[input_file(log, "neutron log"), input_file(Path("setup.cfg"), "site")],
        losses=[LossRow("no position", 3, example)], notes=[Note(NoteCode.NOT_MAPPED, f"see {log}")],
    )  # fmt: skip
    assert [one.name for one in run.inputs] == ["run.csv", "setup.cfg"]
    page = render_report(run)
    assert str(tmp_path) not in json.dumps(summary(run)) + page
    assert "run.csv:17: no fix" in page
    assert "see run.csv" in page


# Earlier surveys, and what has changed -----------------------------------------------------------------------

NOW_S = 1.77e9


def earlier(soil, name: str, days: float, drop: float = 0.0, scatter_seed: int = 1) -> EarlierRun:
    """A survey at the places of a map, where the rate was higher by ``drop``."""
    rng = np.random.default_rng(scatter_seed)
    exposure_s = np.full(len(soil.samples), 2000.0)
    samples = Samples(soil.samples.xy, rng.poisson((soil.samples.rate_cps + drop) * exposure_s), exposure_s)
    survey = EarlierSurvey(name, NOW_S - 86400 * days, samples)
    return EarlierRun(survey, Path(name), survey.stamp_s - 3600, [], remarks=("A remark.",))


@pytest.fixture(scope="module")
def changed(make_run, the_map):
    runs = [earlier(the_map, "april", 30.0), earlier(the_map, "may", 7.0, 1.0)]
    return make_run(earlier=runs, change=run_change(the_map, NOW_S, runs))


def test_the_change_is_since_the_latest_earlier_survey(changed):
    assert changed.change.since.survey.name == "may"
    low, high = changed.change.change.mean_rate.interval95
    assert low < -1.0 < high
    assert changed.change.change.shares[1] > 0.5
    assert changed.change.means.keys() == {"april", "may"}
    assert changed.change.sd < changed.change.sd_alone


def test_the_change_is_less_certain_after_a_drift(the_map):
    runs, samples = [earlier(the_map, "may", 7.0)], the_map.samples
    timed = TimedSamples(samples, np.linspace(0, 3600, len(samples)))
    change = Change(Drift(0.99, False, (0.0, 3600.0), (0.0, 0.0), ((0.1, 0.1),)))
    still = make_soil_map(samples, the_map.grid, the_map.variogram)
    drifted = make_soil_map(samples, the_map.grid, the_map.variogram, changing=Changing(timed, change, 3600.0))
    certain, found = (run_change(one, NOW_S, runs) for one in (still, drifted))
    added = 0.1 * still.mean_rate  # all rates may be too high alike
    assert found.means["may"].value == pytest.approx(certain.means["may"].value)
    for one, other in (
        (found.means["may"].sd, certain.means["may"].sd),
        (found.change.mean_rate.sd, certain.change.mean_rate.sd),
        (found.sd, certain.sd),
        (found.sd_alone, certain.sd_alone),
    ):
        assert np.sqrt(one**2 - other**2) == pytest.approx(added, rel=0.01)
    wider = np.sqrt(found.change.rate_sd**2 - certain.change.rate_sd**2)[the_map.grid.mask]
    np.testing.assert_allclose(wider, added, rtol=0.01)


def test_the_report_names_surveys_and_change(changed):
    part = earlier_part(changed)
    assert [row.name for row in part.rows] == ["april", "may"]
    assert "wetter significantly" not in part.change
    assert "Since the survey may of 2026-01-26" in part.change
    assert "by volume" in part.change
    page = render_report(changed)
    assert "Earlier surveys, and what has changed" in page
    assert "A remark." in page
    layer = next(one for one in viewer_data(changed, irrigation(changed))["layers"] if one["key"] == "change")
    assert (layer["title"], layer["unit"]) == ("Change", "% by volume")


def test_files_have_the_change(changed, tmp_path):
    rasterio = pytest.importorskip("rasterio")
    assert tmp_path / "change.tif" in write_outputs(tmp_path, changed)
    with rasterio.open(tmp_path / "change.tif") as file:
        bands = dict(zip(file.descriptions, file.read(), strict=True))
        assert file.tags()["SOILMOIST_CHANGE_SINCE"] == "may"
        assert "before" not in str(list(map(file.tags, file.indexes))), "it may be a later survey"
    assert list(bands) == ["vwc_change", "vwc_change_sd", "rate_change", "rate_change_sd", "significant"]
    change = changed.change.change
    assert np.nanmean(bands["rate_change"]) == pytest.approx(np.nanmean(change.rate), abs=0.02)
    assert set(np.unique(bands["significant"][np.isfinite(bands["significant"])])) <= {-1.0, 0.0, 1.0}
    about = summary(changed)
    assert [one["name"] for one in about["earlier"]] == ["april", "may"]
    assert about["change"]["since"] == "may"
    assert about["change"]["mean_rate_cps"]["value"] == pytest.approx(change.mean_rate.value)


def test_a_comparison_with_a_later_survey_says_so(make_run, the_map):
    runs = [earlier(the_map, "june", -20.0)]
    part = earlier_part(make_run(earlier=runs, change=run_change(the_map, NOW_S, runs)))
    assert part.change.startswith("Compared with the later survey june of 2026-")


@pytest.mark.parametrize(
    ("days", "factor", "said"),
    [
        (-9e4, 1.0, "is dated 2272-07-02, in the future: check the clock"),
        (4000.0, 1.0, "lies 11 years from this one"),
        (30.0, 0.1, "has 0.1 times the count rate of this one"),
        (30.0, 10.0, "has 10 times the count rate of this one"),
        (30.0, 0.7, ""),
    ],
)
def test_doubtful_earlier_surveys_are_noted(make_run, the_map, days, factor, said):
    one = earlier(the_map, "april", days)
    samples = replace(one.survey.samples, exposure_s=one.survey.samples.exposure_s / factor)
    run = make_run(earlier=[replace(one, survey=replace(one.survey, samples=samples))])
    run = replace(run, track=[replace(record, stamp_s=NOW_S) for record in run.track])
    found = [note.message for note in notes(run) if note.code is NoteCode.DOUBTFUL_EARLIER]
    assert len(found) == bool(said)
    assert said in "".join(found)

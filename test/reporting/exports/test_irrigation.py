# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Irrigation zones as shapefile, GeoJSON and sheet: irrigation.py and sheet.py."""

from __future__ import annotations

import json
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pyogrio
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from reporting.exports.irrigated import OUTLINE, irrigated
from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.mapping import BorderSource
from soilmoist_ros.reporting.exports import irrigation, isoxml, sheet
from soilmoist_ros.reporting.exports.irrigation import RATE_UNITS, dose_layer, irrigation_plan, rate, write_dose
from soilmoist_ros.reporting.exports.registry import EXPORTS, export_run, open_run, open_source
from soilmoist_ros.reporting.exports.sheet import write_sheet
from soilmoist_ros.reporting.exports.source import ExportSettings
from soilmoist_ros.reporting.outputs import write_outputs
from soilmoist_ros.reporting.page.field_dose import field_dose
from soilmoist_ros.reporting.page.irrigation import irrigation as page_irrigation
from soilmoist_ros.sensing import Irrigation


@pytest.fixture
def plan(monkeypatch):
    source, its = irrigated()
    monkeypatch.setattr(irrigation, "irrigation_plan", lambda *_: its)
    return source, its


@pytest.mark.slow
@given(st.floats(0, 100))
def test_units_are_exact(gross_mm):
    """1 in = 25.4 mm; a US gallon has 231 cubic inches, an acre 43,560 square feet."""
    assert rate(gross_mm, "m3/ha") == pytest.approx(10 * gross_mm, rel=1e-15)
    assert rate(gross_mm, "in") == pytest.approx(gross_mm / 25.4, rel=1e-15)
    assert RATE_UNITS["gal/ac"] / RATE_UNITS["in"] == Fraction(43560 * 144, 231)


def test_shapefile_and_geojson_have_the_rate(plan, tmp_path):
    source, its = plan
    paths = write_dose(source, tmp_path, ExportSettings(rate_column="GPA", rate_unit="gal/ac"))
    assert [path.name for path in paths] == ["dose.zip", "dose.geojson"]
    for path in paths:
        about, _, wkb, values = pyogrio.raw.read(path)
        columns = dict(zip(about["fields"], values, strict=True))
        assert pyogrio.read_info(path)["crs"] == "EPSG:4326"
        np.testing.assert_allclose(columns["GPA"], [0.0, 10690.66366704162, 16035.99550056243], rtol=1e-14)
        assert columns["UNIT"].tolist() == ["gal/ac"] * 3
        assert columns["CALIBRATED"].tolist() == ["own"] * 3
        np.testing.assert_allclose(columns["VOLUME_M3"], [zone.volume_m3 for zone in its.zones], atol=0.05)
        assert ((columns["NET_P05"] < columns["NET_MM"]) | (columns["GPA"] == 0)).all()
        shapes = shapely.transform(shapely.from_wkb(wkb), lambda xy: source.frame.to_local(xy[:, 1], xy[:, 0]))
        assert shapely.union_all(shapes, grid_size=1e-4).symmetric_difference(OUTLINE).area < 0.1
        for shape, zone in zip(shapes, its.zones, strict=True):
            assert shape.symmetric_difference(zone.shape).area < 0.01


@pytest.mark.parametrize("name", ["", "1ST", "WATER RATE", "ELEVENCHARS", "zone", "AREA_HA", "date", "Wässerung"])
def test_a_name_that_no_column_can_have(name):
    with pytest.raises(InputError, match=r"cannot name the column of the rate -> give a letter"):
        dose_layer(*irrigated(), ExportSettings(rate_column=name))


def test_without_a_dose_the_reason_is_named():
    source, _ = irrigated()
    for write in (EXPORTS.get(name).write for name in ("dose", "isoxml", "sheet")):
        with pytest.raises(InputError, match="there is no dose: "):
            write(source, source.run.folder, ExportSettings())


def test_facts_fit_a_designator():
    source, plan = irrigated((0.0, 12.5, 17.5))
    small = {"steps_mm": 2.5, "max_dose_mm": 18.0, "root_depth_mm": 500}
    zones = [
        replace(zone, net_mm=zone.gross_mm + 12.3 * (zone.gross_mm == 17.5), needed=0.5) for zone in plan.zones
    ]
    most = replace(plan, zones=zones, settings=plan.settings.model_copy(update=small))
    assert most.facts["best estimate"] == "not certain"
    assert "best estimate" not in plan.facts
    assert most.facts["capped at"] == "17.5 mm, 12 mm remain"
    assert all(len(f"{name}: {value}") <= 32 for name, value in most.facts.items())
    assert dose_layer(source, most, ExportSettings()).columns["LEFT_MM"].tolist() == [0, 0, 12.3]
    xml, _ = isoxml.task_data(source, most, ExportSettings())
    assert b"capped at: 17.5 mm, 12 mm remain" in xml
    largest = "17.5 mm is the largest dose in steps of 2.5 mm up to the 18 mm of the machine"
    assert most.largest_text == largest


@pytest.mark.slow
def test_the_sheet_is_one_page_with_every_dose_and_the_advice(monkeypatch, tmp_path):
    advice = "Best estimate: irrigate 10 to 15 mm on 0.64 of 1.00 ha; decision sure on 55 % of the area. " * 5
    source, its = irrigated(irrigation={"advice": advice.strip()})
    monkeypatch.setattr(sheet, "irrigation_plan", lambda *_: its)
    (path,) = write_sheet(source, tmp_path, ExportSettings())
    content = path.read_bytes()
    assert (content.count(b"/Type /Page\n") + content.count(b"/Type /Page "), content[:5]) == (1, b"%PDF-")
    page = sheet.sheet(source, its, ExportSettings(rate_unit="m3/ha"))
    shown = [text.get_text() for part in (page, *page.axes) for text in part.texts]
    for text in ("West", "10 mm", "15 mm = 150", "dose [m3/ha]", "70 %", "N", "  50 m"):
        assert text in shown
    assert advice.strip() in [text.replace("\n", " ") for text in shown]
    assert any("calibration: own   survey: 2026-05-03" in text for text in shown)
    page.canvas.draw()
    height, width = page.bbox.height, page.bbox.width
    boxes = [text.get_window_extent() for text in page.texts if text.get_text()]
    for box in boxes:
        assert 0 < box.x0 < box.x1 < (1 - sheet.MARGIN / 2) * width
        assert 0 < box.y0 < box.y1 < height
    above = min(box.y0 for box in boxes if box.y0 > height / 2)
    assert above > page.axes[0].get_window_extent().y1, "no text is on the map"


@pytest.mark.slow
def test_a_run_is_exported_as_its_zones(make_run, tmp_path):
    limits = Irrigation(wilting_point=0.08, field_capacity=0.3, width_m=8, efficiency=0.8, max_dose_mm=20)
    folder = tmp_path / "run"
    write_outputs(folder, make_run(irrigation=limits))
    about = json.loads((folder / "summary.json").read_text())["dose"]
    notes = []
    paths = export_run(folder, ["dose", "isoxml", "sheet"], settings=ExportSettings(passes=3), note=notes.append)
    assert [path.name for path in paths] == ["dose.zip", "dose.geojson", "taskdata.zip", "irrigation.pdf"]
    assert any("run the task 3 times" in text for text in notes)
    source = open_source(open_run(folder))
    plan = irrigation_plan(source)
    assert plan.volume_m3 == pytest.approx(about["volume_m3"], rel=1e-12), "as the report has it"
    assert plan.certain is about["certain"]
    assert plan.capped[0] == max(zone.gross_mm for zone in plan.zones) == 20
    assert plan.capped[1] > 2
    assert sum(zone.area_m2 for zone in plan.zones) == pytest.approx(source.boundary.area, rel=1e-3)
    about, _, _, values = pyogrio.raw.read(paths[1])
    columns = dict(zip(about["fields"], values, strict=True))
    assert columns["RATE"].tolist() == [zone.gross_mm for zone in plan.zones]
    assert str(columns["DATE"][0])[:10] == plan.date
    border = BorderSource(paths[2]).read()
    rings = [source.frame.to_local(ring[:, 1], ring[:, 0]) for ring in (border.outline, *border.no_go)]
    found = shapely.Polygon(rings[0], rings[1:])
    assert found.symmetric_difference(source.boundary).area < 0.01, "the task can be the border of the next survey"


def test_sheet_task_and_report_tell_of_the_same_ground(make_run):
    """Water is missing where it is applied: not on the field, of which a half needs none."""
    run = make_run(irrigation=Irrigation(wilting_point=0.08, field_capacity=0.3, width_m=8))
    found, (source, _) = field_dose(run), irrigated()
    assert found.area_m2 < 0.9 * source.boundary.area
    plan = irrigation.Plan(found.settings, found.zones, found.sure, "", source.properties[0], "2026-05-03")
    net, low, high = found.missing_mm
    assert plan.facts["missing [mm]"] == f"{net:.0f} ({low:.0f} to {high:.0f})"
    assert plan.facts["decision sure on"] == f"{100 * found.sure:.0f} %"
    assert plan.facts["need sure on"] == f"{100 * found.need_sure:.0f} % of it"
    said = " ".join(page_irrigation(run).steps)
    assert f"There {net:.0f} mm ({low:.0f} to {high:.0f} mm) are missing" in said
    assert f"need sure on {100 * found.need_sure:.0f} % of that; decision sure on {100 * found.sure:.0f} %" in said
    xml, _ = isoxml.task_data(source, plan, ExportSettings(passes=5))
    assert f"missing [mm]: {net:.0f} ({low:.0f} to {high:.0f})".encode() in xml

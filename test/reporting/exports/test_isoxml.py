# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Irrigation tasks for terminals, read by another library and by a reader after ISO 11783-10: isoxml.py."""

from __future__ import annotations

import dataclasses
import re
import xml.etree.ElementTree as ET
import zipfile
from decimal import Decimal

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from reporting.exports.irrigated import OUTLINE, PARTS, irrigated
from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.reporting.exports import isoxml
from soilmoist_ros.reporting.exports.isoxml import FORMS, MAX_VALUE, VERSIONS, pdv_value, task_data
from soilmoist_ros.reporting.exports.source import ExportSettings

EACH = [(version, form) for version in VERSIONS for form in FORMS]


def made(version=3, form="grid1", plan=None, **changes):
    source, its = plan or irrigated()
    chosen = ExportSettings(isoxml_version=version, isoxml_form=form, **changes)
    xml, grid = task_data(source, its, chosen)
    return ET.fromstring(xml), grid


def polygon(element):
    """A polygon with its inner borders, as printed [deg]."""
    rings = {"1": [], "2": []}
    for line in element.iter("LSG"):
        rings[line.get("A")].append([(float(p.get("D")), float(p.get("C"))) for p in line.iter("PNT")])
    return shapely.MultiPolygon(
        [shapely.Polygon(ring, rings["2"] if len(rings["1"]) == 1 else []) for ring in rings["1"]]
    )


def value_at(root, grid, latitude, longitude):
    """Number of the rate at a place, as a task controller finds it."""
    task = root.find("TSK")
    zones = {zone.get("A"): zone for zone in task.iter("TZN")}
    number = {code: int(zone.find("PDV").get("B")) for code, zone in zones.items()}
    cells = task.find("GRD")
    if cells is None:
        own = [code for code, zone in zones.items() if zone.find("PLN") is not None
               and polygon(zone.find("PLN")).covers(shapely.Point(longitude, latitude))]  # fmt: skip
        return number[own[0] if own else task.get("J")]
    south, west, north_size, east_size = (float(cells.get(key)) for key in "ABCD")
    rows, columns = int(cells.get("F")), int(cells.get("E"))
    row, column = int((latitude - south) // north_size), int((longitude - west) // east_size)
    if not (0 <= row < rows and 0 <= column < columns):
        return number[task.get("J")]
    # The first cell is the south-west one; rows follow to the north.
    if cells.get("I") == "1":
        return number[str(np.frombuffer(grid, np.uint8).reshape(rows, columns)[row, column])]
    return int(np.frombuffer(grid, "<i4").reshape(rows, columns)[row, column])


@pytest.mark.slow
@given(
    doses=st.lists(st.integers(0, 84).map(lambda n: n / 4), min_size=3, max_size=3).map(sorted),
    latitude=st.floats(-66, 66),
    longitude=st.floats(-179, 179),
    which=st.sampled_from(EACH),
    seed=st.integers(0, 10**6),
)
@settings(max_examples=15, deadline=None)
def test_a_terminal_finds_the_dose_of_each_place(doses, latitude, longitude, which, seed):
    plan = source, its = irrigated(doses, latitude, longitude)
    root, grid = made(*which, plan=plan)
    places = np.random.default_rng(seed).uniform((-80, -60), (80, 60), (60, 2))
    borders = [OUTLINE.boundary, *(part.boundary for part in PARTS)]
    for x, y in places.tolist():
        here = shapely.Point(x, y)
        if min(border.distance(here) for border in borders) < 2.0:  # a cell has one dose
            continue
        expected = [zone.gross_mm for zone in its.zones if zone.shape.contains(here)]
        ((lat, lon),) = source.frame.to_geographic(np.array([[x, y]]))
        found = value_at(root, grid, lat, lon)
        assert found == (round(expected[0] * 1e8) if expected else 0)


@pytest.mark.parametrize(("version", "form"), EACH)
def test_borders_and_rates_come_back_to_the_last_digit(version, form):
    plan = source, its = irrigated()
    root, grid = made(version, form, plan)
    there = isoxml._in_degrees(source, [source.boundary, *(zone.shape for zone in its.zones)])
    shapes = [polygon(root.find("PFD/PLN"))]
    if form == "polygons":
        shapes += [polygon(zone.find("PLN")) for zone in root.iter("TZN") if zone.find("PLN") is not None]
        assert [int(z.find("PDV").get("B")) for z in root.iter("TZN")] == [0, 0, 10**9, 15 * 10**8]
    else:
        assert len(grid) == int(root.find("TSK/GRD").get("H"))
    for found, true in zip(shapes, there, strict=False):
        np.testing.assert_allclose(
            shapely.get_coordinates(found), shapely.get_coordinates(true), atol=0.51e-9, rtol=0
        )
    assert (len(shapes[0].geoms[0].interiors), root.find("PFD").get("D")) == (1, str(round(OUTLINE.area)))
    for point in root.iter("PNT"):
        assert all(-Decimal(point.get(key)).as_tuple().exponent == 9 for key in "CD")


@pytest.mark.parametrize(("version", "form"), EACH)
def test_another_library_reads_it_and_its_schema_holds(version, form):
    """The classes of ``isoxml`` carry the rules of the schemas of ISO 11783-10, versions 3.3 and 4.3."""
    io = pytest.importorskip("isoxml.util.isoxml_io")
    plan = irrigated(field="Long Meadow & <Hill> \x07 über sehr langen Namen", site="€" * 40)
    xml, grid = task_data(*plan, ExportSettings(isoxml_version=version, isoxml_form=form, rate_unit="m3/ha"))
    task_data_ = io.isoxml_from_text(xml.decode())
    assert type(task_data_).__module__.split(".")[-2] == f"v{version}"
    _check(task_data_)
    from isoxml.converter.shapely_geom import ShapelyConverterV3, ShapelyConverterV4

    converter = {3: ShapelyConverterV3, 4: ShapelyConverterV4}[version]()
    (pfd,), (task,) = task_data_.partfields, task_data_.tasks
    expected = isoxml._in_degrees(plan[0], [plan[0].boundary])[0]
    found = shapely.get_coordinates(converter.to_shapely_polygon(pfd.polygons[0]))
    np.testing.assert_allclose(found, shapely.get_coordinates(expected), atol=0.51e-9, rtol=0)
    if grid is not None:
        from isoxml.converter.np_grid import to_numpy_array

        array = to_numpy_array(grid, task.grids[0], scale=False)
        south, north = array[len(array) // 6], array[-len(array) // 6]
        assert south.max() == (3 if form == "grid1" else 15 * 10**8)
        assert north.max() == (2 if form == "grid1" else 10**9)


def _check(one):
    """Patterns, lengths and limits of an object of the library, and of all within it."""
    for field in dataclasses.fields(one):
        value, rules = getattr(one, field.name), field.metadata
        for part in value if isinstance(value, list) else [value]:
            if dataclasses.is_dataclass(part):
                _check(part)
        if value is None or isinstance(value, list) or rules.get("type") != "Attribute":
            assert not (value is None and rules.get("required")), (one, field.name)
            continue
        text = str(getattr(value, "value", value))
        assert len(text) <= rules.get("max_length", 99), (one, field.name)
        assert re.fullmatch(rules.get("pattern", ".*"), text), (one, field.name)
        for rule, sign in (("min_inclusive", 1), ("max_inclusive", -1)):
            if rule in rules:
                assert sign * float(value) >= sign * float(rules[rule]), (one, field.name)


def test_the_number_of_a_rate_is_that_of_the_data_dictionary():
    """100 l/ha are the number 1000000 in a public task (isoxml-dotnet, MacOSExtensionFiles): 0.01 mm^3/m^2."""
    assert pdv_value(100 / 1e4) == 1_000_000
    entity = pytest.importorskip("isoxml.models.ddi_entities").DDEntity.from_id(int(isoxml.DDI, 16))
    assert (entity.unit, 1e6 / entity.bit_resolution) == ("mm³/m²", isoxml.UNITS_PER_MM)


@given(gross_mm=st.floats(0, 60), passes=st.integers(1, 5))
def test_rates_that_do_not_fit_are_divided_by_passes(gross_mm, passes):
    try:
        value = pdv_value(gross_mm, passes)
    except InputError as error:
        assert gross_mm / passes > 21.47
        enough = int(str(error).split()[-1])
        assert pdv_value(gross_mm, enough) <= MAX_VALUE < pdv_value(gross_mm, 10**6) * 10**6 / (enough - 1) + 10**6
    else:
        assert abs(value * passes / 1e8 - gross_mm) <= 0.51e-8 * passes


def test_passes_are_named():
    plan = irrigated((0.0, 25.0, 30.0))
    with pytest.raises(InputError, match=r"25 mm does not fit .* 21\.47 mm -> .*--isoxml-passes 2"):
        made(plan=plan)
    root, _ = made(plan=plan, passes=2)
    zones = {zone.get("B"): zone.find("PDV").get("B") for zone in root.iter("TZN")}
    assert zones["12.5 of 25 mm, right with 70 %"] == "1250000000"
    assert "run this task 2 times" in [one.get("C") for one in root.iter("CAN")]
    assert "run the task 2 times" in plan[0].notes[0]


def test_the_limits_of_a_terminal(tmp_path):
    plan = source, _ = irrigated()
    _, grid = made(plan=plan, max_cells=100)
    assert len(grid) <= 100
    assert "so that the grid has at most 100 cells" in source.notes[0]
    with pytest.raises(InputError, match=r"has 3 zones, and the terminal takes 2 -> use --isoxml-form grid2"):
        made(max_zones=2)
    assert made(form="grid2", max_zones=2)[1]
    same = irrigated((10.0, 10.0, 15.0))
    with pytest.raises(InputError, match="choose --isoxml-form grid1, where zones of one dose are one"):
        made(form="polygons", max_zones=2, plan=same)
    assert len(list(made(max_zones=2, plan=same)[0].iter("TZN"))) == 3
    source.notes.clear()
    made(plan=plan, max_cells=1)
    assert sum("is not in the grid" in note for note in source.notes) == 2


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"version": 2}, "ISOXML 2 with 'grid1' is not possible -> use version 3 or 4"),
        ({"form": "grid3"}, "with 'grid3' is not possible"),
        ({"passes": 0}, "0 passes are not possible"),
        ({"max_cells": 0}, "a grid of 0 cells is not possible"),
        ({"rate_unit": "in"}, "cannot show in -> choose --rate-unit mm"),
        ({"rate_unit": "cm"}, "there is no unit 'cm' of a rate"),
        ({"plan": irrigated(longitude=-179.9999)}, "across the antimeridian"),
    ],
)
def test_bad_input_is_named(changes, message):
    with pytest.raises(InputError, match=message):
        made(**changes)


def test_the_archive_is_as_terminals_take_it(tmp_path, monkeypatch):
    source, plan = irrigated()
    monkeypatch.setattr(isoxml, "irrigation_plan", lambda *_: plan)
    (path,) = isoxml.write_isoxml(source, tmp_path, ExportSettings())
    before = path.read_bytes()
    assert zipfile.ZipFile(path).namelist() == ["TASKDATA/TASKDATA.XML", "TASKDATA/GRD00001.bin"]
    assert isoxml.write_isoxml(source, tmp_path, ExportSettings())[0].read_bytes() == before
    (path,) = isoxml.write_isoxml(source, tmp_path, ExportSettings(isoxml_form="polygons"))
    assert zipfile.ZipFile(path).namelist() == ["TASKDATA/TASKDATA.XML"]
    task = made()[0].find("TSK")
    assert [task.get(key) for key in "HIJ"] == ["0", "0", "0"], "no water without a position or a zone"
    assert [one.get("C") for one in task.iter("CAN")][:2] == ["calibration: own", "survey: 2026-05-03"]


def test_a_field_of_two_parts_is_one_polygon_in_version_3_and_two_in_version_4():
    two = shapely.MultiPolygon([shapely.box(-60, -45, -10, 45), shapely.box(10, -45, 60, 45)])
    plan = irrigated(outline=two)
    for zone in plan[1].zones:  # polygons of zones are single ones
        assert zone.shape.area > 0
    for version, polygons in ((3, 1), (4, 2)):
        root, _ = made(version, plan=plan)
        field = root.findall("PFD/PLN")
        assert (len(field), sum(len(one.findall("LSG")) for one in field)) == (polygons, 2)

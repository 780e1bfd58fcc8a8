"""Forecasts and outlines for the page Plan (plan_work.py)."""

from __future__ import annotations

import base64
import io
import json
import subprocess
import sys
import zipfile

import numpy as np
import pyogrio
import pytest
import shapely

from soilmoist_ros.console.plan_work import check_field, field_text, forecast, outline
from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.foundation.geodesy import LocalFrame
from soilmoist_ros.mapping.field import load_field

DATUM = [53.268, -0.5245]
FIELD = {"name": 'A "field": x', "datum": DATUM, "boundary": [[0, 0], [40, 0], [40, 30], [0, 30]]}
HOLE = [[10, 10], [20, 10], [20, 20]]


def test_what_is_drawn_becomes_a_field_file(tmp_path):
    answer = check_field({**FIELD, "no_go": [HOLE]})
    assert answer["area_m2"] == 40 * 30 - 50
    path = tmp_path / "field.yaml"
    path.write_text(answer["file"], encoding="utf-8")
    field = load_field(path)
    assert field.name == 'A "field": x'
    assert field.polygon.tolist() == FIELD["boundary"]
    assert [area.tolist() for area in field.no_go] == [HOLE]
    with pytest.raises(InputError, match="not a simple polygon"):
        check_field({**FIELD, "boundary": [[0, 0], [40, 30], [40, 0], [0, 30]]})
    assert field_text({**FIELD, "name": ""}).startswith('name: "drawn field"\n')


@pytest.mark.slow
def test_a_longer_mission_makes_a_better_map():
    answer = forecast({**FIELD, "hours": 0.5, "variation": 0.2})
    times, errors = zip(*answer["points"], strict=True)
    assert times == tuple(sorted(times))
    assert max(times) == 1800
    assert 0 < errors[-1] < errors[0] < 0.6
    assert answer["stops"] > 5
    assert answer["distance_m"] > 50
    for wrong in ({"hours": 100}, {"variation": 7}, {"strategy": "none", "hours": 0.1}):
        with pytest.raises(InputError):
            forecast({**FIELD, **wrong})


def files():
    """The same field with a hole, as people have it."""
    frame = LocalFrame(*DATUM)
    rings = [frame.to_geographic(np.array(ring, float))[:, ::-1] for ring in (FIELD["boundary"], HOLE)]
    polygon = shapely.Polygon(rings[0], [rings[1]])
    small = shapely.Polygon(rings[1] + 0.01)
    for driver, suffix in (("GeoJSON", "geojson"), ("KML", "kml")):
        content = io.BytesIO()
        shapes = shapely.to_wkb(np.array([small, polygon]))
        pyogrio.raw.write(content, shapes, [], [], driver=driver, geometry_type="Polygon", crs="EPSG:4326")
        yield f"field.{suffix}", content.getvalue()


def zipped(folder):
    frame = LocalFrame(*DATUM)
    rings = [frame.to_geographic(np.array(ring, float))[:, ::-1] for ring in (FIELD["boundary"], HOLE)]
    shape = shapely.to_wkb(np.array([shapely.Polygon(rings[0], [rings[1]])]))
    pyogrio.raw.write(
        folder / "f.shp", shape, [], [], driver="ESRI Shapefile", geometry_type="Polygon", crs="EPSG:4326"
    )
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w") as archive:
        for path in folder.glob("f.*"):
            archive.write(path, path.name)
    return "field.ZIP", content.getvalue()


def test_a_boundary_comes_from_the_files_that_people_have(tmp_path):
    for name, content in (*files(), zipped(tmp_path)):
        given = {"name": name, "content": base64.b64encode(content).decode(), "datum": DATUM}
        answer = outline(given)
        found = shapely.Polygon(answer["boundary"], answer["no_go"])
        assert found.symmetric_difference(shapely.Polygon(FIELD["boundary"], [HOLE])).area < 2.0, name
        assert outline({**given, "datum": None})["datum"] == pytest.approx(DATUM, abs=1e-3)


@pytest.mark.parametrize(
    ("name", "content"),
    [("a.exe", b""), ("a.zip", b"PK nothing"), ("a.kml", b"<kml>"), ("a.json", b"{}"), ("a.geojson", b"\xff")],
)
def test_other_files_are_refused(name, content):
    with pytest.raises(InputError):
        outline({"name": name, "content": base64.b64encode(content).decode()})


def test_it_is_a_process_that_answers_with_json():
    for given, key in (
        ({"task": "field", **FIELD}, "file"),
        ({"task": "field"}, "error"),
        ({"task": "x"}, "error"),
    ):
        done = subprocess.run(
            [sys.executable, "-m", "soilmoist_ros.console.plan_work"],
            input=json.dumps(given), capture_output=True, text=True, timeout=100, check=True,
        )  # fmt: skip
        assert key in json.loads(done.stdout)

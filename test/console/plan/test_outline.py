# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Outlines from files of strangers (outline.py): what people have, and what nobody should have."""

from __future__ import annotations

import base64
import io
import json
import zipfile

import numpy as np
import pyogrio
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from soilmoist_ros.console.plan import outline as module
from soilmoist_ros.console.plan.outline import outline
from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.foundation.geodesy import LocalFrame
from soilmoist_ros.mapping.border_file import MAX_MEMBERS, MAX_UNZIPPED_BYTES

DATUM = [53.268, -0.5245]
RING = [[0, 0], [40, 0], [40, 30], [0, 30]]
HOLE = [[10, 10], [20, 10], [20, 20]]
FRAME = LocalFrame(*DATUM)


def degrees(ring):
    return FRAME.to_geographic(np.array(ring, float))[:, ::-1]


def read(name, content, datum=DATUM):
    return outline({"name": name, "content": base64.b64encode(content).decode(), "datum": datum})


def written(driver, shapes, crs="EPSG:4326"):
    content = io.BytesIO()
    pyogrio.raw.write(
        content, shapely.to_wkb(np.array(shapes)), [], [], driver=driver, geometry_type="Polygon", crs=crs
    )
    return content.getvalue()


def zipped(members):
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in members.items():
            archive.writestr(name, data)
    return content.getvalue()


def shapefile(folder, polygon, crs="EPSG:4326"):
    folder.mkdir(exist_ok=True)
    pyogrio.raw.write(
        folder / "f.shp", shapely.to_wkb(np.array([polygon])), [], [], driver="ESRI Shapefile",
        geometry_type="Polygon", crs=crs,
    )  # fmt: skip
    return {path.name: path.read_bytes() for path in folder.glob("f.*")}


def same(answer, tolerance_m2=2.0):
    found = shapely.Polygon(answer["boundary"], answer["no_go"])
    return found.symmetric_difference(shapely.Polygon(RING, [HOLE])).area < tolerance_m2


def test_a_boundary_comes_from_the_files_that_people_have(tmp_path):
    polygon, small = shapely.Polygon(degrees(RING), [degrees(HOLE)]), shapely.Polygon(degrees(HOLE) + 0.01)
    kml = written("KML", [small, polygon])
    parts = shapefile(tmp_path / "wgs", polygon)
    utm = shapefile(tmp_path / "utm", shapely.Polygon(_utm(RING), [_utm(HOLE)]), "EPSG:32630")
    upper = {f"Field/{name.upper()}": data for name, data in parts.items()}
    files = {
        "a.geojson": written("GeoJSON", [small, polygon]),
        "A.KML": kml,
        "a.kmz": zipped({"doc.kml": kml, "icon.png": b"\x89PNG"}),
        "a.ZIP": zipped({**upper, "__MACOSX/._f.shp": b"x"}),
        "utm.zip": zipped(utm),
        "old.json": json.dumps({
            "type": "FeatureCollection", "crs": {"type": "name", "properties": {"name": "EPSG:32630"}},
            "features": [{"type": "Feature", "geometry": shapely.geometry.mapping(
                shapely.Polygon(_utm(RING), [_utm(HOLE)]))}],
        }).encode(),
    }  # fmt: skip
    for name, content in files.items():
        answer = read(name, content)
        assert same(answer), name
        assert ("largest of 2" in answer["note"]) is (name in ("a.geojson", "A.KML", "a.kmz"))
        assert read(name, content, None)["datum"] == pytest.approx(DATUM, abs=1e-3)


def test_a_polygon_inside_the_boundary_is_a_no_go_area():
    answer = read(
        "two.geojson", written("GeoJSON", [shapely.Polygon(degrees(HOLE)), shapely.Polygon(degrees(RING))])
    )
    assert same(answer)
    assert "is a no-go area" in answer["note"]


def _utm(ring):
    from pyproj import Transformer

    to_utm = Transformer.from_crs("EPSG:4326", "EPSG:32630", always_xy=True)
    return np.column_stack(to_utm.transform(*degrees(ring).T))


def test_a_path_of_google_earth_is_a_boundary_if_it_is_closed():
    places = [*degrees(RING), degrees(RING)[0]]
    text = " ".join(f"{lon},{lat},0" for lon, lat in places)
    kml = "<kml xmlns='http://www.opengis.net/kml/2.2'><Placemark><LineString><coordinates>{}</coordinates></LineString></Placemark></kml>"
    answer = read("path.kml", kml.format(text).encode())
    assert shapely.Polygon(answer["boundary"]).symmetric_difference(shapely.Polygon(RING)).area < 2
    with pytest.raises(InputError, match="close the line"):
        read("path.kml", kml.format(text.rpartition(" ")[0]).encode())


BOMB = zipped({"f.shp": b"\0" * (MAX_UNZIPPED_BYTES + 1)})
ENTITIES = b'<!DOCTYPE k [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;">]><kml><coordinates>&b;</coordinates></kml>'
LAYER = b"<OGRVRTLayer name='p'><SrcDataSource>/etc/passwd</SrcDataSource></OGRVRTLayer>"
VRT = b"<OGRVRTDataSource>" + LAYER + b"</OGRVRTDataSource>"


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("a.exe", b"", "choose one of"),
        ("a.zip", b"PK nothing", "cannot be unpacked"),
        ("a.zip", BOMB, "100 MB"),
        ("a.zip", zipped({f"{n}.txt": b"" for n in range(MAX_MEMBERS + 1)}), "1000 files"),
        ("a.zip", zipped({"f.shp": VRT, "f.shx": b"", "f.prj": b""}), "something else"),
        ("a.zip", zipped({"../../f.txt": b"x"}), "no file with a border"),
        ("a.kml", b"<kml>", "not valid XML"),
        ("a.kml", ENTITIES, "definitions of its own"),
        ("a.kml", VRT, "no polygon"),
        ("a.json", b"{}", "no polygon"),
        ("a.json", b"[1]", "no polygon"),
        ("a.json", b"[" * 100_000, "not valid JSON"),
        ("a.geojson", b"\xff", "not valid JSON"),
        ("a.geojson", b'{"type": "Polygon", "coordinates": [[[1e9, 1], [2, 1], [2, 2], [1e9, 1]]]}', "longitude"),
        ("a.geojson", b'{"type": "Polygon", "coordinates": [[[NaN, 1], [2, 1], [2, 2], [1, 1]]]}', "a.geojson"),
    ],
)  # fmt: skip
def test_other_files_are_refused(name, content, said):
    with pytest.raises(InputError, match=said):
        read(name, content)


@pytest.mark.slow
def test_many_corners_become_few_and_too_many_are_refused():
    angles = np.linspace(0, 2 * np.pi, 20_000)
    circle = degrees(np.column_stack([100 * np.cos(angles), 100 * np.sin(angles)])).tolist()
    answer = read("c.json", json.dumps({"type": "Polygon", "coordinates": [circle]}).encode())
    assert len(answer["boundary"]) <= module.MAX_CORNERS
    assert shapely.Polygon(answer["boundary"]).area == pytest.approx(np.pi * 1e4, rel=1e-3)
    many = {"type": "Polygon", "coordinates": [circle * 12]}
    with pytest.raises(InputError, match="corners"):
        read("c.json", json.dumps(many).encode())


@given(st.binary(max_size=300), st.sampled_from([".geojson", ".kml", ".zip", ".kmz"]))
def test_noise_is_refused_in_words(content, suffix):
    with pytest.raises(InputError):
        read(f"noise{suffix}", content)


def test_a_file_on_another_side_of_the_earth_than_the_datum_is_refused():
    polygon = shapely.Polygon([(170, -50), (170.01, -50), (170.01, -50.01)])
    with pytest.raises(InputError, match="another side of the earth"):
        read("f.geojson", shapely.to_geojson(polygon).encode())

# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Fields for the page Plan."""

from __future__ import annotations

import base64
import io
import json
import math
import subprocess
import sys
import zipfile

import numpy as np
import pyogrio
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from soilmoist_ros.console import Board, Walk
from soilmoist_ros.console.plan_work import MAX_PLACES, STEP_M, check_field, field_text, outline, walked
from soilmoist_ros.foundation import InputError, LocalFrame
from soilmoist_ros.mapping.border_file import MAX_MEMBERS, MAX_UNZIPPED_BYTES
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
    assert answer["note"] == ""
    across = [[[19, 1], [21, 1], [21, 40], [19, 40]]]
    answer = check_field({**FIELD, "no_go": across})
    assert answer["area_m2"] == 40 * 30 - 2 * 29, "without what lies over the border"
    assert "divide the field into 2 parts" in answer["note"]
    with pytest.raises(InputError, match=r"no-go area 1 encloses .* less than 1 m2"):
        check_field({**FIELD, "no_go": [[[1, 1], [1.5, 1], [1.5, 1.5]]]})
    with pytest.raises(InputError, match="not a simple polygon"):
        check_field({**FIELD, "boundary": [[0, 0], [40, 30], [40, 0], [0, 30]]})
    with pytest.raises(InputError, match="draw or walk a larger one"):
        check_field({**FIELD, "boundary": [[0, 0], [0.5, 0], [0.5, 0.5]]})
    assert field_text({**FIELD, "name": ""}).startswith('name: "drawn field"\n')


@pytest.mark.slow
def test_it_is_a_process_that_answers_with_json():
    for asked, key in (
        ({"task": "field", **FIELD}, "file"),
        ({"task": "field"}, "error"),
        ({"task": "x"}, "error"),
        ({"task": "field", **FIELD, "no_go": [[[900, 10], [910, 10], [910, 20]]]}, "error"),
    ):
        done = subprocess.run(
            [sys.executable, "-m", "soilmoist_ros.console.plan_work"],
            input=json.dumps(asked), capture_output=True, text=True, timeout=100, check=True,
        )  # fmt: skip
        assert key in json.loads(done.stdout)
    assert json.loads(done.stdout)["error"].startswith("no-go area 1 lies "), "no name of a temporary file"


# Outlines from files of strangers (outline.py): what people have, and what nobody should have -------------------

FILE_DATUM = [53.268, -0.5245]
RING = [[0, 0], [40, 0], [40, 30], [0, 30]]
POND = [[10, 10], [20, 10], [20, 20]]
FRAME = LocalFrame(*FILE_DATUM)


def degrees(ring):
    return FRAME.to_geographic(np.array(ring, float))[:, ::-1]


def read(name, content, datum=FILE_DATUM):
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
    return found.symmetric_difference(shapely.Polygon(RING, [POND])).area < tolerance_m2


def test_a_boundary_comes_from_the_files_that_people_have(tmp_path):
    polygon, small = shapely.Polygon(degrees(RING), [degrees(POND)]), shapely.Polygon(degrees(POND) + 0.01)
    kml = written("KML", [small, polygon])
    parts = shapefile(tmp_path / "wgs", polygon)
    utm = shapefile(tmp_path / "utm", shapely.Polygon(_utm(RING), [_utm(POND)]), "EPSG:32630")
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
                shapely.Polygon(_utm(RING), [_utm(POND)]))}],
        }).encode(),
    }  # fmt: skip
    for name, content in files.items():
        answer = read(name, content)
        assert same(answer), name
        assert ("largest of 2" in answer["note"]) is (name in ("a.geojson", "A.KML", "a.kmz"))
        assert read(name, content, None)["datum"] == pytest.approx(FILE_DATUM, abs=1e-3)


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


@given(st.binary(max_size=300), st.sampled_from([".geojson", ".kml", ".zip", ".kmz"]))
def test_noise_is_refused_in_words(content, suffix):
    with pytest.raises(InputError):
        read(f"noise{suffix}", content)


# A boundary from a walk (walk.py) -------------------------------------------------------------------------------

CORNERS = np.array([[0, 0], [60, 5], [55, 50], [-5, 40]], float)


def along(corners, step_m=0.5, noise_m=0.0, seed=1):
    """Places of a walk around corners, back to the first."""
    rng, places = np.random.default_rng(seed), []
    for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        shares = np.arange(0, 1, step_m / math.dist(start, end))[:, None]
        places.append(start + shares * (end - start))
    walk = np.vstack(places)
    return (walk + rng.normal(0, noise_m, walk.shape)).round(2).tolist()


@given(st.floats(0, 0.3), st.integers(1, 50))
def test_a_walk_becomes_a_ring_with_few_corners(noise_m, seed):
    places = along(CORNERS, noise_m=noise_m / 3, seed=seed)
    answer = walked({"places": places, "sd": noise_m})
    ring = shapely.Polygon(answer["ring"])
    assert ring.is_valid
    assert 4 <= len(answer["ring"]) < len(places) / 8
    assert ring.symmetric_difference(shapely.Polygon(CORNERS)).area < 200 * (answer["tolerance_m"] + noise_m)
    assert answer["gap_m"] < 1.5


@pytest.mark.slow
def test_places_are_recorded_between_begin_and_end():
    board = Board()
    walk = Walk(board, "r1")
    walk.place(9.0, 9.0, 0.01)
    walk.begin("Ada", "area")
    for n in range(20):
        walk.place(n * STEP_M / 4, 0.0, 0.02 + 0.01 * (n == 12))
    assert board.get("walk/r1") == {"who": "Ada", "kind": "area", "sd": 0.03, "count": 5}
    assert board.get("walk/r1/places")[0] == (0.0, 0.0)
    walk.place(50.0, 0.0, math.nan)
    done = walk.end()
    assert (done["kind"], done["count"], done["sd"], len(done["places"])) == ("area", 6, None, 6)
    assert (board.get("walk/r1"), board.get("walk/r1/places")) == (None, ())
    walk.place(60.0, 0.0, 0.01)
    assert board.get("walk/r1/places") == ()
    walk.begin("", "boundary")
    for n in range(MAX_PLACES + 10):
        walk.place(float(n), 0.0, 0.01)
    assert MAX_PLACES / 2 <= len(walk.end()["places"]) <= MAX_PLACES

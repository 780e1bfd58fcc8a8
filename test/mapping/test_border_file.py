# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Borders of fields in files of other programs (border_file.py): each is read right, or says what is open."""

import json
import re
import zipfile

import numpy as np
import pytest

from soilmoist_ros.foundation import InputError, LocalFrame
from soilmoist_ros.mapping import BorderSource, load_field

FRAME = LocalFrame(53.268, -0.5245)


def degrees(corners):
    """Corners in metres as closed ring of [longitude, latitude]."""
    ring = FRAME.to_geographic(np.array(corners, float))[:, ::-1].tolist()
    return [*ring, ring[0]]


FIELD = [(0, 0), (80, 0), (80, 60), (0, 60)]
POND = [(30, 20), (40, 20), (40, 32), (30, 32)]
NEIGHBOUR = [(100, 0), (150, 0), (150, 60), (100, 60)]


def feature(kind, coordinates, **properties):
    return {"type": "Feature", "properties": properties, "geometry": {"type": kind, "coordinates": coordinates}}


def collection(*features, crs=None):
    named = {"crs": {"type": "name", "properties": {"name": crs}}} if crs else {}
    return {"type": "FeatureCollection", **named, "features": list(features)}


def written(tmp_path, content, name="border.geojson"):
    path = tmp_path / name
    path.write_text(content if isinstance(content, str) else json.dumps(content), encoding="utf-8")
    return path


def read(path, **options):
    border = BorderSource(path, **options).read()
    return border, FRAME.to_local(border.outline[:, 1], border.outline[:, 0])


def assert_is_field(path, no_go=0, **options):
    """Check corners, which may begin anywhere and go either way round."""
    border, outline = read(path, **options)
    np.testing.assert_allclose(sorted(outline.round(2).tolist()), sorted(np.array(FIELD, float).tolist()))
    assert len(border.no_go) == no_go
    return border


POLYGON = feature("Polygon", [degrees(FIELD)], name="field")


@pytest.mark.parametrize(
    ("content", "no_go"),
    [
        (collection(POLYGON), 0),
        (POLYGON["geometry"], 0),
        (collection(feature("MultiPolygon", [[degrees(FIELD), degrees(POND)]])), 1),
        (collection(POLYGON, feature("Polygon", [degrees(POND)], name="pond")), 1),
        (collection(POLYGON, POLYGON), 0),
        (collection(feature("Polygon", [degrees(POND), degrees(FIELD)])), 1),
        (collection(feature("Polygon", [degrees(FIELD), degrees([(5, 5), (5.3, 5), (5.3, 5.3)])])), 1),
        (collection(feature("Polygon", [degrees(FIELD), degrees([(5, 5), (5.1, 5), (5.1, 5.1)])])), 0),
        (collection(feature("Polygon", [degrees(FIELD)[:-1]])), 0),
        (collection(feature("Polygon", [[[*corner, 17.5] for corner in degrees(FIELD)]])), 0),
        (collection(feature("LineString", degrees(FIELD), name="boundary")), 0),
        (collection(feature("MultiLineString", [degrees(FIELD)])), 0),
        ({"type": "GeometryCollection", "geometries": [POLYGON["geometry"]]}, 0),
        (collection(POLYGON, feature("Point", [-0.5245, 53.268], name="gate")), 0),
        (collection(POLYGON, crs="urn:ogc:def:crs:OGC:1.3:CRS84"), 0),
        (collection(POLYGON, crs="urn:ogc:def:crs:EPSG::4326"), 0),
        (collection({**POLYGON, "type": "geoData"}), 0),
        (collection(feature("Polygon", [[[lon + 360, lat] for lon, lat in degrees(FIELD)]])), 0),
    ],
)
def test_geojson_of_many_makers(tmp_path, content, no_go):
    assert_is_field(written(tmp_path, content), no_go)


def test_a_driven_line_with_a_small_gap_is_a_border_and_said_so(tmp_path):
    line = degrees([*FIELD, (0, 3)])[:-1]
    border, outline = read(written(tmp_path, collection(feature("LineString", line))))
    assert len(outline) == 5
    assert "though its ends are apart by about 1% of its length" in border.notes[0]


def test_the_datum_that_a_file_states_is_used(tmp_path):
    pytest.importorskip("pyproj")
    border, outline = read(written(tmp_path, collection(POLYGON, crs="urn:ogc:def:crs:EPSG::4277")))
    np.testing.assert_allclose(
        outline - FIELD, [(-109.1, 33.3)] * 4, atol=2.5
    )  # the accuracy without a grid of PROJ
    assert "converted from urn:ogc:def:crs:EPSG::4277 (OSGB36) to WGS-84" in border.notes[0]


@pytest.mark.slow
@pytest.mark.parametrize("epsg", [27700, 3857, 4258])
def test_projections_lead_to_the_same_place(tmp_path, epsg):
    pyproj = pytest.importorskip("pyproj")
    there = pyproj.Transformer.from_crs("EPSG:4326", f"EPSG:{epsg}", always_xy=True)
    ring = [list(there.transform(*corner)) for corner in degrees(FIELD)]
    for name in (f"urn:ogc:def:crs:EPSG::{epsg}", f"EPSG:{epsg}"):
        border = assert_is_field(written(tmp_path, collection(feature("Polygon", [ring]), crs=name)))
        assert "converted from" in border.notes[0]
    of_shape = feature("Polygon", [ring])
    of_shape["geometry"]["crs"] = {"type": "name", "properties": {"name": f"EPSG:{epsg}"}}
    assert_is_field(written(tmp_path, collection(of_shape)))
    with pytest.raises(InputError, match=f"names two reference systems, EPSG:31467 and EPSG:{epsg}"):
        read(written(tmp_path, collection(of_shape, crs="EPSG:31467")))
    plain = written(tmp_path, collection(feature("Polygon", [ring])))
    if epsg != 4258:
        with pytest.raises(InputError, match=r"metres of a map projection such as UTM -> .*crs: EPSG"):
            read(plain)
    assert_is_field(plain, crs=f"EPSG:{epsg}")
    with pytest.raises(InputError, match=r"is in EPSG:\d+, but the field file says crs: EPSG:31467"):
        read(written(tmp_path, collection(feature("Polygon", [ring]), crs=f"EPSG:{epsg}")), crs="EPSG:31467")


METRES = feature("Polygon", [[[0, 0], [80, 0], [80, 60], [0, 60], [0, 0]]])


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (collection(METRES, crs="urn:ogc:def:crs:EPSG::32630"), r"corner \(0, 0\) is longitude -7\.49"),
        (collection(METRES, crs="EPSG:3857"), "metres from a datum go to 'polygon' in the field file"),
        (collection(METRES), "would span 80 degrees: they look like metres"),
        (collection(POLYGON, crs="EPSG:32630"), r"corner .* looks like degrees"),
        (collection(POLYGON, crs="EPSG:999999"), "EPSG:999999 cannot be converted to WGS-84"),
        ({**collection(POLYGON), "crs": {"type": "link", "properties": {"href": "x"}}}, "a way that is not read"),
        (collection(feature("Polygon", [[[53.2, 200], [53.3, 200], [53.3, 201]]])), "is not in degrees"),
        (collection(feature("Polygon", [[[53.2, -97], [53.3, -97], [53.3, -97.1]]])), "longitude comes first"),
        (collection(feature("Polygon", [[["a", 2], [3, 4], [5, 6]]])), "a corner that is not two numbers"),
        (collection(feature("LineString", degrees(FIELD)[:3])), "no polygon, but 1 open line and .* -> close"),
        (collection(*(feature("Point", one) for one in degrees(FIELD))), "no polygon, but 5 points"),
        (collection(), "holds no polygon"),
        (collection(POLYGON, feature("Polygon", [degrees(NEIGHBOUR)], name="east")),
         r"holds 2 polygons, none .*: 'field', 'east' -> .*border: \{file: border.geojson, feature: 'field'\}"),
        (collection(feature("MultiPolygon", [[degrees(FIELD)], [degrees(NEIGHBOUR)]], name="all")),
         "2 polygons that lie apart, all parts of 'all'"),
        (collection(POLYGON, feature("Polygon", [degrees([(1, 1), (79, 1), (79, 40), (1, 40)])], name="dry")),
         "those inside 'field' cover 63% of it: they may be zones of the field, or no-go areas"),
        ({"type": "Topology", "objects": {}}, "is JSON of another kind"),
        ({"spatialReference": {"wkid": 4326}, "features": []}, "is JSON of another kind"),
    ],
)  # fmt: skip
def test_what_a_file_leaves_open_is_asked_for(tmp_path, content, message):
    with pytest.raises(InputError, match=message):
        read(written(tmp_path, content))


def test_a_feature_is_chosen_by_its_number_or_a_property(tmp_path):
    east = feature("Polygon", [degrees(NEIGHBOUR)], name="east", area_ha=0.3)
    path = written(tmp_path, collection(east, {**POLYGON, "id": "f-7"}, feature("Polygon", [degrees(POND)])))
    for chosen in ("2", "field", "f-7"):
        border = assert_is_field(path, 1, feature=chosen)
        assert "not used, as they are not inside 'field': 'east'" in border.notes
    with pytest.raises(InputError, match=r"no feature 'eest' -> there are: east, field, .*did you mean 'east'"):
        read(path, feature="eest")


def text(ring, separator=",", order=(0, 1)):
    return " ".join(separator.join(repr(corner[axis]) for axis in order) for corner in ring)


def kml():
    pond = f"<LinearRing><coordinates>{text(degrees(POND))}</coordinates></LinearRing>"
    return (
        '<?xml version="1.0"?><kml xmlns="http://www.opengis.net/kml/2.2"><Document><Placemark><name>far</name>'
        f"<LookAt><longitude>1</longitude></LookAt><Polygon><outerBoundaryIs><LinearRing><coordinates>\n"
        f"{text([(*one, 51.2) for one in degrees(FIELD)], order=(0, 1, 2))}\n</coordinates></LinearRing>"
        f"</outerBoundaryIs><innerBoundaryIs>{pond}</innerBoundaryIs></Polygon></Placemark></Document></kml>"
    )


def isoxml(obstacle=POND):
    def polygon(kind, ring):
        points = "".join(f'<PNT A="2" C="{lat!r}" D="{lon!r}"/>' for lon, lat in ring)
        return f'<PLN A="{kind}"><LSG A="1">{points}</LSG></PLN>'

    return (
        '<ISO11783_TaskData VersionMajor="4"><PFD A="PFD1" C="north 40" D="4800">'
        f"{polygon(1, degrees(FIELD)[:-1])}{polygon(6, degrees(obstacle))}{polygon(2, degrees(POND))}"
        "</PFD></ISO11783_TaskData>"
    )


def gpx():
    points = "".join(f'<trkpt lat="{lat!r}" lon="{lon!r}"><ele>5</ele></trkpt>' for lon, lat in degrees(FIELD))
    return (
        '<gpx xmlns="http://www.topografix.com/GPX/1/1"><wpt lat="53" lon="0"/><trk><name>walk</name><trkseg>'
        f"{points}</trkseg></trk></gpx>"
    )


@pytest.mark.parametrize(
    ("name", "content", "no_go"),
    [
        ("farm.kml", kml(), 1),
        ("hand.kml", kml().replace(",", ", "), 1),
        ("TASKDATA.XML", isoxml(), 1),
        ("TASKDATA.XML", isoxml([(70, 20), (90, 20), (90, 32), (70, 32)]), 1),
        ("TASKDATA.XML", isoxml(NEIGHBOUR), 0),
        ("walk.gpx", gpx(), 0),
    ],
)
def test_other_formats(tmp_path, name, content, no_go):
    assert_is_field(written(tmp_path, content, name), no_go)
    with zipfile.ZipFile(tmp_path / "all.zip", "w") as archive:
        archive.write(tmp_path / name, f"farm/{name}")
        archive.writestr("farm/readme.txt", "x")
    assert_is_field(tmp_path / "all.zip", no_go)


def test_a_hole_of_kml_is_no_border(tmp_path):
    empty = re.sub(r"<outerBoundaryIs>.*</outerBoundaryIs>", "<outerBoundaryIs/>", kml(), flags=re.DOTALL)
    with pytest.raises(InputError, match="has a corner that is not two numbers"):
        BorderSource(written(tmp_path, empty, "a.kml")).read()


def test_a_partfield_comes_before_its_obstacles(tmp_path):
    assert_is_field(written(tmp_path, isoxml(), "TASKDATA.XML"), 1, feature="1")


@pytest.mark.slow
def test_shapefiles_and_geopackages(tmp_path):
    pyogrio, shapely = pytest.importorskip("pyogrio"), pytest.importorskip("shapely")
    pyproj = pytest.importorskip("pyproj")
    there = pyproj.Transformer.from_crs("EPSG:4326", "EPSG:27700", always_xy=True)

    def put(path, corners, layer=None, crs="EPSG:27700"):
        shape = shapely.Polygon([there.transform(*corner) for corner in degrees(corners)])
        pyogrio.raw.write(
            path, np.array([shapely.to_wkb(shape)]), [np.array(["north"], object)], ["field"], layer=layer,
            geometry_type="Polygon", crs=crs, append=path.exists(),
        )  # fmt: skip

    put(tmp_path / "b.shp", FIELD)
    assert_is_field(tmp_path / "b.shp")
    with zipfile.ZipFile(tmp_path / "b.zip", "w") as archive:
        for part in tmp_path.glob("b.*"):
            if part.suffix != ".zip":
                archive.write(part, part.name)
    assert_is_field(tmp_path / "b.zip", feature="north")
    (tmp_path / "b.prj").unlink()
    with pytest.raises(
        InputError, match=r"no reference system \(CRS\), and its corners, .* look like metres of a map"
    ):
        read(tmp_path / "b.shp")
    assert_is_field(tmp_path / "b.shp", crs="EPSG:27700")
    put(tmp_path / "farm.gpkg", FIELD, "fields")
    assert_is_field(tmp_path / "farm.gpkg")
    put(tmp_path / "farm.gpkg", NEIGHBOUR, "others")
    with pytest.raises(InputError, match=r"polygons in 2 layers: fields, others -> .* layer: fields"):
        read(tmp_path / "farm.gpkg")
    assert_is_field(tmp_path / "farm.gpkg", layer="fields")
    with pytest.raises(InputError, match="no layer 'field' -> there are: fields, others"):
        read(tmp_path / "farm.gpkg", layer="field")


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.kml", "<kml", "is not valid XML"),
        ("a.kml", "<?xml version='1.0' encoding='x-none'?><kml/>", "is not valid XML"),
        ("a.kml", "<!DOCTYPE x [<!ENTITY a 'b'>]><kml/>", "definitions of its own"),
        ("a.zip", "no archive", "cannot be unpacked"),
        ("a.dxf", "0", "is not a file with a border: its name ends in '.dxf'"),
        ("a.gpkg", "x", "cannot be read as polygons"),
    ],
)
def test_damaged_files_are_errors_of_the_input(tmp_path, name, content, message):
    with pytest.raises(InputError, match=message):
        read(written(tmp_path, content, name))


def test_a_field_file_names_its_border(tmp_path):
    written(tmp_path, collection(POLYGON, feature("Polygon", [degrees(NEIGHBOUR)], name="east")))
    path = tmp_path / "field.yaml"
    path.write_text("border: {file: border.geojson, feature: east}\n")
    east = load_field(path)
    assert "not used, as they are not inside 'east': 'field'" in east.notes
    np.testing.assert_allclose(np.ptp(east.polygon, axis=0), [50, 60], atol=2e-3)
    path.write_text("border: border.geojson\ngeojson: border.geojson\n")
    with pytest.raises(InputError, match="but there are 2: geojson, border"):
        load_field(path)


def test_a_border_on_both_sides_of_the_180th_meridian_is_one_field(tmp_path):
    ring = [[179.9995, -17.0], [-179.9995, -17.0], [-179.9995, -16.999], [179.9995, -16.999], [179.9995, -17.0]]
    path = tmp_path / "field.yaml"
    path.write_text(f"polygon_lonlat: {ring}\n")
    field = load_field(path)
    assert abs(abs(field.frame.longitude_deg) - 180) < 1e-6
    np.testing.assert_allclose(np.ptp(field.polygon, axis=0), [106.5, 110.7], atol=0.2)


def test_a_number_that_is_a_property_of_another_feature_is_asked_for(tmp_path):
    shifted = [[[x + at, y] for x, y in ((0, 50), (0.002, 50), (0.002, 50.001), (0, 50))] for at in (0, 0.01)]
    path = written(tmp_path, collection(*(feature("Polygon", [ring], id=id) for id, ring in enumerate(shifted))))
    with pytest.raises(InputError, match=r"2 polygons, that '1' fits, as number or property.*feature: 'id=[01]'"):
        BorderSource(path, feature="1").read()
    assert BorderSource(path, feature="id=1").read().outline[:, 0].min() == pytest.approx(0.01)


def test_a_shapefile_without_its_index_says_so(tmp_path):
    pytest.importorskip("pyogrio")
    (tmp_path / "a.shp").write_bytes(b"")
    with pytest.raises(
        InputError, match=r"a.shp: lacks its part a.shx -> keep .shp, .shx, .dbf and .prj together"
    ):
        BorderSource(tmp_path / "a.shp").read()


@pytest.mark.parametrize("name", ["a.shp", "b.gpkg", "c.zip", "d.kmz", "e.kml", "f.geojson"])
def test_a_file_that_is_not_there_is_looked_for(tmp_path, name):
    with pytest.raises(InputError, match="No such file or directory -> check its path in the field file"):
        BorderSource(tmp_path / "missing" / name).read()


def test_a_pond_is_not_the_field_because_the_border_is_in_pieces(tmp_path):
    corners = degrees(FIELD)
    pieces = [feature("LineString", line) for line in (corners[:3], corners[2:], degrees(POND))]
    path = written(tmp_path, collection(*pieces))
    with pytest.raises(InputError, match="has 2 open lines around its closed one: is the border in pieces"):
        read(path)
    _, outline = read(path, feature="3")
    np.testing.assert_allclose(np.ptp(outline, axis=0), [10, 12], atol=0.01)


def test_a_polygon_that_reaches_into_the_field_is_named(tmp_path):
    across = feature("Polygon", [degrees([(70, 20), (90, 20), (90, 32), (70, 32)])], name="pond")
    path = written(tmp_path, collection(POLYGON, across, feature("Polygon", [degrees(NEIGHBOUR)], name="other")))
    border = assert_is_field(path, feature="field")
    assert "'pond' lies in the field by 50% and is not used: if it must not be entered, list it" in border.notes[0]
    assert not any("'other' lies" in note for note in border.notes)


def test_a_crossed_hole_and_xml_of_other_kinds_are_refused(tmp_path):
    crossed = [POND[0], POND[2], POND[1], POND[3]]
    written(tmp_path, collection(feature("Polygon", [degrees(FIELD), degrees(crossed)])))
    (tmp_path / "field.yaml").write_text("border: border.geojson\n")
    with pytest.raises(InputError, match="no-go area 1 is not a simple polygon: Self-intersection"):
        load_field(tmp_path / "field.yaml")
    assert_is_field(written(tmp_path, kml(), "doc.xml"), 1)
    with pytest.raises(InputError, match=r"XML with <GAOS_parcel>, neither .* -> convert it to GeoJSON"):
        read(written(tmp_path, "<GAOS_parcel><Field/></GAOS_parcel>", "envelope.xml"))


def test_an_open_line_before_a_closed_one_of_as_many_corners_is_no_border(tmp_path):
    lines = [[*degrees(NEIGHBOUR)[:4], degrees([(300, 300)])[0]], degrees(FIELD)]
    assert_is_field(written(tmp_path, collection(feature("MultiLineString", lines))))

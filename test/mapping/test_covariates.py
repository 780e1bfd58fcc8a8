# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Covariates of a field, and their files (covariate_files.py)."""

import json
import re
from pathlib import Path
from xml.sax.saxutils import escape

import numpy as np
import pytest
import rasterio
import shapely
from hypothesis import given
from hypothesis import strategies as st
from pyproj import Transformer
from rasterio.transform import Affine

from soilmoist_ros.foundation import InputError, LocalFrame
from soilmoist_ros.mapping import (
    Covariates,
    CovariateSource,
    FieldGrid,
    load_field,
    read_covariates,
    require_covariates,
)
from soilmoist_ros.mapping.covariate_files import OTHER, derivatives, indicators

FRAME = LocalFrame(53.268, -0.5245)
GRID = FieldGrid.from_polygon([(0, 0), (60, 0), (60, 50), (0, 50)], cell_m=2.0)


def surface(x, y):
    return 20 + 0.1 * x - 0.05 * y + 2 * np.sin(x / 15) * np.cos(y / 12)


def write_raster(path, epsg=32630, pixel=1.0, function=surface, about=(30, 25), reach=90.0, **options):
    """A GeoTIFF of a function of the field's coordinates, on the axes of another reference system."""
    to_there = Transformer.from_crs(FRAME.crs, epsg, always_xy=True)
    x, y = to_there.transform(*about)
    count = int(2 * reach / (pixel * (1 if epsg != 4326 else 1e5)))
    west, north = x - count / 2 * pixel, y + count / 2 * pixel
    x, y = np.meshgrid(west + pixel * (np.arange(count) + 0.5), north - pixel * (np.arange(count) + 0.5))
    local = np.array(to_there.transform(x, y, direction="INVERSE"))
    layers = [one(*local) for one in np.atleast_1d(np.array(function, object))]
    names = options.pop("names", ())
    transform = Affine(pixel, 0, west, 0, -pixel, north)
    options |= {"crs": f"EPSG:{epsg}", "transform": transform}
    profile = {"driver": "GTiff", "width": count, "height": count, "count": len(layers), "dtype": "float32"}
    with rasterio.open(path, "w", **profile, **options) as file:
        for number, values in enumerate(layers, 1):
            file.write(values.astype("float32"), number)
        for number, name in enumerate(names, 1):
            file.set_band_description(number, name)
    return path


def read(*texts):
    return read_covariates([CovariateSource.parse(str(text)) for text in texts], FRAME, GRID)


def standardised(values):
    return (values - values.mean()) / values.std()


@pytest.mark.parametrize(("epsg", "pixel"), [(32630, 1.0), (32631, 1.5), (27700, 2.0), (4326, 1e-5), (3035, 0.5)])
def test_rasters_of_any_reference_system_and_resolution(tmp_path, epsg, pixel):
    found = read(write_raster(tmp_path / "image.tif", epsg, pixel))
    assert found.names == ("image",)
    wanted = standardised(surface(*GRID.cells.T))
    np.testing.assert_allclose(found.layers[0][GRID.mask], wanted, atol=0.03)
    np.testing.assert_allclose(found.layers[0][GRID.mask].std(), 1)


@pytest.mark.slow
def test_small_pixels_are_averaged_over_the_cells(tmp_path):
    rng = np.random.default_rng(1)
    noisy = write_raster(tmp_path / "noisy.tif", pixel=0.1, function=lambda x, y: x + rng.normal(0, 20, x.shape))
    found = read(noisy).layers[0][GRID.mask]
    assert np.corrcoef(found, GRID.cells[:, 0])[0, 1] > 0.99


@pytest.mark.slow
def test_nodata_is_missing_and_outside_the_raster_too(tmp_path):
    def half(x, y):
        return np.where(x > 30, surface(x, y), -9999)

    found = read(write_raster(tmp_path / "half.tif", function=half, nodata=-9999))
    assert found.coverage(GRID)["half"] == pytest.approx(0.5, abs=0.04)
    assert (found.at([(10, 20), (5, 40)]) == 0).all()
    part = read(write_raster(tmp_path / "part.tif", about=(0, 25), reach=30))
    assert part.coverage(GRID)["part"] == pytest.approx(0.5, abs=0.06)
    assert np.abs(found.layers[0][GRID.mask & np.isfinite(found.layers[0])]).max() < 10  # no trace of -9999


@pytest.mark.parametrize("gap", [-9999.0, -99999.0, -32768.0, -3.4e38, np.inf, np.nan])
def test_gaps_that_a_file_does_not_declare(tmp_path, gap):
    path = write_raster(tmp_path / "half.tif", function=lambda x, y: np.where(x > 30, surface(x, y), gap))
    found = read(path)
    assert found.coverage(GRID)["half"] == pytest.approx(0.5, abs=0.07)
    east = GRID.mask & np.isfinite(found.layers[0])
    places = GRID.to_raster(np.arange(len(GRID.cells)))[east].astype(int)
    np.testing.assert_allclose(found.layers[0][east], standardised(surface(*GRID.cells[places].T)), atol=0.05)


def test_bands_by_number_and_name(tmp_path):
    bands = (surface, lambda x, y: y, lambda x, y: x)
    path = write_raster(tmp_path / "many.tif", function=bands, names=("ndvi", "", "clay"))
    found = read(path, f"{path}:2", f"{path}:clay")
    assert found.names == ("many", "many 2", "many clay")
    inside = found.layers[:, GRID.mask]
    np.testing.assert_allclose(inside[2], standardised(GRID.cells[:, 0]), atol=3e-3)
    np.testing.assert_allclose(inside[1], standardised(GRID.cells[:, 1]), atol=3e-3)


@pytest.mark.slow
def test_elevations_give_the_form_of_the_ground(tmp_path):
    path = write_raster(tmp_path / "relief.tif", function=lambda x, y: 0.002 * (x - 30) ** 2 + 0.02 * y, reach=150)
    sources = [
        CovariateSource(path, derive=("elevation", "slope", "aspect", "curvature")),
        CovariateSource(path, "slope", name="valley"),
    ]
    found = read_covariates(sources, FRAME, GRID)
    assert found.names == (
        "relief elevation",
        "relief slope",
        "relief northness",
        "relief eastness",
        "relief curvature",
        "valley slope",
    )
    x, y = GRID.cells.T
    values = dict(zip(found.names, found.layers[:, GRID.mask], strict=True))
    np.testing.assert_allclose(
        values["relief elevation"], standardised(0.002 * (x - 30) ** 2 + 0.02 * y), atol=0.02
    )
    slope = np.hypot(0.004 * (x - 30), 0.02)
    assert np.corrcoef(values["relief slope"], slope)[0, 1] > 0.99
    assert np.corrcoef(values["relief eastness"], x)[0, 1] < -0.99
    np.testing.assert_array_equal(values["valley slope"], values["relief slope"])
    with pytest.raises(InputError, match=r"no band 'wetness'.* r\.topidx"):
        read(f"{path}:wetness")


@pytest.mark.slow
def test_derived_values_need_no_cover_beyond_the_field(tmp_path):
    path = write_raster(tmp_path / "relief.tif", function=lambda x, y: 0.002 * (x - 30) ** 2, reach=31)
    assert read(f"{path}:slope").coverage(GRID)["relief slope"] > 0.97


def soil_area(west, east):
    ring = np.array(shapely.box(west, -5, east, 55).exterior.coords)
    return {"type": "Polygon", "coordinates": [FRAME.to_geographic(ring)[:, ::-1].tolist()]}


def soil_map(path, classes, **more):
    """Strips of equal width from west to east, one per class."""
    edges = np.linspace(-5, 65, len(classes) + 1)
    features = []
    for west, east, name in zip(edges[:-1], edges[1:], classes, strict=True):
        properties = {"soil": name, **{key: value for key, value in more.items() if value is not None}}
        features.append({"type": "Feature", "properties": properties, "geometry": soil_area(west, east)})
    path.write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    return path


def test_polygons_give_a_column_for_each_class_but_the_most_common(tmp_path):
    found = read(soil_map(tmp_path / "map.geojson", ["sand", "clay", "sand", "loam"]))
    assert found.names == ("map clay", "map loam")
    clay = found.at([(20, 25), (50, 25), (5, 25)])[:, 0]
    assert clay[0] > 1 > 0 > clay[1] == clay[2]
    assert found.coverage(GRID) == {"map clay": 1, "map loam": 1}


def test_where_polygons_overlap_the_first_one_of_the_file_counts(tmp_path):
    path = soil_map(tmp_path / "map.geojson", ["sand", "clay"])
    content = json.loads(path.read_text())
    everywhere = {**content["features"][0], "properties": {"soil": "clay"}}
    everywhere["geometry"] = soil_area(-5, 65)
    for features, clay in (
        ([*content["features"], everywhere], False),
        ([content["features"][1], everywhere, content["features"][0]], True),
    ):
        path.write_text(json.dumps({**content, "features": features}))
        if clay:
            with pytest.raises(InputError, match="same value of 'map' everywhere"):
                read(path)
        else:
            assert read(path).at([(5, 25)])[0] != read(path).at([(55, 25)])[0]


def test_numbers_of_polygons_are_numbers(tmp_path):
    found = read(soil_map(tmp_path / "map.geojson", [12.5, 30.5, 18.0]))
    assert found.names == ("map",)
    assert np.diff(found.at([(5, 25), (30, 25)])[:, 0]) > 1


def test_geopackage_in_a_projected_system(tmp_path):
    pyogrio = pytest.importorskip("pyogrio")
    source = soil_map(tmp_path / "map.geojson", ["sand", "clay"], age=3)
    about, _, shapes, columns = pyogrio.raw.read(source)
    to_utm = Transformer.from_crs(4326, 32630, always_xy=True)

    def moved(xy):
        return np.column_stack(to_utm.transform(xy[:, 0], xy[:, 1]))

    shapes = shapely.to_wkb(shapely.transform(shapely.from_wkb(shapes), moved))
    path = tmp_path / "map.gpkg"
    pyogrio.raw.write(path, shapes, columns, about["fields"], crs="EPSG:32630", geometry_type="Polygon")
    found, same = read(f"{path}:soil"), read(f"{source}:soil")
    np.testing.assert_allclose(found.layers, same.layers)


def test_rare_classes_are_taken_together():
    values = np.array(["a"] * 60 + ["b"] * 30 + [f"rare {i}" for i in range(10)] + [None], object)
    columns = indicators(values, np.ones(101, bool))
    assert list(columns) == ["b", OTHER]
    assert np.nansum(columns[OTHER]) == 10
    assert np.isnan(columns["b"][-1])
    assert indicators(np.array(["a", "a"], object), np.ones(2, bool)) == {}


def no_crs(tmp_path):
    path = write_raster(tmp_path / "a.tif")
    with rasterio.open(path) as file:
        values, profile = file.read(), file.profile
    profile.pop("crs")
    with rasterio.open(path, "w", **profile) as file:
        file.write(values)
    return path


def text_file(tmp_path):
    path = tmp_path / "a.tif"
    path.write_text("no raster")
    return path


BAD = {
    "no such file": lambda tmp_path: tmp_path / "none.tif",
    "cannot be read as a raster": text_file,
    "no coordinate reference system": no_crs,
    "no band 'nvdi'": lambda tmp_path: f"{write_raster(tmp_path / 'a.tif', names=('ndvi',))}:nvdi",
    "no band '2'": lambda tmp_path: f"{write_raster(tmp_path / 'a.tif')}:2",
    "has no value of 'a' in the field": lambda tmp_path: write_raster(tmp_path / "a.tif", about=(5000, 0)),
    "same value of 'a' everywhere": lambda tmp_path: write_raster(
        tmp_path / "a.tif", function=lambda x, y: 0 * x + 3
    ),
    "has no attribute 'soul'": lambda tmp_path: f"{soil_map(tmp_path / 'a.geojson', ['sand', 'clay'])}:soul",
    "which attribute": lambda tmp_path: soil_map(tmp_path / "a.geojson", ["sand", "clay"], other="x"),
    "cannot be read as polygons": lambda tmp_path: Path(text_file(tmp_path)).rename(tmp_path / "a.gpkg"),
}


@pytest.mark.parametrize("message", BAD)
def test_files_that_cannot_be_used(tmp_path, message):
    path = BAD[message](tmp_path)
    with pytest.raises(InputError, match=message) as caught:
        read(path)
    assert all(mistake.remedy and mistake.path for mistake in caught.value.mistakes)
    if "in the field" not in message and "everywhere" not in message:
        with pytest.raises(InputError, match=message):  # found before the work
            require_covariates([CovariateSource.parse(str(path))])


def virtual_raster(path):
    """A file that names another one, of the same place, as a GDAL virtual raster."""
    secret = write_raster(path.parent / "secret.tif")
    with rasterio.open(secret) as file:
        place, crs, width, height = file.transform.to_gdal(), file.crs.to_wkt(), file.width, file.height
    band = f"<SimpleSource><SourceFilename>{secret}</SourceFilename><SourceBand>1</SourceBand></SimpleSource>"
    path.write_text(
        f'<VRTDataset rasterXSize="{width}" rasterYSize="{height}"><SRS>{escape(crs)}</SRS>'
        f"<GeoTransform>{', '.join(map(str, place))}</GeoTransform>"
        f'<VRTRasterBand dataType="Float32" band="1">{band}</VRTRasterBand></VRTDataset>'
    )
    return path


def virtual_polygons(path):
    """A file that names another one as a GDAL virtual layer."""
    secret = soil_map(path.parent / "secret.geojson", ["sand", "clay"])
    source = f"<SrcDataSource>{secret}</SrcDataSource>"
    path.write_text(f'<OGRVRTDataSource><OGRVRTLayer name="secret">{source}</OGRVRTLayer></OGRVRTDataSource>')
    return path


def pipeline(path):
    """A file that states what GDAL shall read, after much space."""
    secret = soil_map(path.parent / "secret.geojson", ["sand", "clay"])
    command = f"gdal vector pipeline ! read {secret} ! make-valid"
    path.write_text(" " * 600 + json.dumps({"type": "gdal_streamed_alg", "command_line": command}))
    return path


@pytest.mark.parametrize("make", [virtual_raster, virtual_polygons, pipeline])
@pytest.mark.parametrize("ending", ["tif", "geojson", "json", "gpkg", "shp", "fgb", "png", "vrt"])
def test_no_file_leads_to_another_one(tmp_path, make, ending):
    path = make(tmp_path / f"a.{ending}")
    with pytest.raises(InputError, match="cannot be read as"):
        read(path)
    with pytest.raises(InputError, match="cannot be read as"):
        require_covariates([CovariateSource.parse(str(path))])


def test_the_virtual_files_are_ones_that_gdal_follows(tmp_path):
    with rasterio.open(virtual_raster(tmp_path / "a.tif")) as file:
        assert np.ptp(file.read(1)) > 0
    pyogrio = pytest.importorskip("pyogrio")
    assert len(pyogrio.raw.read(virtual_polygons(tmp_path / "a.geojson"))[2]) == 2


def test_all_mistakes_are_named_and_so_are_double_names(tmp_path):
    with pytest.raises(InputError) as caught:
        read(tmp_path / "one.tif", tmp_path / "two.tif")
    assert len(caught.value.mistakes) == 2
    path = write_raster(tmp_path / "a.tif")
    with pytest.raises(InputError, match="two covariates have the name 'a'"):
        read(path, path)
    assert read() is None


def test_what_the_text_of_a_source_means(tmp_path):
    assert CovariateSource.parse("a.tif:3") == CovariateSource(Path("a.tif"), "3")
    assert CovariateSource.parse("a.tif") == CovariateSource(Path("a.tif"))
    assert CovariateSource.parse("/odd:place/a.tif").path == Path("/odd:place/a.tif")
    odd = tmp_path / "odd:name.tif"
    odd.touch()
    assert CovariateSource.parse(odd.name, tmp_path) == CovariateSource(odd)
    assert str(CovariateSource.parse("b/a.tif:slope")) == "b/a.tif:slope"


@pytest.mark.slow
@pytest.mark.parametrize("about", [(5000, 0), (2e6, 3e6)])
def test_elevations_off_the_field_are_named(tmp_path, about):
    path = write_raster(tmp_path / "relief.tif", about=about)
    with pytest.raises(InputError, match=r"no value of 'relief slope' in the field"):
        read(f"{path}:slope")


SQUARE = FieldGrid.from_polygon([(0, 0), (60, 0), (60, 40), (20, 40)], cell_m=5.0)
X, Y = np.meshgrid(SQUARE.x_m, SQUARE.y_m)
CENTRES = np.column_stack([X[SQUARE.mask], Y[SQUARE.mask]])


def test_missing_values_and_constants_are_the_mean():
    holed = np.where(X > 30, np.nan, X)
    covariates = Covariates.over(SQUARE, ["holed", "constant"], [holed, np.full_like(X, 7.0)])
    values = covariates.at(CENTRES)
    assert (values[CENTRES[:, 0] > 48, 0] == 0).all()
    assert (values[:, 1] == 0).all()
    assert (covariates.known_at([(50, 20), (10, 5)])[:, 0] == [0, 1]).all()


@given(x=st.floats(-20, 80), y=st.floats(-20, 60))
def test_a_linear_covariate_is_interpolated_exactly_and_ends_at_the_raster(x, y):
    covariates = Covariates("en", SQUARE.x_m, SQUARE.y_m, [X, Y])
    inside = np.clip(x, SQUARE.x_m[0], SQUARE.x_m[-1]), np.clip(y, SQUARE.y_m[0], SQUARE.y_m[-1])
    np.testing.assert_allclose(covariates.at((x, y)), [inside], atol=1e-9)


def test_wrong_covariates_are_refused():
    with pytest.raises(ValueError, match="distinct"):
        Covariates.over(SQUARE, ["a", "a"], [X, Y])
    with pytest.raises(ValueError, match="shape"):
        Covariates(("a",), SQUARE.x_m, SQUARE.y_m, X)
    with pytest.raises(ValueError, match="increase"):
        Covariates(("a",), SQUARE.x_m[::-1], SQUARE.y_m, [X])


def test_covariates_of_one_raster_are_joined():
    rasters = np.random.default_rng(1).normal(size=(2, *SQUARE.shape))
    both = Covariates.over(SQUARE, ["a", "b"], rasters)
    alone = [Covariates.over(SQUARE, [name], [raster]) for name, raster in zip("ab", rasters, strict=True)]
    together = Covariates.joined(alone[0], None, alone[1])
    assert together.names == both.names
    np.testing.assert_array_equal(together.layers, both.layers)
    assert Covariates.joined(None, None) is None
    with pytest.raises(ValueError, match="distinct names"):
        Covariates.joined(alone[0], alone[0])


# Files -----------------------------------------------------------------------------------------------------------

STEP_M = 2.0


def raster(surface, rows=21, columns=25):
    y, x = np.mgrid[:rows, :columns] * STEP_M
    return surface(x, y)


@given(st.floats(-0.5, 0.5), st.floats(-0.5, 0.5))
@pytest.mark.slow
def test_a_plane_has_its_slope_and_aspect_up_to_the_edge(east, north):
    found = derivatives(raster(lambda x, y: 10 + east * x + north * y), STEP_M)
    slope = np.hypot(east, north)
    np.testing.assert_allclose(found["slope"], slope, atol=1e-9)
    np.testing.assert_allclose(found["curvature"], 0, atol=1e-9)
    np.testing.assert_allclose(found["eastness"], -east / np.hypot(1, slope), atol=1e-9)
    np.testing.assert_allclose(found["northness"], -north / np.hypot(1, slope), atol=1e-9)


def test_the_curvature_of_a_bowl_and_of_a_dome():
    bowl = raster(lambda x, y: 0.01 * (x - 24) ** 2 + 0.02 * (y - 20) ** 2)
    inner = slice(1, -1), slice(1, -1)
    np.testing.assert_allclose(derivatives(bowl, STEP_M)["curvature"][inner], -0.06)
    np.testing.assert_allclose(derivatives(-bowl, STEP_M)["curvature"][inner], 0.06)


def bank(x, y):
    """Level ground with a bank of 22 deg between x = 20 m and x = 30 m."""
    return 0.4 * np.clip(x - 20, 0, 10)


def steep_field(folder, no_go, more=""):
    path = folder / "field.yaml"
    path.write_text(
        f"datum: {{latitude_deg: {FRAME.latitude_deg}, longitude_deg: {FRAME.longitude_deg}}}\n"
        f"polygon: [[0, 0], [60, 0], [60, 50], [0, 50]]\nno_go: {no_go}\n{more}\n"
    )
    return load_field(path)


@pytest.mark.parametrize(("limit", "areas"), [("slope > 15 deg", 1), ("slope > 30 %", 1), ("slope > 30 deg", 0)])
def test_ground_that_is_too_steep_is_a_no_go_area(tmp_path, limit, areas):
    write_raster(tmp_path / "relief.tif", pixel=0.5, function=bank)
    field = steep_field(tmp_path, limit, "covariates: [{file: relief.tif, derive: [slope]}]")
    assert len(field.no_go) == areas
    assert f"no-go by '{limit}' in relief.tif: {areas} area" in field.notes[0]
    if areas:
        (west, south), (east, north) = field.no_go[0].min(axis=0), field.no_go[0].max(axis=0)
        assert [west, south, east, north] == pytest.approx([19, 0, 31, 50], abs=2)
        assert not field.grid(2.0).mask[:, 12].any()  # 25 m east


def test_a_file_of_elevations_that_is_coarse_or_noisy_or_has_gaps_says_so(tmp_path):
    rng = np.random.default_rng(1)
    write_raster(tmp_path / "coarse.tif", pixel=8.0, function=bank)
    write_raster(tmp_path / "rough.tif", function=lambda x, y: bank(x, y) + rng.normal(0, 3, x.shape))
    write_raster(tmp_path / "gap.tif", function=lambda x, y: np.where((x > 40) & (y > 30), np.nan, bank(x, y)))
    corner = "[[1, 1], [5, 1], [5, 5]]"
    coarse = steep_field(tmp_path, f"['slope > 12 deg in coarse.tif', {corner}]")
    assert "8 m wide: shorter banks" in coarse.notes[0]
    assert len(coarse.no_go) == 2
    assert len(steep_field(tmp_path, "slope > 15 deg in gap.tif, unknown no_go").no_go) == 2
    assert "no elevation" in steep_field(tmp_path, "slope > 15 deg in gap.tif, unknown allowed").notes[0]
    for text, message in (
        ("slope > 15 deg in gap.tif", r"14\.\d% of the field has no elevation, such as .*unknown no_go"),
        ("slope > 0.5 % in rough.tif", "covers the whole field|noisy"),
        ("slope > 15 deg", "no elevations are known"),
        ("slope > 15", "no limit of the slope"),
        ("slope > 15 deg in nothing.tif", "there is no file"),
        ("['slope > 15 deg', 'slope > 20 deg']", "2 limits"),
    ):
        with pytest.raises(InputError, match=message):
            steep_field(tmp_path, text)


SLOPES = "looks like slopes, not elevations"


@pytest.mark.parametrize(
    ("function", "about", "said"),
    [
        (
            lambda x, y: np.where(x > 35, 0, 50 + bank(x, y)),
            {"nodata": -9999},
            r"no elevation.*\d% of.* have 0, which",
        ),
        (lambda x, y: np.where(x > 35, -32767, bank(x, y)), {}, "no elevation.* have -32767, which"),
        (lambda x, y: np.where(x > 35, 12345.5, bank(x, y)), {}, "no elevation.* have 12345.5, which"),
        (lambda x, y: np.where(abs(x - 25) < 5, 20.0, 1.0), {}, SLOPES),
        (lambda x, y: 5 + x / 20, {"descriptions": ("Slope (percent)",)}, SLOPES),
        *((lambda x, y: 5 + x / 20, {"units": (unit,)}, SLOPES) for unit in ("degrees", "m/m")),
        (lambda x, y: np.round(bank(x, y)), {}, "steps of 1 m, which make slopes or hide them: one step"),
    ],
)
def test_elevations_that_are_none_or_too_rounded_are_refused(tmp_path, function, about, said):
    about_file(write_raster(tmp_path / "relief.tif", function=function), about)
    with pytest.raises(InputError, match=said):
        steep_field(tmp_path, "slope > 15 deg in relief.tif")
    if "have" in said:
        field = steep_field(tmp_path, "slope > 15 deg in relief.tif, unknown no_go")
        assert not field.grid(2.0).mask[:, 18:].any()


def about_file(path, about):
    with rasterio.open(path, "r+") as file:
        for name, value in about.items():
            setattr(file, name, value)


@pytest.mark.parametrize(
    ("function", "about", "pixel", "said"),
    [
        (lambda x, y: bank(x, y) / 0.3048, {"units": ("ft",)}, 1, "converted from 'ft'"),
        (lambda x, y: bank(x, y) / 0.3048, {"units": ("US survey foot",)}, 1, "converted from 'US survey foot'"),
        (lambda x, y: bank(x, y) / 0.3048, {"crs": "EPSG:32630+6360"}, 1, "converted from 'US survey foot'"),
        (lambda x, y: 100 * bank(x, y), {"units": ("cm",)}, 1, "converted from 'cm'"),
        (bank, {}, 1, "its values, 0 to 4, could be slopes: it must have elevations"),
        (bank, {"units": ("fathom",)}, 1, "taken as metres, though it names 'fathom'"),
        (lambda x, y: np.round(bank(x, y)), {}, 5, "steps of 1 m"),
        (lambda x, y: 2.5 * bank(x, y), {"units": ("m",), "descriptions": ("slope",)}, 1, "no-go"),
    ],
)
def test_units_of_elevations_and_what_is_doubtful_are_named(tmp_path, function, about, pixel, said):
    about_file(write_raster(tmp_path / "relief.tif", pixel=pixel, function=function), about)
    field = steep_field(tmp_path, "slope > 19 deg in relief.tif")
    assert re.search(said, field.notes[0])
    if "converted" in said:
        assert len(field.no_go) == 1
        assert not steep_field(tmp_path, "slope > 25 deg in relief.tif").no_go

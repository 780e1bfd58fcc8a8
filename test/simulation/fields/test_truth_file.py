# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Field files with a truth, their tables and rasters: truth_file.py."""

import os
import re

import numpy as np
import pytest

from soilmoist_ros.foundation import InputError, LocalFrame, resource, resource_names
from soilmoist_ros.mapping.grid import FieldGrid
from soilmoist_ros.sensing.moisture.curve import CalibrationCurve
from soilmoist_ros.simulation import load_surrogate, surrogate_field

FRAME = LocalFrame(53.27, -0.52)
FIELD = "datum: {latitude_deg: 53.27, longitude_deg: -0.52}\npolygon: [[0,0],[40,0],[40,30],[0,30]]\ncell_m: 2\n"
CURVE = "  soil: {bulk_density_gcm3: 1.4}\n  calibration: {n0_cps: 4.4}\n"
POINTS = "x_m,y_m,rate_cps\n0,0,3\n40,0,4\n0,30,3\n40,30,4\n20,15,3.5\n"


def write(tmp_path, truth, data=None, name="truth.csv", field=FIELD):
    if data is not None:
        (tmp_path / name).write_text(data)
    path = tmp_path / "field.yaml"
    path.write_text(field + (f"truth:\n{truth}" if truth else ""))
    return path


def plane(x, y):
    return 3.0 + 0.02 * x + 0.01 * y


def mistakes_of(path):
    with pytest.raises(InputError) as caught:
        load_surrogate(path)
    return caught.value.mistakes


# Shipped files


@pytest.mark.slow
def test_every_shipped_field_with_a_truth_can_be_simulated():
    loaded = []
    for name in resource_names("fields"):
        if "\ntruth:" in resource("fields", name).read_text():
            surrogate = surrogate_field(name)
            cells = FieldGrid.from_polygon(surrogate.polygon, surrogate.field.cell_m).cells
            assert surrogate.rate_at(cells).min() > 0
            assert surrogate.curve is None or surrogate.curve.vwc(surrogate.rate_at(cells)).min() > 0
            loaded.append(name)
    assert {"airfield_points", "patches"} <= set(loaded)


# Points


def test_points_are_reproduced(tmp_path):
    surrogate = load_surrogate(write(tmp_path, "  points: truth.csv\n  hours: 3\n", POINTS))
    np.testing.assert_allclose(
        surrogate.rate_at([[0, 0], [40, 0], [0, 30], [40, 30], [20, 15]]), [3, 4, 3, 4, 3.5], rtol=1e-6
    )
    assert surrogate.curve is None
    assert surrogate.hours == 3
    assert surrogate.name == "field"


def test_moistures_at_points_become_rates(tmp_path):
    data = "# cores of May\nname,x_m,y_m,vwc\na,0,0,0.30\n\nb,40,0,0.10\nc,20,30,0.20\n"
    surrogate = load_surrogate(write(tmp_path, "  points: truth.csv\n" + CURVE, data))
    vwc = surrogate.curve.vwc(surrogate.rate_at([[0, 0], [40, 0], [20, 30]]))
    np.testing.assert_allclose(vwc, [0.3, 0.1, 0.2], rtol=1e-6)
    assert surrogate.curve == CalibrationCurve(4.4, 1.4)


@pytest.mark.parametrize(
    ("data", "messages"),
    [
        ("", ["truth.csv: is empty -> name the columns x_m, y_m and rate_cps"]),
        ("x,y_m,rate\n1,2,3\n", ["truth.csv:1: its columns are: x, y_m, rate -> name the columns"]),
        ("x_m;y_m;rate_cps\n1;2;3\n", ["truth.csv:1: its columns are: .* separated by commas"]),
        ("x_m,y_m,vwc,rate_cps\n1,2,0.1,3\n", ["truth.csv:1: its columns are"]),
        (
            "x_m,y_m,rate_cps\n0,0,3\n4,zero,3\n8,0,\n9,0,0\n# note\n10,0,nan\n12\n",
            [
                "truth.csv:3 [y_m]: 'zero' is not a number -> write a decimal number",
                "truth.csv:4 [rate_cps]: '' is not a number",
                "truth.csv:5 [rate_cps]: 0 is not positive, as a count rate must be",
                "truth.csv:7 [rate_cps]: 'nan' is not a number",
                "truth.csv:8 [y_m]: '' is not a number",
                "truth.csv:8 [rate_cps]: '' is not a number",
            ],
        ),
        ("x_m,y_m,rate_cps\n" + "a,1,3\n" * 50,
         ["'a' is not a number", *["truth.csv"] * 19, "has 30 more mistakes"]),
        ("x_m,y_m,vwc\n0,0,25\n1,0,0.2\n", ["truth.csv:2 [vwc]: 25 is no moisture in m3/m3 .* divided by 100"]),
        ("x_m,y_m,rate_cps\n0,0,3\n1,0,3\n0.0,0,4\n", ["truth.csv:4: the place x_m = 0, y_m = 0 occurs twice"]),
        ("x_m,y_m,rate_cps\n0,0,3\n1,0,3\n", ["truth.csv: has 2 points, but at least 3 are needed -> add more"]),
        ("x_m,y_m,rate_cps\n500,0,3\n501,0,3\n502,0,4\n", ["truth.csv: all points lie outside the field -> x_m"]),
        ("x_m,y_m,vwc\n0,0,0.1\n1,0,0.2\n2,0,0.2\n",
         ["field.yaml [truth]: the truth is a moisture (vwc), but there is no calibration curve .*'soil'"]),
    ],
)  # fmt: skip
def test_mistakes_in_points_are_named(tmp_path, data, messages):
    found = [str(mistake) for mistake in mistakes_of(write(tmp_path, "  points: truth.csv\n", data))]
    assert len(found) == len(messages), found
    for text, message in zip(found, messages, strict=True):
        assert re.search(re.escape(message).replace(r"\.\*", ".*"), text), text


def test_a_missing_file_and_one_that_is_no_text_are_named(tmp_path):
    path = write(tmp_path, "  points: truth.csv\n")
    assert "truth.csv: cannot be read: No such file" in str(mistakes_of(path)[0])
    (tmp_path / "truth.csv").write_bytes(b"\xff\xfe\x00")
    assert "is not UTF-8 text" in str(mistakes_of(path)[0])
    (tmp_path / "truth.csv").unlink()
    (tmp_path / "truth.csv").symlink_to("/dev/null")
    assert "is not a regular file" in str(mistakes_of(path)[0])


def test_an_ill_conditioned_extrapolation_is_refused_with_a_remedy(tmp_path):
    data = "x_m,y_m,rate_cps\n" + "".join(f"{x / 4},10,{4 + np.sin(x)}\n" for x in range(60))
    text = "  points: truth.csv\n  variogram: {model: gaussian, range_m: 60}\n"
    mistake = mistakes_of(write(tmp_path, text, data))[0]
    assert "ill-conditioned for the gaussian model with range 60 m" in mistake.message
    assert "give a 'nugget', another range or the exponential model as 'variogram'" in mistake.remedy


# GeoTIFF


def geotiff(path, value=plane, crs="EPSG:32630", names=("rate",), pixel_m=2.0, margin_m=20.0, shift_m=0.0):
    """A north-up raster in another reference system, whose pixels have a formula of the local coordinates."""
    import rasterio
    from pyproj import Transformer

    corners = np.array([[0, 0], [40, 0], [40, 30], [0, 30]], float) + shift_m
    target = crs or "EPSG:32630"
    east, north = Transformer.from_crs(FRAME.crs, target, always_xy=True).transform(*corners.T)
    left, top = min(east) - margin_m, max(north) + margin_m
    width, height = (int(np.ceil((np.ptp(side) + 2 * margin_m) / pixel_m)) for side in (east, north))
    columns, rows = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    back = Transformer.from_crs(target, FRAME.crs, always_xy=True)
    x, y = back.transform(left + columns * pixel_m, top - rows * pixel_m)
    profile = {"driver": "GTiff", "dtype": "float64", "width": width, "height": height, "count": len(names)}
    transform = rasterio.Affine(pixel_m, 0, left, 0, -pixel_m, top)
    with rasterio.open(path, "w", **profile, crs=crs, transform=transform, nodata=-9999.0) as raster:
        for band, name in enumerate(names, start=1):
            raster.write(np.asarray(value(np.asarray(x), np.asarray(y)) * np.ones((height, width))), band)
            raster.set_band_description(band, name)


@pytest.mark.slow
@pytest.mark.parametrize("crs", ["EPSG:27700", "EPSG:3857"])
def test_a_geotiff_in_another_reference_system_lies_in_its_place(tmp_path, crs):
    geotiff(tmp_path / "truth.tif", crs=crs)
    surrogate = load_surrogate(write(tmp_path, "  grid: truth.tif\n"))
    places = np.random.default_rng(2).uniform((0, 0), (40, 30), (200, 2))
    np.testing.assert_allclose(surrogate.rate_at(places), plane(*places.T), atol=1e-3)


@pytest.mark.slow
def test_a_band_of_moistures(tmp_path):
    geotiff(tmp_path / "truth.tif", lambda x, y: 0.1 + 0.002 * x, names=("other", "vwc"))
    surrogate = load_surrogate(write(tmp_path, "  grid: truth.tif\n  band: vwc\n" + CURVE))
    assert surrogate.curve.vwc(surrogate.rate_at([[10, 10]])) == pytest.approx(0.12, abs=1e-3)


@pytest.mark.slow
def test_a_raster_cut_along_the_boundary_is_complete(tmp_path):
    def cut(x, y):
        inside = (x >= 0) & (x <= 40) & (y >= 0) & (y <= 30)
        return np.where(inside, plane(x, y), -9999.0)

    geotiff(tmp_path / "truth.tif", cut)
    surrogate = load_surrogate(write(tmp_path, "  grid: truth.tif\n"))
    cells = FieldGrid.from_polygon(surrogate.polygon, 2.0).cells
    np.testing.assert_allclose(surrogate.rate_at(cells), plane(*cells.T), atol=0.06)

    def with_a_hole(x, y):
        return np.where(np.hypot(x - 20, y - 15) < 4.5, -9999.0, cut(x, y))

    geotiff(tmp_path / "truth.tif", with_a_hole)
    path = write(tmp_path, "  grid: truth.tif\n")
    assert "of the field: x = 19 m, y = 13 m has none" in mistakes_of(path)[0].message
    path.write_text(FIELD + "no_go: [[[14,9],[26,9],[26,21],[14,21]]]\ntruth:\n  grid: truth.tif\n")
    load_surrogate(path)  # a gap inside a no-go area is no mistake


@pytest.mark.slow
def test_mistakes_in_geotiffs_are_named(tmp_path):
    path = write(tmp_path, "  grid: truth.tif\n")
    cases = [
        ({"crs": None}, "truth.tif: has no coordinate reference system (CRS)"),
        ({"shift_m": 500.0}, "truth.tif: has no value in the field"),
        ({"margin_m": -6.0}, "of the field: x = 1 m, y = 1 m has none"),
        ({"value": lambda x, y: np.where(x > 20, -9999.0, 3)}, "has no value in 4"),
        (
            {"value": lambda x, y: x - 1000},
            "is not positive, as a count rate must be -> correct it, or mark it as",
        ),
        ({"value": lambda x, y: 25 + 0 * x, "names": ("vwc",)}, "a percentage must be divided by 100"),
    ]
    import warnings

    for options, message in cases:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # rasterio warns when it writes a file without a CRS
            geotiff(tmp_path / "truth.tif", **options)
        assert message in str(mistakes_of(path)[0])
    (tmp_path / "truth.tif").write_text("no raster")
    assert "truth.tif: cannot be read as a raster" in str(mistakes_of(path)[0])
    geotiff(tmp_path / "truth.tif")
    path = write(tmp_path, "  grid: truth.tif\n  band: moisture\n")
    assert "truth.tif: has no band 'moisture' -> use one of: 1, or rate" in str(mistakes_of(path)[0])


# Formulas and the section itself


def test_a_formula_of_moisture_and_its_generator(tmp_path):
    text = "  formula: {family: matern32, quantity: vwc, mean: 0.2, sd: 0.03, seed: 4}\n" + CURVE
    path = write(tmp_path, text)
    places = [[5, 5], [30, 20]]
    same = [load_surrogate(path).rate_at(places) for _ in range(2)]
    np.testing.assert_array_equal(*same)
    assert (load_surrogate(path, np.random.default_rng(1)).rate_at(places) != same[0]).all()
    assert load_surrogate(path).curve.vwc(same[0]) == pytest.approx([0.2, 0.2], abs=0.12)


@pytest.mark.parametrize(
    ("truth", "message"),
    [
        ("", "field.yaml: the field file has no truth: it cannot be simulated -> add a section 'truth' with"),
        ("  hours: 2\n", "field.yaml:4 [truth]: give one truth: 'points', 'grid' or 'formula', but there is none"),
        ("  points: a.csv\n  grid: b.tif\n", "but there are 2: points, grid"),
        ("  grid: a.tif\n  variogram: {range_m: 3}\n", "'variogram' belongs to 'points'; remove it"),
        ("  points: a.csv\n  band: x\n", "'band' belongs to 'grid'; remove it"),
        ("  grid: a.csv\n", "'grid' must be a GeoTIFF (.tif); give up to 1000 places of a table as 'points'"),
        ("  points: a.csv\n  soil: {bulk_density_gcm3: 1.4}\n", "'soil' is of no use without 'calibration'"),
        ("  pionts: a.csv\n",
         "field.yaml:5 [truth.pionts]: unknown key 'pionts' -> remove it or use one of: points,"),
        ("  points: a.csv\n  variogram: {model: linear}\n",
         "field.yaml:6 [truth.variogram.model]: there is no variogram model 'linear'"),
        ("  points: a.csv\n  variogram: {nugget: 2, sill: 1}\n", "'sill' is the total sill and must be greater"),
        ("  formula: {low: 1}\n", "field.yaml:5 [truth.formula]: a formula is a block of keys with a 'family'"),
        ("  formula:\n    family: rigde\n", "field.yaml:5 [truth.formula]: unknown family 'rigde'; known are"),
        ("  formula:\n    family: ridge\n    background: -1\n    crest: 2\n",
         "field.yaml:7 [truth.formula.background]: input should"),
        ("  formula: {family: matern32, mean: 4, sd: 0.4, range_m: 9000}\n",
         "field.yaml [truth.formula]: no random field with the matern32 model of range 9000 m"),
        ("  formula: {family: ridge, quantity: vwc, background: 0.1, crest: 0.2}\n",
         "field.yaml [truth]: the truth is a moisture (vwc), but there is no calibration curve"),
    ],
)  # fmt: skip
@pytest.mark.slow
def test_mistakes_in_the_field_file_are_named(tmp_path, truth, message):
    found = [str(mistake) for mistake in mistakes_of(write(tmp_path, truth))]
    assert any(message in text for text in found), found


# By path, made once


def test_a_changed_file_is_read_again(tmp_path):
    path = write(tmp_path, "  points: truth.csv\n", POINTS)
    first = surrogate_field(str(path))
    assert surrogate_field(str(path)) is first
    data = tmp_path / "truth.csv"
    data.write_text(POINTS.replace("0,0,3\n", "0,0,2\n", 1))
    os.utime(data, ns=(1, 1))
    assert surrogate_field(str(path)).rate_at([[0, 0]]) == pytest.approx(2.0)

# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest
import rasterio
from pyproj import Transformer

from soilmoist_ros.foundation import InputError, LocalFrame
from soilmoist_ros.mapping import FieldGrid
from soilmoist_ros.reporting import write_geotiff
from soilmoist_ros.reporting.geotiff import BANDS, target_cells, write_cell_raster

FRAME = LocalFrame(53.27, -0.52)


@pytest.fixture(scope="module")
def tif(the_map, tmp_path_factory):
    return write_geotiff(
        tmp_path_factory.mktemp("tif") / "map.tif", the_map, FRAME, tags={"SOILMOIST_SIMULATED": "no"}
    )


def test_large_maps_are_cloud_optimised_and_have_overviews(the_map, tmp_path):
    fine = dataclasses.replace(the_map, grid=FieldGrid.from_polygon(the_map.grid.polygon, 0.15))
    with rasterio.open(write_geotiff(tmp_path / "map.tif", fine, FRAME)) as raster:
        assert raster.tags(ns="IMAGE_STRUCTURE")["LAYOUT"] == "COG"
        assert raster.overviews(1) == [2]
        full = raster.read(1)
        half = raster.read(1, out_shape=(raster.height // 2, raster.width // 2))
    rows, columns = half.shape
    mean = full[: rows * 2, : columns * 2].reshape(rows, 2, columns, 2).mean(axis=(1, 3))
    assert np.isfinite(mean).sum() > 0.5 * half.size
    np.testing.assert_allclose(half[np.isfinite(mean)], mean[np.isfinite(mean)], atol=2e-3)


def centres(raster):
    rows, columns = np.indices(raster.shape)
    t = raster.transform
    return t.c + (columns + 0.5) * t.a, t.f + (rows + 0.5) * t.e


def test_header(tif):
    with rasterio.open(tif) as raster:
        assert raster.crs.to_epsg() == 32630
        assert raster.descriptions == tuple(BANDS) == ("vwc", "vwc_sd", "vwc_p05", "vwc_p95", "rate", "rate_sd")
        assert raster.units == tuple(BANDS[name][0] for name in raster.descriptions)
        assert raster.tags(1)["long_name"] == "volumetric water content of the soil"
        assert set(raster.dtypes) == {"float32"}
        assert all(np.isnan(value) for value in raster.nodatavals)
        assert raster.profile["compress"] == "deflate"
        assert raster.profile["tiled"]
        assert raster.tags()["AREA_OR_POINT"] == "Area"
        assert raster.tags()["SOILMOIST_SIMULATED"] == "no"
        assert json.loads(raster.tags()["SOILMOIST_MODEL"])["range_m"] == 12.0
        assert json.loads(raster.tags()["SOILMOIST_PARAMETERS"])["calibration"]["n0_cps"] == 7.0
        assert json.loads(raster.tags()["SOILMOIST_LIMITS"])["saturation"] == pytest.approx(1 - 1.4 / 2.65)
        assert "90 in 100 places" in raster.tags()["SOILMOIST_INTERVAL"]
    assert [p.name for p in tif.parent.iterdir()] == ["map.tif"], "no side-car files"


def test_each_cell_is_the_prediction_at_its_place(tif, the_map):
    with rasterio.open(tif) as raster:
        x, y = centres(raster)
        bands = dict(zip(raster.descriptions, raster.read(), strict=True))
    local = np.column_stack(
        Transformer.from_crs("EPSG:32630", FRAME.crs, always_xy=True).transform(x.ravel(), y.ravel())
    )
    inside = np.isfinite(bands["rate"]).ravel()
    expected = the_map.evaluate(local[inside])._asdict()
    assert bands.keys() == expected.keys()
    for name, values in expected.items():
        np.testing.assert_allclose(bands[name].ravel()[inside], values, rtol=1e-6)


@pytest.mark.parametrize(
    ("crs", "epsg", "cell"),
    [("EPSG:27700", 27700, 2.0), (3857, 3857, 2.0), ("EPSG:2263", 2263, 2 / 0.3048), (4326, 4326, 3e-5)],
)
def test_another_crs(the_map, tmp_path, crs, epsg, cell):
    frame = LocalFrame(40.7, -74.0) if epsg == 2263 else FRAME
    with rasterio.open(write_geotiff(tmp_path / "m.tif", the_map, frame, crs)) as raster:
        assert raster.crs.to_epsg() == epsg
        assert raster.res[0] == pytest.approx(cell, rel=0.01)
        assert np.isfinite(raster.read(1)).any()


def test_southern_hemisphere_and_no_calibration(uncalibrated, tmp_path):
    with rasterio.open(write_geotiff(tmp_path / "m.tif", uncalibrated, LocalFrame(-33.0, 151.0))) as raster:
        assert raster.crs.to_epsg() == 32756
        assert raster.descriptions == ("rate", "rate_sd"), "no band without values comes first"
        assert np.isfinite(raster.read(1)).any()
        assert json.loads(raster.tags()["SOILMOIST_PARAMETERS"])["calibration"] is None


@pytest.mark.slow
@pytest.mark.parametrize("crs", ["EPSG:1", "nonsense"])
def test_unknown_crs_is_refused(the_map, tmp_path, crs):
    with pytest.raises(InputError, match="not a coordinate reference system"):
        write_geotiff(tmp_path / "m.tif", the_map, FRAME, crs)


def test_crs_that_does_not_cover_the_field_is_refused(the_map, tmp_path):
    with pytest.raises(InputError, match="no place in"):
        write_geotiff(tmp_path / "m.tif", the_map, FRAME, "+proj=gnom +lat_0=-53 +lon_0=179 +type=crs")


def test_every_cell_has_the_value_of_the_cell_at_its_centre(the_map, tmp_path):
    grid, crs = the_map.grid, FRAME.export_crs()
    x, y = np.meshgrid(grid.x_m, grid.y_m)
    bands = {"rate": x, "rate_sd": y, "significant": np.where(grid.mask, 1.0, 5.0)}
    write_cell_raster(tmp_path / "cells.tif", grid, FRAME, crs, bands, {"ABOUT": "cells"})
    with rasterio.open(tmp_path / "cells.tif") as file:
        assert file.descriptions == ("rate", "rate_sd", "significant")
        assert file.units == ("counts/s", "counts/s", "1")
        assert file.tags()["ABOUT"] == "cells"
        east, north, inside = file.read()
        rows, columns = np.nonzero(np.isfinite(east))
        there = np.column_stack(file.xy(rows, columns))
    local = np.column_stack(target_cells(grid, FRAME, crs).to_local.transform(*there.T))
    assert np.abs(local[:, 0] - east[rows, columns]).max() <= grid.cell_m / 2 + 1e-3
    assert np.abs(local[:, 1] - north[rows, columns]).max() <= grid.cell_m / 2 + 1e-3
    assert np.count_nonzero(np.isfinite(inside)) == pytest.approx(np.count_nonzero(grid.mask), rel=0.05)
    assert np.nanmax(inside) == 1.0

# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Coloured GeoTIFF and KMZ read by GDAL."""

from __future__ import annotations

import io
import zipfile
from dataclasses import replace
from xml.etree import ElementTree as ET

import numpy as np
import pyogrio
import pytest
import rasterio
from affine import Affine
from matplotlib.image import imread

from soilmoist_ros.foundation.geodesy import LocalFrame
from soilmoist_ros.reporting.colours import colour_ramp
from soilmoist_ros.reporting.exports.rasters import write_kmz, write_styled
from soilmoist_ros.reporting.exports.source import ExportSettings
from soilmoist_ros.reporting.exports.zones import shown_range

pytestmark = pytest.mark.slow  # the run that all export takes long to make

SETTINGS = ExportSettings()
NAMES = {"k": "http://www.opengis.net/kml/2.2"}


def test_the_coloured_geotiff_has_whole_percents_in_colours(exported, tmp_path):
    first, second = write_styled(exported.source, tmp_path, SETTINGS)
    assert (first.name, second.name) == ("map_styled.tif", "map_styled_salt.tif")
    one, other = exported.source.properties
    with rasterio.open(first) as raster:
        assert raster.tags(ns="IMAGE_STRUCTURE")["LAYOUT"] == "COG"
        assert (raster.dtypes, raster.nodata, raster.colorinterp[0].name) == (("uint8",), 255, "palette")
        assert raster.crs.to_epsg() == 32630
        assert raster.tags()["TIFFTAG_DATETIME"] == "2023:11:14 22:07:37"
        pixels, table = raster.read(1, masked=True), raster.colormap(1)
    inside = np.isfinite(one.values)
    np.testing.assert_array_equal(~pixels.mask, inside)
    np.testing.assert_array_equal(pixels[inside], np.round(one.values[inside]))
    high = shown_range(one.values)[1]
    assert table[0][:3] == tuple(colour_ramp("YlGnBu", 256)[0])
    assert table[int(high) + 2][:3] == tuple(colour_ramp("YlGnBu", 256)[-1])
    assert table[255][3] == 0
    with rasterio.open(second) as raster:
        read = raster.read(1, masked=True) * raster.scales[0] + raster.offsets[0]
        assert raster.units == ("counts/s",)
        step = raster.scales[0]
    assert abs(read[inside] - other.values[inside]).max() <= step / 2 + 1e-6
    assert step < 0.02


@pytest.fixture(scope="module")
def kmz(exported, tmp_path_factory):
    first, second = write_kmz(exported.source, tmp_path_factory.mktemp("kmz"), SETTINGS)
    assert second.name == "map_salt.kmz"
    return first


def test_kmz_shows_the_map_in_its_place(kmz, exported):
    one = exported.source.properties[0]
    with zipfile.ZipFile(kmz) as archive:
        kml = ET.fromstring(archive.read("doc.kml"))
        picture = imread(io.BytesIO(archive.read("map.png")), format="png")
        named = [element.text for element in kml.iter(f"{{{NAMES['k']}}}href")]
        assert set(named) <= set(archive.namelist()), "works without network"
    north, south, east, west = (
        float(kml.findtext(f".//k:LatLonBox/k:{side}", namespaces=NAMES))
        for side in ("north", "south", "east", "west")
    )
    inside, xy = one.cells
    lat, lon = one.frame.to_geographic(xy).T
    rows = ((north - lat) / (north - south) * picture.shape[0]).astype(int)
    columns = ((lon - west) / (east - west) * picture.shape[1]).astype(int)
    found = np.round(255 * picture[rows, columns])
    low, high = shown_range(one.values)
    share = np.clip((one.values[inside] - low) / (high - low), 0, 1)
    ramp = colour_ramp("YlGnBu", 256).astype(float)
    assert (found[:, 3] == 255).all()
    assert abs(found[:, :3] - ramp[np.round(255 * share).astype(int)]).max() <= 6
    assert picture[0, 0, 3] == 0, "outside the field is transparent"


def test_kmz_has_samples_with_time_and_the_field(kmz, exported):
    with zipfile.ZipFile(kmz) as archive:
        kml = ET.fromstring(archive.read("doc.kml"))
    samples = kml.findall(".//k:Folder/k:Placemark", NAMES)
    assert len(samples) == len(exported.run.soil_map.samples)
    assert samples[0].findtext("k:TimeStamp/k:when", namespaces=NAMES) == "2023-11-14T22:13:20Z"
    assert "counts" in samples[0].findtext("k:description", namespaces=NAMES)
    assert kml.findtext(".//k:TimeSpan/k:begin", namespaces=NAMES) == "2023-11-14T22:07:37Z"
    assert "Samples" in {name for name, _ in pyogrio.list_layers(kmz)}
    points = pyogrio.raw.read(kmz, layer="Samples")[2]
    assert len(points) == len(samples)


def test_kmz_on_the_antimeridian_is_one_piece(exported, tmp_path):
    one = exported.source.properties[0]
    frame = LocalFrame(-17.0, 180.0)
    moved = replace(one, frame=frame, crs=frame.crs, transform=Affine(2, 0, -20, 0, -2, 15))
    (path,) = write_kmz(replace(exported.source, properties=[moved], frame=frame), tmp_path, SETTINGS)
    with zipfile.ZipFile(path) as archive:
        kml = ET.fromstring(archive.read("doc.kml"))
    east, west = (float(kml.findtext(f".//k:LatLonBox/k:{side}", namespaces=NAMES)) for side in ("east", "west"))
    assert 179.99 < west < 180 < east < 180.01

# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The KMZ, read without Google Earth."""

from __future__ import annotations

import io
import zipfile
from dataclasses import replace
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from affine import Affine
from matplotlib.image import imread

from soilmoist_ros.foundation.geodesy import LocalFrame
from soilmoist_ros.reporting.colours import colour_ramp, robust_range
from soilmoist_ros.reporting.exports.kmz import write_kmz
from soilmoist_ros.reporting.exports.source import ExportSettings

pytestmark = pytest.mark.slow  # the run that all export takes long to make

NAMES = {"k": "http://www.opengis.net/kml/2.2"}
SIDES = ("north", "south", "east", "west")


def opened(path):
    """The document, the picture, and its box [deg]."""
    with zipfile.ZipFile(path) as archive:
        kml = ET.fromstring(archive.read("doc.kml"))
        assert {href.text for href in kml.iter(f"{{{NAMES['k']}}}href")} <= set(archive.namelist()), "no network"
        picture = imread(io.BytesIO(archive.read("map.png")), format="png")
    return kml, picture, [float(kml.findtext(f".//k:LatLonBox/k:{side}", namespaces=NAMES)) for side in SIDES]


def test_kmz_shows_the_map_in_its_place_with_its_time(exported, tmp_path):
    first, second = write_kmz(exported.source, tmp_path, ExportSettings())
    assert (first.name, second.name) == ("map.kmz", "map_salt.kmz")
    kml, picture, (north, south, east, west) = opened(first)
    one = exported.source.properties[0]
    inside, xy = one.cells
    lat, lon = one.frame.to_geographic(xy).T
    rows = ((north - lat) / (north - south) * picture.shape[0]).astype(int)
    columns = ((lon - west) / (east - west) * picture.shape[1]).astype(int)
    found = np.round(255 * picture[rows, columns])
    low, high = robust_range(one.values)
    share = np.clip((one.values[inside] - low) / (high - low), 0, 1)
    ramp = colour_ramp("YlGnBu", 256).astype(float)
    assert (found[:, 3] == 255).all()
    assert abs(found[:, :3] - ramp[np.round(255 * share).astype(int)]).max() <= 6
    assert picture[0, 0, 3] == 0, "outside the field is transparent"
    assert kml.findtext(".//k:TimeSpan/k:begin", namespaces=NAMES) == "2023-11-14T22:07:37Z"
    assert "(pale) to" in kml.findtext(".//k:description", namespaces=NAMES)
    assert len(kml.findall(".//k:innerBoundaryIs", NAMES)) == 1


def test_kmz_on_the_antimeridian_is_one_piece(exported, tmp_path):
    one = exported.source.properties[0]
    frame = LocalFrame(-17.0, 180.0)
    moved = replace(one, frame=frame, crs=frame.crs, transform=Affine(2, 0, -20, 0, -2, 15))
    (path,) = write_kmz(replace(exported.source, properties=[moved], frame=frame), tmp_path, ExportSettings())
    _, _, (_, _, east, west) = opened(path)
    assert 179.99 < west < 180 < east < 180.01

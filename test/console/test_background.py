# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The picture below the map (background.py, background_route.py)."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
import rasterio
from rasterio import Affine

from soilmoist_ros.console.background import GROUND, MARGIN, MAX_BYTES, make_background
from soilmoist_ros.foundation import InputError, LocalFrame

FRAME = LocalFrame(53.268, -0.5245)
FIELD = np.array([(0.0, 0.0), (100.0, 0.0), (100.0, 80.0), (0.0, 80.0)])
NORTH_WEST, NORTH_EAST, SOUTH_WEST, SOUTH_EAST = (200, 30, 30), (30, 200, 30), (30, 30, 200), (200, 200, 30)


def quarters(side=512):
    """Four colours that meet in the middle of the field, shape (3, side, side)."""
    half = side // 2
    rgb = np.empty((side, side, 3), np.uint8)
    rgb[:half, :half], rgb[:half, half:], rgb[half:, :half], rgb[half:, half:] = (
        NORTH_WEST, NORTH_EAST, SOUTH_WEST, SOUTH_EAST,
    )  # fmt: skip
    return np.moveaxis(rgb, 2, 0)


def write_photo(path, bands, crs="EPSG:32630", half_m=150.0, **profile):
    """A photo about the middle of the field, in another reference system than the field's."""
    from pyproj import Transformer

    latitude, longitude = FRAME.to_geographic([(50.0, 40.0)])[0]
    x, y = Transformer.from_crs(4326, crs, always_xy=True).transform(longitude, latitude)
    step_m = 2 * half_m / bands.shape[2]
    place = Affine(step_m, 0, x - half_m, 0, -step_m, y + half_m)
    size = {"width": bands.shape[2], "height": bands.shape[1], "count": len(bands), "dtype": bands.dtype}
    with rasterio.open(path, "w", driver="GTiff", crs=crs, transform=place, **size, **profile) as raster:
        raster.write(bands)
    return path


def colours(made):
    """Colours of the picture in the middle of each quarter of the field, and in the outermost corner."""
    with warnings.catch_warnings(), rasterio.MemoryFile(made.jpeg) as memory:
        warnings.simplefilter("ignore", rasterio.errors.NotGeoreferencedWarning)
        with memory.open() as raster:
            rgb = np.moveaxis(raster.read(), 0, 2).astype(int)
    west, east, south, north = made.extent
    rows, columns, _ = rgb.shape

    def at(x_m, y_m):
        return rgb[int((north - y_m) / (north - south) * rows), int((x_m - west) / (east - west) * columns)]

    return [at(25, 60), at(75, 60), at(25, 20), at(75, 20)], rgb[0, 0]


def assert_quarters(made):
    assert np.allclose(colours(made)[0], [NORTH_WEST, NORTH_EAST, SOUTH_WEST, SOUTH_EAST], atol=12)


@pytest.mark.parametrize("crs", ["EPSG:32630", "EPSG:27700", "EPSG:3857"])
def test_a_photo_lies_where_the_field_does(tmp_path, crs):
    made = make_background(write_photo(tmp_path / "photo.tif", quarters(), crs), FRAME, FIELD)
    assert_quarters(made)
    assert made.extent == (-100 * MARGIN, 100 + 100 * MARGIN, -100 * MARGIN, 80 + 100 * MARGIN)


def test_a_photo_with_opacity_shows_the_ground_where_it_has_nothing(tmp_path):
    rgb = quarters()
    rgba = np.concatenate([rgb, np.zeros_like(rgb[:1])])
    rgba[3, 150:362, 150:362] = 255
    made = make_background(write_photo(tmp_path / "photo.tif", rgba, photometric="RGB", alpha="yes"), FRAME, FIELD)
    assert_quarters(made)
    assert np.allclose(colours(made)[1], GROUND, atol=6)


@pytest.mark.slow
def test_no_picture_is_too_large(tmp_path):
    noise = np.random.default_rng(1).integers(0, 256, (3, 3000, 3000), np.uint8)
    made = make_background(write_photo(tmp_path / "noise.tif", noise, half_m=90.0), FRAME, FIELD)
    assert 10_000 < len(made.jpeg) <= MAX_BYTES


def test_what_cannot_be_used_is_said(tmp_path):
    far = write_photo(tmp_path / "far.tif", quarters(64))
    with pytest.raises(InputError, match="does not show the field"):
        make_background(far, LocalFrame(51.0, -0.5), FIELD)
    (tmp_path / "text.tif").write_text("no picture")
    with pytest.raises(InputError, match="cannot be read as a raster"):
        make_background(tmp_path / "text.tif", FRAME, FIELD)
    with pytest.raises(InputError, match="is a folder -> give a GeoTIFF"):
        make_background(tmp_path, FRAME, FIELD)
    nowhere = tmp_path / "nowhere.tif"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", rasterio.errors.NotGeoreferencedWarning)
        size = {"width": 8, "height": 8, "count": 3, "dtype": "uint8"}
        with rasterio.open(nowhere, "w", driver="GTiff", **size) as raster:
            raster.write(quarters(8))
    with pytest.raises(InputError, match="no coordinate reference system"):
        make_background(nowhere, FRAME, FIELD)

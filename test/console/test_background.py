# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The picture below the map (background.py, background_route.py)."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
import rasterio
from rasterio import Affine

from soilmoist_ros.console import background as module
from soilmoist_ros.console.background import GROUND, MARGIN, MAX_BYTES, make_background
from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.foundation.geodesy import LocalFrame

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


def test_more_than_8_bits_are_stretched_and_one_band_is_grey(tmp_path):
    ramp = np.tile(np.linspace(900, 3000, 512), (512, 1)).astype(np.uint16)[None]
    (west, east, *_), _ = colours(make_background(write_photo(tmp_path / "grey.tif", ramp), FRAME, FIELD))
    assert len(set(west)) == len(set(east)) == 1
    assert west[0] < 110 < 140 < east[0]


def write_tiles(folder, zoom, from_south, suffix="png"):
    """Web tiles of the photo around the field."""
    from pyproj import Transformer

    latitude, longitude = FRAME.to_geographic([(50.0, 40.0)])[0]
    middle = Transformer.from_crs(4326, 3857, always_xy=True).transform(longitude, latitude)
    tile_m = 2 * module._HALF_WORLD_M / (1 << zoom)
    edge_m = module._HALF_WORLD_M
    column, row = int((middle[0] + edge_m) / tile_m), int((edge_m - middle[1]) / tile_m)
    step_m = tile_m / 256
    for x in range(column - 2, column + 3):
        for y in range(row - 2, row + 3):
            east = x * tile_m - module._HALF_WORLD_M + step_m * (np.arange(256) + 0.5) >= middle[0]
            south = module._HALF_WORLD_M - y * tile_m - step_m * (np.arange(256) + 0.5) < middle[1]
            index = 2 * south[:, None] + east[None, :]
            rgb = np.array([NORTH_WEST, NORTH_EAST, SOUTH_WEST, SOUTH_EAST], np.uint8)[index]
            path = folder / str(zoom) / str(x) / f"{(1 << zoom) - 1 - y if from_south else y}.{suffix}"
            path.parent.mkdir(parents=True, exist_ok=True)
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", rasterio.errors.NotGeoreferencedWarning)
                driver = {"png": "PNG", "jpg": "JPEG"}[suffix]
                with rasterio.open(
                    path, "w", driver=driver, width=256, height=256, count=3, dtype="uint8"
                ) as tile:
                    tile.write(np.moveaxis(rgb, 2, 0))


@pytest.mark.parametrize(("from_south", "suffix"), [(False, "png"), (True, "jpg")])
def test_tiles_lie_where_the_field_does(tmp_path, from_south, suffix):
    write_tiles(tmp_path, 17, from_south, suffix)
    assert_quarters(make_background(tmp_path, FRAME, FIELD))


@pytest.mark.slow
def test_the_finest_tiles_that_are_not_too_many_are_used(tmp_path, monkeypatch):
    for zoom in (16, 17, 18):
        write_tiles(tmp_path, zoom, False)
    used = []
    read = module._read_tile
    monkeypatch.setattr(module, "_read_tile", lambda path: (used.append(path), read(path))[1])
    monkeypatch.setattr(module, "MAX_TILES", 4)
    make_background(tmp_path, FRAME, FIELD)
    assert {path.parts[-3] for path in used} == {"17"}


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
    (tmp_path / "tiles" / "17").mkdir(parents=True)
    with pytest.raises(InputError, match="has no tiles of the field"):
        make_background(tmp_path / "tiles", FRAME, FIELD)
    nowhere = tmp_path / "nowhere.tif"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", rasterio.errors.NotGeoreferencedWarning)
        size = {"width": 8, "height": 8, "count": 3, "dtype": "uint8"}
        with rasterio.open(nowhere, "w", driver="GTiff", **size) as raster:
            raster.write(quarters(8))
    with pytest.raises(InputError, match="no coordinate reference system"):
        make_background(nowhere, FRAME, FIELD)

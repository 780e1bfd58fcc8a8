# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import json

import numpy as np
import pytest

from soilmoist_ros.reporting.page.viewer.packing import MAX_CELLS, pack, pack_bits, thinning, unpack, unpack_bits


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e9])
def test_a_raster_comes_back(scale):
    values = scale * np.random.default_rng(1).normal(0.3, 0.1, (17, 23))
    values[3, 4:9] = np.nan
    found = unpack(json.loads(json.dumps(pack(values))), values.shape)
    np.testing.assert_array_equal(np.isnan(found), np.isnan(values))
    assert np.nanmax(np.abs(found - values)) <= 0.51 * np.nanmax(values - np.nanmin(values)) / 65534


@pytest.mark.parametrize("values", [np.full((2, 3), 0.25), np.full((2, 3), np.nan)])
def test_a_flat_or_empty_raster_comes_back(values):
    np.testing.assert_array_equal(unpack(pack(values), (2, 3)), values)


def test_a_mask_comes_back():
    mask = np.random.default_rng(2).random((5, 7)) > 0.6
    np.testing.assert_array_equal(unpack_bits(pack_bits(mask), mask.shape), mask)
    assert pack_bits(np.zeros((5, 7), bool)) == ""
    assert not unpack_bits("", (5, 7)).any()


def test_large_rasters_are_thinned():
    assert thinning((300, 300)) == 1
    step = thinning((2000, 1500))
    assert (2000 // step) * (1500 // step) <= MAX_CELLS

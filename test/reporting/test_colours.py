# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Colour maps and pictures of rasters (colours.py)."""

import io

import matplotlib
import numpy as np
import pytest
from matplotlib.image import imread

from soilmoist_ros.reporting import RATE, UNCERTAIN
from soilmoist_ros.reporting.colours import DARKEST, DIFFERENCE, PALEST, WATER, colour_ramp, coloured_png, hex_ramp


@pytest.mark.parametrize("name", [WATER, RATE, UNCERTAIN, DIFFERENCE, f"{DIFFERENCE}_r"])
@pytest.mark.parametrize("count", [2, 5, 256])
def test_colours_are_those_of_matplotlib(name, count):
    wanted = 255 * matplotlib.colormaps[name].resampled(4096)(np.linspace(PALEST, DARKEST, count))[:, :3]
    assert abs(colour_ramp(name, count) - wanted).max() < 0.7
    assert hex_ramp(name, count)[-1] == "#{:02x}{:02x}{:02x}".format(*colour_ramp(name, count)[-1])


def test_png_has_a_pixel_for_each_cell():
    shares = np.array([[0.0, 0.5, 1.0], [-3.0, np.nan, 7.0]])
    colours = colour_ramp(RATE, 255)
    pixels = np.round(255 * imread(io.BytesIO(coloured_png(shares, colours)), format="png"))
    low, middle, high = colours[[0, 127, 254]]
    assert pixels.shape == (2, 3, 4)
    np.testing.assert_array_equal(pixels[0, :, :3], [low, middle, high])
    np.testing.assert_array_equal(pixels[1, [0, 2], :3], [low, high])
    np.testing.assert_array_equal(pixels[..., 3], [[255, 255, 255], [255, 0, 255]])

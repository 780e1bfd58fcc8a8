# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""soilmoist_msgs/MapSummary of a map."""

from __future__ import annotations

import math

import numpy as np
import pytest

pytest.importorskip("soilmoist_msgs.msg")

from msg_adapters.soilmoist.map_summary import map_summary_to_message
from soilmoist_ros.mapping.field_map import MapState
from soilmoist_ros.mapping.grid import FieldGrid
from soilmoist_ros.mapping.samples import Samples
from soilmoist_ros.mapping.soil_map import SoilMap
from soilmoist_ros.mapping.variogram.model import Variogram
from soilmoist_ros.simulation.fields.catalogue import surrogate_field

NUMBERS = ("mean_rate", "mean_vwc", "rate_sd", "vwc_sd", "normalised_variance", "nugget", "sill", "range_m")


@pytest.fixture
def state():
    samples = Samples([(1, 1), (8, 3)], [310, 295], [100.0, 110.0])
    return MapState(records=21, stamp_s=1234.5, samples=samples)


def made(state, curve):
    """A map whose cells outside a triangle are NaN; variance 0.04 and 0.16 in halves of it."""
    grid = FieldGrid.from_polygon([(0, 0), (10, 0), (0, 10)], cell_m=1.0)
    rate = np.where(grid.mask, 5.0, np.nan)
    variance = np.where(grid.mask, 0.04, np.nan)
    variance[:, ::2] *= 4.0
    variogram = Variogram("matern32", 0.1, 25.0, 0.5)
    return SoilMap(grid, rate, variance, state.samples, variogram, None, 5.0, curve, True, None, 0)


def test_a_map_with_calibration_in_numbers(state):
    soil_map = made(state, surrogate_field("synthetic-high").curve)
    message = map_summary_to_message(state, soil_map, "field")
    assert (message.header.frame_id, message.header.stamp.sec, message.header.stamp.nanosec) == (
        "field", 1234, 500_000_000,
    )  # fmt: skip
    assert (message.records, message.samples, message.raw_counts, message.effective_exposure_s) == (
        21,
        2,
        605,
        210,
    )
    assert (message.variogram_model, message.nugget, message.sill, message.range_m) == ("matern32", 0.1, 0.5, 25.0)
    variance = np.nanmean(soil_map.variance)
    assert message.mean_rate == 5.0
    assert message.rate_sd == pytest.approx(math.sqrt(variance))
    assert message.normalised_variance == pytest.approx(variance / 0.5)
    assert message.mean_vwc == pytest.approx(np.nanmean(soil_map.vwc))
    assert message.vwc_sd == pytest.approx(math.sqrt(np.nanmean(soil_map.vwc_sd**2)))
    assert 0 < message.mean_vwc < 0.6


def test_what_is_unknown_is_nan(state):
    message = map_summary_to_message(state, made(state, None))
    assert math.isnan(message.mean_vwc)
    assert math.isnan(message.vwc_sd)
    assert message.mean_rate == 5.0
    message = map_summary_to_message(MapState(), None)
    assert (message.records, message.samples, message.raw_counts, message.variogram_model) == (0, 0, 0, "")
    assert all(math.isnan(getattr(message, name)) for name in NUMBERS)

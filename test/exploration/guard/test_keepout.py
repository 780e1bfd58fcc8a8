# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The fence as a raster."""

import math

import numpy as np
import pytest

from soilmoist_ros.exploration.guard.fence import Fence
from soilmoist_ros.exploration.guard.keepout import FREE, KEPT_OUT, RIM_M, keepout_mask
from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.foundation.geodesy import LocalFrame, PlaneMove
from soilmoist_ros.mapping.field import Field

FIELD = Field(
    "meadow", LocalFrame(53.0, 0.0), np.array([[0, 0], [30, 0], [30, 12], [10, 20], [0, 12]], float),
    (np.array([[5, 4], [9, 4], [9, 9], [5, 9]], float),),
)  # fmt: skip


def value(mask, x, y):
    column, row = (
        math.floor((at - low) / mask.resolution_m) for at, low in zip((x, y), mask.origin_m, strict=True)
    )
    return mask.values[row, column]


@pytest.mark.parametrize("move", [PlaneMove(), PlaneMove(2.1, (-13.3, 470.0))])
def test_allowed_places_are_free_and_those_far_outside_are_not(move):
    fence, resolution_m = Fence(FIELD, 0.75), 0.25
    mask = keepout_mask(fence, resolution_m, move)
    rng = np.random.default_rng(1)
    places = rng.uniform((-3, -3), (33, 23), (3000, 2))
    found = np.array([value(mask, *move.place(tuple(place))) for place in places])
    assert (found[fence.contains(places)] == FREE).all()
    far_m = np.array([fence.outside_m(place) for place in places])
    assert (found[far_m > 1.001 * math.sqrt(2) * resolution_m] == KEPT_OUT).all()
    assert set(np.unique(mask.values)) == {FREE, KEPT_OUT}


def test_rows_run_along_y_and_a_rim_is_kept_out():
    mask = keepout_mask(Fence(FIELD), 0.5)
    assert mask.origin_m == (-RIM_M, -RIM_M)
    assert mask.values.shape == (60, 80)
    assert (mask.values[0] == KEPT_OUT).all()
    assert (mask.values[:, -1] == KEPT_OUT).all()
    assert value(mask, 29, 1) == FREE
    assert value(mask, 1, 19) == KEPT_OUT
    assert value(mask, 7, 6.5) == KEPT_OUT


def test_cells_too_fine():
    with pytest.raises(InputError, match="larger keepout_resolution_m"):
        keepout_mask(Fence(FIELD), 0.01)

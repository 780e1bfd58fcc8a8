# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The fence and its raster: what it allows, and what it says about the rest."""

import math

import numpy as np
import pytest

from soilmoist_ros.exploration.guard.fence import FREE, KEPT_OUT, MAX_CELLS, RIM_M, Fence, keepout_mask
from soilmoist_ros.foundation import InputError, LocalFrame, PlaneMove
from soilmoist_ros.mapping.field import Field

SQUARE = np.array([[0, 0], [60, 0], [60, 40], [0, 40]], float)
POND = np.array([[20, 10], [40, 10], [40, 30], [20, 30]], float)
FIELD = Field("meadow", LocalFrame(53.0, 0.0), SQUARE, (POND,))


def test_places_and_routes_inside():
    fence = Fence(FIELD)
    assert fence.contains([(5, 5), (30, 20), (-1, 5), (0, 0), (np.nan, 3)]).tolist() == [
        True, False, False, True, False,
    ]  # fmt: skip
    assert fence.allows([(5, 5), (55, 5), (55, 35)])
    assert fence.allows([(5, 5)])
    assert not fence.allows([(5, 20), (55, 20)]), "through the pond"
    assert fence.allows([(5, 10), (55, 10)]), "along its border"
    assert not fence.allows([(5, 5), (np.nan, 5)])
    assert not fence.allows(np.empty((0, 2)))
    assert fence.refusal([(5, 5), (55, 5)]) == ""


def test_a_refusal_says_what_where_and_by_how_much():
    fence = Fence(FIELD)
    assert fence.refusal([(5, 20), (55, 20)]) == "it enters no-go area 1 at (20.0, 20.0), 10.0 m deep"
    assert fence.refusal([(55, 20), (5, 20)]).startswith("it enters no-go area 1 at (40.0, 20.0)")
    assert fence.refusal([(30, 28)]) == "it is in no-go area 1 at (30.0, 28.0), 2.0 m deep"
    assert fence.refusal([(5, 5), (-7, 5), (5, 6)]) == "it leaves the field at (0.0, 5.0), 7.0 m outside"
    assert fence.refusal([(72, 5)]) == "it is outside the field at (72.0, 5.0), 12.0 m outside"
    assert "not finite" in fence.refusal([(np.inf, 5)])


def test_the_robots_radius_is_kept():
    fence = Fence(FIELD, 1.5)
    assert fence.allows([(1.5, 1.5), (58.5, 1.5)])
    assert not fence.allows([(1.4, 1.5), (58.5, 1.5)])
    assert "enters no-go area 1" in fence.refusal([(5, 9), (55, 9)])
    assert "0.5 m deep with 1.5 m margin" in fence.refusal([(5, 9), (55, 9)])


def test_a_border_beyond_the_field_keeps_the_margin_of_no_go_areas():
    fence = Fence(FIELD, 1.0, 3.0)
    assert fence.contains([(-2.9, 5), (-3.1, 5), (30, 9.1), (30, 8.9)]).tolist() == [True, False, False, True]


def test_distance_outside():
    fence = Fence(FIELD)
    assert fence.outside_m((5, 5)) == 0
    assert fence.outside_m((60, 43)) == pytest.approx(3.0)
    assert fence.outside_m((30, 28)) == pytest.approx(2.0), "to the border of the pond"
    assert fence.outside_m((np.nan, 0)) == np.inf


def test_depth_in_no_go_areas_that_touch_and_distance_beyond_the_border():
    halves = [
        np.array([[10, 10], [20, 10], [20, 20], [10, 20]]),
        np.array([[20, 10], [30, 10], [30, 20], [20, 20]]),
    ]
    square = np.array([[0, 0], [60, 0], [60, 40], [0, 40]])
    fence = Fence(Field("two", FIELD.frame, square, tuple(map(np.asarray, halves))), 1.0)
    assert fence.in_no_go_m((20.0, 15.0)) == pytest.approx(6.0), "1 m of it is the margin"
    assert fence.in_no_go_m((9.5, 15.0)) == pytest.approx(0.5)
    assert (
        fence.in_no_go_m((8.9, 15.0)) == fence.beyond_border_m((0.5, 5.0)) == fence.beyond_border_m((20, 15)) == 0
    )
    assert fence.beyond_border_m((-3.0, 5.0)) == pytest.approx(3.0)
    assert (fence.leaving_m, Fence(FIELD, 0.2).leaving_m) == (2.0, 0.7)


def test_a_field_too_narrow_for_the_robot():
    with pytest.raises(InputError, match="no place of the field 'meadow' is 30 m away"):
        Fence(FIELD, 30.0)


def test_parts_that_no_go_areas_and_the_robots_width_divide_are_named_with_their_size():
    assert Fence(FIELD).divided() == ""
    ditch = np.array([[44, 1], [46, 1], [46, 50], [44, 50]], float)
    field = Field("ditch", FIELD.frame, SQUARE, (ditch,))
    assert Fence(field).divided() == "", "a way of 1 m is left"
    found = Fence(field, 0.75).divided()
    assert "into 2 parts that cannot be reached from each other by a robot that keeps 0.75 m distance" in found
    assert "0.16 ha about (22, 20), 481 m2 about (53, 20)" in found, "42.5 m x 38.5 m and 12.5 m x 38.5 m"


# The fence as a raster ------------------------------------------------------------------------------------------

MASKED = Field(
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
    fence, resolution_m = Fence(MASKED, 0.75), 0.25
    mask = keepout_mask(fence, resolution_m, move)
    rng = np.random.default_rng(1)
    places = rng.uniform((-3, -3), (33, 23), (3000, 2))
    found = np.array([value(mask, *move.place(tuple(place))) for place in places])
    assert (found[fence.contains(places)] == FREE).all()
    far_m = np.array([fence.outside_m(place) for place in places])
    assert (found[far_m > 1.001 * math.sqrt(2) * resolution_m] == KEPT_OUT).all()
    assert set(np.unique(mask.values)) == {FREE, KEPT_OUT}


def test_rows_run_along_y_and_a_rim_is_kept_out():
    mask = keepout_mask(Fence(MASKED), 0.5)
    assert mask.origin_m == (-RIM_M, -RIM_M)
    assert mask.values.shape == (60, 80)
    assert (mask.values[0] == KEPT_OUT).all()
    assert (mask.values[:, -1] == KEPT_OUT).all()
    assert value(mask, 29, 1) == FREE
    assert value(mask, 1, 19) == KEPT_OUT
    assert value(mask, 7, 6.5) == KEPT_OUT


@pytest.mark.slow
@pytest.mark.parametrize("side_m", [900.0, 1e5])
def test_a_large_field_has_a_mask_of_larger_cells(side_m):
    corners = side_m * np.array([[0, 0], [1, 0], [1, 0.5], [0, 0.5]])
    mask = keepout_mask(Fence(Field("large", LocalFrame(53.0, 0.0), corners)), 0.2)
    assert 0.9 * MAX_CELLS < mask.values.size <= MAX_CELLS
    assert value(mask, side_m / 2, side_m / 4) == FREE

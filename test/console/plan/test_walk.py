# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A boundary from a walk (walk.py)."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from soilmoist_ros.console.board import Board
from soilmoist_ros.console.plan.walk import MAX_PLACES, STEP_M, Walk, walked
from soilmoist_ros.foundation.errors import InputError

CORNERS = np.array([[0, 0], [60, 5], [55, 50], [-5, 40]], float)


def along(corners, step_m=0.5, noise_m=0.0, seed=1):
    """Places of a walk around corners, back to the first."""
    rng, places = np.random.default_rng(seed), []
    for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        shares = np.arange(0, 1, step_m / math.dist(start, end))[:, None]
        places.append(start + shares * (end - start))
    walk = np.vstack(places)
    return (walk + rng.normal(0, noise_m, walk.shape)).round(2).tolist()


@given(st.floats(0, 0.3), st.integers(1, 50))
def test_a_walk_becomes_a_ring_with_few_corners(noise_m, seed):
    places = along(CORNERS, noise_m=noise_m / 3, seed=seed)
    answer = walked({"places": places, "sd": noise_m})
    ring = shapely.Polygon(answer["ring"])
    assert ring.is_valid
    assert 4 <= len(answer["ring"]) < len(places) / 8
    assert ring.symmetric_difference(shapely.Polygon(CORNERS)).area < 200 * (answer["tolerance_m"] + noise_m)
    assert answer["gap_m"] < 1.5


def test_a_loop_at_the_start_is_cut_off_and_a_figure_of_eight_is_refused():
    loop = [[-3, -3], [-1, 2], [2, -1], [-2, -2], *along(CORNERS)[4:]]
    assert shapely.Polygon(walked({"places": loop})["ring"]).area == pytest.approx(
        shapely.Polygon(CORNERS).area, rel=0.02
    )
    for wrong in ([[0, 0], [40, 30], [40, 0], [0, 30]], [[0, 0], [5, 0]], [[0, 0], [10, 0], [20, 0], [30, 0]]):
        with pytest.raises(InputError, match="walk"):
            walked({"places": wrong})


@pytest.mark.slow
def test_places_are_recorded_between_begin_and_end():
    board = Board()
    walk = Walk(board, "r1")
    walk.place(9.0, 9.0, 0.01)
    walk.begin("Ada", "area")
    for n in range(20):
        walk.place(n * STEP_M / 4, 0.0, 0.02 + 0.01 * (n == 12))
    assert board.get("walk/r1") == {"who": "Ada", "kind": "area", "sd": 0.03, "count": 5}
    assert board.get("walk/r1/places")[0] == (0.0, 0.0)
    walk.place(50.0, 0.0, math.nan)
    done = walk.end()
    assert (done["kind"], done["count"], done["sd"], len(done["places"])) == ("area", 6, None, 6)
    assert (board.get("walk/r1"), board.get("walk/r1/places")) == (None, ())
    walk.place(60.0, 0.0, 0.01)
    assert board.get("walk/r1/places") == ()
    walk.begin("", "boundary")
    for n in range(MAX_PLACES + 10):
        walk.place(float(n), 0.0, 0.01)
    assert MAX_PLACES / 2 <= len(walk.end()["places"]) <= MAX_PLACES

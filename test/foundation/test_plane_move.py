# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Moves between planes: exact inverses, recovered by a fit, and right on the earth."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from soilmoist_ros.foundation.geodesy import LocalFrame
from soilmoist_ros.foundation.plane_move import PlaneMove, fit_move, move_between

metres = st.floats(-5000, 5000)
moves = st.builds(PlaneMove, st.floats(-math.pi, math.pi), st.tuples(metres, metres))
FIELD = LocalFrame(52.0, 13.0)


@given(moves, metres, metres)
def test_the_inverse_leads_back(move, x, y):
    assert move.inverse.place(move.place((x, y))) == pytest.approx((x, y), abs=1e-8)
    assert move.places([(x, y)])[0] == pytest.approx(move.place((x, y)), abs=1e-9)
    assert math.cos(move.inverse.heading(move.heading(0.3))) == pytest.approx(math.cos(0.3))


def test_the_identity_changes_no_bit():
    xy = np.array([(0.1, 0.2), (1e-17, -0.0)])
    assert PlaneMove().is_identity
    assert (PlaneMove().places(xy) == xy).all()
    assert PlaneMove().place((0.1, 0.2)) == (0.1, 0.2)
    assert move_between(FIELD, LocalFrame(52.0, 13.0)).is_identity


@given(moves, st.integers(0, 2**32 - 1))
def test_a_fit_recovers_the_move(move, seed):
    rng = np.random.default_rng(seed)
    start = rng.uniform(-100, 100, (20, 2))
    found, error_m = fit_move(start, move.places(start))
    assert error_m < 1e-6
    assert found.places(start) == pytest.approx(move.places(start), abs=1e-6)
    noisy, error_m = fit_move(start, move.places(start) + rng.normal(0, 0.1, (20, 2)))
    assert error_m < 0.3
    assert np.abs(noisy.places(start) - move.places(start)).max() < 0.5


@pytest.mark.slow
@settings(max_examples=20)
@given(st.floats(-60, 60), st.floats(-180, 180), metres, metres, st.floats(-math.pi, math.pi))
def test_a_place_keeps_its_latitude_and_longitude(latitude, longitude, east, north, yaw_rad):
    start = LocalFrame(latitude, longitude)
    end_latitude, end_longitude = start.to_geographic([(east, north)])[0]
    end = LocalFrame(float(end_latitude), float(end_longitude))
    move = move_between(start, end, yaw_rad)
    for place in ((0.0, 0.0), (300.0, 0.0), (-200.0, 250.0)):
        moved = move.place(place)
        back = end.to_geographic([PlaneMove(yaw_rad).place(moved)])[0]
        away_m = start.to_local(*back)[0] - place
        assert np.hypot(*away_m) < 0.01  # at 5 km from the datum


def test_meridians_converge():
    far = move_between(FIELD, LocalFrame(52.0, 14.0))
    assert math.degrees(far.yaw_rad) == pytest.approx(
        -math.sin(math.radians(52.0)), abs=0.01
    )  # north is to the right


def test_the_other_side_of_the_earth_is_refused():
    with pytest.raises(ValueError, match="two sides"):
        move_between(FIELD, LocalFrame(-52.0, -167.0))

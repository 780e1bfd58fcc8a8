# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Moves between planes: exact inverses, recovered by a fit, and right on the earth."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from pyproj import Geod, Transformer

from soilmoist_ros.foundation.geodesy import LocalFrame, PlaneMove, distance_and_bearing, fit_move, move_between


def test_the_plane_is_topocentric_east_north():
    frame = LocalFrame(38.7, -97.4)
    topocentric = Transformer.from_pipeline(
        "+proj=pipeline +step +proj=unitconvert +xy_in=deg +xy_out=rad +step +proj=cart +ellps=WGS84 "
        "+step +proj=topocentric +ellps=WGS84 +lon_0=-97.4 +lat_0=38.7 +h_0=0"
    )
    east, north, _ = topocentric.transform(-97.3, 38.75, 0.0)
    np.testing.assert_allclose(frame.to_local(38.75, -97.3), [[east, north]], atol=1e-6)


@pytest.mark.parametrize(
    ("latitude", "longitude", "code"),
    [(38.7, -97.4, 32614), (-33.9, 18.4, 32734), (53.2, -0.0001, 32630), (53.2, 0.0001, 32631), (88, 0, 32661),
     (-85, 0, 32761), (10, 180, 32601), (10, -180, 32601)],
)  # fmt: skip
def test_export_crs_is_the_zone_of_the_datum(latitude, longitude, code):
    assert LocalFrame(latitude, longitude).export_crs().to_epsg() == code


def test_the_far_side_of_the_earth_is_nan_not_a_wrong_place():
    assert np.isnan(LocalFrame(0.0, 0.0).to_local(0.0, 170.0)).all()


@pytest.mark.parametrize(("latitude", "longitude"), [(91, 0), (0, 181), (float("nan"), 0)])
def test_impossible_datums_are_refused(latitude, longitude):
    with pytest.raises(ValueError, match="must be within"):
        LocalFrame(latitude, longitude)


def test_the_plane_has_the_datum_of_gnss():
    """Else a map in another datum, as the British National Grid, is moved by its 100 m."""
    easting, northing = Transformer.from_crs(4326, 27700, always_xy=True).transform(-0.5245, 53.268)
    to_local = Transformer.from_crs(27700, LocalFrame(53.268, -0.5245).crs, always_xy=True)
    assert np.hypot(*to_local.transform(easting, northing)) < 0.1


@pytest.mark.parametrize(
    ("latitude", "longitude"),
    [
        (53.26841, -0.52437),
        (-36.5, 149.1),
        (0.0, 10.0),
        (90.0, 0.0),
        (-90.0, 30.0),
        (64.1, -180.0),
        (-17.8, 180.0),
    ],
)
def test_it_is_the_projection_of_proj(latitude, longitude):
    """Bit for bit, except for a field on the antimeridian."""
    frame, rng = LocalFrame(latitude, longitude), np.random.default_rng(4)
    proj = Transformer.from_crs("EPSG:4326", frame.crs, always_xy=True)
    places = np.clip(rng.normal((latitude, longitude), 0.02, (200, 2)), (-90, -999), (90, 999))
    wanted = np.column_stack(proj.transform(*places.T[::-1]))
    found = frame.to_local(*places.T)
    np.testing.assert_allclose(found, wanted, rtol=0, atol=0 if abs(longitude) < 180 else 2e-8)
    back = frame.to_geographic(found)
    np.testing.assert_allclose(frame.to_local(*back.T), found, rtol=0, atol=1e-8)
    np.testing.assert_allclose(back[:, 0], places[:, 0], rtol=0, atol=1e-10)


def test_positions_that_are_none_are_nan():
    frame = LocalFrame(53.0, 1.0)
    places = frame.to_local([np.nan, 53.0, np.inf, 90.1, 53.0], [1.0, np.nan, 1.0, 1.0, 1.0])
    assert np.isnan(places[:4]).all()
    np.testing.assert_array_equal(places[4], 0.0)
    assert np.isnan(frame.to_geographic([[7e6, 0.0]])).all()


@given(st.tuples(st.floats(-90, 90), st.floats(-180, 180)), st.tuples(st.floats(-90, 90), st.floats(-180, 180)))
@example((51.0, 12.0), (50.99995, 12.0))
def test_distances_and_bearings_are_those_of_geodesics(start, end):
    bearing_deg, _, distance_m = Geod(ellps="WGS84").inv(start[1], start[0], end[1], end[0])
    found_m, found_deg = distance_and_bearing(start, end)
    far = distance_m > 15e6
    assert found_m == pytest.approx(distance_m, abs=0.05, rel=0.01 if far else 1e-4)
    if distance_m > 0.01 and not far and max(abs(start[0]), abs(end[0])) < 89:
        assert (found_deg - bearing_deg + 180) % 360 - 180 == pytest.approx(0, abs=0.6)


# Moves between planes: exact inverses, recovered by a fit, and right on the earth -------------------------------

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


def test_the_other_side_of_the_earth_is_refused():
    with pytest.raises(ValueError, match="two sides"):
        move_between(FIELD, LocalFrame(-52.0, -167.0))

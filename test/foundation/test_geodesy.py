import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pyproj import Transformer

from soilmoist_ros.foundation.geodesy import LocalFrame


@pytest.mark.slow
@given(st.floats(-85, 85), st.floats(-180, 180), st.floats(-5e3, 5e3), st.floats(-5e3, 5e3))
def test_local_and_geographic_are_inverse(latitude, longitude, x, y):
    frame = LocalFrame(latitude, longitude)
    geographic = frame.to_geographic([[x, y]])
    np.testing.assert_allclose(frame.to_local(geographic[:, 0], geographic[:, 1]), [[x, y]], atol=1e-5)


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


def test_a_zone_seam_through_the_field_does_no_harm():
    frame = LocalFrame(53.2, 0.0)  # border of zones 30 and 31
    west, east = frame.to_local([53.2, 53.2], [-0.0005, 0.0005])
    assert east[0] - west[0] == pytest.approx(66.8, abs=0.2)
    assert abs(east[1] - west[1]) < 1e-3


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

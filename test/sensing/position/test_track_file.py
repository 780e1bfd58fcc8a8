# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Positions in files of other programs: GPX, tables, solutions of RTKLIB."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.sensing.gnss import FixStatus
from soilmoist_ros.sensing.position.track_file import read_positions
from soilmoist_ros.sensing.problems import Kind

T0 = 1_778_749_200.0  # 2026-05-14 09:00 UTC
FILES = {
    "gpx": '<?xml version="1.0"?>\n<gpx xmlns="http://www.topografix.com/GPX/1/1"><trk><trkseg><trkpt '
    'lat="53.268" lon="-0.5245"><ele>31.5</ele><time>2026-05-14T09:00:00Z</time></trkpt></trkseg></trk></gpx>',
    "csv": "time,lat,lon,elevation,accuracy\n2026-05-14T09:00:00Z,53.268,-0.5245,31.5,2\n",
    "semicolons": "Timestamp [ms];Latitude [deg];Longitude [deg];Height (m)\n1778749200000;53,268;-0,5245;31,5\n",
    "date and time": "Date,UTC time,Longitude,Latitude,Alt\n2026/05/14,11:00:00 +0200,-0.5245,53.268,31.5\n",
    "0 to 360": "unix time\tlat\tlng\tele\n1778749200\t53.268\t359.4755\t31.5\n",
    "RTKLIB in UTC": "%  UTC  latitude(deg) longitude(deg) height(m) Q ns sdn(m) sde(m)\n"
    "2026/05/14 09:00:00.000   53.268   -0.5245   31.5   1  18   0.006   0.008\n",
    "RTKLIB": "% program : rnx2rtkp\n%  GPST  latitude(deg) longitude(deg) height(m) Q ns sdn(m) sde(m)\n"
    "2026/05/14 09:00:18.000   53.268   -0.5245   31.5   1  18   0.006   0.008\n",
    "RTKLIB by week": "%  GPST  latitude(deg) longitude(deg) height(m) Q ns sdn(m) sde(m)\n"
    "2418 378018.000   53.268   -0.5245   31.5   1  18   0.006   0.008\n",
}


def read(tmp_path, text):
    path = tmp_path / "track"
    path.write_text(text)
    return read_positions(path)


@pytest.mark.parametrize("form", FILES)
def test_a_track_is_known_by_its_content(tmp_path, form):
    (fix,), problems = read(tmp_path, FILES[form])
    assert fix.stamp_s == T0
    place = fix.position
    assert (place.latitude_deg, place.altitude_m) == (53.268, 31.5)
    assert place.longitude_deg == pytest.approx(-0.5245, abs=1e-12)
    rtklib = "RTKLIB" in form
    assert (
        place.horizontal_sd_m == pytest.approx(0.00707, abs=1e-5) if rtklib else math.isnan(place.horizontal_sd_m)
    )
    assert [one.kind for one in problems] == [Kind.ASSUMED_TIME] * form.startswith("RTKLIB") * ("UTC" not in form)


def test_times_without_a_zone_are_said_once_and_rows_without_a_place_are_no_fix(tmp_path):
    fixes, problems = read(
        tmp_path, "datetime,lat,lon\n2026-05-14 09:00:00,53.268,-0.5245\n2026-05-14 09:00:01,,\n"
    )
    assert [fix.stamp_s - T0 for fix in fixes] == [0, 1]
    assert math.isnan(fixes[1].position.latitude_deg)
    assert [one.mistake.message for one in problems] == [
        "times such as '2026-05-14 09:00:00' have no time zone: they are read as UTC"
    ]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "time,lat,lon\n14/05/2026 09:00:00,53.2,-0.5\n",
            r"track:2: '14/05/2026 09:00:00' is no time .*not guessed",
        ),
        ("time,lat,lon\n2026-05-14T09:00:00Z,5316.08,-0.5\n", r"track:2: '5316.08' is no latitude in degrees"),
        ("lat,lon\n53.2,-0.5\n", "no column of times"),
        ("<gpx></gpx>", "without points"),
        ("<gpx><trk>", "damaged GPX"),
        ("<kml></kml>", "KML"),
        ("a,b\n1,2\n", "no NMEA sentence"),
    ],
)
def test_what_cannot_be_read_is_named(tmp_path, text, message):
    with pytest.raises(InputError, match=message):
        read(tmp_path, text)


@settings(deadline=None, max_examples=200)
@given(
    st.sampled_from(
        [b"", b"<gpx><trkpt ", b"time,lat,lon\n", b"lat;lon;unix\n", b"%  GPST latitude(deg) longitude(deg)\n"]
    ),
    st.one_of(
        st.binary(max_size=200),
        st.lists(
            st.sampled_from([b"1", b"2026-05-14", b"\n", b",", b";", b" ", b"9e99", b"-5", b'"', b"$GPGGA,"])
        ).map(b"".join),
    ),
)
def test_any_bytes_are_read_or_refused(tmp_path_factory, head, rest):
    path = tmp_path_factory.getbasetemp() / "any.track"
    path.write_bytes(head + rest)
    try:
        fixes, _ = read_positions(path, (T0, T0 + 60.0))
    except InputError:
        return
    assert all(math.isnan(fix.position.latitude_deg) == (fix.status is FixStatus.NO_FIX) for fix in fixes)

# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Positions in files of other programs: GPX, and tables in one form; others are refused by name."""

import math

import pytest

from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.sensing import Kind, read_positions

T0 = 1_778_749_200.0  # 2026-05-14 09:00 UTC
FILES = {
    "gpx": '<?xml version="1.0"?>\n<gpx xmlns="http://www.topografix.com/GPX/1/1"><trk><trkseg><trkpt '
    'lat="53.268" lon="-0.5245"><ele>31.5</ele><time>2026-05-14T09:00:00Z</time></trkpt></trkseg></trk></gpx>',
    "csv": "sep=,\ntime,lat,lon,alt\n2026-05-14T09:00:00Z,53.268,-0.5245,31.5\n",
    "another zone": "Time, Lat, Lon, Alt\n2026-05-14T11:00:00+02:00, 53.268, -0.5245, 31.5\n",
    "quotes": '"time","lat","lon","alt"\n"2026-05-14T09:00:00Z","53.268","-0.5245",31.5\n',
    "0 to 360": "time,lat,lon,alt\n1778749200,53.268,359.4755,31.5\n",
    "nanoseconds": "time,lat,lon,alt\n1778749200000000000,53.268,-0.5245,31.5\n",
}


def read(tmp_path, text):
    path = tmp_path / "track"
    path.write_text(text)
    return read_positions(path)


@pytest.mark.parametrize("form", FILES)
def test_a_track_is_known_by_its_content(tmp_path, form):
    (fix,), problems = read(tmp_path, FILES[form])
    place = fix.position
    assert (fix.stamp_s, place.altitude_m, problems) == (T0, 31.5, [])
    assert (place.latitude_deg, place.longitude_deg) == pytest.approx((53.268, -0.5245), abs=1e-12)
    assert math.isnan(place.horizontal_sd_m)


def test_times_without_a_zone_are_said_once_and_rows_without_a_place_are_no_fix(tmp_path):
    fixes, problems = read(tmp_path, "time,lat,lon\n2026-05-14 09:00:00,53.268,-0.5245\n2026-05-14 09:00:01,,\n")
    assert [fix.stamp_s - T0 for fix in fixes] == [0, 1]
    assert math.isnan(fixes[1].position.latitude_deg)
    assert [(one.kind, one.mistake.message) for one in problems] == [
        (Kind.ASSUMED_TIME, "times such as '2026-05-14 09:00:00' have no time zone: they are read as UTC")
    ]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("time,lat,lon\n14/05/2026 09:00:00,53.2,-0.5\n", "track:2: '14/05/2026 09:00:00' is no time that can"),
        ("time,lat,lon\n2026-05-14T09:00:00Z,53,268,-0,5245\n", "track:2: has 5 fields, the header names 3"),
        ("time,lat,lon\n2026-05-14T09:00:00Z,5316.08,-0.5\n", "2: '5316.08' is no latitude in degrees"),
        ("time,lat,lon\n2026-05-14T09:00:00Z,53.2 N,0.5 W\n", "2: '53.2 N' is no latitude in degrees"),
        ("time,lat,lon\n,53,0\n", "has 1 points, but not one time"),
        ("time,lat,lon\n2026-10-25 02:59:50,53,0\n2026-10-25 02:00:00,53,0\n", "go back from 2026-10-25 02:59:50"),
        ("<gpx><trk><trkpt lat='53' lon='0'/></trk></gpx>", "has 1 points, but not one time"),
        ("<gpx></gpx>", "without points"),
        ("<gpx><trk>", "damaged GPX"),
        ("<kml></kml>", "KML"),
        ("by me\ntime,lat,lon\n1778749200,53.2,-0.5\n", "no NMEA .* CSV file that begins with time,lat"),
        ("time;lat;lon\n1778749200;53.2;-0.5\n", "columns time, lat, lon, which no commas separate"),
        ("<TrainingCenterDatabase></TrainingCenterDatabase>", "TCX"),
        *(
            (text, "is a table with the columns .* -> give NMEA or GPX, or a CSV file with the columns")
            for text in (
                "time;lat;lon\n2026-05-14T09:00:00Z;53,268;-0,5245\n",
                "time,lat,lon,fix_type\n2026-05-14T09:00:00Z,53.2,-0.5,NONE\n",
                "Timestamp,Longitude,Latitude\n1778749200,-0.5245,53.268\n",
                "%time,field.latitude,field.longitude\n1778749200000000000,53.268,-0.5245\n",
                "lat,lon\n53.2,-0.5\n",
            )
        ),
        *(
            (text, "is a solution of RTKLIB, which is not read -> .*rnx2rtkp -n")
            for text in (
                "% program : rnx2rtkp\n%  GPST  latitude(deg) longitude(deg) height(m) Q ns\n",
                "%  UTC  x-ecef(m) y-ecef(m) z-ecef(m) Q\n",
                "2026/05/14 09:00:18.000   53.268   -0.5245   31.5   1  18  0.0\n",
                "2418 378018.000   53.268   -0.5245   31.5   1  18  0.0\n",
            )
        ),
    ],
)  # fmt: skip
def test_what_cannot_be_read_is_named(tmp_path, text, message):
    with pytest.raises(InputError, match=message):
        read(tmp_path, text)

# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Positions in files of other programs: GPX, tables, solutions of RTKLIB."""

import math

import pytest

from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.sensing import Kind, read_positions

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
    "day before month": "Date,Time,Lat,Long,Ele\n14/05/2026,09:00:00,53.268,-0.5245,31.5\n",
    "month before day": "time,lat,lon,alt\n05/14/2026 09:00:00 AM,53.268,-0.5245,31.5\n",
    "local time, too": "date,time,utc,lat,lon,alt\n2026-05-14,11:00:00,2026-05-14T09:00:00Z,53.268,-0.5245,31.5\n",
    "rostopic": "%time,field.status.status,field.latitude,field.longitude,altitude\n"
    "1778749200000000000,0,53.268,-0.5245,31.5\n",
    "PlotJuggler": "__time,/fix/latitude,/fix/longitude,alt\n1778749200.000,53.268,-0.5245,31.5\n",
    "letters in columns": "time,lat,N/S,lon,E/W,alt\n2026-05-14T09:00:00Z,53.268,N,0.5245,W,31.5\n",
    "letters in fields": "time,lat,lon,alt\n2026-05-14T09:00:00Z,53.268 N,0.5245W,31.5\n",
    "letters in the header": "time,lat (N),lon (W),alt\n2026-05-14T09:00:00Z,53.268,0.5245,31.5\n",
    "degrees and minutes": "time,lat,lon,alt\n"
    "2026-05-14T09:00:00Z,53\N{DEGREE SIGN}16.08'N,0\N{DEGREE SIGN}31.47'W,31.5\n",
}
NO_ZONE = ("day before month", "month before day")


def read(tmp_path, text):
    path = tmp_path / "track"
    path.write_text(text)
    return read_positions(path)


@pytest.mark.parametrize("form", FILES)
def test_a_track_is_known_by_its_content(tmp_path, form):
    (fix,), problems = read(tmp_path, FILES[form])
    assert fix.stamp_s == T0
    place = fix.position
    assert (place.latitude_deg, place.altitude_m) == (pytest.approx(53.268, abs=1e-12), 31.5)
    assert place.longitude_deg == pytest.approx(-0.5245, abs=1e-12)
    rtklib = "RTKLIB" in form
    assert (
        place.horizontal_sd_m == pytest.approx(0.00707, abs=1e-5) if rtklib else math.isnan(place.horizontal_sd_m)
    )
    assert [one.kind for one in problems] == [Kind.ASSUMED_TIME] * (
        form in NO_ZONE or (rtklib and "UTC" not in form)
    )


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
        ("time,lat,lon\n05/06/2026 09:00:00,53.2,-0.5\n",
         "two meanings: 2026-0(5-06 or 2026-06-05|6-05 or 2026-05-06)"),
        ("time,lat,lon,latitude\n2026-05-14T09:00:00Z,53.2,-0.5,54.2\n", "several columns .*: lat, latitude"),
        ("time,lat,lon\n2026-05-14T09:00:00Z,53,268,-0,5245\n", "track:2: has 5 fields, the header names 3"),
        ("time,lat_deg,lat_min,lon\n2026-05-14T09:00:00Z,53,16.0,0\n", "minutes in columns of their own lat_min"),
        ("%  GPST  latitude(d'\") longitude(d'\") height(m) Q\n", "degrees and minutes in columns of their own"),
        ("<gpx><trk><trkpt lat='53' lon='0'/></trk></gpx>", "has 1 points, but not one time"),
        ("time,lat,lon\n,53,0\n", "has 1 points, but not one time"),
        ("time,easting,northing\n1778749200,664000,5904000\n",
         "without columns of latitude.*: time, easting, north"),
        ("time,lat,lon\n2026-10-25 02:59:50,53,0\n2026-10-25 02:00:00,53,0\n",
         "go back from 2026-10-25 02:59:50 to"),
        ("%  GPST  x-ecef(m) y-ecef(m) z-ecef(m) Q\n", "from the centre of the earth"),
        ("<TrainingCenterDatabase></TrainingCenterDatabase>", "TCX"),
        ("time,lat,lon\n2026-05-14T09:00:00Z,5316.08,-0.5\n", r"2: '5316.08' is no latitude in.* is 53.26800"),
        ("2026/05/14 09:00:18.000   53.268   -0.5245   31.5   1  18  0.0\n", "RTKLIB without its header"),
        ("2418 378018.000   53.268   -0.5245   31.5   1  18  0.0\n", "RTKLIB without its header"),
        ("lat,lon\n53.2,-0.5\n", "no column of times"),
        ("<gpx></gpx>", "without points"),
        ("<gpx><trk>", "damaged GPX"),
        ("<kml></kml>", "KML"),
        ("a,b\n1,2\n", "no NMEA sentence"),
    ],
)  # fmt: skip
def test_what_cannot_be_read_is_named(tmp_path, text, message):
    with pytest.raises(InputError, match=message):
        read(tmp_path, text)


def test_letters_of_hemispheres_are_told_from_directions_of_travel(tmp_path):
    for name, longitudes in (("E/W", [0.0001, -0.0001]), ("heading", [0.0001, 0.0001])):
        fixes, _ = read(tmp_path, f"time,lat,lon,{name}\n1778749200,53,0.0001,E\n1778749201,53,0.0001,W\n")
        assert [fix.position.longitude_deg for fix in fixes] == pytest.approx(longitudes)


@pytest.mark.parametrize(
    ("column", "value", "said"),
    [
        ("fix_type", "NONE", "'NONE'"),
        ("fix", "0", "'0'"),
        ("status", "-1", "'-1'"),
        ("valid", "V", "'V'"),
        ("Q", "", ""),
    ],
)
def test_rows_without_a_fix_are_no_positions(tmp_path, column, value, said):
    fixes, _ = read(tmp_path, f"time,lat,lon,{column}\n1778749200,53.2,-0.5,{value}\n1778749201,53.2,-0.5,3D\n")
    assert [fix.said for fix in fixes] == [said, ""]


def test_the_quality_of_rtklib_is_read(tmp_path):
    header = "%  UTC  latitude(deg) longitude(deg) height(m) Q\n"
    rows = [f"2026/05/14 09:00:0{q}.000   53.268   -0.5245   31.5   {q}\n" for q in range(8)]
    fixes, _ = read(tmp_path, header + "".join(rows))
    assert [fix.said for fix in fixes] == ["quality 0", *[""] * 6, "quality 7"]
    assert [fix.quality for fix in fixes] == [0, 4, 5, 9, 2, 1, 2, 0]

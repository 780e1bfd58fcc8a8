# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The table of cutoff rigidities, and neutron monitors."""

from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.sensing import Corrections, NeutronMonitor
from soilmoist_ros.sensing.corrections.intensity import (
    MONITORS,
    CosmicPlace,
    cosmic_place,
    cutoff_rigidity_gv,
    intensity_scale,
    read_neutron_monitor,
)

JUNGFRAUJOCH = CosmicPlace(4.49, 665.18)

# latitude, altitude, cutoff rigidity, then what crnpy returns for rates of 140 and 160 and a reference of 150:
# the divisor of Hawdon et al. and the factor of McJannet and Desilets.
REFERENCE = [
    (38.2346, 455.0, 3.1, (0.9263833333333333, 1.0736166666666667), (1.0756278551796299, 0.9343083778007669)),
    (51.35, 66.0, 2.93, (0.9255333333333333, 1.0744666666666667), (1.0741759111501186, 0.9354066326106066)),
    (-35.0, 600.0, 4.8, (0.9348833333333333, 1.0651166666666667), (1.0607293542695078, 0.9458478909592463)),
    (65.0, 15.0, 0.8, (0.9148833333333334, 1.0851166666666667), (1.0826603801900083, 0.9290664141578904)),
]


@pytest.mark.parametrize(("latitude", "altitude", "rigidity", "hawdon", "mcjannet"), REFERENCE)
def test_the_scaled_factors_agree_with_crnpy(latitude, altitude, rigidity, hawdon, mcjannet) -> None:
    site = cosmic_place(latitude, 0.0, altitude, rigidity)
    for scaling, answers in (("hawdon2014", [1 / divisor for divisor in hawdon]), ("mcjannet2023", mcjannet)):
        scale = intensity_scale(scaling, site, JUNGFRAUJOCH)
        corrections = Corrections(reference_intensity=150.0, intensity_scale=scale)
        assert [corrections.f_intensity(rate) for rate in (140.0, 160.0)] == pytest.approx(answers, rel=1e-12)


# Cutoff rigidity -------------------------------------------------------------------------------------------------


# Values of the database NMDB, mostly of the years 1965 to 2000.
@pytest.mark.parametrize(
    ("code", "published_gv", "tolerance_gv"),
    [("OULU", 0.81, 0.2), ("KIEL", 2.36, 0.2), ("LMKS", 3.84, 0.2), ("JUNG", 4.49, 0.4), ("ROME", 6.27, 0.4),
     ("ATHN", 8.53, 0.4), ("PSNM", 16.8, 0.3), ("NEWK", 2.40, 0.6), ("HRMS", 4.58, 0.4), ("KERG", 1.14, 0.2),
     ("TSMB", 9.15, 0.4), ("PTFM", 6.98, 0.3), ("TERA", 0.01, 0.1), ("THUL", 0.3, 0.3)],
)  # fmt: skip
def test_the_table_gives_the_cutoff_rigidity_of_the_monitors(code, published_gv, tolerance_gv) -> None:
    _, latitude, longitude, _ = MONITORS[code]
    assert cutoff_rigidity_gv(latitude, longitude) == pytest.approx(published_gv, abs=tolerance_gv)


def test_the_table_is_continuous_around_the_world() -> None:
    assert cutoff_rigidity_gv(40.0, 179.999) == pytest.approx(cutoff_rigidity_gv(40.0, -179.999), abs=0.01)
    assert cutoff_rigidity_gv(40.0, 284.25) == cutoff_rigidity_gv(40.0, -75.75)
    assert cutoff_rigidity_gv(90.0, 12.0) == cutoff_rigidity_gv(90.0, -170.0) == 0.0
    assert cutoff_rigidity_gv(-90.0, 0.0) < 0.2
    with pytest.raises(ValueError, match="latitude"):
        cutoff_rigidity_gv(91.0, 0.0)


# Neutron monitor -------------------------------------------------------------------------------------------------

NOON = datetime(2018, 5, 1, 12, tzinfo=UTC).timestamp()
HOUR = 3600.0

# Layout of the database's export; the rates are made up.
HEAD = """\
#_____________ QUERY RESULTS SUMMARY ___________________________________
#        STATION: JUNG
#     START TIME: 2018-05-01 12:00:00 UTC
#       END TIME: 2018-05-02 11:00:00 UTC
#     NMDB TABLE: revised original
#      DATA TYPE: corr_for_efficiency(RCORR_E)
#      AVERAGING: Yes / 1 hour
#   ORIGINAL RES: 1 min
#_______________________________________________________________________
#
# Timestamps always correspond to the beginning of the time interval
#
  start_date_time   RCORR_E
"""
ROWS = """\
2018-05-01 12:00:00;150.000
2018-05-01 13:00:00;   null
2018-05-01 14:00:00;160.000
"""


def write(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "monitor.txt"
    path.write_text(text)
    return path


def test_an_export_has_intervals_that_begin_at_their_time(tmp_path) -> None:
    monitor = read_neutron_monitor(write(tmp_path, HEAD + ROWS))
    assert monitor.interval_s == HOUR
    assert monitor.at(NOON) == monitor.at(NOON + HOUR / 2) == 150.0
    assert monitor.at(NOON + 1.5 * HOUR) == pytest.approx(155.0)
    assert monitor.at(NOON + 3 * HOUR) == 160.0
    assert monitor.at(NOON - 1) is None
    assert monitor.at(NOON + 3 * HOUR + 1) is None


def test_without_averaging_the_resolution_is_the_original_one(tmp_path) -> None:
    head = HEAD.replace("Yes / 1 hour", "No").replace("RCORR_E\n", "1HCOR_E\n")
    monitor = read_neutron_monitor(write(tmp_path, head + ROWS))
    assert monitor.interval_s == 60.0
    assert monitor.stamp_s[0] == NOON + 30


def test_a_plain_table_of_time_and_rate(tmp_path) -> None:
    text = "#comment\nstart_date_time;RCORR_E\n2018-05-01 12:00:00;150.0\n2018-05-01 13:00:00;null\n"
    monitor = read_neutron_monitor(write(tmp_path, text + "2018-05-01T16:00:00+02:00;160.0\n"))
    assert (list(monitor.stamp_s), list(monitor.rate)) == ([NOON, NOON + 2 * HOUR], [150.0, 160.0])
    assert list(read_neutron_monitor(write(tmp_path, "time,rate\n2018-05-01,150\n")).rate) == [150.0]
    with pytest.raises(InputError, match="is of the station JUNG, not of OULU"):
        read_neutron_monitor(write(tmp_path, HEAD + ROWS), "OULU")
    with pytest.raises(InputError, match="is of the station JUNG, not of OULU"):
        read_neutron_monitor(write(tmp_path, '"time","JUNG"\n2018-05-01,150\n'), "OULU")


def test_gaps_are_bridged_up_to_their_limit() -> None:
    stamps, rates = np.array([NOON, NOON + 7 * HOUR]), np.array([150.0, 164.0])
    assert NeutronMonitor(stamps, rates).at(NOON + HOUR) is None
    assert NeutronMonitor(stamps, rates, max_gap_s=7 * HOUR).at(NOON + HOUR) == pytest.approx(152.0)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (HEAD.replace("corr_for_efficiency(RCORR_E)", "uncorrected(RUNCORR)") + ROWS, "the data type uncorrected"),
        ("<html>Sorry, no data available for JUNG</html>", "no data"),
        ("time,rate\n", "has no row of time and rate"),
        ("Date,Time,JUNG\n29/10/2021,23:00,151.15\n", "2: the time '29/10/2021' cannot be read"),
        (
            "2018-05-01 12:00;150\n2018-05-01 13:00;-999\n",
            "'-999' is not .* -> if it marks a gap, leave the rate empty",
        ),
        ("2018-05-01 12:00;150\n2018-05-01 13:00;0\n", "'0' is not .* -> if it marks a gap, leave the rate empty"),
        (
            "".join(f"5/{day}/2018 12:00;150\n" for day in range(1, 10)),
            "1: the time '5/1/2018 12:00' cannot be read",
        ),
        ("0001-01-01 12:00:00;150\n", "1: the time '0001-01-01 12:00:00' cannot be read"),
        ("2018-05-01 12:00;150,25\n", "1: the row has 3 fields, not time and rate: .* export one station"),
        (HEAD + ROWS + HEAD.replace("JUNG", "OULU") + ROWS, "has the stations JUNG and OULU"),
        ("start_date_time   RUNCORR\n2018-05-01 12:00:00;130.0\n", "the data type RUNCORR -> export the rates"),
        ("time,UNCORR\n2018-05-01 12:00,130\n", "the data type UNCORR -> export the rates"),
        (HEAD.replace("RCORR_E\n", "JUNG  OULU\n") + "2018-05-01 12:00:00;150.0;100.0\n", "has 3 fields"),
        (HEAD + "2018-05-01 12:00:00; -1.007\n", "-1.007' is not a positive number"),
    ],
)
def test_files_that_cannot_serve_say_why(tmp_path, text, message) -> None:
    with pytest.raises(InputError, match=message):
        read_neutron_monitor(write(tmp_path, text))

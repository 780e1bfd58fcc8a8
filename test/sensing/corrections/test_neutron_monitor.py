# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.sensing import LoggerRecord, Site
from soilmoist_ros.sensing.corrections.intensity import NeutronMonitor, read_neutron_monitor
from soilmoist_ros.sensing.survey.correction import UnusableRecordError, correct_record

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


def test_the_page_of_the_database_is_read_like_its_export(tmp_path) -> None:
    page = f"<html><body><pre><code>{HEAD}{ROWS}</code></pre><br>Total records</body></html>\n"
    exported = read_neutron_monitor(write(tmp_path, HEAD + ROWS))
    saved = read_neutron_monitor(write(tmp_path, page))
    assert np.array_equal(saved.stamp_s, exported.stamp_s)
    assert np.array_equal(saved.rate, exported.rate)


def test_without_averaging_the_resolution_is_the_original_one(tmp_path) -> None:
    head = HEAD.replace("Yes / 1 hour", "No").replace("RCORR_E\n", "1HCOR_E\n")
    monitor = read_neutron_monitor(write(tmp_path, head + ROWS))
    assert monitor.interval_s == 60.0
    assert monitor.stamp_s[0] == NOON + 30


@pytest.mark.parametrize(
    "names",
    [
        "#       STATIONS: JUNG, OULU\n  start_date_time   RCORR_E  RCORR_E\n",
        "  start_date_time   JUNG   OULU\n",
        "start_date_time;JUNG;OULU\n",
    ],
)
def test_one_of_several_stations_is_chosen_by_its_code(tmp_path, names) -> None:
    head = "".join(HEAD.splitlines(keepends=True)[2:-1])
    path = write(tmp_path, head + names + "2018-05-01 12:00:00;150.0;100.0\n2018-05-01 13:00:00;151.0;null\n")
    assert list(read_neutron_monitor(path, "OULU").rate) == [100.0]
    assert list(read_neutron_monitor(path, "jung").rate) == [150.0, 151.0]
    with pytest.raises(InputError, match="has several stations: it has JUNG, OULU -> choose one with 'monitor'"):
        read_neutron_monitor(path)
    with pytest.raises(InputError, match=r"has no station OULI.*did you mean 'OULU'"):
        read_neutron_monitor(path, "OULI")


def test_exports_of_two_stations_one_after_the_other(tmp_path) -> None:
    other = HEAD.replace("JUNG", "OULU") + ROWS.replace("150.000", "100.000")
    path = write(tmp_path, HEAD + ROWS + other)
    assert list(read_neutron_monitor(path, "OULU").rate) == [100.0, 160.0]
    assert list(read_neutron_monitor(path, "JUNG").rate) == [150.0, 160.0]


def test_a_plain_table_of_time_and_rate(tmp_path) -> None:
    text = "#comment\nstart_date_time;RCORR_E\n2018-05-01 12:00:00;150.0\n2018-05-01 13:00:00;null\n"
    monitor = read_neutron_monitor(write(tmp_path, text + "2018-05-01T16:00:00+02:00;160.0\n"))
    assert monitor.at(NOON) == 150.0
    assert monitor.at(NOON + HOUR) == pytest.approx(155.0)
    assert monitor.at(NOON + 2 * HOUR) == 160.0
    assert monitor.at(NOON - 1) is None
    assert monitor.at(NOON + 2 * HOUR + 1) is None
    assert list(read_neutron_monitor(write(tmp_path, "time,rate\n2018-05-01,150\n")).rate) == [150.0]
    more = "time,rate,note\n2018-05-01,150,quiet\n"  # without a head of the database only the first column counts
    assert list(read_neutron_monitor(write(tmp_path, more)).rate) == [150.0]


def test_gaps_are_bridged_up_to_their_limit() -> None:
    stamps, rates = np.array([NOON, NOON + 7 * HOUR]), np.array([150.0, 164.0])
    assert NeutronMonitor(stamps, rates).at(NOON + HOUR) is None
    assert NeutronMonitor(stamps, rates, max_gap_s=7 * HOUR).at(NOON + HOUR) == pytest.approx(152.0)
    held = NeutronMonitor(stamps, rates, gaps="hold", max_gap_s=2 * HOUR)
    assert held.at(NOON + 2 * HOUR) == 150.0
    assert held.at(NOON + 2 * HOUR + 1) is None
    assert held.at(NOON + 9 * HOUR) == 164.0
    assert held.at(NOON - 1) is None


def test_a_record_outside_the_file_says_what_the_file_covers(tmp_path) -> None:
    monitor = read_neutron_monitor(write(tmp_path, HEAD + ROWS))
    site = Site(corrections={"intensity": {"reference": 150, "constant": 150}})
    record = LoggerRecord(NOON + 9 * HOUR, (700.0,), (HOUR,), 980.0, 20.0, 0.5)
    with pytest.raises(UnusableRecordError, match="2018-05-01 12:30 to 2018-05-01 14:30 UTC, has no rate at this"):
        correct_record(record, site, monitor, np.ones(1))


def test_the_longest_gap_within_a_survey() -> None:
    stamps = NOON + HOUR * np.array([0.5, 1.5, 4.5, 5.5, 20.5])
    monitor = NeutronMonitor(stamps, np.full(5, 150.0), interval_s=HOUR)
    assert monitor.longest_gap_s(NOON + HOUR, NOON + 1.4 * HOUR) == 0.0
    assert monitor.longest_gap_s(NOON + HOUR, NOON + 5.2 * HOUR) == 2 * HOUR
    assert monitor.longest_gap_s(NOON + 6 * HOUR, NOON + 7 * HOUR) == 14 * HOUR


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (HEAD.replace("corr_for_efficiency(RCORR_E)", "uncorrected(RUNCORR)") + ROWS, "the data type uncorrected"),
        ("<html>Sorry, no data available for JUNG</html>", "no data"),
        ("time,rate\n", "has no row of time and rate"),
        ("Date,Time,JUNG\n29/10/2021,23:00,151.15\n", "but rows such as '29/10/2021,23:00,151.15'"),
        (
            "2018-05-01 12:00;150\n2018-05-01 13:00;-999\n",
            "'-999' is not .* -> if it marks a gap, leave the rate empty",
        ),
        ("2018-05-01 12:00;150\n2018-05-01 13:00;0\n", "'0' is not .* -> if it marks a gap, leave the rate empty"),
        (
            "".join(f"5/{day}/2018 12:00;150\n" for day in range(1, 10)),
            "3/2018 12:00' cannot be read, and 6 more rows",
        ),
        ("0001-01-01 12:00:00;150\n", "1: the time '0001-01-01 12:00:00' cannot be read"),
        (HEAD + "2018-05-01 12:00:00; -1.007\n", "-1.007' is not a positive number"),
    ],
)
def test_files_that_cannot_serve_say_why(tmp_path, text, message) -> None:
    with pytest.raises(InputError, match=message):
        read_neutron_monitor(write(tmp_path, text))


def test_a_file_of_another_station_is_refused(tmp_path) -> None:
    with pytest.raises(InputError, match="is of the station JUNG, not of KIEL"):
        read_neutron_monitor(write(tmp_path, HEAD + ROWS), "KIEL")


def test_bad_rows_are_named(tmp_path) -> None:
    path = write(tmp_path, "2018-05-01 12:00:00;150\n2018-05-01 13:00:00;-3\n2018-05-01 14:00:00;abc\n")
    with pytest.raises(InputError) as caught:
        read_neutron_monitor(path)
    assert [mistake.line for mistake in caught.value.mistakes] == [2, 3]
    with pytest.raises(InputError, match="cannot be read"):
        read_neutron_monitor(tmp_path / "missing.csv")
    with pytest.raises(InputError, match="not a regular file"):
        read_neutron_monitor(Path("/dev/null"))


@pytest.mark.parametrize(
    "rows",
    [
        "2018-05-01 12:00:00;150,25\n2018-05-01 13:00:00;151,5\n",
        "2018-05-01 12:00\t150.25\n2018-05-01 13:00\t151.5\n",
        "2018-05-01 12:00   150.25\n2018-05-01 13:00   151.5\n",
        "2018/05/01 12:00,150.25\n2018/05/01 13:00,151.5\n",
        "01.05.2018 12:00;150,25\n1.5.2018 13:00;151,5\n",
        "time;rate\n2018-05-01T12:00:00Z;150,25\n2018-05-01T13:00:00Z;151,5\n",
    ],
)
@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16"])
def test_notations_of_tables_mean_the_same(tmp_path, rows, encoding) -> None:
    path = tmp_path / "monitor.txt"
    path.write_bytes(rows.encode(encoding))
    assert list(read_neutron_monitor(path).rate) == [150.25, 151.5]


def test_one_of_several_columns_of_rates_is_not_chosen_in_silence(tmp_path) -> None:
    table = "time,raw,corrected\n2018-05-01 12:00,140.0,150.0\n"
    with pytest.raises(InputError, match="has several columns of rates: it has raw, corrected"):
        read_neutron_monitor(write(tmp_path, table))
    monitor = read_neutron_monitor(write(tmp_path, table), "corrected")
    assert (list(monitor.rate), monitor.station, monitor.not_used) == ([150.0], "corrected", ("raw",))


def test_the_corrected_type_of_an_export_of_several_types_is_read(tmp_path) -> None:
    head = HEAD.replace("RCORR_E\n", "RUNCORR  RPRESS  RCORR_E\n")
    monitor = read_neutron_monitor(write(tmp_path, head + "2018-05-01 12:00:00;130.0;980.0;150.0\n"))
    assert (list(monitor.rate), monitor.station, monitor.not_used) == ([150.0], "JUNG", ("RUNCORR", "RPRESS"))
    with pytest.raises(InputError, match="has the data types RUNCORR, RPRESS -> export the rates"):
        read_neutron_monitor(
            write(tmp_path, head.replace("RCORR_E\n", "\n") + "2018-05-01 12:00:00;130.0;980.0\n")
        )


def test_a_time_that_cannot_be_read_is_not_a_missing_row(tmp_path) -> None:
    with pytest.raises(InputError, match=r":15: the time '5/1/2018 13:00' cannot be read -> write times as"):
        read_neutron_monitor(write(tmp_path, HEAD + "2018-05-01 12:00:00;150.0\n5/1/2018 13:00;151.0\n"))

# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest
from crnpy import crnpy

from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.sensing import (
    Fix,
    FixStatus,
    Kind,
    Site,
    Track,
    format_header,
    format_record,
    load_logger_format,
    read_log,
)
from soilmoist_ros.sensing.records import LoggerRecord, Position
from soilmoist_ros.sensing.survey.logs import calibration_counts, log_doubts, process_logs

T0 = datetime(2024, 5, 1, tzinfo=UTC).timestamp()
NO_CORRECTIONS = Site(corrections={"pressure": None, "humidity": None})


def record(elapsed_s, counts=5.0, **values):
    weather = {"pressure_hpa": 1000.0, "temperature_degc": 20.0, "relative_humidity": 0.5}
    number = int(elapsed_s / 10) + 1
    return LoggerRecord(
        T0 + elapsed_s, (counts,) * 12, (10.0,) * 12, **{**weather, "record_number": number, **values}
    )


def write_log(path: Path, records):
    path.write_text("\n".join([format_header("a"), *map(format_record, records)]) + "\n")
    return read_log(path, "thorvald_crs")


def track(*corners):
    """Fixes every 5 s between corners (elapsed time, latitude)."""
    elapsed = np.arange(corners[0][0], corners[-1][0] + 1, 5.0)
    points = zip(elapsed.tolist(), np.interp(elapsed, *zip(*corners, strict=True)).tolist(), strict=True)
    return Track(Fix(T0 + stamp, Position(latitude, 10.0), FixStatus.FIX) for stamp, latitude in points)


@pytest.mark.slow
def test_real_roving_record_agrees_with_crnpy(roving_record):
    log = read_log(roving_record, "hydroinnova_rover", "west")
    site = Site(
        longitude="west",
        corrections={"pressure": {"beta_per_hpa": 1 / 130, "reference_hpa": 976.0}, "humidity": {}},
    )
    survey = process_logs([log], site)
    placed = [r for r in log.records if r.position is not None]
    assert len(survey.records) == len(placed) == 200
    for ours, raw in zip(survey.records, placed, strict=True):
        counts = sum(raw.tube_counts)
        humidity = crnpy.abs_humidity(100 * raw.relative_humidity, raw.temperature_degc)
        expected = counts / crnpy.correction_pressure(raw.pressure_hpa, 976.0, 130.0)
        expected *= crnpy.correction_humidity(humidity, 0.0)
        assert ours.corrected_rate * ours.exposure_s == pytest.approx(expected, rel=1e-3)
        assert ours.raw_counts == counts
    latitude, longitude = survey.frame.to_geographic(survey.xy_m).mean(axis=0)
    assert (latitude, longitude) == (pytest.approx(38.72, abs=0.05), pytest.approx(-97.41, abs=0.05))


def test_moving_records_are_placed_at_the_middle_of_their_interval(tmp_path):
    log = write_log(tmp_path / "a.log", [record(10.0 * k) for k in range(1, 6)])
    north = process_logs([log], NO_CORRECTIONS, track=track((0, 50.0), (50, 50.005))).xy_m[:, 1]
    np.testing.assert_allclose(np.diff(north), 111.2, atol=0.3)  # 0.001 deg of latitude
    own = [record(10.0 * k, position=Position(50 + 1e-4 * k, 10.0)) for k in range(1, 6)]
    placed = process_logs([replace_records(log, own)], NO_CORRECTIONS)
    assert placed.frame.to_geographic(placed.xy_m)[2:, 0] == pytest.approx(
        [50.00025, 50.00035, 50.00045], abs=1e-8
    )


def test_a_separate_track_is_joined_by_gnss_time_where_the_loggers_clock_is_off(tmp_path):
    log = write_log(tmp_path / "a.log", [record(200.0 + 10.0 * k) for k in range(1, 6)])
    moving = track((0, 50.0), (60, 50.006))
    with pytest.raises(InputError, match="they do not overlap"):
        process_logs([log], NO_CORRECTIONS, track=moving)
    late = process_logs([with_clock(log, [200.0] * 5)], NO_CORRECTIONS, track=moving)
    expected = 50.0005 + 0.001 * np.arange(5)
    assert late.frame.to_geographic(late.xy_m)[:, 0] == pytest.approx(expected, abs=1e-8)


@pytest.mark.parametrize("separate", [True, False])
def test_a_log_whose_clock_was_set_is_placed_by_the_offset_of_each_part(separate, tmp_path):
    ahead_s = [105.0] * 20 + [0.0] * 15  # the times of the first part come again
    log = write_log(
        tmp_path / "a.log",
        [record(10.0 * k + ahead, 5.0 + k % 2, record_number=k) for k, ahead in enumerate(ahead_s, 1)],
    )
    log = with_clock(log, ahead_s)
    if not separate:
        places = [Position(50.0 + 1e-3 * k, 10.0) for k in range(1, 36)]
        pairs = zip(log.records, places, strict=True)
        log = replace_records(log, [replace(one, position=place) for one, place in pairs])
    moving = track((0, 50.0), (400, 50.04)) if separate else None
    survey = process_logs([log], NO_CORRECTIONS, track=moving)
    north_deg = {one.stamp_s - T0: survey.frame.to_geographic((one.x_m, one.y_m))[0, 0] for one in survey.records}
    expected = {10.0 * k: 50.0 + 1e-4 * (10.0 * k - 5.0) for k in range(1, 36)}
    first = expected.pop(10.0), north_deg.pop(10.0)
    assert north_deg == pytest.approx(expected, abs=1e-6)
    assert first[1] == pytest.approx(first[0], abs=1e-6 if separate else 6e-4)  # no place before its middle


def with_clock(log, ahead_s):
    pairs = zip(log.records, ahead_s, strict=True)
    return replace_records(log, [replace(one, clock_ahead_s=ahead) for one, ahead in pairs])


def replace_records(log, records):
    return replace(log, records=tuple(records))


def test_a_stationary_probe_has_the_position_of_the_site_file(tmp_path):
    log = write_log(tmp_path / "a.log", [record(10.0), record(20.0)])
    site = Site(location={"latitude_deg": 50.0, "longitude_deg": 10.0}, corrections=NO_CORRECTIONS.corrections)
    survey = process_logs([log], site)
    np.testing.assert_allclose(survey.frame.to_geographic(survey.xy_m), [[50, 10], [50, 10]], atol=1e-9)


def test_two_files_of_one_probe_join_in_order_of_time_and_without_repeats(tmp_path):
    first = write_log(tmp_path / "a.log", [record(10.0), record(20.0)])
    second = write_log(tmp_path / "b.log", [record(20.0), record(30.0)])
    survey = process_logs([second, first], NO_CORRECTIONS, track=track((0, 50.0), (30, 50.0)))
    assert [r.stamp_s - T0 for r in survey.records] == [10.0, 20.0, 30.0]
    assert [problem.kind for problem in survey.problems] == [Kind.DUPLICATE]


def test_only_records_between_two_times_count_for_a_calibration(tmp_path):
    log = write_log(tmp_path / "a.log", [record(10.0 * n, 4.0 + n % 3) for n in range(1, 11)])
    start_s = log.records[0].stamp_s
    assert calibration_counts([log], NO_CORRECTIONS, start_s, start_s + 30.0).records == 3
    with pytest.raises(InputError, match="no record between these times"):
        calibration_counts([log], NO_CORRECTIONS, start_s + 1e6)


# Log doubts ------------------------------------------------------------------------------------------------------

FINAPP = "Datetime,neutrons,integration_time(s),pressure(hPa)\n"
CRS1000 = "//RecordNum,Date Time(UTC),P4_mb,T1_C,RH1,N1Cts,N2Cts,N1ET_sec,N2ET_sec\n"


def doubts(tmp_path, text, **options):
    path = tmp_path / "some.csv"
    path.write_text(text)
    return [(one.kind, str(one)) for one in log_doubts([read_log(path, **options)])]


def test_a_log_that_was_read_with_another_clock_than_the_site_s_is_refused(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text(
        FINAPP + "".join(f"2024-05-01 {hour:02d}:00:00,17{hour},3600,1000\n" for hour in range(10, 20))
    )
    here = {"corrections": NO_CORRECTIONS.corrections, "location": {"latitude_deg": 50.0, "longitude_deg": 10.0}}
    site, of_utc = Site(logger_utc_offset_hours=-6, **here), read_log(path)
    with pytest.raises(InputError, match=r"clock of UTC\+0 h, and the site has UTC-6 h -> read_log"):
        process_logs([of_utc], site)
    late, early = process_logs([read_log(path, utc_offset_hours=-6)], site), process_logs([of_utc], Site(**here))
    assert late.records[0].stamp_s - early.records[0].stamp_s == 21600


def night(hours):
    return FINAPP + "".join(f"2023-10-{stamp}:00:00,17{n:02d},3600,1000\n" for n, stamp in enumerate(hours))


def test_more_hours_of_counts_than_of_time(tmp_path):
    hours = [f"28 {hour:02d}" for hour in range(14, 24)] + [f"29 {hour:02d}" for hour in (0, 1, 2, 2, 3, 4, 5)]
    (found,) = doubts(tmp_path, night(hours), utc_offset_hours=2.0)
    assert found[0] is Kind.OVERLAP
    assert "17 h were counted in the 16 h from 2023-10-28 12:00 UTC to 2023-10-29 03:00 UTC" in found[1]
    assert "logger_time_zone: Europe/Berlin" in found[1]
    assert doubts(tmp_path, night(hours), utc_offset_hours="Europe/Berlin") == []


def test_live_times_in_another_unit(tmp_path):
    text = FINAPP + "".join(f"2023-10-28 {hour:02d}:00:00,1700,60,1000\n" for hour in range(9))
    (found,) = doubts(tmp_path, text)
    assert "records count 60 s, 1/60 of the time between them: the live time may be in minutes" in found[1]
    text = FINAPP + "".join(f"2023-10-28 {hour:02d}:00:00,1700,36000,1000\n" for hour in range(9))
    (found,) = doubts(tmp_path, text)
    assert "check live_time and record_period of the logger format" in found[1]


@pytest.mark.parametrize(("second", "n_doubts"), [(178, 1), (77, 0)])
def test_the_tube_that_is_left_out_counts_more(tmp_path, second, n_doubts):
    rows = "".join(f"{n}, 2018/01/08 {n:02d}:03:00, 1000, 9, 80, 91, {second}, 900, 900\n" for n in range(8))
    found = doubts(tmp_path, CRS1000 + rows)
    assert len(found) == n_doubts
    assert all("tube 2, which the format leaves out, counts 1.96 times what tube 1" in one for _, one in found)


@pytest.mark.parametrize(
    ("name", "factor", "why"),
    [("neutrons", 60, "all are multiples of 60"), ("neutrons/h", 1, "so the header says"), ("neutrons", 1, "")],
)
def test_counts_that_are_a_rate(tmp_path, name, factor, why):
    form = load_logger_format("finapp")
    counts = form.counts.model_copy(update={"columns": [name]})
    rows = "".join(f"2024-05-01 00:{n:02d}:00,{factor * (230 + n * n % 31)},60,1000\n" for n in range(25))
    text = FINAPP.replace("neutrons", name) + rows
    found = doubts(tmp_path, text, logger=form.model_copy(update={"counts": counts}))
    assert [kind for kind, _ in found] == [Kind.NOT_COUNTS] * bool(why)
    assert all(why in text and "write 'unit: counts_per_hour' below 'counts'" in text for _, text in found)


def test_a_log_without_any_position_says_so(tmp_path):
    log = write_log(tmp_path / "a.log", [record(10.0), record(20.0)])
    with pytest.raises(InputError) as caught:
        process_logs([log], NO_CORRECTIONS)
    text = str(caught.value)
    assert "not one of 2 records can be placed" in text
    assert "--nmea" in text
    assert "a.log" in text

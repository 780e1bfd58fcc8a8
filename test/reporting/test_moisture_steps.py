# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A stationary probe end to end: the public record of a station in Kansas, and its moisture over time."""

import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from soilmoist_ros.cli.map import _print_summary as print_summary
from soilmoist_ros.foundation.configuration import resource
from soilmoist_ros.pipeline import MapRun, MapSettings, NoteCode, map_logs
from soilmoist_ros.reporting import at_one_place, notes, write_outputs
from soilmoist_ros.reporting.moisture_steps import moisture_of_all, moisture_series
from soilmoist_ros.sensing import CountRecord, Irrigation, Site, process_logs, read_log

STATION = Path(__file__).parents[2] / "examples" / "station_kansas_2021-10.dat"
HOUR = 3600.0


@pytest.fixture(scope="module")
def run() -> MapRun:
    return map_logs([STATION], MapSettings(site=resource("sites", "station_kansas")))


@pytest.mark.slow
def test_the_corrections_agree_with_crnpy() -> None:
    # crnpy was run on the eight records of 22 October until 16:00 (local time), with P0 976 hPa and L 130.
    pressure = {"beta_per_hpa": 1 / 130, "reference_hpa": 976.0}
    site = Site(corrections={"pressure": pressure}, logger_utc_offset_hours=-6)
    log = read_log(STATION, utc_offset_hours=site.logger_utc_offset_hours)
    records = [r for r in process_logs([log], site).records if 0 < r.stamp_s - 1634911200 <= 8 * HOUR]
    assert np.mean([1 / record.f_pressure for record in records]) == pytest.approx(1.111694993011282, rel=1e-12)
    assert np.mean([record.f_humidity for record in records]) == pytest.approx(1.0455073869559603, rel=2e-3)
    assert np.mean([r.corrected_rate for r in records]) == pytest.approx(0.42961513959596065, rel=2e-3)


@pytest.mark.slow
def test_one_place_gives_a_series_and_says_so(run, capsys) -> None:
    assert at_one_place(run)
    assert run.title == "Soil moisture over time"
    assert len(run.track) == 263
    assert not run.quarantined
    # Tube 2 twice has half as many counts again as tube 1 expects.
    assert [note.code for note in notes(run)] == [NoteCode.BAD_TUBES, NoteCode.OVERDISPERSED, NoteCode.ONE_PLACE]
    mean = moisture_of_all(run.track, run.soil_map.curve)
    assert mean.vwc_p05 < mean.vwc < mean.vwc_p95
    print_summary(run)
    assert f"mean {mean.rate:.4f} +- {mean.rate_sd:.4f} counts/s" in capsys.readouterr().out  # not that of a cell
    series = moisture_series(run.track, run.soil_map.curve)
    assert series.step_s == 6 * HOUR
    assert series.counts.sum() == sum(record.raw_counts for record in run.track)
    # The cores of 22 October, and 50 mm of rain from the evening of the 26th on.
    day = (series.begin_s >= 1634882400) & (series.begin_s < 1634968800)
    assert series.bands.vwc[day].mean() == pytest.approx(0.292, abs=0.01)
    rain = series.begin_s >= 1635314400
    assert series.bands.vwc[rain].min() > series.bands.vwc[~rain].max()


@pytest.mark.slow
def test_the_folder_has_the_series(run, tmp_path) -> None:
    written = write_outputs(tmp_path, run)
    assert tmp_path / "moisture.csv" in written
    assert "moisture.csv" in json.loads((tmp_path / "summary.json").read_text())["outputs"]
    with (tmp_path / "moisture.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    assert rows[0]["begin_utc"] == "2021-10-18T06:00:00Z"
    assert sum(int(row["records"]) for row in rows) == 263
    assert all(float(row["vwc_p05"]) <= float(row["vwc"]) <= float(row["vwc_p95"]) for row in rows)
    page = (tmp_path / "report.html").read_text()
    assert "Soil moisture over time" in page
    assert "the moisture is known to ±" in page.replace("\u00a0", " ").lower()
    assert "The map</h2>" not in page
    assert "measure at more places" not in page


def test_a_reference_far_from_the_pressure_of_the_place_is_noted(run) -> None:
    row = replace(run.corrections[0], parameters={"beta [1/hPa]": 0.0077, "P0 [hPa]": 1013.25}, mean_factor=0.69)
    far = replace(run, corrections=[row])
    (note,) = [note for note in notes(far) if note.code is NoteCode.FAR_REFERENCE_PRESSURE]
    assert "48 hPa below the reference of 1013 hPa" in note.message
    for hpa, noted in ((1013.25, False), (960.0, True)):  # that which N0 was found with
        known = replace(far, calibration=replace(run.calibration, method="combined", reference_hpa=hpa))
        assert (NoteCode.FAR_REFERENCE_PRESSURE in [note.code for note in notes(known)]) == noted
    shallow = notes(replace(run, irrigation=Irrigation(root_depth_mm=60)))
    assert any(note.code is NoteCode.SHALLOW_ROOTS and "600 if it is in cm" in note.message for note in shallow)


def record(end_s: float, counts: int, exposure_s: float = 900.0) -> CountRecord:
    return CountRecord(end_s, 0.0, 0.0, 0.0, counts, exposure_s, exposure_s)


def test_steps_begin_at_whole_hours_and_take_the_records_that_end_in_them() -> None:
    track = [record(1000 * HOUR + 900 * number, 2600) for number in range(9)]
    series = moisture_series(track, None)
    assert series.step_s == HOUR
    assert list(series.begin_s / HOUR) == [999, 1000, 1001]
    assert list(series.records) == [1, 4, 4]
    assert np.isnan(series.bands.vwc).all()
    assert series.bands.rate == pytest.approx(2600 / 900)
    assert series.bands.rate_sd[1] == pytest.approx(np.sqrt(4 * 2600) / HOUR)

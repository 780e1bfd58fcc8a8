# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import math
import shutil
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest
from earlier_folders import FRAME, JUNE_S, MAY_S, records, run_folder

from soilmoist_ros.foundation import InputError, LocalFrame
from soilmoist_ros.mapping import EarlierSurvey, FieldGrid, FieldMapSettings, Samples
from soilmoist_ros.pipeline.earlier_runs import (
    EarlierTarget,
    earlier_doubts,
    find_runs,
    read_earlier_runs,
    read_run,
    require_other,
)
from soilmoist_ros.pipeline.run import EarlierRun
from soilmoist_ros.recording.stored_records import read_records, write_records
from soilmoist_ros.sensing.moisture.curve import CalibrationCurve, UniversalCurve

GRID = FieldGrid.from_polygon([(0, 0), (60, 0), (60, 50), (0, 50)], cell_m=5.0)
TARGET = EarlierTarget(FRAME, GRID, FieldMapSettings(margin_m=5.0))


def test_counts_and_exposures_are_kept_in_order_of_time(tmp_path):
    june = run_folder(tmp_path / "june", records(2, JUNE_S))
    may = run_folder(tmp_path / "may", records(1, MAY_S))
    runs = read_earlier_runs([june, may], TARGET)
    assert [run.survey.name for run in runs] == ["may", "june"]
    assert [run.date for run in runs] == ["2026-05-02", "2026-06-02"]
    assert runs[0].survey.stamp_s == MAY_S
    for run, its in zip(runs, (records(1, MAY_S), records(2, JUNE_S)), strict=True):
        assert run.survey.samples.counts.sum() == sum(one.raw_counts for one in its)
        assert run.survey.samples.exposure_s.sum() == pytest.approx(285.0)
        assert not run.remarks


def test_a_folder_of_runs_and_a_table_of_records_are_runs(tmp_path):
    for name, seed in (("a", 1), ("b", 2)):
        run_folder(tmp_path / name, records(seed, MAY_S + seed))
    assert len(read_earlier_runs([tmp_path], TARGET)) == 2
    assert find_runs(tmp_path / "a" / "records.csv") == [tmp_path / "a"]


def test_another_datum_is_the_same_earth(tmp_path):
    frame = LocalFrame(53.2685, -0.5235)
    its = records(1, MAY_S)
    xy = np.array([(one.x_m, one.y_m) for one in its])
    there = frame.to_local(*FRAME.to_geographic(xy).T)
    moved = [replace(one, x_m=x, y_m=y) for one, (x, y) in zip(its, there.tolist(), strict=True)]
    run_folder(tmp_path / "here", its)
    run_folder(tmp_path / "there", moved, frame)
    (here,) = read_earlier_runs([tmp_path / "here"], TARGET)
    (other,) = read_earlier_runs([tmp_path / "there"], TARGET)
    np.testing.assert_allclose(other.survey.samples.xy, here.survey.samples.xy, atol=1e-4)


def test_records_outside_and_quarantined_ones_are_left_out(tmp_path):
    its = records(1, MAY_S)
    its[0] = replace(its[0], x_m=500.0)
    its[1] = replace(its[1], quarantine="unexpected")
    (run,) = read_earlier_runs([run_folder(tmp_path / "run", its)], TARGET)
    assert len(run.records) == 28
    assert run.outside == 1
    assert "1 of 29 records lie outside" in run.remarks[0]


def test_exposures_are_scaled_by_the_sensitivity_of_calibrated_sensors(tmp_path):
    path = run_folder(tmp_path / "run", records(1, MAY_S), calibration=CalibrationCurve(2.0, 1.4).parameters)
    curve = CalibrationCurve(8.0, 1.4)
    (plain,) = read_earlier_runs([path], TARGET)
    (scaled,) = read_earlier_runs([path], replace(TARGET, settings=replace(TARGET.settings, curve=curve)))
    assert scaled.scale == 0.25
    np.testing.assert_allclose(scaled.survey.samples.exposure_s, 0.25 * plain.survey.samples.exposure_s)
    np.testing.assert_allclose(scaled.survey.samples.rate_cps, 4 * plain.survey.samples.rate_cps)
    assert "By the calibrations, its sensor counts 0.25 times as much over equal soil" in scaled.remarks[0]


@pytest.mark.parametrize(
    "now", [UniversalCurve(1.0, 1.4, humidity_gm3=8.0), CalibrationCurve(1.0, 1.4, lattice_water=0.05)]
)
def test_a_sensor_with_a_new_calibration_is_the_same_sensor(tmp_path, now):
    its = records(1, MAY_S)
    rate_cps = sum(one.raw_counts for one in its) / sum(one.effective_exposure_s for one in its)
    before = CalibrationCurve(6.0, 1.4)
    now = replace(
        now, n0_cps=rate_cps / float(now.rate_cps(before.vwc(rate_cps)))
    )  # moisture as by the former one
    assert abs(now.n0_cps / before.n0_cps - 1) > 0.05
    path = run_folder(tmp_path / "run", its, calibration=before.parameters)
    (run,) = read_earlier_runs([path], replace(TARGET, settings=replace(TARGET.settings, curve=now)))
    assert run.scale == 1.0
    assert not run.remarks


def test_runs_of_one_name_get_the_folder_above(tmp_path):
    paths = [
        run_folder(tmp_path / month / "map", records(n, MAY_S + n)) for n, month in enumerate(("may", "june"))
    ]
    assert {run.survey.name for run in read_earlier_runs(paths, TARGET)} == {"may/map", "june/map"}


def test_every_run_that_cannot_be_used_is_named(tmp_path):
    far = run_folder(tmp_path / "far", records(1, MAY_S, shift_m=3000.0))
    other = run_folder(tmp_path / "other", records(2, MAY_S), properties=[{"name": "salt"}])
    made = run_folder(tmp_path / "made", records(3, MAY_S), simulated=True)
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError) as caught:
        read_earlier_runs(
            [far, other, made, tmp_path / "empty", tmp_path / "none"],
            replace(TARGET, name="compaction", simulated=False),
        )
    text = str(caught.value)
    for part in (
        "does not overlap",
        "4.2 km",
        "'salt', not of 'compaction'",
        "simulated",
        "neither a run",
        "exist",
    ):
        assert part in text
    assert len(caught.value.mistakes) == 5


def test_a_survey_is_used_once(tmp_path):
    path = run_folder(tmp_path / "run", records(1, MAY_S))
    shutil.copytree(path, tmp_path / "copy")
    with pytest.raises(InputError, match="is the same survey as"):
        read_earlier_runs([path, tmp_path / "copy"], TARGET)
    runs = read_earlier_runs([path], TARGET)
    require_other(runs, records(2, MAY_S))
    with pytest.raises(InputError, match="the survey that is being mapped"):
        require_other(runs, read_records(path / "records.csv"))


def test_a_run_has_its_records_its_plane_and_how_they_were_corrected(tmp_path):
    rows = [{"name": "air pressure", "parameters": {"P0 [hPa]": 1013.25}}]
    run = read_run(run_folder(tmp_path / "run", records(1, MAY_S)[::-1], corrections=rows, simulated=True))
    assert run.records == records(1, MAY_S)
    assert run.frame == FRAME
    assert run.corrections == {"air pressure": {"P0 [hPa]": 1013.25}}
    assert run.simulated


@pytest.mark.parametrize("change", [{"y_m": math.nan}, {"effective_exposure_s": math.nan}, {"x_m": math.nan}])
def test_a_record_that_no_map_can_use_is_left_out(tmp_path, change):
    good = records(1, MAY_S)
    run = read_run(run_folder(tmp_path / "run", [*good, replace(good[0], **change)]))
    assert run.records == good


def test_another_property_of_a_run_is_read_by_its_name(tmp_path):
    path = run_folder(
        tmp_path / "run", records(1, MAY_S), properties=[{"name": "moisture"}, {"name": "compaction"}]
    )
    write_records(path / "records_compaction.csv", records(7, MAY_S))
    assert read_run(path, "compaction", first=False).records == records(7, MAY_S)
    assert read_run(path).records == records(1, MAY_S)
    assert read_run(path, "salt", first=False) is None


NOW = datetime(2026, 6, 1, tzinfo=UTC)


def run(stamp_s: float, rate_cps: float = 4.0) -> EarlierRun:
    samples = Samples(np.array([[0.0, 0.0], [5.0, 5.0]]), np.full(2, 100 * rate_cps), np.full(2, 100.0))
    return EarlierRun(EarlierSurvey("may", stamp_s, samples), Path("may"), stamp_s - 60, [])


@pytest.mark.parametrize(
    ("date", "rate_cps", "said"),
    [
        (datetime(2026, 5, 1, tzinfo=UTC), 4.0, []),
        (datetime(2026, 5, 1, tzinfo=UTC), 2.1, []),
        (datetime(2026, 5, 1, tzinfo=UTC), 1.9, ["has 0.47 times the count rate of this one"]),
        (datetime(2026, 6, 2, tzinfo=UTC), 4.0, []),  # a local clock
        (datetime(2027, 1, 1, tzinfo=UTC), 4.0, ["is dated 2027-01-01, in the future"]),
        (datetime(2020, 5, 1, tzinfo=UTC), 9.0, ["of 2020-05-01 lies 6 years", "has 2.2 times"]),
        (datetime(1970, 1, 1, tzinfo=UTC), 4.0, []),  # a clock without a date
    ],
)
def test_dates_and_rates_that_can_hardly_be_right(date, rate_cps, said):
    found = list(earlier_doubts(run(date.timestamp(), rate_cps), 4.0, NOW, NOW))
    assert len(found) == len(said)
    assert all(one.startswith(start) for one, start in zip(found, said, strict=True))

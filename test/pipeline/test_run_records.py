# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import math
from dataclasses import replace

import pytest
from earlier_folders import FRAME, MAY_S, records, run_folder

from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.pipeline.earlier_runs import find_runs, read_run
from soilmoist_ros.recording.stored_records import write_records


def test_a_run_has_its_records_its_plane_and_how_they_were_corrected(tmp_path):
    rows = [{"name": "air pressure", "parameters": {"P0 [hPa]": 1013.25}}]
    run = read_run(run_folder(tmp_path / "run", records(1, MAY_S)[::-1], corrections=rows, simulated=True))
    assert run.records == records(1, MAY_S)
    assert run.frame == FRAME
    assert run.corrections == {"air pressure": {"P0 [hPa]": 1013.25}}
    assert run.simulated


def test_a_folder_without_runs_is_refused(tmp_path):
    with pytest.raises(InputError, match="neither a run"):
        find_runs(tmp_path)


def test_a_run_without_a_usable_record_is_refused(tmp_path):
    with pytest.raises(InputError, match="no usable record"):
        read_run(run_folder(tmp_path / "run", []))


@pytest.mark.parametrize("change", [{"y_m": math.nan}, {"effective_exposure_s": math.nan}, {"x_m": math.nan}])
def test_a_record_that_no_map_can_use_is_left_out(tmp_path, change):
    good = records(1, MAY_S)
    run = read_run(run_folder(tmp_path / "run", [*good, replace(good[0], **change)]))
    assert run.records == good


def test_a_run_without_its_table_is_refused(tmp_path):
    path = run_folder(tmp_path / "run", records(1, MAY_S))
    (path / "records.csv").unlink()
    with pytest.raises(InputError, match=r"has no records\.csv"):
        read_run(path)


def test_another_property_of_a_run_is_read_by_its_name(tmp_path):
    path = run_folder(
        tmp_path / "run", records(1, MAY_S), properties=[{"name": "moisture"}, {"name": "compaction"}]
    )
    write_records(path / "records_compaction.csv", records(7, MAY_S))
    assert read_run(path, "compaction", first=False).records == records(7, MAY_S)
    assert read_run(path).records == records(1, MAY_S)
    assert read_run(path, "salt", first=False) is None


@pytest.mark.parametrize("content", ["{", '{"datum": null}', '{"datum": {"latitude_deg": 500}}'])
def test_a_damaged_summary_is_refused(tmp_path, content):
    path = run_folder(tmp_path / "run", records(1, MAY_S))
    (path / "summary.json").write_text(content)
    with pytest.raises(InputError, match=r"summary.json"):
        read_run(path)

# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
import csv
import json
import shutil
from dataclasses import replace

import pytest

from soilmoist_ros.foundation import InputError
from soilmoist_ros.pipeline import run_certificate
from soilmoist_ros.reporting import check_certificate, mission_run, open_run, statement_text, write_mission
from soilmoist_ros.reporting.certified import certificate_text
from soilmoist_ros.simulation import MissionSettings, simulate_mission


@pytest.fixture(scope="module")
def certified(tmp_path_factory):
    """A run with a certificate, and its folder."""
    settings = MissionSettings(field="synthetic-low", hours=0.7, cell_m=5.0, series_every_s=1e9, certify=6)
    run, folder = mission_run(simulate_mission(settings)), tmp_path_factory.mktemp("certified")
    return run, folder, {path.name for path in write_mission(folder, run.mission, run=run)}


def test_a_certificate_can_be_made_again_from_its_folder(certified):
    run, folder, names = certified
    assert "certificate.json" in names
    made, compared = check_certificate(folder)
    found = run_certificate(run)
    assert statement_text(made, True) == statement_text(found, True)
    assert "the seed draws the sample" in compared
    assert "not checked: report.html" in compared
    assert open_run(folder).summary["certificate"]["measured"] == 6
    report = (folder / "report.html").read_text()
    for said in ("whatever the model", f"seed {found.sample.seed}", found.sample.digest, "(N0)"):
        assert said in report
    name = made.sample.stops[2].name
    fewer = replace(run.mission, visits=[visit for visit in run.mission.visits if visit.name != name])
    assert f"Not counted at: {name}. " in " ".join(certificate_text(replace(run, mission=fewer)))
    wide = replace(found, vwc=replace(found.vwc, mean=0.15, half_width=0.14, rmse_below=None))
    assert "(too few counts for an upper limit); too wide to be of much use" in statement_text(wide, True)


def test_a_map_that_other_fields_inform_is_not_taken_for_a_wrong_one(certified, tmp_path):
    settings = replace(certified[0].mission.settings, prior=str(certified[1]))
    result = simulate_mission(settings)
    write_mission(tmp_path, result, run=mission_run(result))
    assert "other surveys or covariates informed the map" in check_certificate(tmp_path)[1]


def away(row):
    return {"x_m": float(row["x_m"]) + 59}


def more(row):
    return {"raw_counts": int(row["raw_counts"]) + 20}


@pytest.mark.parametrize(
    ("files", "change", "said"),
    [
        (["visits"], lambda row: {"arrival_stamp_s": float(row["arrival_stamp_s"]) + 15}, "rate_cps of"),
        (["visits"], lambda row: {"reason": "first of 3 stops"}, "measured of"),
        (["visits"], lambda row: {"name": "elsewhere"}, "measured of"),
        (["records"], away, "measured of"),
        (["records"], more, "rate_cps of"),
        (["records"], lambda row: {"effective_exposure_s": 5.0}, "rate_cps of"),
        (["records"], lambda row: {"quarantine": "spike"}, "measured of"),
        (["records", "visits"], away, "measured of"),
        (["others"], lambda row: {"raw_counts": 5}, "rate_cps of"),
        (["summary", "certificate", "vwc", "mean"], 0.2, "summary.json: vwc of"),
        (["summary", "certificate", "sealed"], "0000", "summary.json: sealed of"),
        (["certificate", "rate_cps", "half_width"], 0.01, "certificate.json: rate_cps of"),
        (["certificate", "seed"], 1, "certificate.json: seed of"),
        (["certificate", "sealed"], "0000", "certificate.json: sealed of"),
        (["certificate", "sample", "seed"], 1, "does not draw"),
        (["certificate", "sample", "dwell_s"], 200.0, "sealed of"),
        (["certificate", "map", "model"], "spherical", "rate_cps of"),
    ],
)
def test_every_change_is_found(certified, tmp_path, files, change, said):
    run, folder, _ = certified
    shutil.copytree(folder, tmp_path, dirs_exist_ok=True)
    visit = next(one for one in run.mission.visits if "certified place 3" in one.reason)
    begin_s, end_s = (40, 80) if files == ["others"] else (visit.arrival_stamp_s + 9.9, visit.end_stamp_s + 0.1)
    if not callable(change):
        *keys, last = files[1:]
        content = at = json.loads((path := tmp_path / f"{files[0]}.json").read_text())
        for key in keys:
            at = at[key]
        at[last] = change
        path.write_text(json.dumps(content))
    for path in (tmp_path / f"{file.replace('others', 'records')}.csv" for file in files if callable(change)):
        rows = list(csv.DictReader(path.read_text().splitlines()))
        with path.open("w", newline="") as file:
            table = csv.DictWriter(file, rows[0])
            table.writeheader()
            for row in rows:
                its = row["name"] == visit.name if "name" in row else begin_s <= float(row["stamp_s"]) <= end_s
                table.writerow(row | change(row) if its else row)
    with pytest.raises(InputError, match=said):
        check_certificate(tmp_path)

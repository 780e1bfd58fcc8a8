# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
import json
from dataclasses import replace

import pytest

from soilmoist_ros.foundation import InputError
from soilmoist_ros.pipeline import run_certificate
from soilmoist_ros.reporting import check_certificate, mission_run, open_run, statement_text, write_mission
from soilmoist_ros.reporting.certified import certificate_text
from soilmoist_ros.simulation import MissionSettings, simulate_mission


def test_a_certificate_can_be_made_again_from_its_folder_and_a_change_is_found(tmp_path):
    settings = MissionSettings(field="synthetic-low", hours=0.7, cell_m=5.0, series_every_s=1e9, certify=6)
    run = mission_run(simulate_mission(settings))
    names = {path.name for path in write_mission(tmp_path, run.mission, run=run)}
    assert "certificate.json" in names
    made, compared = check_certificate(tmp_path)
    found = run_certificate(run)
    assert statement_text(made, True) == statement_text(found, True)
    assert "the seed draws the sample" in compared
    assert open_run(tmp_path).summary["certificate"]["measured"] == 6
    report = (tmp_path / "report.html").read_text()
    for said in ("whatever the model", f"seed {found.sample.seed}", found.sample.digest, "(N0)"):
        assert said in report
    visits = tmp_path / "visits.csv"
    name = made.sample.stops[2].name
    fewer = replace(run.mission, visits=[visit for visit in run.mission.visits if visit.name != name])
    assert f"Not counted at: {name}. " in " ".join(certificate_text(replace(run, mission=fewer)))
    lines = visits.read_text().splitlines()
    visits.write_text("\n".join(line for line in lines if not line.startswith(f"{name},")) + "\n")
    with pytest.raises(InputError, match="another statement"):
        check_certificate(tmp_path)
    content = json.loads((tmp_path / "certificate.json").read_text())
    content["sample"]["places"][0][0] += 1
    (tmp_path / "certificate.json").write_text(json.dumps(content))
    with pytest.raises(InputError, match="does not draw"):
        check_certificate(tmp_path)

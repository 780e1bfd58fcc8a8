# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import json

import numpy as np
import pytest

from soilmoist_ros.pipeline.bag_map import ReplaySettings, robot_survey
from soilmoist_ros.recording.run_folder import CONFIGURATION, write_parameters
from soilmoist_ros.recording.stored_records import write_records
from soilmoist_ros.sensing.records import CountRecord


@pytest.fixture
def may(tmp_path):
    """The output folder of an earlier survey of a simulated field, which names its property."""
    rng = np.random.default_rng(1)
    xy = rng.uniform((0, 0), (60, 50), (20, 2)).tolist()
    records = [
        CountRecord(1.7e9 + 10 * i, x, y, 0.0, int(rng.poisson(40)), 10.0, 10.0) for i, (x, y) in enumerate(xy)
    ]
    folder = tmp_path / "may"
    folder.mkdir()
    datum = {"latitude_deg": 53.268, "longitude_deg": -0.5245}
    about = {"datum": datum, "properties": [{"name": "smooth"}], "simulated": False}
    (folder / "summary.json").write_text(json.dumps(about))
    write_records(folder / "records.csv", records)
    return folder


def test_a_replay_has_the_earlier_runs_of_the_robot_unless_it_is_given_others(tmp_path, may):
    write_parameters(tmp_path, "mapper", {"field": "smooth", "model": "matern32", "earlier": [str(may)]})
    bag, configuration = tmp_path / "bag", tmp_path / CONFIGURATION
    of_robot, _ = robot_survey(bag, configuration, ReplaySettings())
    assert [run.survey.name for run in of_robot.earlier] == ["may"]
    assert of_robot.map.knowledge.earlier == (of_robot.earlier[0].survey,)
    without, _ = robot_survey(bag, configuration, ReplaySettings(earlier=()))
    assert without.map.knowledge.earlier == ()

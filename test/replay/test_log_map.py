"""Logs of a survey, mapped by the Python API."""

from __future__ import annotations

import numpy as np
import pytest

from soilmoist_ros.foundation.errors import InputError, Mistake
from soilmoist_ros.replay import MapSettings, map_logs
from soilmoist_ros.replay.log_map import loss_rows
from soilmoist_ros.sensing.problems import Kind, Problem
from soilmoist_ros.simulation.robot.virtual_survey import write_survey


@pytest.fixture(scope="module")
def survey(tmp_path_factory):
    folder = tmp_path_factory.mktemp("survey")
    write_survey(folder, seed=2, spacing_m=30.0, dwell_s=60.0)
    return folder


def settings(survey, **changes):
    files = {"site": survey / "site.yaml", "field": survey / "field.yaml", "nmea": (survey / "survey.nmea",)}
    return MapSettings(**{**files, **changes})


def test_steps_are_reported_and_the_files_are_inputs(survey):
    steps = []
    run = map_logs([survey / "survey.log"], settings(survey), lambda step, share: steps.append(step))
    assert steps[0] == "reading logs"
    assert f"fitting the variogram of {len(run.soil_map.samples)} samples" in steps
    assert [item.role for item in run.inputs] == ["neutron log", "GNSS log", "site", "field"]
    assert all(len(item.sha256) == 64 for item in run.inputs)
    assert run.simulated
    assert len(repr(run)) < 115


def test_without_a_field_the_surroundings_of_the_track_are_mapped(survey):
    run = map_logs([survey / "survey.log"], settings(survey, field=None, cell_m=4.0))
    assert run.field_name == "surroundings of the track"
    assert np.isfinite(run.soil_map.rate).any()


def test_a_file_of_positions_without_a_fix_is_refused(survey, tmp_path):
    (tmp_path / "none.nmea").write_text("$GPGGA,120000.00,,,,,0,00,,,M,,M,,*4B\r\n" * 3)
    with pytest.raises(InputError, match="holds no position"):
        map_logs([survey / "survey.log"], settings(survey, nmea=(tmp_path / "none.nmea",)))


def test_losses_come_first_and_the_most_frequent_of_them():
    kinds = [Kind.GAP, Kind.NO_POSITION, Kind.CHECKSUM]
    problems = [Problem(kinds[0], Mistake("once"), False)]
    problems += [Problem(kinds[1], Mistake("twice"), True)] + 2 * [Problem(kinds[2], Mistake("often"), True)]
    rows = loss_rows(problems)
    assert [(row.count, row.consequence) for row in rows] == [(2, "lost"), (1, "lost"), (1, "kept")]
    assert [row.example for row in rows] == ["often", "twice", "once"]

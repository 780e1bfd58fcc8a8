# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Lines on a map: what informed it, its notes."""

from dataclasses import replace

import pytest

from soilmoist_ros.cli.answers.map_lines import print_knowledge, print_notes, rate_error
from soilmoist_ros.reporting.outputs import mission_run
from soilmoist_ros.simulation import MissionSettings, simulate_mission


@pytest.fixture(scope="module")
def informed():
    settings = MissionSettings(
        "synthetic-low", hours=0.2, seed=1, strategy="lattice", dwell="fmi:20", earlier_surveys=2, cell_m=3.0,
        covariate_correlation=0.8,
    )  # fmt: skip
    return mission_run(simulate_mission(settings))


@pytest.mark.slow
def test_what_informed_a_map_is_printed(informed, capsys):
    print_knowledge(informed)
    lines = capsys.readouterr().out.splitlines()
    names = [one.survey.name for one in informed.earlier]
    assert [
        line.split(":")[0].removeprefix("earlier    ") for line in lines if line.startswith("earlier")
    ] == names
    assert all("correlation of the patterns 0." in line for line in lines if line.startswith("earlier"))
    (change,) = (line for line in lines if line.startswith("change"))
    assert change.startswith(f"change     since the survey {names[-1]}: mean ")
    (covariate,) = (line for line in lines if line.startswith("covariate"))
    assert "counts/s per standard deviation (" in covariate


def test_nothing_is_printed_of_a_map_without_them(informed, capsys):
    print_knowledge(replace(informed, earlier=(), change=None, covariates=None))
    assert capsys.readouterr().out == ""


def test_notes_are_printed_as_warnings(informed, capsys):
    print_notes(informed)
    assert all(line.startswith("warning    ") for line in capsys.readouterr().out.splitlines())


def test_the_error_of_a_rate_map_in_words():
    assert rate_error(0.01234, 0.951) == ("MSE 0.0123 (counts/s)2, 95 % of the cells within their 95 % interval")

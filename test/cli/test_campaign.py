# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``soilmoist campaign``: campaign.py."""

from __future__ import annotations

import pytest
from click.testing import CliRunner

from soilmoist_ros.cli import campaign
from soilmoist_ros.cli.main import main
from soilmoist_ros.lab.campaign import CampaignProgress


@pytest.mark.slow
def test_a_first_impression_is_part_of_the_campaign(tmp_path):
    plan = tmp_path / "plan.yaml"
    plan.write_text(
        "title: tiny\nruns: 2\n"
        "experiments: [{name: a, field: synthetic-high, hours: 0.3, preset: paper, cell_m: 4}]\n"
    )
    command = ["campaign", str(plan), "--workers", "0", "--out", str(tmp_path / "out")]
    result = CliRunner().invoke(main, [*command, "--runs", "1"])
    assert "1 simulated, 0 reused, 0 failed" in result.output
    assert "... 1 of 1 missions" in result.output
    result = CliRunner().invoke(main, command)
    assert "1 simulated, 1 reused, 0 failed" in result.output
    assert result.exit_code == 0


@pytest.mark.slow
def test_a_mission_that_fails_is_named_and_the_others_are_kept(tmp_path):
    plan = tmp_path / "plan.yaml"
    plan.write_text(
        "title: tiny\nruns: 1\n"
        "experiments: [{name: a, field: synthetic-high, hours: 0.1, preset: paper, cell_m: [5000, 4]}]\n"
    )
    result = CliRunner().invoke(main, ["campaign", str(plan), "--workers", "0", "--out", str(tmp_path / "out")])
    assert result.exit_code == 1
    assert "1 simulated, 0 reused, 1 failed" in result.output
    assert "cell_m=5000" in result.output
    assert "cannot be gridded" in result.output
    assert "cannot be gridded" in (tmp_path / "out" / "report.html").read_text()


def test_progress_without_a_terminal_is_a_line_per_tenth(capsys):
    with campaign._progress() as progress:
        for done in range(101):
            progress(CampaignProgress(done, 100))
        for _ in range(3):
            progress(CampaignProgress(100, 100, note="waiting"))
    lines = capsys.readouterr().err.splitlines()
    assert lines[:11] == [f"... {done} of 100 missions" for done in range(0, 101, 10)]
    assert lines[11:] == ["... 100 of 100 missions · waiting"]

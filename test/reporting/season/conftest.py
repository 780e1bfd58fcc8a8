# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import pytest

from soilmoist_ros.reporting.mission_report import write_mission
from soilmoist_ros.reporting.season.season import SeasonSettings, make_season
from soilmoist_ros.simulation import MissionSettings, simulate_mission


@pytest.fixture(scope="session")
def runs(tmp_path_factory):
    """The folder of a mission with two earlier surveys in it."""
    folder = tmp_path_factory.mktemp("season") / "run"
    settings = MissionSettings(
        field="synthetic-low", hours=0.15, cell_m=6.0, strategy="random", earlier_surveys=2, persistence=0.95
    )
    write_mission(folder, simulate_mission(settings))
    return folder


@pytest.fixture(scope="session")
def season(runs):
    return make_season([runs, runs / "earlier"], SeasonSettings())

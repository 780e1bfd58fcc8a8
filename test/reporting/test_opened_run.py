# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A reopened run folder."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
import pytest

from soilmoist_ros.exploration.mission.visit import Visit
from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.reporting import open_run, write_mission
from soilmoist_ros.simulation import MissionSettings, simulate_mission

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def result():
    return simulate_mission(MissionSettings(hours=0.3, cell_m=4.0, dwell="fmi:60", preset="paper"))


@pytest.fixture(scope="module")
def run(result, tmp_path_factory):
    folder = tmp_path_factory.mktemp("mission")
    write_mission(folder, result)
    return open_run(folder)


@pytest.mark.slow
def test_a_mission_comes_back(run, result):
    assert run.summary["simulated"] is True
    assert run.properties == [""]
    assert run.samples()["raw_counts"].tolist() == result.soil_map.samples.counts.tolist()
    np.testing.assert_allclose(run.series["mse"], [row.mse for row in result.series], rtol=1e-6)
    assert [visit.name for visit in run.visits] == [visit.name for visit in result.visits]
    for one, other in zip(run.visits, result.visits, strict=True):
        for field in fields(Visit):
            found, wanted = getattr(one, field.name), getattr(other, field.name)
            assert type(found) is type(wanted)
            if isinstance(wanted, float):
                assert found == pytest.approx(wanted, rel=1e-6, nan_ok=True)
            else:
                assert found == wanted
    assert np.nanmean(run.bands()["rate"]) == pytest.approx(np.nanmean(result.soil_map.rate), rel=0.02)


@pytest.mark.slow
def test_visits_of_an_older_file_have_defaults(tmp_path):
    (tmp_path / "summary.json").write_text("{}")
    (tmp_path / "visits.csv").write_text(
        "name,x_m,y_m,arrived_s,dwell_s,raw_counts,reason\nr1c2,1.5,2,10,60.5,300,largest variance\n"
    )
    (visit,) = open_run(tmp_path).visits
    assert (visit.dwell_s, visit.raw_counts, visit.robot, visit.reason) == (60.5, 300, 1, "largest variance")
    assert np.isnan(visit.exposure_s)


@pytest.mark.parametrize(("name", "row"), [("visits", "a,1.2.3"), ("series", "x,2"), ("series", "1,2,3")])
def test_damaged_tables_are_named_with_their_line(tmp_path, name, row):
    (tmp_path / "summary.json").write_text("{}")
    (tmp_path / f"{name}.csv").write_text(f"name,x_m\n{row}\n" if name == "visits" else f"time_s,mse\n{row}\n")
    with pytest.raises(InputError, match=rf"{name}.csv:2: cannot be read"):
        getattr(open_run(tmp_path), name)


def test_what_is_missing_is_named_with_a_remedy(run, tmp_path):
    with pytest.raises(InputError, match=r"holds no summary.json -> give the folder"):
        open_run(tmp_path)
    with pytest.raises(InputError, match=r"is a file, not the folder of a run -> give "):
        open_run(run.folder / "map.tif")
    (tmp_path / "summary.json").write_text("{")
    with pytest.raises(InputError, match="cannot be read"):
        open_run(tmp_path)
    with pytest.raises(InputError, match=r"there is no map_salt.tif -> the properties with a map are: ''"):
        run.bands("salt")

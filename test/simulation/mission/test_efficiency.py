from dataclasses import replace

import pytest

from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.simulation.mission.efficiency import mission_efficiency
from soilmoist_ros.simulation.mission.settings import MissionSettings
from soilmoist_ros.simulation.mission.simulator import simulate_mission


def mission(**changes):
    usual = {
        "hours": 0.6,
        "model": "matern32",
        "fit": "reml",
        "cell_m": 3.0,
        "strategy": "ivr",
        "dwell": "optimal",
    }
    return simulate_mission(MissionSettings(**{**usual, "dwell": "optimal", "map_from": "records", **changes}))


@pytest.mark.slow
def test_a_plan_that_weighs_time_reaches_more_than_the_published_one():
    good, published = mission(), mission(strategy="greedy", dwell="fmi:300", map_from="stops")
    best, other = mission_efficiency(good), mission_efficiency(published)
    assert 0.6 < best.reached <= 1
    assert other.reached < 0.75 * best.reached
    assert best.reached == pytest.approx(best.least / best.left)
    assert not best.moisture


def test_without_a_map_there_is_no_figure():
    short = mission(hours=0.05, strategy="greedy", dwell="fmi:600")
    assert mission_efficiency(replace(short, properties=[replace(short.properties[0], soil_map=None)])) is None


@pytest.mark.slow
def test_the_target_changes_where_the_time_goes():
    rate, moisture = mission(field="synthetic-high"), mission(field="synthetic-high", target="vwc")
    plan = mission_efficiency(moisture)
    assert plan.moisture
    assert 0.3 < plan.reached <= 1
    wet = [sum(row.exposure_s for row in run.records if row.x_m < 30) for run in (rate, moisture)]
    assert moisture.records != rate.records
    # the wet side has fewer counts
    west = run_mean(moisture, lambda x: x < 30)
    east = run_mean(moisture, lambda x: x > 30)
    assert (wet[1] > wet[0]) == (west < east)


def run_mean(run, side):
    here = [row for row in run.records if side(row.x_m)]
    return sum(row.raw_counts for row in here) / sum(row.effective_exposure_s for row in here)


def test_a_target_without_a_calibration_is_refused(tmp_path):
    field = tmp_path / "bare.yaml"
    field.write_text(
        "name: bare\ndatum: {latitude_deg: 53.2, longitude_deg: -0.5}\n"
        "polygon: [[0, 0], [40, 0], [40, 30], [0, 30]]\ntruth: {formula: {family: gradient, low: 3, high: 5}}\n"
    )
    with pytest.raises(InputError, match="no calibration"):
        simulate_mission(MissionSettings(field=str(field), target="vwc", hours=0.2))

# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What the explorer makes of maps, correction factors and budgets before a strategy chooses."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import KDTree

from soilmoist_ros.exploration.control.explorer import Explorer, cell_stops
from soilmoist_ros.exploration.mission.actions import RequestPlan
from soilmoist_ros.exploration.mission.types import PlanKind
from soilmoist_ros.exploration.planning.dwell import parse_dwell
from soilmoist_ros.exploration.planning.planning_model import best_dwell
from soilmoist_ros.exploration.planning.properties import Property
from soilmoist_ros.exploration.planning.prospect import MAX_STOPS
from soilmoist_ros.exploration.strategies.registry import make_strategy
from soilmoist_ros.exploration.travel.stop import Stop, stops_xy
from soilmoist_ros.exploration.travel.travel import FreeTravel, RobotMotion
from soilmoist_ros.mapping.field_map import FieldMap, FieldMapSettings
from soilmoist_ros.mapping.grid import FieldGrid
from soilmoist_ros.mapping.samples import as_samples
from soilmoist_ros.mapping.variogram.fit import estimate_variogram
from soilmoist_ros.simulation.mission.settings import MissionSettings
from soilmoist_ros.simulation.mission.simulator import _Simulation

GRID = FieldGrid.from_polygon(np.array([[0, 0], [60, 0], [60, 50], [0, 50]], float), 5.0)
SAMPLES = as_samples([(5.0, 5.0), (9.0, 20.0), (20.0, 8.0), (5.0, 40.0)], [300, 320, 410, 330], [100.0] * 4)
FIT = estimate_variogram(SAMPLES.xy, SAMPLES.counts, SAMPLES.exposure_s, extent_m=78.0)
REQUEST = RequestPlan(1, PlanKind.EXPLORE, (), 3600.0, 3600.0)
PLACE = (2.5, 2.5)


def explorer(factor=1.0, dwell="optimal", strategy="ivr", stops=None):
    mapped = Property(FieldMap(GRID, FieldMapSettings(for_planning=True)), factor=factor)
    mapped.field_map.set_samples(SAMPLES, FIT)
    mapped.field_map.update()
    return Explorer(
        [mapped], stops or cell_stops(GRID), FreeTravel(RobotMotion()), make_strategy(strategy),
        make_strategy("random"), parse_dwell(dwell), np.random.default_rng(1),
    )  # fmt: skip


def test_the_stops_that_are_compared_cover_all_of_the_field():
    """Every tenth stop of rows of 70 was one of seven columns, the last of them far from the border."""
    x, y = np.meshgrid(np.arange(0.5, 60.0, 60 / 70), np.arange(0.5, 50.0, 50 / 70))
    stops = tuple(Stop(f"s{i}", *place) for i, place in enumerate(zip(x.ravel(), y.ravel(), strict=True)))
    compared = explorer(stops=stops).situation(REQUEST, PLACE).prospect().stops
    assert 400 <= len(compared) <= MAX_STOPS
    assert KDTree(stops_xy(compared)).query(stops_xy(stops))[0].max() < 3.0


def test_the_correction_factor_shortens_the_dwell_at_low_pressure():
    at_900_hpa = explorer(factor=0.42)
    prospect = at_900_hpa.situation(REQUEST, PLACE).prospect()
    worth = prospect.worth()
    expected_s, _ = best_dwell(
        worth.on_way,
        worth.gain,
        worth.variance,
        0.42 * worth.rate,
        worth.travel_s,
        np.full(len(worth.rate), 3600.0),
        10.0,
    )
    np.testing.assert_allclose(worth.dwell_s, expected_s)
    assert at_900_hpa.plan(REQUEST, PLACE).choice.dwell.factor == 0.42
    sooner, later = (explorer(factor).situation(REQUEST, PLACE).prospect().worth() for factor in (0.42, 1.0))
    assert (sooner.dwell_s[later.dwell_s > 10] < later.dwell_s[later.dwell_s > 10]).all()


def test_a_dwell_by_counts_is_expected_shorter_where_more_neutrons_arrive():
    usual, at_900_hpa = (explorer(factor, "ami:0.05").situation(REQUEST, PLACE) for factor in (1.0, 0.42))
    assert at_900_hpa.expected_dwell_s == pytest.approx(0.42 * usual.expected_dwell_s)


def test_before_the_first_map_the_nominal_rate_is_expected():
    mapped = Property(FieldMap(GRID, FieldMapSettings(for_planning=True)))
    new = Explorer(
        [mapped], cell_stops(GRID), FreeTravel(RobotMotion()), make_strategy("lattice"), make_strategy("random"),
        parse_dwell("ami:0.1"), np.random.default_rng(1), nominal_rate_cps=2.5,
    )  # fmt: skip
    assert new.situation(REQUEST, PLACE).expected_dwell_s == pytest.approx(100 / 2.5, rel=0.02)


@pytest.mark.slow
@pytest.mark.parametrize("weather", [False, True])
def test_the_simulator_plans_with_the_factors_of_its_records(weather):
    settings = MissionSettings(
        strategy="ivr", dwell="optimal", map_from="records", fit="reml", properties=("rough",)
    )
    simulation = _Simulation(replace(settings, hours=0.15, cell_m=4.0, weather=weather))
    simulation.run(lambda share: None)
    (robot,) = simulation.robots
    for mapped, record in zip(robot.explorer.properties, robot.records[-1], strict=True):
        assert mapped.factor == record.exposure_s / record.effective_exposure_s
        assert (mapped.factor != 1.0) is weather


def test_before_the_first_map_the_dwell_follows_the_nominal_rate():
    planner = explorer(dwell="ami:0.05")
    planner.properties = [Property(FieldMap(GRID, FieldMapSettings(for_planning=True)))]
    look = planner.situation(REQUEST, PLACE)
    assert look.expected_dwell_s == 400 / planner.nominal_rate_cps
    assert (look.map_variance == 1).all()
    assert (look.variance == 1).all()

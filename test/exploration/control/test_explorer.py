# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""From maps, factors, field and graph to a choice: what the strategy is shown, and what a mission needs."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import KDTree
from stand_in import graph, square_setup

from soilmoist_ros.exploration import Property, RequestPlan, Stop, make_strategy, parse_dwell, stops_xy
from soilmoist_ros.exploration.control.explorer import Explorer, ExplorerSettings, first_forecast, nominal_rate_cps
from soilmoist_ros.exploration.control.field_access import AccessRules, FieldAccess, cell_stops
from soilmoist_ros.exploration.control.planning_queue import make_explorer
from soilmoist_ros.exploration.mission.types import MissionRules, PlanKind
from soilmoist_ros.exploration.planning.planning_model import MAX_STOPS
from soilmoist_ros.exploration.travel.travel import FreeTravel, RobotMotion
from soilmoist_ros.mapping import FieldGrid, FieldMap, estimate_variogram
from soilmoist_ros.mapping.samples import as_samples
from soilmoist_ros.sensing.moisture.curve import CalibrationCurve

GRID = FieldGrid.from_polygon(np.array([[0, 0], [60, 0], [60, 50], [0, 50]], float), 5.0)
SAMPLES = as_samples([(5.0, 5.0), (9.0, 20.0), (20.0, 8.0), (5.0, 40.0)], [300, 320, 410, 330], [100.0] * 4)
FIT = estimate_variogram(SAMPLES.xy, SAMPLES.counts, SAMPLES.exposure_s, extent_m=78.0)
REQUEST = RequestPlan(1, PlanKind.EXPLORE, (), 3600.0, 3600.0)
PLACE = (2.5, 2.5)


def explorer(factor=1.0, dwell="optimal", strategy="greedy", stops=None):
    mapped = Property(FieldMap(GRID), factor=factor)
    mapped.field_map.set_samples(SAMPLES, FIT)
    mapped.field_map.update()
    return Explorer(
        [mapped], stops or cell_stops(GRID), FreeTravel(RobotMotion()), make_strategy(strategy),
        make_strategy("random"), MissionRules(budget_s=7200, dwell=parse_dwell(dwell)), np.random.default_rng(1),
    )  # fmt: skip


def test_the_stops_that_are_compared_cover_all_of_the_field():
    """Every tenth stop of rows of 70 was one of seven columns, the last of them far from the border."""
    x, y = np.meshgrid(np.arange(0.5, 60.0, 60 / 70), np.arange(0.5, 50.0, 50 / 70))
    stops = tuple(Stop(f"s{i}", *place) for i, place in enumerate(zip(x.ravel(), y.ravel(), strict=True)))
    compared = explorer(stops=stops).situation(REQUEST, PLACE).prospect().stops
    assert 400 <= len(compared) <= MAX_STOPS
    assert KDTree(stops_xy(compared)).query(stops_xy(stops))[0].max() < 3.0


def test_counts_are_as_noisy_as_the_correction_factor_says():
    at_900_hpa, usual = (explorer(factor).situation(REQUEST, PLACE).prospect().model for factor in (0.42, 1.0))
    nodes, dwell_s = np.arange(5), np.full(5, 60.0)
    nugget = FIT.variogram.nugget
    np.testing.assert_allclose(
        at_900_hpa.noise(nodes, dwell_s) - nugget, 0.42 * (usual.noise(nodes, dwell_s) - nugget)
    )


def test_a_dwell_by_counts_is_expected_shorter_where_more_neutrons_arrive():
    usual, at_900_hpa = (explorer(factor, "ami:0.05").situation(REQUEST, PLACE) for factor in (1.0, 0.42))
    assert at_900_hpa.expected_dwell_s == pytest.approx(0.42 * usual.expected_dwell_s)


def test_before_the_first_map_the_dwell_follows_the_nominal_rate():
    planner = explorer(dwell="ami:0.05")
    planner.properties = [Property(FieldMap(GRID))]
    look = planner.situation(REQUEST, PLACE)
    assert look.expected_dwell_s == 400 / planner.nominal_rate_cps
    assert (look.map_variance == 1).all()
    assert (look.variance == 1).all()


# From field and graph to what a mission needs -------------------------------------------------------------------

SQUARE = square_setup(20, 2.0).field


def test_only_nodes_in_the_field_are_measured_at_but_others_are_home_and_way():
    access = FieldAccess(
        SQUARE, RobotMotion(), graph({"shed": (-9, 0), "edge": (-1, 5), "in": (5, 5)}, "shed edge in"),
        AccessRules(beyond_m=2.0), home="shed",
    )  # fmt: skip
    assert [stop.name for stop in access.stops] == ["edge", "in"]
    assert access.stop("shed") == Stop("shed", -9.0, 0.0)
    assert np.isfinite(access.travel.travel_s((-9.0, 0.0), access.stops)).all()


@pytest.mark.slow
@given(st.floats(60, 400), st.sampled_from(["random", "gcb"]))
def test_no_stop_is_offered_that_the_mission_finds_too_late_for(left_s, strategy):
    access = FieldAccess(SQUARE, RobotMotion(), None)
    rules = MissionRules(budget_s=3600.0, dwell=parse_dwell("ami:0.03"), home=access.stop("r0c0"))
    settings = ExplorerSettings(strategy=strategy, preset="paper", seed=1, motion=RobotMotion())
    request = RequestPlan(1, PlanKind.EXPLORE, (), left_s, left_s)
    plan = make_explorer(access, settings, rules).plan(request, (10.0, 10.0))
    if plan.choice is not None:
        stop = plan.choice.stop
        needed_s = plan.travel_s + rules.min_dwell_s + rules.way_home_s((stop.x_m, stop.y_m))
        assert needed_s <= left_s
    else:
        assert left_s < 60 + 12 + 60 + rules.way_home_s((10.0, 10.0))


def test_the_reserve_is_kept_on_top_of_the_real_way_home():
    """Around a ditch the way is several times the straight distance."""
    ditch = (np.array([(9, -1), (11, -1), (11, 18), (9, 18)], float),)
    divided = square_setup(20, 1.0, no_go=ditch).field
    access = FieldAccess(divided, RobotMotion(0.6, 12.0), None, home="r0c6")
    rules = MissionRules(budget_s=7200.0, dwell=parse_dwell("fmi:60"), home=access.home, return_margin_s=60.0)
    settings = ExplorerSettings(strategy="random", preset="paper", seed=1, motion=RobotMotion())
    explorer = make_explorer(access, settings, rules)
    home = (access.home.x_m, access.home.y_m)
    beyond = access.stop("r0c13")
    real_s = float(access.travel.travel_s(home, [beyond])[0])
    assert real_s > rules.travel_s(home, (beyond.x_m, beyond.y_m)) + 20
    for spare_s, offered in ((-1.0, False), (1.0, True)):
        left_s = 2 * real_s + rules.min_dwell_s + 60.0 + spare_s
        situation = explorer.situation(RequestPlan(1, PlanKind.EXPLORE, (), left_s, left_s), home)
        row = situation.candidates.index(beyond)
        assert np.isfinite(situation.travel_s[row]) == offered
    others = tuple(stop.name for stop in access.stops if stop != beyond)
    plan = explorer.plan(RequestPlan(1, PlanKind.EXPLORE, others, 3600.0, 3600.0), home)
    assert (plan.choice.stop, plan.home_s) == (beyond, pytest.approx(real_s))


def test_before_the_start_the_forecast_is_that_of_a_field_that_varies_as_expected():
    curve = CalibrationCurve(n0_cps=7.0, bulk_density_gcm3=1.4)
    rate = ExplorerSettings(strategy="greedy", preset="paper", seed=1, motion=RobotMotion())
    moist = replace(rate, curve=curve, calibration=curve)
    grid = SQUARE.grid()
    hour, two = (first_forecast(grid, rate, budget_s) for budget_s in (3600.0, 7200.0))
    assert hour.is_guess
    assert hour.times_s[-1] == 3600.0
    assert hour.sd_end > two.sd_end > 0
    assert nominal_rate_cps(curve) == curve.rate_cps(0.15)
    calibrated = first_forecast(grid, moist, 3600.0)
    assert (calibrated.moisture, calibrated.mean_rate_cps) == (True, curve.rate_cps(0.15))


def test_a_robot_that_turns_out_slow_is_offered_nearer_stops_only():
    access = FieldAccess(SQUARE, RobotMotion(), None)
    rules = MissionRules(budget_s=7200.0, dwell=parse_dwell("fmi:60"), home=access.stop("r0c0"))
    settings = ExplorerSettings(strategy="random", preset="paper", seed=1, motion=RobotMotion())
    explorer = make_explorer(access, settings, rules)
    request = RequestPlan(1, PlanKind.EXPLORE, (), 150.0, 150.0)
    offered = np.isfinite(explorer.situation(request, (0.0, 0.0)).travel_s).sum()
    explorer.use_rules(replace(rules, speed_mps=0.3))
    fewer = np.isfinite(explorer.situation(request, (0.0, 0.0)).travel_s).sum()
    assert 0 < fewer < offered

# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Each source of randomness of a mission has a separate stream, equal to earlier releases and to a robot."""

from dataclasses import replace

import numpy as np
import pytest

from soilmoist_ros.exploration import FieldAccess, RequestPlan, RobotMotion, parse_dwell
from soilmoist_ros.exploration.control.explorer import ExplorerSettings, strategy_stream
from soilmoist_ros.exploration.control.planning_queue import make_explorer
from soilmoist_ros.exploration.mission.types import MissionRules, PlanKind
from soilmoist_ros.sensing.moisture.curve import CalibrationCurve
from soilmoist_ros.simulation import MissionSettings, simulate_mission, surrogate_field
from soilmoist_ros.simulation.mission.mission_result import map_errors
from soilmoist_ros.simulation.mission.streams import device_stream, field_stream, gnss_stream, sensor_stream

SETTINGS = MissionSettings(
    strategy="lattice", dwell="fmi:60", hours=0.2, cell_m=5.0, seed=11, travel="graph", weather=False
)


def counts(settings):
    return [record.raw_counts for record in simulate_mission(settings).records]


@pytest.mark.parametrize("seed", [0, 1, 2026])
def test_a_seed_means_what_it_meant(seed):
    """The first three children of the seed are the streams of sensor, strategy and receiver."""
    children = np.random.SeedSequence(seed).spawn(8)
    streams = (
        sensor_stream(seed), strategy_stream(seed), gnss_stream(seed), sensor_stream(seed, 1),
        *(device_stream(seed, device) for device in range(4)),
    )  # fmt: skip
    for child, stream in zip(children, streams, strict=True):
        np.testing.assert_array_equal(stream.random(4), np.random.default_rng(child).random(4))


def test_no_two_sources_share_a_stream():
    seed, robots = 5, 3
    streams = [field_stream(seed, number) for number in range(3)]
    for robot in range(robots):
        streams += [strategy_stream(seed, robot), gnss_stream(seed, robot)]
        streams += [sensor_stream(seed, number, robot, robots) for number in range(4)]
        streams += [device_stream(seed, device, robot, robots) for device in range(9)]
    first = [float(stream.random()) for stream in streams]
    assert len(set(first)) == len(streams)
    devices = [float(device_stream(seed, device).random()) for device in range(9)]
    alone = [float(sensor_stream(seed, number).random()) for number in range(4)]
    others = [float(strategy_stream(seed).random()), float(gnss_stream(seed).random())]
    assert len({*devices, *alone, *others}) == 15


@pytest.mark.slow
def test_counts_do_not_depend_on_the_noise_of_the_receiver():
    noisy, exact = (counts(replace(SETTINGS, position_sd_m=sd)) for sd in (0.05, 0.0))
    assert noisy == exact


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_planner_on_a_robot_draws_the_stop_that_the_simulator_draws(seed):
    settings = replace(SETTINGS, strategy="random", travel="free", seed=seed)
    visit = simulate_mission(settings).visits[0]
    access = FieldAccess(surrogate_field(settings.field).field, RobotMotion(), None, cell_m=settings.cell_m)
    dwell = parse_dwell(settings.dwell)
    chosen = ExplorerSettings(strategy="random", preset="recommended", seed=seed, motion=RobotMotion())
    explorer = make_explorer(access, chosen, MissionRules(budget_s=720.0, dwell=dwell))
    choice = explorer.plan(RequestPlan(1, PlanKind.EXPLORE, (), 720.0, 720.0), (0.5, 0.5)).choice
    assert choice.stop.name == visit.name


# Results -------------------------------------------------------------------------------------------------------

CURVE = CalibrationCurve(6.0, 1.4, 0.02, 0.01)
PORES = 1 - 1.4 / 2.65
TRUTH = np.array([3.6, 3.8, 4.0, 4.5])
ONE = np.ones(4)


def test_coverage_counts_the_cells_whose_interval_holds_the_truth():
    error = np.array([1.95, -1.97, 1.97, -1.95])
    assert map_errors(TRUTH + error, ONE, TRUTH, None)[2] == 0.5
    assert map_errors(TRUTH + error, 2 * ONE, TRUTH, None)[2] == 1.0


def test_the_error_of_the_moisture_is_that_of_the_curve():
    wrong = TRUTH + 0.1
    expected = np.sqrt(np.mean((CURVE.vwc(wrong) - CURVE.vwc(TRUTH)) ** 2))
    assert map_errors(wrong, ONE, TRUTH, CURVE)[1] == pytest.approx(expected)


def test_a_truth_beyond_the_curve_does_no_harm():
    truth = np.array([1.0, 3.0, *TRUTH[:2]])
    assert map_errors(truth, ONE, truth, CURVE) == (0.0, 0.0, 1.0)


def test_one_cell_at_the_pole_does_not_decide():
    for low in (CURVE.lowest_rate_cps * (1 + 1e-12), CURVE.lowest_rate_cps, 0.1, -3.0):
        rate = np.array([low, *TRUTH[1:]])
        expected = (PORES - CURVE.vwc(TRUTH)[0]) / 2
        assert map_errors(rate, ONE, TRUTH, CURVE)[1] == pytest.approx(float(expected))

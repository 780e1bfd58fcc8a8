# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Simulated missions and what they leave: simulator.py and result.py."""

import math
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from datetime import UTC, datetime
from itertools import combinations
from multiprocessing import get_context

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from soilmoist_ros.exploration import STRATEGIES, GoTo, make_topological_map, open_lattice, polyline_length_m
from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.mapping.field_map import FieldMap
from soilmoist_ros.simulation import MissionSettings, simulate_mission, surrogate_field
from soilmoist_ros.simulation.mission import simulator
from soilmoist_ros.simulation.mission.simulator import _Simulation

SHORT = MissionSettings(hours=1.0, dwell="fmi:120", fit="reml", model="matern32", cell_m=2.0, preset="paper")


def bits(result):
    """Result of a mission for comparison bit for bit; as text, because NaN differs from itself."""
    return repr(result.series), repr(result.visits), result.tracks[0].tobytes(), repr(result.records)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("strategy", "preset"),
    [("greedy", "paper"), ("monte_carlo", "authors"), ("adaptive_sampling", "authors"), ("random", "paper"),
     ("lattice", "paper")],
)  # fmt: skip
def test_every_strategy_maps_the_border(strategy, preset):
    result = simulate_mission(replace(SHORT, strategy=strategy, preset=preset))
    first, last = next(row for row in result.series if row.mse == row.mse), result.series[-1]
    assert last.samples >= 12
    # half the field is 2.5, half 5.0 counts/s: knowing only the mean leaves an error of about 1.3
    assert last.mse < 0.35
    assert last.mse < first.mse
    assert 3600 - 150 <= last.time_s <= 3600
    assert result.soil_map is not None
    assert np.nanmean((result.soil_map.rate - result.truth_rate) ** 2) == pytest.approx(last.mse, rel=1e-9)


@pytest.mark.slow
def test_a_mission_is_determined_by_its_seed_in_any_process():
    settings = [replace(SHORT, strategy="monte_carlo", seed=seed, hours=0.5) for seed in (1, 2)]
    here = [bits(simulate_mission(each)) for each in settings]
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        there = [bits(result) for result in pool.map(simulate_mission, settings)]
    assert here == there
    assert here[0] != here[1]


@pytest.mark.slow
def test_stops_are_counted_for_as_long_as_the_rule_says():
    fixed = simulate_mission(replace(SHORT, dwell="fmi:120")).visits
    # the record that began before the arrival is not counted
    assert all(120 <= visit.dwell_s <= 130 for visit in fixed[:-1])
    adaptive = simulate_mission(replace(SHORT, dwell="ami:0.05", hours=1.5)).visits
    assert all(400 <= visit.raw_counts <= 470 for visit in adaptive[:-1])


@pytest.mark.slow
def test_the_weather_is_applied_and_undone():
    settings = replace(SHORT, strategy="random", hours=3.0, seed=4)
    result = simulate_mission(settings)
    field = surrogate_field(settings.field)
    standing = [r for r in result.records if any(abs(r.x_m - v.x_m) < 0.3 and abs(r.y_m - v.y_m) < 0.3
                and v.arrived_s + 10 <= r.stamp_s <= v.arrived_s + v.dwell_s for v in result.visits)]  # fmt: skip
    factors = {round(r.effective_exposure_s, 6) for r in standing}
    assert len(factors) > 20
    counts = np.array([r.raw_counts for r in standing])
    rate = field.rate_at([(r.x_m, r.y_m) for r in standing])
    expected = rate * [r.effective_exposure_s for r in standing]
    chi_square = ((counts - expected) ** 2 / expected).sum()
    assert abs(chi_square - len(counts)) < 4 * np.sqrt(2 * len(counts))
    calm = simulate_mission(replace(settings, weather=False))
    assert {r.effective_exposure_s for r in calm.records} == {10.0}


@pytest.mark.slow
def test_missions_over_a_graph_stop_at_its_nodes_and_drive_its_edges(tmp_path):
    field = surrogate_field("synthetic-high")
    graph = open_lattice(field.field, 10.0).graph
    path = tmp_path / "map.yaml"
    path.write_text(make_topological_map(graph, "airfield", datetime(2026, 1, 1, tzinfo=UTC)).to_json())
    result = simulate_mission(replace(SHORT, travel="graph", graph=str(path)))
    nodes = set(graph.names)
    assert {visit.name for visit in result.visits} <= nodes
    corners = {tuple(np.round(xy, 3)) for xy in graph.xy}
    assert {tuple(np.round(xy, 3)) for xy in result.tracks[0][1:-1]} <= corners
    assert result.series[-1].mse < 0.5
    laid = simulate_mission(replace(SHORT, travel="graph"))
    assert laid.series[-1].samples > 8


def test_bad_settings_are_named():
    for change, message in (({"cell_m": 500.0}, "cannot be gridded"), ({"robots": 0}, "robots: must be >= 1"),
                            ({"field": "smooth", "target": "vwc"}, "no calibration")):  # fmt: skip
        with pytest.raises(InputError, match=message):
            simulate_mission(replace(SHORT, **change))


class Watched(_Simulation):
    """Notes the targets of all robots at each goal."""

    def __init__(self, given):
        super().__init__(given)
        self.held = []

    def carry_out(self, robot, action):
        super().carry_out(robot, action)
        if isinstance(action, GoTo):
            targets = [each.mission.status.target for each in self.robots]
            self.held.append([target.name for target in targets if target is not None])


@pytest.mark.slow
@settings(max_examples=8, deadline=None)
@given(
    strategy=st.sampled_from(STRATEGIES.names()),
    robots=st.integers(2, 4),
    seed=st.integers(0, 1000),
    map_from=st.sampled_from(["stops", "records"]),
    travel=st.sampled_from(["free", "graph"]),
)
def test_two_robots_never_hold_the_same_target(strategy, robots, seed, map_from, travel):
    mission = Watched(
        replace(SHORT, hours=0.2, dwell="fmi:60", strategy=strategy, robots=robots, seed=seed, map_from=map_from,
                travel=travel, cell_m=5.0)
    )  # fmt: skip
    result = mission.run(lambda share: None)
    assert mission.held
    assert all(len(set(held)) == len(held) for held in mission.held)
    assert {visit.robot for visit in result.visits} == set(range(1, robots + 1))


@pytest.mark.slow
@pytest.mark.parametrize("map_from", ["stops", "records"])
def test_several_robots_share_one_map(map_from):
    base = replace(SHORT, hours=0.5, map_from=map_from, strategy="gcb")
    one, three = (simulate_mission(replace(base, robots=robots)) for robots in (1, 3))
    assert three.series[-1].mse < one.series[-1].mse
    assert len(three.visits) > 2 * len(one.visits)
    # the error belongs to the one shared map; distance and time are sums over all robots
    assert np.nanmean((three.soil_map.rate - three.truth_rate) ** 2) == pytest.approx(three.series[-1].mse)
    assert sum(map(polyline_length_m, three.tracks)) == pytest.approx(three.series[-1].distance_m)
    assert sum(visit.dwell_s for visit in three.visits) == pytest.approx(three.series[-1].counting_s)
    starts = [track[0].tolist() for track in three.tracks]
    assert starts[0] == one.tracks[0][0].tolist()
    assert min(math.dist(*pair) for pair in combinations(starts, 2)) >= 3.0
    stamps = [record.stamp_s for record in three.records]
    assert stamps == sorted(stamps)
    assert len(stamps) > 2.9 * len(one.records)
    assert bits(three) == bits(simulate_mission(replace(base, robots=3)))


@pytest.mark.slow
@pytest.mark.parametrize(("every_s", "dwell"), [(60.0, "fmi:60"), (300.0, "optimal")])
def test_maps_that_guide_nothing_are_made_for_the_series_only(every_s, dwell, monkeypatch):
    base = MissionSettings(field="synthetic-high", strategy="lattice", dwell=dwell, hours=0.5, cell_m=4.0)
    made, fit = [], FieldMap.compute
    monkeypatch.setattr(FieldMap, "compute", lambda *given, **named: made.append(1) or fit(*given, **named))
    free = simulate_mission(replace(base, series_every_s=every_s))
    assert len(made) <= len(free.series) + 2
    monkeypatch.undo()
    monkeypatch.setattr(simulator, "strategy_kind", lambda name: STRATEGIES.get("gcb"))
    guided = simulate_mission(base)
    assert free.visits == guided.visits
    rows = {row.time_s: row for row in guided.series}
    assert [repr(row) for row in free.series] == [repr(rows[row.time_s]) for row in free.series]
    np.testing.assert_array_equal(free.soil_map.rate_sd, guided.soil_map.rate_sd)

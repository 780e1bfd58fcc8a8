# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Topological maps in simulated missions (mission_ground.py): a map lies where its datum says."""

import json
import math
from datetime import datetime
from itertools import combinations

import numpy as np
import pytest

from soilmoist_ros.exploration import ROBOT_RADIUS_M, RobotMotion, Stop, keep_apart_m, make_topological_map
from soilmoist_ros.exploration.control.field_access import PAST_M, AccessRules, FieldAccess, cell_stops
from soilmoist_ros.exploration.travel.travel_graph import TravelGraph
from soilmoist_ros.foundation import InputError, LocalFrame
from soilmoist_ros.mapping.field import Field
from soilmoist_ros.simulation.mission.mission_ground import fenced_map, mission_map, start_stops, travel_and_stops
from soilmoist_ros.simulation.mission.settings import MissionSettings

FRAME = LocalFrame(53.268, -0.5245)
FIELD = Field("plot", FRAME, np.array([[0, 0], [80, 0], [80, 60], [0, 60]], float))


def map_file(tmp_path, places, meta):
    stops = [Stop(str(number), x, y) for number, (x, y) in enumerate(places)]
    edges = [("0", "1"), ("1", "0")]
    made = make_topological_map(TravelGraph.from_edges(stops, edges), "plot", datetime(2026, 1, 1))
    path = tmp_path / "map.json"
    path.write_text(json.dumps({**made.document, "meta": meta}))
    return str(path)


def test_a_map_with_another_datum_lies_where_it_says(tmp_path, caplog):
    datum = {"latitude": 53.268642, "longitude": -0.5245095, "altitude": 0}
    graph = map_file(tmp_path, [(10, 10), (20, -30)], {"origin": datum})
    found = mission_map(FIELD, FIELD.grid(), graph)
    north_m = FRAME.to_local(53.268642, -0.5245095)[0]
    np.testing.assert_allclose(found.graph.xy, np.add(north_m, [(10, 10), (20, -30)]), atol=1e-3)
    assert "datum of the map is 71.5 m from the field's" in caplog.text
    with pytest.raises(InputError, match="no node of the topological map lies in the field 'plot'"):
        fenced_map(
            FIELD, mission_map(FIELD, FIELD.grid(), map_file(tmp_path, [(10, 10), (20, 30)], {"origin": datum}))
        )
    same = map_file(tmp_path, [(10, 10), (20, 30)], {"datum_latitude": 53.268, "datum_longitude": -0.5245})
    np.testing.assert_array_equal(mission_map(FIELD, FIELD.grid(), same).graph.xy, [(10, 10), (20, 30)])
    with pytest.raises(InputError, match="the map is not of the field 'plot'"):
        mission_map(
            FIELD, FIELD.grid(),
            map_file(tmp_path, [(1, 1), (2, 2)], {"origin": {"latitude": -53, "longitude": 179}}),
        )  # fmt: skip


def test_robots_start_apart_at_different_corners():
    stops = cell_stops(FIELD.grid(2.0))
    starts = [start_stops(FIELD, stops, MissionSettings(robots=robots)) for robots in (1, 2, 5)]
    assert [stop.xy for stop in starts[0]] == [(1.0, 1.0)]
    assert (starts[2][:1], starts[2][:2]) == (starts[0], starts[1])
    apart_m = keep_apart_m(ROBOT_RADIUS_M) + PAST_M
    for one, other in combinations(starts[2], 2):
        assert math.dist(one.xy, other.xy) >= apart_m
    for stop, corner in zip(starts[2], [*FIELD.polygon, FIELD.polygon[0]], strict=True):
        assert math.dist(stop.xy, corner) < 6.0
    spread = start_stops(FIELD, stops, MissionSettings(robots=2, position_sd_m=1.0))
    assert math.dist(*(stop.xy for stop in spread)) >= apart_m + 4.0
    with pytest.raises(InputError, match="3 robots cannot start on the field 'plot': only 2 of its 4 stops are"):
        start_stops(FIELD, stops[:4], MissionSettings(robots=3))


@pytest.mark.parametrize("travel", ["free", "graph"])
def test_simulator_and_planner_name_the_parts_of_a_divided_field(caplog, travel):
    ditch = np.array([[30, -5], [32, -5], [32, 65], [30, 65]], float)
    field = Field("ditch", FRAME, FIELD.polygon, (ditch,))
    travel_and_stops(field, field.grid(), RobotMotion(), MissionSettings(travel=travel))
    assert "2 parts that cannot be reached from each other (0.29 ha about (56, 30), 0.18 ha about" in caplog.text
    access = FieldAccess(field, RobotMotion(), None, AccessRules(robot_radius_m=0.75))
    assert "by a robot that keeps 0.75 m distance (0.27 ha about (56, 30), 0.17 ha about" in access.warning

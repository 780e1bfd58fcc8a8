# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Tracks of a file as a graph, and routes of a car that turns around only at ends and junctions."""

import json
from dataclasses import replace

import numpy as np
import pytest

from soilmoist_ros.exploration import AccessRules, FieldAccess, Outside, Way
from soilmoist_ros.exploration.travel.lanes import LaneTravel, read_lanes, read_travel_map
from soilmoist_ros.exploration.travel.travel import GraphTravel, RobotMotion, polyline_length_m
from soilmoist_ros.foundation import InputError, LocalFrame
from soilmoist_ros.mapping import Field

FRAME = LocalFrame(53.268, -0.5245)
FIELD = Field("farm", FRAME, np.array([(-10.0, -10.0), (210.0, -10.0), (210.0, 110.0), (-10.0, 110.0)]))
MOTION = RobotMotion(speed_mps=5.0, stop_overhead_s=0.0)
TRACKS = {  # a track from west to east, a branch to the north at its middle, and a loop there, driven clockwise
    "main": [(0, 0), (100, 0), (200, 0)],
    "branch": [(100.0, 1.2), (100, 60)],  # ends 1.2 m from the track
    "loop": [(100, 60), (100, 100), (160, 100), (160, 60), (100, 60)],
}
ONEWAY = {"loop": "yes"}


def written(path, tracks=TRACKS, oneway=ONEWAY):
    def degrees(corners):
        return [[lon, lat] for lat, lon in FRAME.to_geographic(corners).tolist()]

    features = [
        {"type": "Feature", "properties": {"name": name, "oneway": oneway.get(name, "no")},
         "geometry": {"type": "LineString", "coordinates": degrees(corners)}}
        for name, corners in tracks.items()
    ]  # fmt: skip
    path.write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    return path


@pytest.fixture
def lanes(tmp_path):
    return read_lanes(written(tmp_path / "tracks.geojson"), FIELD)


def at(graph, x, y):
    return graph.stops[int(np.argmin(np.hypot(*(graph.xy - (x, y)).T)))]


def test_lines_of_a_file_join_where_one_ends_near_another(lanes, tmp_path):
    assert (lanes.components() == 0).all()
    assert lanes.distance_m(at(lanes, 0, 0).name, at(lanes, 100, 60).name) == pytest.approx(160, abs=0.5)
    one_way = at(lanes, 100, 80).name, at(lanes, 160, 80).name
    assert lanes.distance_m(*one_way) == pytest.approx(100, abs=0.5)
    assert lanes.distance_m(*one_way[::-1]) == pytest.approx(100, abs=0.5)  # on around, not back
    assert lanes.length_m.max() <= 5.1
    with pytest.raises(InputError, match="no line in the field"):
        read_travel_map(written(tmp_path / "far.geojson", {"far": [(900, 900), (950, 900)]}), FIELD)
    crossing = {"a": [(0, 50), (200, 50)], "b": [(100, 0), (100, 100)]}
    graph = read_travel_map(written(tmp_path / "x.geojson", crossing), FIELD).graph
    assert graph.distance_m(at(graph, 0, 50).name, at(graph, 100, 100).name) == pytest.approx(150, abs=0.5)


def test_a_car_does_not_turn_around_on_a_lane(lanes):
    travel, anywhere = LaneTravel(lanes, MOTION), GraphTravel(lanes, MOTION)
    west, north = at(lanes, 0, 0), at(lanes, 100, 60)
    whole_m = lanes.distance_m(west.name, north.name)
    assert travel.lengths_m(np.array(west.xy), [north])[0] == pytest.approx(whole_m)
    behind, ahead, here = at(lanes, 20, 0), at(lanes, 80, 0), (50.0, 0.5)
    back_m, on_m = here[0] - behind.x_m + 0.5, ahead.x_m - here[0] + 0.5
    assert travel.lengths_m(np.array(here), [behind, ahead]) == pytest.approx([back_m, on_m], abs=0.1)
    for x in (0.0, 20.0, 40.0, 50.0):
        travel.moved((x, 0.5))
    # On to the branch, where it may turn, and back.
    assert travel.lengths_m(np.array(here), [behind, ahead]) == pytest.approx([back_m + 100, on_m], abs=0.1)
    way = travel.route(here, behind)
    assert way[:, 0].max() == pytest.approx(100)
    assert polyline_length_m(way) == pytest.approx(back_m + 100, abs=0.1)
    half = travel.along(here, [behind], np.array([[0.5]]))[0, 0]
    assert half == pytest.approx((100 - (back_m - 0.5) / 2, 0), abs=0.6)
    assert anywhere.lengths_m(np.array(here), [behind])[0] == pytest.approx(back_m, abs=1.5)
    # A stop that one has just rolled past needs no way around, and other places have no direction.
    assert travel.lengths_m(np.array(here), [at(lanes, 47, 0)])[0] < 6
    assert travel.lengths_m(np.array([150.0, 0.0]), [at(lanes, 130, 0)])[0] == pytest.approx(20, abs=2.5)


def test_limits_of_the_speed_count_on_every_way(lanes):
    west = np.where(lanes.xy[lanes.edges].max(axis=1)[:, 0] < 60, 2.5, np.inf)  # half as fast there
    limited = replace(lanes, limit_mps=west)
    travel, chosen = GraphTravel(limited, MOTION), np.arange(0, len(lanes.stops), 3)
    ends = [limited.stops[index] for index in chosen]
    each = [
        [travel.slower_m(travel.route(a.xy, b)) + travel.lengths_m(np.array(a.xy), [b])[0] for b in ends]
        for a in ends
    ]
    assert travel.between_s(limited.stops, chosen) * MOTION.speed_mps == pytest.approx(np.array(each))
    car = LaneTravel(limited, MOTION)
    for travelled in (travel, car):
        times = travelled.travel_s((0.0, 0.0), [at(limited, 50, 0), at(limited, 90, 0)])
        assert times * MOTION.speed_mps == pytest.approx([100, 150], abs=6)


def test_the_arrow_points_to_the_next_bend_of_the_lane(lanes):
    access = FieldAccess(FIELD, MOTION, lanes, AccessRules(outside=Outside.WAY, lanes=True))
    for x in (0.0, 20.0, 40.0):
        access.travel.moved((x, 0.0))
    stop = next(stop for stop in access.stops if stop.name == at(lanes, 100, 60).name)
    assert access.way((40.0, 0.0), stop).leads == pytest.approx((100, 0, 120), abs=1.3)
    assert access.way((95.0, 0.0), stop).leads == pytest.approx((100, 60, 65), abs=1.3)
    assert Way(np.array([(0.0, 0.0)])).leads == (0, 0, 0)

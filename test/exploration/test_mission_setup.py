"""From field and graph to what a mission needs."""

from itertools import pairwise

import numpy as np
import pytest

from soilmoist_ros.errors import InputError
from soilmoist_ros.exploration.mission_setup import Ways
from soilmoist_ros.exploration.strategy import Stop
from soilmoist_ros.exploration.travel import RobotMotion
from soilmoist_ros.exploration.travel_graph import TravelGraph
from soilmoist_ros.geodesy import LocalFrame
from soilmoist_ros.mapping.field import Field

SQUARE = np.array([[0, 0], [20, 0], [20, 20], [0, 20]], float)


def field(cell_m=2.0):
    return Field("square", LocalFrame(53.0, 0.0), SQUARE, (), cell_m)


def graph(*places):
    stops = [Stop(name, x, y) for name, x, y in places]
    names = [stop.name for stop in stops]
    return TravelGraph.from_edges(stops, [*pairwise(names), *pairwise(names[::-1])])


def test_only_nodes_in_the_field_are_measured_at_but_others_are_home_and_way():
    ways = Ways(field(), RobotMotion(), graph(("shed", -9.0, 0.0), ("edge", -1.0, 5.0), ("in", 5.0, 5.0)), 2.0)
    assert [stop.name for stop in ways.stops] == ["edge", "in"]
    assert ways.stop("shed") == Stop("shed", -9.0, 0.0)
    assert np.isfinite(ways.travel.travel_s((-9.0, 0.0), ways.stops)).all()


def test_a_map_of_another_place():
    with pytest.raises(InputError, match=r"no node .* x 900 \.\. 905 m, .* check the datum"):
        Ways(field(), RobotMotion(), graph(("a", 900.0, 5.0), ("b", 905.0, 5.0)))


def test_free_ways_have_a_stop_for_each_cell():
    ways = Ways(field(), RobotMotion(), None)
    assert len(ways.stops) == 100
    with pytest.raises(InputError, match="did you mean 'r0c"):
        ways.stop("r0c")


def test_a_field_too_fine():
    with pytest.raises(InputError, match="change its cell_m"):
        Ways(field(1e-4), RobotMotion(), None)

# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The access to a field follows its graph, cells, home and the robot; an error leaves it as it is."""

from dataclasses import replace

import pytest
from test_access import FIELD, MAP, PLACES, RADIUS, graph

from soilmoist_ros.exploration.control.field_access import CurrentAccess
from soilmoist_ros.exploration.travel.travel import RobotMotion
from soilmoist_ros.foundation.errors import InputError


class Around:
    """An access, and what was used."""

    def __init__(self, home=""):
        self.home, self.used = home, []
        self.current = CurrentAccess(FIELD, RobotMotion(), RADIUS, lambda: self.home, self.used.append)


def test_a_map_that_cannot_be_used_is_named_and_changes_nothing():
    around = Around(home="a")
    assert "the map of the navigation" in around.current.waiting_for
    with pytest.raises(InputError, match="there is no stop 'a'"):
        around.current.use_graph(graph({"t": (30, 6), "u": (50, 6)}, "t u"))
    assert "there is no stop 'a'" in around.current.waiting_for
    assert (around.current.access, around.used) == (None, [])
    around.current.use_graph(MAP)
    around.home = "barn"
    with pytest.raises(InputError, match="there is no stop 'barn'"):
        around.current.use_home(None)
    assert around.used == [around.current.access]


def test_cells_of_the_map_are_kept_until_another_field_is_used():
    around = Around()
    around.current.use_cells(8.0)
    around.current.use_graph(None)
    around.current.use_cells(8.0)
    assert [access.grid.cell_m for access in around.used] == [8.0]
    use = around.current.opened(replace(FIELD, no_go=()), None)
    assert len(around.used) == 1
    use()
    assert [access.grid.cell_m for access in around.used] == [8.0, 4.0]


def test_the_part_of_the_map_is_looked_for_again_only_after_a_move():
    around = Around()
    around.current.use_graph(graph({**PLACES, "i": (3, 36), "j": (14, 36)}, "a s t u b", "i j"))
    around.current.moved((4.0, 35.0), 3.0)
    around.current.moved((5.0, 35.0), 3.0)
    assert [len(access.stops) for access in around.used] == [5, 2]
    around.current.moved((30.0, 5.0), 3.0)
    assert [len(access.stops) for access in around.used] == [5, 2, 5]


def test_a_map_that_comes_while_a_mission_is_paused_is_used_where_the_robot_stands():
    around = Around()
    parts = graph({**PLACES, "i": (3, 36), "j": (14, 36)}, "a s t u b", "i j")
    around.current.use_graph(parts, (4.0, 35.0))
    assert [stop.name for stop in around.current.access.stops] == ["i", "j"]

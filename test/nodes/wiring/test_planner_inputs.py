# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What the planner takes from the messages of the mapper and of the navigation."""

import copy
import json
from datetime import datetime
from types import SimpleNamespace
from unittest.mock import MagicMock

import numpy as np
import pytest

pytest.importorskip("rclpy")

from msg_adapters.model import Model, model_to_message
from soilmoist_ros.exploration.control.field_access import AccessRules, CurrentAccess
from soilmoist_ros.exploration.guard.robot_frames import FIELD, MAP, FrameSettings, RobotFrames
from soilmoist_ros.exploration.guard.watch import Doing, Watch
from soilmoist_ros.exploration.travel.stop import Stop
from soilmoist_ros.exploration.travel.topological_map import make_topological_map
from soilmoist_ros.exploration.travel.travel import RobotMotion
from soilmoist_ros.exploration.travel.travel_graph import TravelGraph
from soilmoist_ros.foundation.geodesy import LocalFrame
from soilmoist_ros.mapping.field import Field
from soilmoist_ros.mapping.knowledge.drift import Change, Changing, Drift, TimedSamples
from soilmoist_ros.mapping.samples.samples import as_samples
from soilmoist_ros.mapping.variogram.fit import estimate_variogram
from soilmoist_ros.nodes.wiring.planner_inputs import PlannerInputs

SAMPLES = as_samples([(2.0, 2.0), (10.0, 5.0), (18.0, 18.0)], [50, 60, 40], [10.0, 10.0, 10.0])
FIT = estimate_variogram(SAMPLES.xy, SAMPLES.counts, SAMPLES.exposure_s, extent_m=20.0)


@pytest.mark.parametrize("drift", [None, Drift(0.9, False, (0.0, 90.0), (-0.1, 0.0), ((0.02, 0.0),))])
def test_the_drift_of_a_model_reaches_the_control(drift):
    node, control = MagicMock(), MagicMock()
    PlannerInputs(node, control, MagicMock(), map_topic="")
    receive = {call.args[1]: call.args[2] for call in node.create_subscription.call_args_list}
    times_s = np.array([0.0, 40.0, 80.0])
    changing = None if drift is None else Changing(TimedSamples(SAMPLES, times_s), Change(drift), 90.0)
    receive["model"](model_to_message(Model(FIT, 90.0, 2.0, changing)))
    fit, stamp_s, name, cell_m, found = control.fit.call_args.args
    assert (fit.variogram, stamp_s, name, cell_m) == (FIT.variogram, 90.0, "", 2.0)
    assert (None if found is None else found.change.drift) == drift


MEADOW = Field("meadow", LocalFrame(53.0, 0.0), np.array([[0, 0], [60, 0], [60, 40], [0, 40]], float), cell_m=4.0)
ROW = TravelGraph.from_edges([Stop("a", 5, 5), Stop("b", 50, 5)], [("a", "b"), ("b", "a")])


class MapOfTheNavigation:
    """The planner's inputs, of which a test publishes the map of a navigation that chooses the way itself."""

    def __init__(self, datum):
        self._access = CurrentAccess(MEADOW, RobotMotion(), AccessRules(), lambda: "", lambda access: None)
        self.watch, self._now_s = Watch(), 0.0
        robot = RobotFrames(MEADOW, FrameSettings(datum=datum))
        frames = SimpleNamespace(robot=robot, tick=lambda: robot.fault)
        node, control = MagicMock(), MagicMock(watch=self.watch, takes_graph=True)
        control.use_graph.side_effect = self._access.use_graph
        self._inputs = PlannerInputs(node, control, frames, "topological_map_2", by_name=True)
        receive = {call.args[1]: call.args[2] for call in node.create_subscription.call_args_list}
        self._receive = receive["topological_map_2"]

    def causes(self, document):
        """Causes that are on a minute after a map has come."""
        self._receive(SimpleNamespace(data=json.dumps(document)))
        for _ in range(60):
            self._now_s += 1.0
            self._inputs.tick()
            self.watch.check(self._now_s, Doing())
        return {str(cause) for cause in self.watch.on}

    @property
    def xy(self):
        return self._access.access.travel.graph.xy.tolist()


def document(latitude=53.0):
    found = copy.deepcopy(make_topological_map(ROW, "row", datetime(2026, 1, 1)).document)
    found["meta"] |= {"datum_latitude": latitude, "datum_longitude": 0.0}
    return found


@pytest.mark.parametrize("datum", [FIELD, MAP])
def test_a_map_of_another_datum_is_forgotten_when_the_right_one_is_back(datum):
    navigation = MapOfTheNavigation(datum)
    assert navigation.causes(document()) == set()
    elsewhere = document(53.0009)
    for entry in elsewhere["nodes"]:
        entry["node"]["pose"]["position"]["y"] -= 500.0
    assert navigation.causes(elsewhere) == {"frame_mismatch", "map_changed"}
    assert navigation.causes(document()) == set()


def test_a_map_in_another_frame_holds_the_robot_until_the_right_one_is_back():
    navigation = MapOfTheNavigation(FIELD)
    elsewhere = document()
    elsewhere["transformation"]["parent"] = "odom"
    for entry in elsewhere["nodes"]:
        entry["node"].pop("parent_frame")
    assert navigation.causes(document()) == set()
    assert navigation.causes(elsewhere) == {"frame_mismatch"}
    assert navigation.causes(document()) == set()


def test_a_map_that_cannot_be_read_is_another_map():
    navigation = MapOfTheNavigation(FIELD)
    assert navigation.causes(document()) == set()
    broken = document()
    broken["nodes"][0]["node"]["edges"][0]["node"] = "z"
    assert navigation.causes(broken) == {"map_changed"}
    assert navigation.causes(document()) == set()
    assert navigation.causes(broken) == {"map_changed"}
    longer = document()
    longer["nodes"][1]["node"]["pose"]["position"]["x"] = 55.0
    assert navigation.causes(longer) == set()
    assert navigation.xy == [[5, 5], [55, 5]]

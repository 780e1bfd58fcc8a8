# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The datum of a navigation from the robot's datum service; its type is imported at run time, and a fake here."""

import sys
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("rclpy")
from rclpy.task import Future

from soilmoist_ros.foundation.geodesy import LocalFrame
from soilmoist_ros.foundation.plane_move import move_between
from soilmoist_ros.mapping.field import Field
from soilmoist_ros.nodes.planner_inputs import PlannerFrames

FIELD = Field("test", LocalFrame(52.0, 13.0), np.array([(0.0, 0.0), (60.0, 0.0), (60.0, 40.0), (0.0, 40.0)]))
DATUM = LocalFrame(52.001, 13.002)


class ToLL(metaclass=type("Metaclass", (type,), {"_TYPE_SUPPORT": "there"})):
    """Like robot_localization/srv/ToLL."""

    def __init__(self):
        self.there, self.questions, self.forgotten = False, [], 0

    class Request:
        def __init__(self, map_point):
            self.map_point = map_point

    def service_is_ready(self):
        return self.there

    def call_async(self, question):
        future = Future()
        self.questions.append((question, future))
        return future

    def remove_pending_request(self, _future):
        self.forgotten += 1

    def answer(self):
        for question, future in self.questions:
            latitude, longitude = DATUM.to_geographic([(question.map_point.x, question.map_point.y)])[0]
            future.set_result(SimpleNamespace(ll_point=SimpleNamespace(latitude=latitude, longitude=longitude)))
        self.questions.clear()


class Values:
    """Parameters of a planner."""

    def __init__(self):
        self.values = {"frame": "field", "navigation_frame": "map", "base_frame": "base_link",
                       "navigation_datum": "robot", "datum_service": "toLL", "frame_limit_m": 2.0}  # fmt: skip

    def text(self, name):
        return self.values[name]

    number = text

    def as_dict(self):
        return self.values


@pytest.fixture
def planner(monkeypatch):
    """Frames of a planner, its datum service, and its warnings."""
    service, warnings = ToLL(), []
    node = SimpleNamespace(
        create_publisher=lambda *_: None,
        create_client=lambda _kind, name: service if name == "toLL" else None,
        get_logger=lambda: SimpleNamespace(warning=warnings.append),
        get_clock=lambda: SimpleNamespace(now=lambda: SimpleNamespace(nanoseconds=10**9)),
    )
    monkeypatch.setitem(sys.modules, "tf2_msgs.msg", None)  # not installed
    return node, service, warnings


def test_the_service_is_asked_until_it_answers(planner, monkeypatch):
    node, service, _ = planner
    monkeypatch.setitem(sys.modules, "robot_localization.srv", SimpleNamespace(ToLL=ToLL))
    frames = PlannerFrames(node, Values(), FIELD)
    assert frames.tick() == ""
    assert not service.questions
    service.there = True
    frames.tick()
    frames.tick()
    assert len(service.questions) == 3, "one set of questions at a time"
    monkeypatch.setattr("soilmoist_ros.nodes.planner_inputs.ASK_AGAIN_S", -1.0)
    frames.tick()
    assert service.forgotten == 3
    monkeypatch.undo()
    service.answer()
    frames.tick()
    wanted = move_between(FIELD.frame, DATUM, about_m=(30.0, 20.0))
    assert frames.robot.move.place((30.0, 20.0)) == pytest.approx(wanted.place((30.0, 20.0)), abs=0.01)
    frames.tick()
    assert not service.questions, "what is known is not asked again"


def test_without_its_type_the_datum_comes_from_a_drive(planner, monkeypatch):
    node, _, warnings = planner
    monkeypatch.setitem(sys.modules, "robot_localization.srv", None)
    frames = PlannerFrames(node, Values(), FIELD)
    frames.tick()
    assert any("robot_localization/srv/ToLL is not installed" in each for each in warnings)
    assert any("the frames are not checked: tf2_msgs is not installed" in each for each in warnings)
    assert "driven by hand" in frames.robot.waiting_for

# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The monitor keeps a live mission up to date."""

import numpy as np
import pytest

pytest.importorskip("rclpy")
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.executors import SingleThreadedExecutor
from sensor_msgs.msg import NavSatFix, NavSatStatus, PointCloud2

from msg_adapters.mission import mission_to_message
from msg_adapters.samples import samples_to_message
from msg_adapters.soil_map import soil_map_to_message
from soilmoist_ros.exploration.mission.types import MissionStatus, Phase
from soilmoist_ros.exploration.travel.stop import Stop
from soilmoist_ros.mapping import Samples
from soilmoist_ros.nodes.runtime import qos
from soilmoist_ros.nodes.system.monitor import Monitor
from soilmoist_ros.pipeline.field_survey import open_survey
from soilmoist_ros.reporting.live.live_mission import LiveMap, LiveMission
from soilmoist_ros.sensing.records import CountRecord

STATUS = MissionStatus(
    1e9,
    Phase.COUNTING,
    "because",
    Stop("s1", 3.0, 4.0),
    60.0,
    10.0,
    0.1,
    100.0,
    500.0,
    42.0,
    2,
    70.0,
    99,
    0,
    (),
    1e9,
)


@pytest.fixture
def live(ros):
    """A live mission and its monitor; errors in callbacks end the monitor, as in the demo."""
    survey = open_survey("example")
    found = LiveMission("test", [LiveMap(), LiveMap("salt", np.full(survey.map.grid.mask.shape, 4.0))])
    executor = SingleThreadedExecutor(context=ros.context)
    monitor = Monitor(found, survey.field.frame, ros.context)
    executor.add_node(monitor)
    found.spin = lambda condition: ros.wait_for(lambda: (executor.spin_once(timeout_sec=0.02), condition())[1])
    found.survey, found.monitor = survey, monitor
    yield found
    executor.shutdown(timeout_sec=2)
    monitor.destroy_node()


def publisher(ros, kind, topic, profile=qos.LATCHED):
    return ros.node.create_publisher(kind, topic, profile)


def test_it_shows_every_topic(ros, live):
    survey = live.survey
    for number in range(4):
        survey.map.add(CountRecord(1e9 + number, 10.0 * number + 5, 20.0, 30.0, 400, 100.0, 95.0))
    soil_map = survey.map.compute(survey.map.state)
    publisher(ros, DiagnosticStatus, "mission").publish(mission_to_message(STATUS))
    publisher(ros, PointCloud2, "samples").publish(samples_to_message(survey.map.state.samples, 1e9))
    publisher(ros, PointCloud2, "soil_map").publish(soil_map_to_message(survey.map.grid, soil_map, 1e9))
    publisher(ros, PointCloud2, "salt/soil_map").publish(soil_map_to_message(survey.map.grid, soil_map, 1e9))
    latitude, longitude = survey.field.frame.to_geographic([(12.0, 34.0)])[0].tolist()
    fixes = publisher(ros, NavSatFix, "fix", qos.SENSOR)
    fix = NavSatFix(status=NavSatStatus(status=0), latitude=latitude, longitude=longitude)

    (robot,) = live.robots

    def complete():
        fixes.publish(fix)
        return robot.status and len(live.samples_xy) and len(live.view().bands) == 2 and robot.xy

    live.spin(complete)
    assert live.robots[0].xy == pytest.approx((12.0, 34.0), abs=1e-6)
    assert live.robots[0].state == "counting: because"
    view = live.view()
    assert view.targets_xy == [(3.0, 4.0)]
    np.testing.assert_allclose(view.samples_xy, survey.map.state.samples.xy)
    assert view.bands[0].extent == pytest.approx((0, 60, 0, 50), abs=0.6)
    assert "mean squared error salt" in view.facts["map"]
    fix.status.status = -1
    fix.latitude = 0.0
    seen = live.robots[0].xy
    live.robots[0].status = {}
    publisher(ros, DiagnosticStatus, "mission").publish(mission_to_message(STATUS))
    for _ in range(5):
        fixes.publish(fix)
    live.spin(lambda: live.robots[0].status)
    assert live.robots[0].xy == seen


def test_messages_of_others_do_no_harm(live):
    """The test calls the callbacks, since a latched topic may replace a message before delivery."""
    live.monitor._on_samples(samples_to_message(Samples(np.zeros((1, 2)), [3.0], [1.0]), 1e9))
    live.monitor._on_mission(live.robots[0], DiagnosticStatus(message="of another robot"))
    live.monitor._on_map(live.maps[0], PointCloud2(height=2, width=3))
    live.monitor._on_samples(PointCloud2())
    live.monitor._on_fix(live.robots[0], NavSatFix(status=NavSatStatus(status=0), latitude=np.nan, longitude=0.0))
    assert live.robots[0].status == {}
    assert live.view().bands == []
    assert len(live.samples_xy) == 1

# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Failsafes with a real planner process: those whose fault is in messages that only the node hears.

One planner goes through all of them, in the order of the tests; the last one ends its mission. The others
are tried with the mission's control, see test_watching.
"""

import contextlib
import json
import math

import numpy as np
import pytest

pytest.importorskip("rclpy")
pytest.importorskip("topological_navigation_msgs")
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.action import ActionClient
from real_nodes import ALL
from ros_system import RosSystem
from sensor_msgs.msg import BatteryState, PointCloud2
from soilmoist_msgs.msg import Visit
from std_msgs.msg import String
from std_srvs.srv import Trigger
from topological_navigation_msgs.action import GotoNode
from virtual_navigation import FIELD, STOPS, VirtualNavigation, World, make_map

from msg_adapters import diagnostics_from_message, mission_from_message, quarantined_to_message
from soilmoist_ros.exploration import Cause, MissionEnd, Phase
from soilmoist_ros.nodes.topics import RECORDS, SENSOR, VISITS
from soilmoist_ros.sensing.records import CountRecord

pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")]
LIMIT_S = 120.0
RATE = 10.0


class FaultyWorld(World):
    """A world whose sensor and battery have faults."""

    def __init__(self, ros):
        super().__init__(ros, rate=RATE)
        self.batteries = self.node.create_publisher(BatteryState, "battery_state", SENSOR)
        self.quarantined = self.node.create_publisher(PointCloud2, "quarantined_counts", RECORDS)
        self.quarantine = ""
        self.noise = np.random.default_rng(1)
        self.charge, self.has_battery = 0.9, True

    def publish_fix(self):
        if self.has_battery:
            self.batteries.publish(BatteryState(present=True, percentage=self.charge))
        true = self.place
        noise_m = self.noise.normal(0.0, 0.02, 2)  # without noise, a robot that stands has a frozen receiver
        self.place = (true[0] + float(noise_m[0]), true[1] + float(noise_m[1]))
        super().publish_fix()
        self.place = true

    def publish_record(self):
        if self.quarantine:
            record = CountRecord(self.now_s, *self.place, 0.0, 40, 10.0, 10.0, quarantine=self.quarantine)
            self.quarantined.publish(quarantined_to_message([record]))
        else:
            super().publish_record()


def alarms_of(message):
    values = {pair.key: pair.value for pair in message.values}
    return set(json.loads(values.get("alarms", "{}")))


class Watched:
    """The planner, its world, its navigation and what it reports."""

    def __init__(self, ros, folder):
        self.ros, self.stack, self.begin = ros, contextlib.ExitStack(), 0
        (folder / "field.yaml").write_text(FIELD)
        self.said = ros.collect(DiagnosticStatus, "mission", ALL)  # an alarm may be short
        self.found = ros.collect(DiagnosticArray, "/diagnostics", 10)
        self.world = self.stack.enter_context(FaultyWorld(ros))
        self.navigation = VirtualNavigation(ros, self.world)
        self.navigation.__enter__()
        given = {
            "use_sim_time": True, "field": str(folder / "field.yaml"), "dwell": "fmi:900", "hours": 10.0,
            "strategy": "random", "home": "n00", "speed_mps": 1.0, "arrival_radius_m": 2.0, "autostart": True,
            "battery_low": 0.06, "battery_empty": 0.05, "map_old_s": 40.0,
        }  # fmt: skip
        self.process = ros.start("planner", params=given)

    def close(self):
        self.navigation.__exit__()
        self.stack.close()

    @property
    def status(self):
        return mission_from_message(self.said[-1])

    @property
    def alarms(self):
        return alarms_of(self.said[-1]) if self.said else set()

    @property
    def health(self):
        parts = [part for message in self.found[-3:] for part in diagnostics_from_message(message)]
        return next((part for part in reversed(parts) if part.name == "/planner: guard"), None)

    def wait(self, condition, message):
        self.ros.wait_for(lambda: self.said and condition(), LIMIT_S, message)

    def alarm(self, cause):
        """Wait for an alarm, in the mission and in the diagnostics; it may be over by then."""
        self.wait(
            lambda: any(cause in alarms_of(message) for message in self.said[self.begin :]), f"alarm {cause}"
        )
        self.wait(
            lambda: self.health is not None and "so far" in self.health.values[cause], f"diagnostics of {cause}"
        )

    def stands(self, *phases):
        self.wait(lambda: self.status.phase in phases, f"one of {phases}")
        self.ros.wait_for(lambda: self.world.goal is None, LIMIT_S, "standstill")

    def all_over(self):
        self.wait(lambda: not self.alarms, "no alarm")

    def works(self, *phases):
        phases = phases or (Phase.TRAVELLING, Phase.COUNTING)
        self.wait(lambda: self.status.phase in phases, f"one of {phases}")

    def call(self, verb):
        return self.ros.call(Trigger, f"planner/{verb}")

    def resumes(self):
        """Resume, if the mission has paused."""

        def works():
            if self.status.phase is Phase.PAUSED and not self.alarms:
                self.call("resume")
            return self.status.phase in (Phase.TRAVELLING, Phase.COUNTING)

        self.all_over()
        self.ros.wait_for(works, LIMIT_S, "resume", every=0.1)


@pytest.fixture(scope="module")
def watched(tmp_path_factory):
    folder = tmp_path_factory.mktemp("failsafes")
    with RosSystem(folder) as ros:
        system = Watched(ros, folder)
        try:
            system.works(Phase.COUNTING)
            yield system
        finally:
            system.close()


PLAIN = {  # what is wrong in the world, and whether it stops the robot
    Cause.MAP_OLD: ({"mapper": False}, False),
    Cause.COUNTS_STAMP: ({"stamped_ahead_s": 5000.0}, False),
    Cause.COUNTS_BAD: ({"quarantine": "noisy_tube"}, True),
    Cause.BATTERY_SILENT: ({"has_battery": False}, False),
}


def plain(cause):
    def check(watched):
        wrong, stops = PLAIN[cause]
        right = {name: getattr(watched.world, name) for name in wrong}
        vars(watched.world).update(wrong)
        watched.alarm(cause)
        if stops:
            watched.stands(Phase.PAUSED)
        vars(watched.world).update(right)
        watched.resumes()

    check.__name__ = cause.value
    return check


def navigation_silent(watched):
    watched.ros.wait_for(lambda: watched.call("skip").success, LIMIT_S, "skip")
    watched.works(Phase.TRAVELLING)
    watched.navigation.die()
    watched.alarm(Cause.NAVIGATION_SILENT)
    watched.navigation = VirtualNavigation(watched.ros, watched.world)
    watched.navigation.__enter__()
    watched.world.goal = None
    watched.all_over()
    watched.works()


def other_client(watched):
    """An operator's panel sends the robot away while it counts; its goal is left alone."""
    watched.works(Phase.COUNTING)
    watched.wait(lambda: watched.status.raw_counts > 0, "a record of the stop")
    ends, visits = len(watched.navigation.ends), watched.ros.collect(Visit, "visits", VISITS)
    panel = ActionClient(watched.ros.node, GotoNode, "topological_navigation")
    watched.ros.wait_for(panel.server_is_ready)
    far = max(STOPS, key=lambda stop: math.dist(watched.world.place, (stop.x_m, stop.y_m)))
    panel.send_goal_async(GotoNode.Goal(target=far.name))
    watched.alarm(Cause.OTHER_CLIENT)
    watched.stands(Phase.PAUSED)
    assert not watched.call("resume").success
    watched.ros.wait_for(lambda: watched.navigation.ends[ends:] == ["succeeded"], LIMIT_S, "the panel's goal")
    assert watched.world.place == (far.x_m, far.y_m)
    watched.resumes()
    watched.ros.wait_for(lambda: visits and visits[-1].reason_code == "moved", LIMIT_S, "the visit")
    panel.destroy()


def map_changed(watched):
    """The planner takes over the new map while the robot stands, so that the mission can go on."""
    maps = [make_map(), make_map(without=("n00", "n01"))]
    watched.world.maps.publish(String(data=maps[0].to_json()))  # the same again
    watched.world.maps.publish(String(data=maps[1].to_json()))
    watched.alarm(Cause.MAP_CHANGED)
    watched.stands(Phase.PAUSED)
    watched.resumes()
    watched.world.maps.publish(String(data=maps[0].to_json().replace("n00", "elsewhere")))
    watched.stands(Phase.PAUSED)
    watched.wait(lambda: "there is no stop 'n00'" in watched.process.output(), "the home is missed")
    assert not watched.call("resume").success
    watched.world.maps.publish(String(data=maps[1].to_json()))  # the map is back
    watched.resumes()


def battery_low(watched):
    """The mission ends; then the battery is charged, and another one begins."""
    watched.world.charge = 0.055
    watched.alarm(Cause.BATTERY_LOW)
    watched.stands(Phase.FINISHED)
    assert watched.status.ended is MissionEnd.FAILSAFE
    watched.world.charge = 0.9
    watched.all_over()
    watched.ros.wait_for(lambda: watched.call("start").success, LIMIT_S, "another mission")
    watched.works(Phase.COUNTING)


CAUSES = (*map(plain, PLAIN), navigation_silent, other_client, map_changed, battery_low)


@pytest.mark.parametrize("cause", CAUSES, ids=lambda cause: cause.__name__)
def test_failsafe(watched, cause):
    watched.all_over()
    watched.begin = len(watched.said)
    cause(watched)
    assert watched.process.running

# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What a planner doubts about the place reaches driver and mapper, with real processes."""

import math

import numpy as np
import pytest

pytest.importorskip("rclpy")
pytest.importorskip("topological_navigation_msgs")
from diagnostic_msgs.msg import DiagnosticStatus
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import String
from virtual_navigation import FIELD, VirtualNavigation, World

from msg_adapters.counts import samples_from_message
from msg_adapters.mission import mission_from_message
from soilmoist_ros.exploration.mission.types import Phase
from soilmoist_ros.nodes.topics import LATCHED, VISITS
from soilmoist_ros.sensing.position.place_doubt import DOUBTS, Doubt, Outcome

pytestmark = pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")


class Jumping(World):
    """A world whose receiver jumps."""

    away_m = 0.0

    def publish_fix(self):
        self.shifted(super().publish_fix)

    def publish_record(self):
        self.shifted(super().publish_record)

    def shifted(self, publish):
        true = self.place
        self.place = true[0] + self.away_m, true[1]
        publish()
        self.place = true


@pytest.mark.parametrize("comes_back", [True, False])
def test_no_record_is_mapped_where_the_robot_was_not(ros, tmp_path, comes_back):
    (tmp_path / "field.yaml").write_text(FIELD)
    given = {"use_sim_time": True, "field": str(tmp_path / "field.yaml")}
    doubts = ros.collect(String, DOUBTS, VISITS)
    samples = ros.collect(PointCloud2, "samples", LATCHED)
    said = ros.collect(DiagnosticStatus, "mission", LATCHED)
    ros.start("mapper", params={**given, "save_dir": str(tmp_path / "saved")})
    mission = {"dwell": "fmi:900", "hours": 2.0, "speed_mps": 1.0, "arrival_radius_m": 2.0, "autostart": True}
    with Jumping(ros, rate=10.0, mapper=False) as world, VirtualNavigation(ros, world):
        ros.start("planner", params={**given, **mission, "fix_frozen_s": 0.0, "strategy": "random", "home": "n00"})

        def wait(condition, message):
            ros.wait_for(lambda: said and condition(mission_from_message(said[-1])), message=message)

        def after(seconds):
            until_s = world.now_s + seconds
            ros.wait_for(lambda: world.now_s >= until_s, message="time")

        wait(lambda status: status.phase is Phase.COUNTING, "counting")
        stop = world.place
        after(60.0)
        world.away_m = 8.0
        after(30.0)
        none, begun = (Doubt.from_text(message.data) for message in doubts)
        assert none.until_s == 0.0, "what an earlier planner doubted is over"
        assert begun.outcome is Outcome.OPEN
        if comes_back:
            world.away_m = 0.0
            ros.wait_for(lambda: len(doubts) == 3, message="the end of the doubt")
            ended = Doubt.from_text(doubts[-1].data)
            assert (ended.since_s, ended.outcome) == (begun.since_s, Outcome.RETURNED)
            assert math.dist((ended.x_m, ended.y_m), stop) < 0.5
        else:
            wait(lambda status: status.phase is Phase.PAUSED and status.needs_operator, "a wait for people")
        after(30.0)
        mapped = samples_from_message(samples[-1])
        places = np.atleast_2d(mapped.xy)
        assert not len(places) or np.hypot(*(places - [stop[0] + 8.0, stop[1]]).T).min() > 3.0
        near = np.hypot(*(places - stop).T) < 1.0
        seconds = mapped.exposure_s[near].sum()
        assert (seconds >= 100.0) if comes_back else (40.0 <= seconds <= 70.0)

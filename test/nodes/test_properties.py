# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A planner and two mappers: unmapped parts of a further property change the choice of stops."""

import pytest

pytest.importorskip("rclpy")
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import PoseStamped
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import String
from std_srvs.srv import Trigger
from virtual_navigation import FIELD, START_S, World

from msg_adapters.counts import counts_to_message
from msg_adapters.mission import mission_from_message
from msg_adapters.model import model_from_message
from soilmoist_ros.nodes.topics import LATCHED, RECORDS
from soilmoist_ros.sensing.records import CountRecord

CORNERS = [(x, y) for x in (4.0, 12.0, 20.0, 28.0, 36.0) for y in (5.0, 15.0, 25.0)]
AGO_S = 1000.0


def record(number, place, rate_cps):
    return CountRecord(
        stamp_s=START_S - AGO_S + 10.0 * number, x_m=place[0], y_m=place[1], z_m=0.0,
        raw_counts=round(100 * rate_cps), exposure_s=100.0, effective_exposure_s=100.0, f_pressure=1.0,
        f_humidity=1.0, f_intensity=1.0,
    )  # fmt: skip


def test_planner_and_mapper_have_one_grid(ros, tmp_path):
    """The mapper overrides the 2 m cells of the field file; the planner's stops are the mapper's cells."""
    (tmp_path / "field.yaml").write_text(FIELD)
    common = {"use_sim_time": True, "field": str(tmp_path / "field.yaml")}
    models = ros.collect(String, "model", LATCHED)
    missions = ros.collect(DiagnosticStatus, "mission", LATCHED)
    ros.collect(PoseStamped, "goal_pose")
    ros.start("mapper", params={**common, "cell_m": 5.0})
    ros.wait_for(lambda: bool(models), message="the cell size before the first map")
    assert model_from_message(models[-1]).cell_m == 5.0
    with World(ros, mapper=False) as world:
        world.place = (20.0, 15.0)
        ros.start("planner", params={**common, "strategy": "random", "navigator": "goal_pose", "graph": "free"})
        ros.wait_for(lambda: len(missions) > 2, message="the planner's status")
        ros.wait_for(lambda: ros.call(Trigger, "planner/start").success)
        stop = ros.wait_for(lambda: mission_from_message(missions[-1]).target, message="the first stop")
    assert (stop.x_m % 5.0, stop.y_m % 5.0) == (2.5, 2.5)


def test_unknown_parts_of_a_further_property_change_the_choice(ros, tmp_path):
    (tmp_path / "field.yaml").write_text(FIELD)
    common = {"use_sim_time": True, "field": str(tmp_path / "field.yaml")}
    diagnostics = ros.collect(DiagnosticArray, "/diagnostics", 10)
    missions = ros.collect(DiagnosticStatus, "mission", LATCHED)
    ros.collect(PoseStamped, "goal_pose")  # a subscriber receives the goals, but nothing drives

    def feed(namespace, places, level_cps):
        """Start a mapper, let it map records of the past, and wait for the map."""
        found = ros.collect(String, f"{namespace}/model", LATCHED)
        samples = ros.collect(PointCloud2, f"{namespace}/samples", LATCHED)
        save_dir = str(tmp_path / f"map{namespace.strip('/')}")
        ros.start("mapper", params={**common, "save_dir": save_dir}, namespace=namespace)
        publisher = ros.node.create_publisher(PointCloud2, f"{namespace}/counts", RECORDS)
        listeners = 2 if namespace else 1  # the planner saves records of a further property
        ros.wait_for(lambda: publisher.get_subscription_count() >= listeners, message="the mapper")
        records = [record(n, place, level_cps * (1 + place[0] / 80)) for n, place in enumerate(places)]
        publisher.publish(counts_to_message(records))
        ros.wait_for(
            lambda: samples and samples[-1].width * samples[-1].height >= len(places), message="the samples"
        )
        ros.wait_for(lambda: found and model_from_message(found[-1]).fit is not None, message="the model")

    def health(part):
        said = [status for array in list(diagnostics) for status in array.status]
        return [status.message for status in said if status.name == f"/planner: {part}"]

    def newest_parts():
        """Parts that the planner names in its newest message."""
        said = [[status.name for status in array.status] for array in list(diagnostics)]
        newest = [names for names in said if "/planner: navigation" in names][-1]
        return {name.removeprefix("/planner: ") for name in newest}

    def chosen():
        """Start missions until the map guides the first stop: the map may arrive a moment after the planner."""
        while True:
            missions.clear()
            ros.wait_for(lambda: ros.call(Trigger, "planner/start").success)
            ros.wait_for(
                lambda: any("most variance" in m.message or "middle" in m.message for m in list(missions))
            )
            found = [m for m in list(missions) if "most variance" in m.message]
            stop = mission_from_message(found[0]).target if found else None
            assert ros.call(Trigger, "planner/abort").success
            if stop is not None:
                return stop

    feed("", [place for place in CORNERS if place[0] > 10 or place[1] > 10], 4.0)
    with World(ros, mapper=False, rate=5.0) as world:
        world.place = (20.0, 15.0)
        ros.start(
            "planner",
            params={**common, "strategy": "ivr", "navigator": "goal_pose", "graph": "free",
                    "properties": ["compaction:3"], "hours": 2.0},
        )  # fmt: skip
        ros.wait_for(lambda: "no map of compaction: stops are chosen without it" in health("properties"))
        alone = chosen()
        assert alone.x_m < 15.0, "the south-west is unknown"
        feed("/compaction", [place for place in CORNERS if place[0] < 25], 40.0)
        ros.wait_for(lambda: "properties" not in newest_parts(), message="the other map")
        assert chosen().x_m > 25.0, "the further property is unknown in the east"
        assert ros.call(Trigger, "compaction/mapper/save").success
    assert (tmp_path / "mapcompaction").is_dir()

# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A bag played to real nodes: the nodes act as during the recording."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

pytest.importorskip("rclpy")
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.serialization import serialize_message
from ros_system import NodeProcess
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import String

from msg_adapters.counts import counts_from_message
from msg_adapters.mission import mission_to_message
from msg_adapters.point_cloud import to_seconds, to_time
from msg_adapters.soil_map import soil_map_from_message
from soilmoist_ros.exploration import MissionStatus, Phase, Stop
from soilmoist_ros.mapping import map_cells
from soilmoist_ros.nodes.command_nodes import NodeMonitor
from soilmoist_ros.nodes.topics import CLOCK, LATCHED, RECORDS, published_qos
from soilmoist_ros.pipeline import replay_bag
from soilmoist_ros.recording import BagReader, BagWriter, Qos, Topic, find_definition, read_parameters
from soilmoist_ros.reporting.live_view import LiveMission

GOLDEN = Path(__file__).resolve().parents[1] / "golden"
START_S = 1.78e9
EVERY_CLOCK = QoSProfile(depth=1000, reliability=ReliabilityPolicy.BEST_EFFORT)
"""Nodes need the latest time only; a test that is late would miss the others."""
VOLATILE, KEPT = Qos(), Qos(depth=1, durability="transient_local")


@pytest.fixture
def play(ros, tmp_path):
    def start(bag, *options):
        command = [sys.executable, "-m", "soilmoist_ros.cli.main", "bag", "play", str(bag)]
        command += map(str, options)
        process = NodeProcess(command, ros.environment, tmp_path / f"player{len(ros.processes)}.txt")
        ros.processes.append(process)
        return process

    return start


@pytest.fixture
def notes_bag(tmp_path):
    """One text per second, and one latched text at the beginning."""
    offered = {"/r/notes": VOLATILE, "/topological_map_2": KEPT, "/r/samples": KEPT}
    text = find_definition("std_msgs/msg/String")
    topics = [Topic(name, text, (qos,)) for name, qos in offered.items()]
    with BagWriter(tmp_path / "notes") as writer:
        for number in range(40):
            stamp_ns = round((START_S + number) * 1e9)
            for topic in topics if number == 0 else topics[:1]:
                message = String(data=f"{topic.name} {number}")
                writer.write(topic, stamp_ns, stamp_ns, serialize_message(message))
    return tmp_path / "notes"


def test_the_mapper_makes_the_map_that_the_replay_makes(ros, play):
    run = GOLDEN / "no_position_gap"
    replay = replay_bag(run)
    mapper = read_parameters(run / "configuration", "mapper")
    ros.start("mapper", params={"noise": "mean", **mapper, "use_sim_time": True})  # as mappers of its time
    maps = ros.collect(PointCloud2, "soil_map", LATCHED)
    counts = ros.collect(PointCloud2, "counts", RECORDS)
    clock = ros.collect(Clock, "/clock", EVERY_CLOCK)
    ros.wait_for(lambda: ros.node.count_subscribers("counts") == 2, message="the mapper")
    player = play(run, "--time-factor", 100)
    assert player.wait() == 0, player.output()
    assert "played 30 messages" in player.output()
    assert "note: played" not in player.output(), "it is the result, no warning"
    with BagReader(run / "bag") as reader:
        recorded, begin_ns = reader.read_counts(), reader.extent.start_ns
    ros.wait_for(lambda: len(counts) == len(recorded), message="the last counts")
    played = [record for message in counts for record in counts_from_message(message)]
    assert repr(played) == repr(recorded)
    stamp_s = recorded[-1].stamp_s
    ros.wait_for(lambda: maps and to_seconds(maps[-1].header.stamp) == stamp_s, message="the last map")
    grid = replay.run.soil_map.grid
    assert soil_map_from_message(maps[-1]).tobytes() == map_cells(grid, replay.run.soil_map).tobytes()
    times = [to_seconds(one.clock) for one in clock]
    assert times == sorted(times)
    assert min(times) == begin_ns * 1e-9
    assert len(set(times)) > 30, "time passes between the messages, too"


def test_it_starts_late_with_the_last_of_what_is_latched(ros, play, notes_bag):
    notes = ros.collect(String, "/r/notes", 1000)
    maps = ros.collect(String, "/topological_map_2", LATCHED)
    clock = ros.collect(Clock, "/clock", CLOCK)
    player = play(notes_bag, "--topics", "/r/notes|/topo.*", "--start", 20, "--time-factor", 12)
    assert player.wait() == 0, player.output()
    ros.wait_for(lambda: len(notes) >= 20, message="the last note")
    assert [one.data for one in notes] == [f"/r/notes {number}" for number in range(20, 40)]
    assert [one.data for one in maps] == ["/topological_map_2 0"]
    assert "played 21 messages" in player.output()
    assert ros.node.count_publishers("/r/samples") == 0, "what the mapper publishes itself is not played"
    ros.wait_for(lambda: to_seconds(clock[-1].clock) == START_S + 39, message="the last time")


def test_the_clock_of_a_simulation_is_played_as_it_was(ros, play, tmp_path):
    clock_topic = Topic("/clock", find_definition("rosgraph_msgs/msg/Clock"), (Qos(reliability="best_effort"),))
    note = Topic("/fix", find_definition("std_msgs/msg/String"), (VOLATILE,))
    with BagWriter(tmp_path / "bag") as writer:
        for number in range(60):  # a minute in a second
            stamp_ns = round((1.9e9 + number / 60) * 1e9)
            time = serialize_message(Clock(clock=to_time(START_S + number)))
            writer.write(clock_topic, stamp_ns, stamp_ns, time)
        writer.write(note, stamp_ns, stamp_ns, serialize_message(String(data="end")))
    received = ros.collect(Clock, "/clock", EVERY_CLOCK)
    ends = ros.collect(String, "/fix")
    mistaken = play(tmp_path / "bag", "--start", 50)
    player = play(tmp_path / "bag")
    assert player.wait() == 0, player.output()
    assert mistaken.wait() == 2
    assert "there is nothing after 50 s" in mistaken.output()
    ros.wait_for(lambda: ends, message="the end")
    assert [one.data for one in ends] == ["end"]
    times = [to_seconds(one.clock) for one in received]
    assert len(times) > 10
    assert set(times) <= {START_S + number for number in range(60)}


def test_a_publisher_serves_whom_the_recorded_ones_served():
    best = Qos(reliability="best_effort", depth=5)
    kept = published_qos([best, KEPT])
    assert kept == LATCHED or (kept.durability, kept.reliability) == (LATCHED.durability, LATCHED.reliability)
    assert published_qos([best]).reliability == CLOCK.reliability
    assert published_qos([Qos(depth=0)]).depth == RECORDS.depth
    assert published_qos([Qos(depth=0, durability="transient_local")]).depth == 1
    unknown = published_qos([])
    assert (unknown.reliability, unknown.durability) == (RECORDS.reliability, RECORDS.durability)


# The monitor keeps a live mission up to date --------------------------------------------------------------------

STATUS = MissionStatus(
    now_s=1e9, phase=Phase.COUNTING, reason="because", target=Stop("s1", 3.0, 4.0), planned_dwell_s=60.0,
    dwell_s=10.0, progress=0.1, time_used_s=100.0, time_left_s=500.0, distance_m=42.0, samples=2, counting_s=70.0,
    raw_counts=99, failures=0, blacklisted=(), estimated_end_s=1e9,
)  # fmt: skip


def test_the_monitor_shows_the_mission_and_messages_of_others_do_no_harm(ros):
    live = LiveMission("test")
    executor = SingleThreadedExecutor(context=ros.context)  # errors in callbacks end the monitor, as in the demo
    monitor = NodeMonitor(live, ros.context)
    executor.add_node(monitor)
    # Called here, since a latched topic may replace a message before delivery.
    monitor._on_mission(live.robots[0], DiagnosticStatus(message="of another robot"))
    assert live.robots[0].status == {}
    ros.node.create_publisher(DiagnosticStatus, "mission", LATCHED).publish(mission_to_message(STATUS))

    def shown():
        executor.spin_once(timeout_sec=0.02)
        return live.robots[0].status

    ros.wait_for(shown)
    assert live.robots[0].state == "counting: because"
    executor.shutdown(timeout_sec=2)
    monitor.destroy_node()

# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Nodes killed at any moment: the measurements are on the disk, and the mission resumes."""

from __future__ import annotations

import math
import time

import numpy as np
import pytest

pytest.importorskip("rclpy")
pytest.importorskip("topological_navigation_msgs")
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import PointCloud2
from test_planner import Planning
from virtual_navigation import VirtualNavigation, World

from msg_adapters.counts import counts_from_message, samples_from_message
from soilmoist_ros.cli.main import main
from soilmoist_ros.exploration.mission.types import Phase
from soilmoist_ros.nodes.topics import LATCHED, RECORDS
from soilmoist_ros.pipeline import replay_bag
from soilmoist_ros.recording import BagReader, bag_info
from soilmoist_ros.recording.bag.scan import McapScan
from soilmoist_ros.recording.journal import decode

# rclpy warns when a server of the test disappears during an answer.
pytestmark = pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")

MISSION = {"hours": 0.3, "dwell": "fmi:40", "autostart": True}
SLOW_RATE, RATE, LAST_RATE = 3.0, 40.0, 200.0
"""Speeds of the world relative to real time; the slow one leaves a busy machine time for an event."""
END_S = 180.0
"""Longest wait for the end of a mission of some 10 s."""


class Received:
    """Stamps of the published records."""

    def __init__(self, ros):
        self._ros, self.stamps = ros, []
        ros.node.create_subscription(PointCloud2, "counts", self._take, RECORDS)

    def _take(self, message):
        self.stamps += [record.stamp_s for record in counts_from_message(message)]

    def require(self, stamps):
        assert stamps
        # A node that was killed may have stored a record that is still on its way to the test.
        self._ros.wait_for(lambda: self.stamps[-1:] >= stamps[-1:], message="the last stored record")
        first = self.stamps.index(stamps[0])
        assert stamps == self.stamps[first : first + len(stamps)]


def in_journal(folder):
    """Stamps of the records in a journal.

    It must be complete except for an unfinished write.
    """
    lines = decode((folder / "journal.jsonl").read_bytes())
    assert all("never confirmed" in problem for problem in lines.problems)
    first = lines.entries[0].seq
    assert [entry.seq for entry in lines.entries] == list(range(first, first + len(lines.entries)))
    return [
        entry.payload["record"]["stamp_s"]
        for entry in lines.entries
        if entry.payload.get("event") == "RecordArrived"
    ]


def last_event_s(folder):
    entries = decode((folder / "journal.jsonl").read_bytes()).entries
    return max(entry.payload["now_s"] for entry in entries if "now_s" in entry.payload)


def recover(bag, target):
    main(["bag", "recover", str(bag), "--out", str(target)], standalone_mode=False)
    return target


def require_progress(before, asking, last_s=math.inf):
    """Check that a resumed mission keeps everything that it used or gathered.

    :param before: what a mission said last
    :param last_s: when it noted its last event in the journal; counting until later is not known to its successor
    """
    # Its first status has the time of the last event in the journal; a status before the kill may be later.
    asking.wait(lambda status: status.now_s >= before.now_s, "the clock of the resumed mission")
    after = asking.status
    assert after.samples >= before.samples
    assert after.distance_m >= before.distance_m - 1e-6
    assert after.time_used_s >= before.time_used_s
    assert after.counting_s >= before.counting_s - max(0.0, before.now_s - last_s)
    if after.samples == before.samples:
        assert after.raw_counts >= before.raw_counts


def on_disk(bag, topic, kind):
    path = bag / f"{bag.name}_0.mcap"
    found = [message.data for message in McapScan(path).messages() if message.topic.name == topic]
    return [deserialize_message(data, kind) for data in found]


def recorded_stamps(bag):
    messages = on_disk(bag, "/counts", PointCloud2)
    return [record.stamp_s for message in messages for record in counts_from_message(message)]


def test_a_planner_goes_on_but_not_by_itself(ros, tmp_path):
    rng = np.random.default_rng(0)
    received, folder = Received(ros), tmp_path / "journal"
    with World(ros, rate=RATE) as world, VirtualNavigation(ros, world) as navigation:
        first = Planning(ros, tmp_path, journal_dir=str(folder), **MISSION)
        first.wait(lambda status: status.samples >= 1 and status.phase is Phase.TRAVELLING)
        time.sleep(rng.uniform(0, 1.5))
        first.process.kill()
        world.rate = SLOW_RATE  # the restart takes a moment
        received.require(in_journal(folder))
        before, last_s = first.status, last_event_s(folder)

        asking = Planning(ros, tmp_path, journal_dir=str(folder), **MISSION)
        asking.wait_phase(Phase.PAUSED)
        assert "resumable" in asking.status.reason
        require_progress(before, asking, last_s)
        ros.wait_for(lambda: world.goal is None, message="the robot to be stopped")
        goals, used_s = list(navigation.goals), asking.status.time_used_s
        world.rate = RATE
        asking.wait(lambda status: status.time_used_s > used_s + 20, "time to pass")
        assert (navigation.goals, world.goal, asking.status.phase) == (goals, None, Phase.PAUSED)
        assert navigation.most_at_once == 1
        asking.process.kill()
    stamps = in_journal(folder)
    assert stamps == sorted(set(stamps)), "no record twice"
    ros.wait_for(lambda: set(stamps) <= set(received.stamps), message="all records of the journal to be heard of")


def test_a_planner_that_is_started_again_after_a_crash_goes_on_unless_it_drove_or_was_paused(ros, tmp_path):
    given = {"journal_dir": str(tmp_path / "journal"), "respawn_limit_s": 600.0, **MISSION, "hours": 2.0}
    with World(ros, rate=RATE) as world, VirtualNavigation(ros, world) as navigation:
        on_way = Planning(ros, tmp_path, **given)
        on_way.wait_phase(Phase.TRAVELLING)
        on_way.process.kill()
        first = Planning(ros, tmp_path, **given)
        first.wait(lambda status: status.phase is Phase.PAUSED and "resumable" in status.reason, "people")
        ros.wait_for(lambda: first.call("resume").success, message="people to be obeyed")
        first.wait_phase(Phase.COUNTING)
        first.process.kill()
        world.rate = SLOW_RATE
        goals = len(navigation.goals)
        again = Planning(ros, tmp_path, **given)
        again.wait(lambda status: status.phase in (Phase.TRAVELLING, Phase.COUNTING), "the mission to go on")
        ros.wait_for(lambda: len(navigation.goals) > goals, message="another goal")
        assert again.call("pause").success
        again.wait_phase(Phase.PAUSED)
        again.process.kill()
        last = Planning(ros, tmp_path, **given)
        last.wait_phase(Phase.PAUSED)
        used_s = last.status.time_used_s
        world.rate = RATE
        last.wait(lambda status: status.time_used_s > used_s + 20, "time to pass")
        assert last.status.phase is Phase.PAUSED
        assert "resumable" in last.status.reason


def test_all_at_once_as_in_a_power_cut(ros, tmp_path):
    rng = np.random.default_rng(5)
    received, folder = Received(ros), tmp_path / "journal"
    bags = {"out": str(tmp_path / "bags"), "name": "run"}
    samples = ros.collect(PointCloud2, "samples", LATCHED)
    with World(ros, rate=RATE, mapper=False) as world, VirtualNavigation(ros, world) as navigation:
        recorder = ros.start("recorder", params=bags)
        first = Planning(ros, tmp_path, journal_dir=str(folder), **MISSION)
        field = {"field": str(tmp_path / "field.yaml"), "save_dir": str(tmp_path / "map"), "use_sim_time": True}
        field["record_dir"] = str(tmp_path / "records")  # as launched on the robot
        mapper = ros.start("mapper", params=field)
        configuration = tmp_path / "bags" / "run" / "configuration"
        ros.wait_for(lambda: {"mapper.yaml", "planner.yaml"} <= names(configuration), message="the configuration")
        first.wait(lambda status: status.samples >= 1)
        time.sleep(rng.uniform(0, 1.5))
        last_s = received.stamps[-1]
        ros.wait_for(
            lambda: last_s in recorded_stamps(tmp_path / "bags" / "run"), message="the last record on disk"
        )
        for process in (recorder, mapper, first.process):
            process.kill()
        world.rate = SLOW_RATE
        received.require(in_journal(folder))
        before, last_event = first.status, last_event_s(folder)

        recovered = recover(tmp_path / "bags" / "run", tmp_path / "recovered")
        with BagReader(recovered) as reader:
            records = reader.read_counts()
        received.require([record.stamp_s for record in records])
        assert last_s in [record.stamp_s for record in records]
        replay = replay_bag(recovered)
        assert replay.run.mission.series[-1].samples >= 1
        in_bag = sum(record.raw_counts for record in replay.run.track)
        assert in_bag == replay.run.soil_map.samples.counts.sum() > 0

        samples.clear()
        second = ros.start("recorder", params=bags)
        ros.start("mapper", params=field)
        ros.wait_for(lambda: samples, message="the map so far")
        assert samples_from_message(samples[0]).counts.sum() > 0
        again = Planning(ros, tmp_path, journal_dir=str(folder), resume="auto", exit_when_finished=True, **MISSION)
        again.wait(lambda status: status.phase not in (Phase.IDLE, Phase.PAUSED))
        require_progress(before, again, last_event)
        goals = len(navigation.goals)
        world.rate = RATE
        ros.wait_for(lambda: len(navigation.goals) > goals, message="another goal")
        world.rate = LAST_RATE
        assert again.process.wait(END_S) == 0
        again.wait_phase(Phase.FINISHED)
        ros.wait_for(lambda: samples_from_message(samples[-1]).counts.sum() > in_bag, message="more counts")
        assert second.stop() == 0
    assert bag_info(tmp_path / "bags" / "run_2").whole
    assert "metadata.yaml" not in names(tmp_path / "bags" / "run"), "what was cut stays as it was"


def names(folder):
    return {path.name for path in folder.iterdir()} if folder.is_dir() else set()

# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The recorder as a process: published messages are in the bag even after faults of the process."""

import signal
import sys
from pathlib import Path

import pytest

pytest.importorskip("rclpy")

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from std_msgs.msg import Float64, String
from std_srvs.srv import Trigger
from visualization_msgs.msg import MarkerArray

from soilmoist_ros.nodes import recorder
from soilmoist_ros.recording import BagReader, read_parameters, recover_bag
from soilmoist_ros.recording.bag.scan import McapScan

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
BEST_EFFORT = QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT)


def params(tmp_path, **more):
    return {"out": str(tmp_path / "bags"), "name": "run", **more}


def on_disk(path):
    return [m.topic.name for m in McapScan(path).messages()] if path.exists() else []


@pytest.fixture
def published(ros):
    """Publishers of one latched, one reliable and one best-effort topic; the latched one has already published."""
    model = ros.node.create_publisher(String, "/robot/model", LATCHED)
    notes = ros.node.create_publisher(String, "/notes", 100)
    pressure = ros.node.create_publisher(Float64, "/pressure", BEST_EFFORT)
    model.publish(String(data="spoken before"))

    def speak(count=20):
        ros.wait_for(lambda: notes.get_subscription_count() and pressure.get_subscription_count())
        for number in range(count):
            notes.publish(String(data=f"note {number}"))
        pressure.publish(Float64(data=101300.0))

    return speak


def test_everything_is_recorded_until_an_interrupt(ros, tmp_path, published):
    ros.node.create_publisher(String, "/left_out", LATCHED).publish(String(data="early"))
    process = ros.start("recorder", params=params(tmp_path, exclude="/left_out|/rosout"))
    published()
    path = tmp_path / "bags" / "run" / "run_0.mcap"
    ros.wait_for(lambda: on_disk(path).count("/notes") == 20 and "/robot/model" in on_disk(path))
    ros.wait_for(lambda: [published(0), {"/pressure", "/diagnostics"} <= set(on_disk(path))][1])
    weak = ros.node.create_publisher(String, "/notes", BEST_EFFORT)  # comes later than a reliable one
    ros.wait_for(weak.get_subscription_count)
    ros.wait_for(lambda: [weak.publish(String(data="weak")), on_disk(path).count("/notes") > 20][1])
    process.process.send_signal(signal.SIGSTOP)  # as on a machine that is busy
    published(5)
    process.process.send_signal(signal.SIGINT)
    process.process.send_signal(signal.SIGCONT)
    assert process.wait() == 0
    with BagReader(tmp_path / "bags" / "run") as bag:
        assert bag.read_texts("model") == ["spoken before"]
        notes = [text for text in bag.read_texts("notes") if text != "weak"]
        assert notes == [f"note {number}" for number in (*range(20), *range(5))], "what has arrived before, too"
        assert "/left_out" not in bag.topics
        message = next(bag.messages(["/pressure"]))
        assert bag.decode(message).data == 101300.0
    text = (tmp_path / "bags" / "run" / "metadata.yaml").read_text()
    assert "durability: transient_local" in text
    assert "reliability: best_effort" in text


def test_messages_in_transit_are_awaited_also_by_a_process_that_stands_still(monkeypatch):
    arrived = iter([9, *[0] * 18, 11, *[0] * 50])
    taken = []
    monkeypatch.setattr(recorder.time, "sleep", lambda _: None)
    monkeypatch.setattr(recorder.time, "monotonic", lambda: 1000.0 * len(taken))
    recorder.take_until_quiet(lambda: [taken.append(next(arrived)), taken[-1]][1])
    assert (sum(taken), len(taken)) == (20, 40)
    taken.clear()
    recorder.take_until_quiet(lambda: [taken.append(1), 1][1])
    assert len(taken) == 100, "not for ever"


def test_a_kill_costs_nothing_that_was_flushed(ros, tmp_path, published):
    """A second recorder on one folder, and one after the first was killed, leave its files alone."""
    process = ros.start("recorder", params=params(tmp_path))
    published()
    path = tmp_path / "bags" / "run" / "run_0.mcap"
    ros.wait_for(lambda: on_disk(path).count("/notes") == 20)
    ros.start("recorder", params=params(tmp_path, autostart=False), namespace="/b")
    answer = ros.call(Trigger, "/b/recorder/start")
    assert not answer.success
    assert "another recorder is writing" in answer.message
    process.kill()
    recover_bag(tmp_path / "bags" / "run", tmp_path / "recovered")
    with BagReader(tmp_path / "recovered") as bag:
        assert bag.read_texts("notes") == [f"note {number}" for number in range(20)]
    left = path.read_bytes()
    for number in (2, 3):
        bag = tmp_path / "bags" / f"run_{number}"
        ros.wait_for(lambda: ros.call(Trigger, "/b/recorder/start").success, every=0.1)  # it tries by itself, too
        ros.wait_for(lambda bag=bag: [published(1), "/notes" in on_disk(bag / f"{bag.name}_0.mcap")][1])
        assert ros.call(Trigger, "/b/recorder/stop").success
        assert (bag / "metadata.yaml").is_file()
    assert path.read_bytes() == left


SQUARE = "name: square\ndatum: {latitude_deg: 53.2, longitude_deg: -0.5}\npolygon: [[0, 0], [30, 0], [30, 30]]\n"


def test_what_the_nodes_of_its_robot_were_set_up_with_is_with_the_bag(ros, tmp_path):
    (tmp_path / "field.yaml").write_text(SQUARE)
    (tmp_path / "other.yaml").write_text(SQUARE.replace("square", "other"))
    fields = {name: str(tmp_path / f"{name}.yaml") for name in ("field", "other")}
    planning = {"field": fields["field"], "graph": "free", "navigator": "goal_pose"}
    ros.start("recorder", params=params(tmp_path), namespace="/r1")
    ros.start("planner", params={**planning, "properties": ["salt:0.5"]}, namespace="/r1")
    mapper = ros.start("mapper", params={"field": fields["field"], "fit": "soft_l1"}, namespace="/r1")
    ros.start("mapper", params={"field": fields["other"], "model": "gaussian"}, namespace="/r1/salt")
    ros.start("mapper", params={"field": fields["field"]}, namespace="/r2")
    folder = tmp_path / "bags" / "run" / "configuration"
    for name in ("planner", "mapper", "salt/mapper"):
        ros.wait_for((folder / f"{name}.yaml").is_file, message=name)
    first, salt = (read_parameters(folder, name) for name in ("mapper", "salt/mapper"))
    assert (first["fit"], first["use_sim_time"], first["merge_radius_m"]) == ("soft_l1", False, 0.0)
    assert salt["model"] == "gaussian"
    assert read_parameters(folder, "planner")["properties"] == ["salt:0.5"]
    assert first["field"] == str(folder / "field.yaml")
    assert (folder / "field.yaml").read_text() == SQUARE
    assert "name: other" in Path(salt["field"]).read_text()
    assert Path(salt["field"]).parent == folder
    # Even if a node has ended, the next bag gets the whole configuration.
    mapper.kill()
    assert ros.call(Trigger, "/r1/recorder/stop").success
    assert ros.call(Trigger, "/r1/recorder/start").success
    ros.wait_for((tmp_path / "bags" / "run_2" / "configuration" / "mapper.yaml").is_file)
    assert len(list(folder.rglob("mapper.yaml"))) == 2, "none of another robot"


def skipped(message):
    return {item.key: item.value for item in message.status[0].values}["topics skipped"]


WITHOUT_MARKERS = """
import sys
from pathlib import Path
import soilmoist_ros.recording.bag.metadata as definitions
definitions.search_prefixes = lambda: [Path({prefix!r})]
from soilmoist_ros.nodes.recorder import main
main()
"""


def test_a_topic_whose_type_is_unknown_is_reported_once_and_the_others_are_recorded(ros, tmp_path, published):
    shared = tmp_path / "prefix" / "share"
    shared.mkdir(parents=True)
    for folder in (Path(sys.prefix) / "share").iterdir():
        if folder.name.endswith(("_msgs", "_interfaces")) and folder.name != "visualization_msgs":
            (shared / folder.name).symlink_to(folder)
    script = tmp_path / "recorder"
    script.write_text(f"#!{sys.executable}{WITHOUT_MARKERS.format(prefix=str(tmp_path / 'prefix'))}")
    script.chmod(0o755)
    ros.node.create_publisher(MarkerArray, "/plan_markers", 10)
    ros.node.create_publisher(String, "/mixed", 10)
    ros.start_publisher(Float64, "/mixed")
    ros.wait_for(lambda: ros.node.count_publishers("/mixed") == 2)
    health = ros.collect(DiagnosticArray, "/diagnostics")
    process = ros.start(str(script), params=params(tmp_path))
    published()
    path = tmp_path / "bags" / "run" / "run_0.mcap"
    ros.wait_for(lambda: on_disk(path).count("/notes") == 20)
    ros.wait_for(lambda: health and skipped(health[-1]) in ("1", "2"), message="the number of topics skipped")
    # The first type decides whether one is recorded; both cases are reported.
    ros.wait_for(lambda: "several types: " in process.output(), message="a word on /mixed")
    said = "/plan_markers is not recorded: the definition of visualization_msgs/msg/MarkerArray is not installed"
    assert process.output().count(said) == 1
    assert process.output().count("/mixed") == 1

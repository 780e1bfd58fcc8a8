# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Launch files: the nodes that they start, and the parameters that the nodes receive (launching.py)."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path

import pytest

pytest.importorskip("rclpy")
import launch_stand_in as stand_in
import yaml
from rclpy.node import Node
from ros_system import ros_in_this_process

from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.mapping.field import load_field
from soilmoist_ros.nodes.parameters import Parameters
from soilmoist_ros.sensing.moisture.site import load_site

ROOT = Path(__file__).resolve().parent.parent.parent
FILES = sorted((ROOT / "launch").glob("*.launch.py"))
ROBOT, SIMULATION = (ROOT / "launch" / f"{name}.launch.py" for name in ("robot", "simulation"))


@pytest.fixture(autouse=True)
def in_a_folder(tmp_path, monkeypatch):
    """The robot's launch file makes a folder for records where it is started."""
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def seen(tmp_path):
    def see(action):
        with ros_in_this_process(action.command_line(tmp_path), tmp_path):
            node = Node(action.executable)
            table = importlib.import_module(f"soilmoist_ros.nodes.{action.executable}").PARAMETERS
            values = Parameters(node, table).as_dict()
            values["use_sim_time"] = node.get_parameter("use_sim_time").value
            values["node"] = node.get_fully_qualified_name()
            node.destroy_node()
            return values

    return see


def defaults(node):
    return {row.name: row.default for row in importlib.import_module(f"soilmoist_ros.nodes.{node}").PARAMETERS}


def by_name(started):
    nodes = {action.executable: action for action in started if isinstance(action, stand_in.Node)}
    assert all(action.package == "soilmoist_ros" for action in nodes.values())
    return nodes


def ended(node, code=0, context=None):
    return node.on_exit(stand_in.ProcessExited(returncode=code), context or stand_in.LaunchContext())


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_every_argument_is_described(path, monkeypatch):
    description = stand_in.load(path, monkeypatch)
    declared = [one for one in description.entities if isinstance(one, stand_in.DeclareLaunchArgument)]
    assert len(declared) == len(stand_in.arguments_of(description)) > 5
    assert [one.name for one in declared if len(one.description or "") < 15] == []
    assert sorted([ROBOT, SIMULATION]) == FILES


def test_the_robot_starts_the_recorder_first_and_leaves_all_parameters_alone(monkeypatch, seen, tmp_path):
    nodes = by_name(stand_in.start(ROBOT, monkeypatch, {}))
    assert list(nodes) == ["recorder", "mapper", "planner", "sensor_driver", "watchdog"]
    for name, action in nodes.items():
        values = seen(action)
        if name == "planner":
            assert values.pop("journal_dir") == str(tmp_path / "recordings" / "journal")
            assert values["respawn_limit_s"] == 60.0
            values |= {"journal_dir": "", "respawn_limit_s": 0.0}
        if name in ("mapper", "sensor_driver"):
            values["record_dir"] = ""
        assert (values.pop("node"), values.pop("use_sim_time")) == (f"/{name}", False)
        assert values == defaults(name)
        assert ended(action) == []


def test_arguments_go_to_every_node_that_has_the_parameter_before_the_file(monkeypatch, seen, tmp_path):
    path = tmp_path / "mine.yaml"
    about = {"/**": {"use_sim_time": False}, "/**/planner": {"hours": 4.0, "speed_mps": 0.9}}
    path.write_text(yaml.safe_dump({name: {"ros__parameters": values} for name, values in about.items()}))
    given = {"field": "f.yaml", "site": "24", "hours": "3", "dwell": "fmi:60", "out": "runs", "namespace": "r1"}
    given |= {"params_file": str(path), "use_sim_time": "true", "console": "true", "covariates": "[a.tif]"}
    nodes = by_name(stand_in.start(ROBOT, monkeypatch, given))
    values = {name: seen(action) for name, action in nodes.items()}
    assert {values[name]["field"] for name in ("mapper", "planner", "sensor_driver", "console")} == {"f.yaml"}
    assert [values[name]["site"] for name in ("mapper", "sensor_driver")] == ["24"] * 2
    planner, console = values["planner"], values["console"]
    assert (planner["hours"], planner["dwell"], planner["speed_mps"], planner["use_sim_time"]) == (
        3.0, "fmi:60", 0.9, True,
    )  # fmt: skip
    assert values["recorder"]["out"] == "runs"
    assert (console["host"], console["runs"]) == ("127.0.0.1", "runs")
    assert {value["node"] for value in values.values()} == {f"/r1/{name}" for name in nodes}
    with pytest.raises(InputError, match="planner: parameter hours must be a number, got 'two'"):
        stand_in.start(ROBOT, monkeypatch, {"hours": "two"})


def test_each_further_property_has_a_mapper_of_its_own(monkeypatch, seen, tmp_path):
    path = tmp_path / "team.yaml"
    path.write_text(yaml.safe_dump({"/**/mapper": {"ros__parameters": {"others": ["/r1", "/r2"], "site": "x"}}}))
    given = {
        "field": "f.yaml",
        "site": "s",
        "namespace": "r1",
        "save_dir": "m",
        "params_file": str(path),
        "property": "compaction:2, /salt",
    }
    actions = [one for one in stand_in.start(ROBOT, monkeypatch, given) if isinstance(one, stand_in.Node)]
    mappers = {values["node"]: values for one in actions if one.executable == "mapper" for values in [seen(one)]}
    assert list(mappers) == ["/r1/mapper", "/r1/compaction/mapper", "/salt/mapper"]
    assert [values["save_dir"] for values in mappers.values()] == ["m", "m_compaction", "m_salt"]
    assert [values["site"] for values in mappers.values()] == ["s", "", ""]
    assert {values["field"] for values in mappers.values()} == {"f.yaml"}
    whose = [values["others"] for values in mappers.values()]
    assert whose == [["/r1", "/r2"], [], []], "the neutrons of the team are not counts of these"
    planner = next(seen(one) for one in actions if one.executable == "planner")
    assert planner["properties"] == ["compaction:2", "/salt"]
    with pytest.raises(InputError, match="is not a namespace"):
        stand_in.start(ROBOT, monkeypatch, {"property": "compaction:much"})


def test_the_journal_is_where_a_restart_finds_it(monkeypatch, seen, tmp_path):
    path = tmp_path / "mine.yaml"
    path.write_text(yaml.safe_dump({"/**": {"ros__parameters": {"journal_dir": "/data/journal"}}}))
    for given, folder in [
        ({"out": str(tmp_path)}, f"{tmp_path}/journal"),
        ({"out": str(tmp_path), "namespace": "/r1/"}, f"{tmp_path}/journal/r1"),
        ({"out": str(tmp_path), "params_file": str(path)}, "/data/journal"),
        ({"journal_dir": "/other", "params_file": str(path)}, "/other"),
    ]:
        values = seen(by_name(stand_in.start(ROBOT, monkeypatch, {**given, "resume": "auto"}))["planner"])
        assert (values["journal_dir"], values["resume"]) == (folder, "auto")


def test_topics_of_the_robot_have_the_names_of_the_arguments(monkeypatch, tmp_path):
    given = {
        "fix_topic": "/gps/fix",
        "battery_topic": "bms/state",
        "remap": "/tf:=tf, counts:=/crns/counts",
        "property": "salt",
        "namespace": "r1",
        "console": "true",
    }
    resolved = {}
    for action in stand_in.start(ROBOT, monkeypatch, given):
        with ros_in_this_process(action.command_line(tmp_path), tmp_path):
            node = Node(action.executable)
            topics = ("fix", "battery_state", "/tf", "counts", "samples")
            resolved[node.get_fully_qualified_name()] = [node.resolve_topic_name(name) for name in topics]
            node.destroy_node()
    ours = ["/gps/fix", "/r1/bms/state", "/r1/tf", "/crns/counts", "/r1/samples"]
    for name in ("mapper", "planner", "sensor_driver", "console", "watchdog"):
        assert resolved.pop(f"/r1/{name}") == ours
    # The recorder subscribes to what it finds; the counts of another property are not those of the robot.
    recorder = ["/r1/fix", "/r1/battery_state", "/r1/tf", "/r1/counts", "/r1/samples"]
    assert resolved.pop("/r1/recorder") == recorder
    assert resolved.pop("/r1/salt/mapper") == [f"/r1/salt/{name.lstrip('/')}" for name in topics]
    assert not resolved
    for wrong, message in [("/tf", "is no rule"), ("/tf:=my tf", "'my tf' is not the name of a topic")]:
        with pytest.raises(InputError, match=message):
            stand_in.start(ROBOT, monkeypatch, {"remap": wrong})


SAID = (
    b"[INFO] [17.5] [mapper]: hello\nthere is no field 'x' -> give a file\nhours must be >= 0\n",
    b"[WARN] [17.6] [mapper]: bye\nthe port 8050 is in use\n",
)


@pytest.mark.parametrize(
    ("path", "given"),
    [
        (ROBOT, {"console": "true", "property": "salt", "namespace": "r1"}),
        (SIMULATION, {"console": "true", "out": "run"}),
    ],
)
def test_a_node_that_cannot_start_ends_the_launch_and_a_console_only_itself(monkeypatch, path, given):
    context, heard = stand_in.LaunchContext(), []
    started = stand_in.start(path, monkeypatch, given, heard=heard)
    nodes = [one for one in started if isinstance(one, stand_in.Node)]
    for pid, node in enumerate(nodes):
        for text in SAID:
            for hear in heard:
                hear(stand_in.ProcessIO(text=text, pid=pid))
        ended = stand_in.ProcessExited(returncode=2, pid=pid, action=node)
        name = f"{node.namespace}/{node.name}".lstrip("/")
        if node.executable == "console":
            said, event = node.on_exit(ended, context)
            assert said.msg == f"the node {name} is missing, the others go on: the port 8050 is in use"
            assert [event.event.process_matcher(one) for one in nodes] == [one is node for one in nodes]
        else:
            with pytest.raises(InputError) as error:
                node.on_exit(ended, context)
            assert str(error.value) == f"the node {name} is missing, and the launch ends: the port 8050 is in use"
        assert node.on_exit(ended, stand_in.LaunchContext(is_shutdown=True)) == []
    assert {node.executable for node in nodes} >= {"mapper", "console", "planner"}


def test_a_reason_of_several_lines_is_whole(monkeypatch):
    heard, end = [], (stand_in.ProcessExited(returncode=2), stand_in.LaunchContext())
    node = next(iter(by_name(stand_in.start(ROBOT, monkeypatch, {}, heard=heard)).values()))
    for part in (SAID[0][:50], SAID[0][50:]):
        heard[0](stand_in.ProcessIO(text=part))
    for why in (r"there is no field 'x' -> give a file\nhours must be >= 0$", r"it ended with exit code 2$"):
        with pytest.raises(InputError, match=f"ends: {why}"):
            node.on_exit(*end)


def test_unknown_arguments_are_refused_with_a_suggestion(monkeypatch):
    def call(path, *arguments):
        monkeypatch.setattr(sys, "argv", ["/opt/ros/bin/ros2", "launch", *arguments])
        given = dict(one.split(":=", 1) for one in arguments if ":=" in one)
        return stand_in.start(path, monkeypatch, given | ({"out": "run"} if path == SIMULATION else {}))

    with pytest.raises(
        InputError, match=r"no launch argument 'feild' \(did you mean 'field'\?\), 'zz' -> there are: ac"
    ):
        call(ROBOT, "soilmoist_ros", "robot.launch.py", "feild:=a", "hours:=1", "zz:=2")
    with pytest.raises(InputError, match="no launch argument 'robots'"):
        call(SIMULATION, "/ws/simulation.launch.py", "resume:=fresh", "robots:=2")
    assert call(ROBOT, "soilmoist_ros", "robot.launch.py", "field:=a", "launch-prefix:=nice")
    assert call(SIMULATION, "soilmoist_ros", "simulation.launch.py", "resume:=fresh"), "robot.launch.py reads it"
    assert call(ROBOT, "mine", "bringup.launch.py", "feild:=of_its_own"), "arguments of a file that includes ours"


def test_empty_lists_are_lists_and_a_missing_parameter_file_is_named(monkeypatch, seen, tmp_path):
    path = tmp_path / "mine.yaml"
    path.write_text("/**:\n  ros__parameters: {covariates: [a.tif], others: []}\n")
    given = {"params_file": str(path), "covariates": "[]", "earlier": "[ ]", "property": "[]"}
    values = seen(by_name(stand_in.start(ROBOT, monkeypatch, given))["planner"])
    lists = ("covariates", "earlier", "others", "properties")
    assert [values[name] for name in lists] == [[], [], [], []]
    for file, more in ((ROBOT, {}), (SIMULATION, {"out": "run"})):
        with pytest.raises(InputError, match=r"params_file: there is no file 'nix\.yaml'"):
            stand_in.start(file, monkeypatch, {"params_file": "nix.yaml", **more})


def test_nodes_that_crash_start_again_none_is_killed_while_it_saves_and_all_end_with_the_mission_if_wished(
    monkeypatch, seen
):
    nodes = by_name(stand_in.start(ROBOT, monkeypatch, {}))
    for action in nodes.values():
        assert (action.respawn, action.respawn_delay) == (True, 2.0)
        assert min(float(action.sigterm_timeout), float(action.sigkill_timeout)) >= 60
    given = {"respawn": "false", "record": "false", "exit_when_finished": "true"}
    nodes = by_name(stand_in.start(ROBOT, monkeypatch, given))
    assert list(nodes) == ["mapper", "planner", "sensor_driver", "watchdog"], "nothing is recorded"
    assert not any(action.respawn for action in nodes.values())
    assert seen(nodes["planner"])["respawn_limit_s"] == 0.0
    assert isinstance(ended(nodes["planner"])[0], stand_in.Shutdown)
    assert ended(nodes["mapper"]) == []
    assert all(ended(nodes["planner"], code) == [] for code in (1, -9, -11)), "one that crashed starts again"


def test_driver_and_mapper_store_records_in_one_folder_and_each_launch_is_another_map(monkeypatch, seen, tmp_path):
    given = {"out": str(tmp_path), "namespace": "r1", "property": "salt"}
    folders = []
    for _ in range(2):
        actions = [one for one in stand_in.start(ROBOT, monkeypatch, given) if isinstance(one, stand_in.Node)]
        mapper, salt = (seen(one) for one in actions if one.executable == "mapper")
        driver = next(seen(one) for one in actions if one.executable == "sensor_driver")
        assert mapper["record_dir"] == driver["record_dir"]
        assert salt["record_dir"] == f"{mapper['record_dir']}/properties/salt"
        assert salt["start_property"] == "salt"
        assert Path(mapper["record_dir"]).parent == tmp_path / "records" / "r1"
        folders.append(mapper["record_dir"])
    assert folders[0] != folders[1]


def test_the_simulation_joins_all_nodes_on_one_simulated_field(monkeypatch, seen, tmp_path):
    given = {"field": "synthetic-high", "out": str(tmp_path / "run"), "logger_port": "5001", "seed": "7"}
    nodes = by_name(stand_in.start(SIMULATION, monkeypatch, given))
    values = {name: seen(action) for name, action in nodes.items()}
    simulator, driver, planner = (values[name] for name in ("field_simulator", "sensor_driver", "planner"))
    assert next(iter(nodes)) == "field_simulator"
    assert (simulator["field"], simulator["seed"], simulator["logger_port"]) == ("synthetic-high", 7, 5001)
    assert simulator["use_sim_time"] is False
    assert (driver["logger_uri"], driver["gnss_uri"]) == ("tcp://127.0.0.1:5001", "tcp://127.0.0.1:4002")
    for name in ("mapper", "planner", "sensor_driver", "recorder"):
        assert values[name]["use_sim_time"] is True
    assert len({values[name]["field"] for name in ("mapper", "planner", "sensor_driver")}) == 1
    load_field(Path(driver["field"]))
    load_site(Path(driver["site"]))
    assert (planner["autostart"], planner["exit_when_finished"]) == (True, True)
    assert values["mapper"]["simulated"] is True
    assert Path(values["recorder"]["out"], values["recorder"]["name"]) == tmp_path / "run" / "bag"
    assert isinstance(ended(nodes["planner"])[0], stand_in.Shutdown)
    default = stand_in.arguments_of(stand_in.load(SIMULATION, monkeypatch))["out"].default_value
    assert default.startswith("soilmoist_simulation_2"), "two simulations do not share a folder"


def test_every_property_is_simulated_mapped_and_planned_for(monkeypatch, seen, tmp_path):
    given = {"property": "rough:0.5,ridge", "out": str(tmp_path), "namespace": "r1"}
    actions = [one for one in stand_in.start(SIMULATION, monkeypatch, given) if isinstance(one, stand_in.Node)]
    values = {found["node"]: found for one in actions for found in [seen(one)]}
    assert values["/r1/field_simulator"]["properties"] == ["rough", "ridge"]
    assert values["/r1/planner"]["properties"] == ["rough:0.5", "ridge:1"]
    for name in ("rough", "ridge"):
        mapper = values[f"/r1/{name}/mapper"]
        assert (mapper["simulated"], mapper["use_sim_time"], mapper["site"]) == (True, True, "")
        assert mapper["save_dir"] == str(tmp_path / f"map_{name}")
    with pytest.raises(InputError, match="does not cover the field 'synthetic-high'"):
        stand_in.start(SIMULATION, monkeypatch, {**given, "property": "patches"})


def test_each_node_gets_its_enclave(monkeypatch, tmp_path):
    given = {"out": str(tmp_path), "enclaves": "/soilmoist"}
    robot = stand_in.start(ROBOT, monkeypatch, {**given, "namespace": "r1", "property": "salt"})
    simulation = stand_in.start(SIMULATION, monkeypatch, given)
    enclaves = {action.ros_arguments[1].removeprefix("/soilmoist/") for action in (*robot, *simulation)}
    assert {"r1/planner", "r1/mapper", "r1/salt/mapper", "field_simulator", "planner"} <= enclaves
    assert not any(action.ros_arguments for action in stand_in.start(ROBOT, monkeypatch, {"out": str(tmp_path)}))


@pytest.mark.parametrize("path", sorted((ROOT / "config" / "robots").glob("*.yaml")), ids=lambda path: path.stem)
def test_the_nodes_take_the_file_and_the_launch_line_of_each_robot(path, monkeypatch, seen):
    lines = [line[1:].strip() for line in path.read_text().splitlines() if line.startswith("#   ")]
    launch, package, file, *words = " ".join(lines).replace("\\", "").split()[1:]
    assert (launch, package, file) == ("launch", "soilmoist_ros", ROBOT.name)
    given = dict(word.split(":=", 1) for word in words) | {"params_file": str(path)}
    nodes = by_name(stand_in.start(ROBOT, monkeypatch, given))
    values = {name: seen(action) for name, action in nodes.items()}
    blocks = yaml.safe_load(path.read_text())
    for block, its in blocks.items():
        said = its["ros__parameters"]
        assert {name: values[block.removeprefix("/**/")][name] for name in said} == said, "and no argument differs"
    planner, driver = values["planner"], values["sensor_driver"]
    assert (planner["home"], planner["frame"], values["mapper"]["frame"]) == (
        given["home"],
        *2 * [driver["frame_id"]],
    )
    assert not planner["autostart"]

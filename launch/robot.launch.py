# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A survey with the robot: recorder, mapper, planner, sensor driver and watchdog.

    ros2 launch soilmoist_ros robot.launch.py field:=my_field.yaml site:=my_site.yaml params_file:=my_robot.yaml

Arguments override params_file. An empty argument keeps the value in params_file or the default (see
docs/parameters.md).
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction, RegisterEventHandler, Shutdown
from launch.conditions import IfCondition
from launch.event_handlers import OnProcessIO
from launch.launch_description_entity import LaunchDescriptionEntity
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from soilmoist_ros.exploration.planning.properties import property_weights
from soilmoist_ros.nodes.launching import (
    SIMULATED_SILENT_S,
    TOPICS,
    LastWords,
    enclave,
    parameter_files,
    parameters_from,
    property_argument,
    refuse_unknown,
    remappings,
    with_empty_lists,
)
from soilmoist_ros.nodes.planner_parameters import PERSON
from soilmoist_ros.recording.map_sources import open_session

PARAMETERS = {
    "field": "field file, or name of a shipped one",
    "site": "site file (corrections, soil, calibration), or name of a shipped one",
    "logger_uri": "where the neutron logger is: tcp://HOST:PORT, udp://0.0.0.0:PORT or "
    "serial:///dev/ttyUSB0?baud=115200",
    "gnss_uri": "where the GNSS receiver is (NMEA), like logger_uri",
    "strategy": "how the next stop is chosen, such as gcb",
    "dwell": "how long to count at a stop: fmi:SECONDS, ami:THRESHOLD or optimal",
    "hours": "time of the mission [h], the way home included",
    "earlier": "earlier runs of the field, which inform map and plan: [FOLDER, FOLDER]",
    "covariates": "files that may explain the map: [FILE:BAND, FILE]",
    "home": "stop to return to at the end",
    "navigator": "how goals are sent: goto_node, navigate_to_pose or follow_route (Nav2), goal_pose or person",
    "action_name": "name of the navigation's action, such as /robot/navigate_to_pose",
    "map_topic": "topic of the navigation's topological map",
    "save_dir": "folder that the mapper's service save writes",
    "out": "folder for recordings",
    "name": "name of the recording; the time if empty",
    "resume": "interrupted mission: ask (wait for resume or abort), auto (resume) or fresh (start a new one)",
    "simulated": "true if the counts come from a simulation; every output says so",
}
"""Arguments that set a parameter of one or more nodes."""
RECORDINGS = "recordings"
"""Default folder of the recorder."""
PROPERTY = (
    "further properties that the planner explores, such as compaction:2,salt (NAME[:WEIGHT], the field itself has "
    "weight 1); each has a mapper, which reads NAME/counts"
)
JOURNAL = "folder of the mission's journal, which survives a power cut (empty: as in params_file, or OUT/journal)"
CONSOLE = "true: the operator's page is served, on port 8050 of this computer unless params_file says otherwise"
REMAP = "further topics and services by other names: FROM:=TO,FROM:=TO, such as /tf:=tf,/tf_static:=tf_static"
RESPAWN = (
    "true: nodes that crash start again, with the map and the mission that they had; bad input ends the launch"
)
RESPAWN_DELAY_S = 2.0
RESPAWN_LIMIT_S = 60.0
"""A planner that starts again this soon after a crash goes on by itself [s]."""
STOP_LIMIT_S = "120"
"""Time after SIGINT until SIGTERM, and from there until SIGKILL [s]: a node that saves must not be killed."""
ENCLAVES = "prefix of the nodes' security enclaves, /soilmoist with a keystore of scripts/keystore; empty: none"
AUTOSTART = "true: the mission starts as soon as position, map and navigation are there"


def generate_launch_description() -> LaunchDescription:
    """The nodes on the robot's computer."""
    return LaunchDescription(
        [
            DeclareLaunchArgument("params_file", default_value="", description="parameters of all nodes (YAML)"),
            DeclareLaunchArgument("namespace", default_value="", description="namespace of the robot"),
            DeclareLaunchArgument(
                "use_sim_time", default_value="false", description="true: time comes from /clock"
            ),
            DeclareLaunchArgument("enclaves", default_value="", description=ENCLAVES),
            DeclareLaunchArgument("record", default_value="true", description="false: nothing is recorded"),
            DeclareLaunchArgument("console", default_value="false", description=CONSOLE),
            DeclareLaunchArgument("respawn", default_value="true", description=RESPAWN),
            DeclareLaunchArgument("autostart", default_value="false", description=AUTOSTART),
            DeclareLaunchArgument(
                "exit_when_finished", default_value="false", description="true: all nodes end with the mission"
            ),
            DeclareLaunchArgument("journal_dir", default_value="", description=JOURNAL),
            DeclareLaunchArgument("property", default_value="", description=PROPERTY),
            *(
                DeclareLaunchArgument(name, default_value="", description=f"{text} (empty: as in params_file)")
                for name, text in PARAMETERS.items()
            ),
            *(
                DeclareLaunchArgument(name, default_value="", description=f"{text} (empty: {topic})")
                for name, (topic, text) in TOPICS.items()
            ),
            DeclareLaunchArgument("remap", default_value="", description=REMAP),
            OpaqueFunction(function=nodes),
        ]
    )


def nodes(context: LaunchContext) -> list[LaunchDescriptionEntity]:
    """The nodes, with parameters from the arguments."""
    refuse_unknown(__file__, [generate_launch_description()])

    def given(name: str) -> str:
        return LaunchConfiguration(name).perform(context)

    def flag(name: str) -> bool:
        return IfCondition(LaunchConfiguration(name)).evaluate(context)

    arguments = {name: given(name) for name in PARAMETERS}
    # The recorder starts first, so that it misses no message.
    values = {
        name: parameters_from(name, arguments) for name in ("recorder", "mapper", "planner", "sensor_driver")
    }
    if arguments["navigator"] != PERSON:
        by_pose = arguments["navigator"] == "goal_pose"
        values["watchdog"] = {"pose_action": arguments["action_name"] or "navigate_to_pose"} if by_pose else {}
        values["watchdog"] |= {"silent_s": SIMULATED_SILENT_S} if flag("use_sim_time") else {}
    if flag("console"):
        values["console"] = parameters_from("console", arguments)
        values["console"] |= {"runs": arguments["out"]} if arguments["out"] else {}
    properties = property_argument(given("property"))
    if properties:
        values["planner"] |= parameters_from("planner", {"properties": str(properties)})
    values["planner"] |= {name: flag(name) for name in ("autostart", "exit_when_finished")}
    files = parameter_files(given("params_file"))
    values["planner"] |= journal(given("journal_dir"), arguments["out"], given("params_file"), given("namespace"))
    records = stored_records(values["planner"], arguments["out"], given("namespace"))
    values["sensor_driver"] |= {"record_dir": records["record_dir"]}
    values["mapper"] |= records
    if flag("respawn"):
        values["planner"] |= {"respawn_limit_s": RESPAWN_LIMIT_S}
    if not flag("record"):
        del values["recorder"]
    rules = remappings({name: given(name) for name in TOPICS}, given("remap"))
    # The recorder records topics by their final names, and the topics of a property are not those of the robot.
    general = [rule for rule in rules if rule[0].startswith("/")]
    started = [
        (node, given("namespace"), files, parameters, general if node == "recorder" else rules)
        for node, parameters in values.items()
    ]
    # Settings of /**/mapper in params_file, such as the counts to map, must not apply to property mappers.
    started += [
        ("mapper", *one, general) for one in property_mappers(given("namespace"), arguments, properties, records)
    ]
    last_words = LastWords()
    ends = end_all if flag("exit_when_finished") else None
    return [
        RegisterEventHandler(OnProcessIO(on_stderr=last_words.hear)),
        *(
            Node(
                package="soilmoist_ros",
                executable=node,
                name=node,  # so that the arguments override params_file
                namespace=namespace,
                ros_arguments=enclave(given("enclaves"), namespace, node),
                parameters=[*own, with_empty_lists({"use_sim_time": flag("use_sim_time"), **parameters})],
                remappings=renamed,
                on_exit=last_words.on_exit(f"{namespace}/{node}".lstrip("/"), ends if node == "planner" else None),
                respawn=flag("respawn"),
                respawn_delay=RESPAWN_DELAY_S,
                sigterm_timeout=STOP_LIMIT_S,
                sigkill_timeout=STOP_LIMIT_S,
                output="screen",
            )
            for node, namespace, own, parameters, renamed in started
        ),
    ]


def end_all(code: int) -> list[Shutdown]:
    """End everything when the planner has finished. A planner that has crashed starts again."""
    return [] if code else [Shutdown(reason="the mission has ended")]


def property_mappers(
    namespace: str, arguments: Mapping[str, str], properties: Sequence[str], records: Mapping[str, object]
) -> list[tuple[str, list[str], dict[str, object]]]:
    """Namespace, no files, and parameters of each property's mapper; each mapper saves to a separate folder."""
    mapper = parameters_from("mapper", {**arguments, "site": ""})
    folder = arguments["save_dir"] or "soilmoist_map"
    return [
        (
            name if name.startswith("/") else f"{namespace.rstrip('/')}/{name}".lstrip("/"),
            [],
            {
                **mapper,
                "save_dir": f"{folder}_{Path(name).name}",
                "start_property": name,
                **records,
                "record_dir": f"{records['record_dir']}/properties/{name.strip('/')}",
            },
        )
        for name in property_weights(properties)
    ]


def journal(folder: str, out: str, params_file: str, namespace: str) -> dict[str, str]:
    """Folder of the planner's journal; every run uses the same folder, so that a restart finds the journal."""
    if not folder and params_file and "journal_dir" in Path(params_file).read_text(encoding="utf-8"):
        return {}
    own = Path(out or RECORDINGS, "journal", namespace.strip("/"))  # several robots may share a computer
    return {"journal_dir": folder or str(own.expanduser().absolute())}


def stored_records(planner: Mapping[str, object], out: str, namespace: str) -> dict[str, object]:
    """Folder where driver and mappers store records; respawned nodes use it again."""
    journal_dir, recordings = str(planner.get("journal_dir", "")), Path(out or RECORDINGS).expanduser().absolute()
    journal_path = Path(journal_dir).expanduser() if journal_dir else None
    session = open_session(
        recordings / "records" / namespace.strip("/"), journal_path, planner.get("resume") == "fresh"
    )
    return {"record_dir": str(session)}

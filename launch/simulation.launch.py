# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A survey in simulation: the nodes of robot.launch.py with a simulated robot, sensor and clock.

    ros2 launch soilmoist_ros simulation.launch.py field:=synthetic-high hours:=1

``soilmoist demo --robots 3`` simulates several robots, which share mapper, recorder and clock.

The folder ``out`` receives the field file and site file of the simulated field, the recording and the map.
"""

from datetime import datetime
from pathlib import Path

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription, OpaqueFunction, RegisterEventHandler
from launch.event_handlers import OnProcessIO
from launch.launch_description_entity import LaunchDescriptionEntity
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from soilmoist_ros.nodes.launching import (
    LastWords,
    enclave,
    parameter_files,
    parameters_from,
    property_argument,
    refuse_unknown,
)
from soilmoist_ros.recording.run_folder import CONFIGURATION
from soilmoist_ros.simulation.fields.catalogue import surrogate_field_names
from soilmoist_ros.simulation.fields.surrogate_field import write_field_file, write_site_file
from soilmoist_ros.simulation.mission.channel import mission_fields
from soilmoist_ros.simulation.mission.settings import MissionSettings, PropertySettings

SIMULATOR = {
    "field": (
        "synthetic-high",
        f"field to simulate: {', '.join(surrogate_field_names())}, or a field file with a truth",
    ),
    "speed": ("60", "simulated time per wall time"),
    "seed": ("1", "seed of all randomness"),
    "scenario": ("", "faults of navigation, links and sensor: a name or a file; empty for none"),
    "logger_port": ("4001", "TCP port on which the logger is simulated"),
    "gnss_port": ("4002", "TCP port on which the GNSS receiver is simulated"),
}
MISSION = {
    "strategy": ("gcb", "how the next stop is chosen"),
    "dwell": ("optimal", "how long to count at a stop: fmi:SECONDS, ami:THRESHOLD or optimal"),
    "hours": ("1", "simulated time of the mission [h]"),
    "navigator": (
        "goto_node",
        "how goals are sent: goto_node (needs topological_navigation_msgs), navigate_to_pose (needs nav2_msgs) or "
        "goal_pose",
    ),
    "autostart": ("true", "false to wait for the service planner/start"),
    "exit_when_finished": ("true", "false to keep the nodes after the mission, to look at its map"),
    "namespace": ("", "namespace of the robot"),
    "params_file": ("", "parameters of all nodes (YAML); arguments override them"),
    "record": ("true", "false to record nothing"),
    "console": ("false", "true to serve the operator's page on port 8050"),
    "enclaves": (
        "",
        "prefix of the nodes' security enclaves, /soilmoist with a keystore of scripts/keystore --rehearsal; "
        "empty: none",
    ),
}

PROPERTY = "further properties that are counted and mapped, such as rough:0.5,ridge: FIELD[:WEIGHT] to simulate"


def generate_launch_description() -> LaunchDescription:
    """The simulator and the nodes of the robot."""
    out = f"soilmoist_simulation_{datetime.now():%Y%m%d_%H%M%S}"
    return LaunchDescription(
        [
            *(
                DeclareLaunchArgument(name, default_value=default, description=text)
                for name, (default, text) in (SIMULATOR | MISSION).items()
            ),
            DeclareLaunchArgument("property", default_value="", description=PROPERTY),
            DeclareLaunchArgument("out", default_value=out, description="folder for all results"),
            OpaqueFunction(function=system),
        ]
    )


def system(context: LaunchContext) -> list[LaunchDescriptionEntity]:
    """The simulator, and the nodes of the robot on the simulated field."""
    robot = PythonLaunchDescriptionSource(str(Path(__file__).with_name("robot.launch.py")))
    last_words = LastWords()

    def given(name: str) -> str:
        return LaunchConfiguration(name).perform(context)

    properties = tuple(map(PropertySettings.parse, property_argument(given("property"))))
    field = mission_fields(MissionSettings(field=given("field"), properties=properties))[0]
    out = Path(given("out")).absolute()
    # The arguments of the robot's launch file reach it from here, too.
    refuse_unknown(__file__, [generate_launch_description(), robot.get_launch_description(context)])
    files = {"field": out / CONFIGURATION / "field.yaml", "site": out / CONFIGURATION / "site.yaml"}
    write_field_file(field, files["field"])
    write_site_file(field, files["site"])
    simulator = Node(
        package="soilmoist_ros",
        executable="field_simulator",
        name="field_simulator",
        namespace=given("namespace"),
        ros_arguments=enclave(given("enclaves"), given("namespace"), "field_simulator"),
        parameters=[
            *parameter_files(given("params_file")),
            parameters_from(
                "field_simulator",
                {
                    **{name: given(name) for name in SIMULATOR},
                    "properties": str([one.field for one in properties]) if properties else "",
                },
            ),
        ],
        on_exit=last_words.on_exit("field_simulator"),
        output="screen",
    )
    arguments = {
        **{name: given(name) for name in MISSION},
        **{name: str(path) for name, path in files.items()},
        "logger_uri": f"tcp://127.0.0.1:{given('logger_port')}",
        "gnss_uri": f"tcp://127.0.0.1:{given('gnss_port')}",
        "out": str(out),
        "name": "bag",
        "save_dir": str(out / "map"),
        "property": ",".join(f"{one.name}:{one.weight:g}" for one in properties),
        "simulated": "true",
        "use_sim_time": "true",
    }
    heard = RegisterEventHandler(OnProcessIO(on_stderr=last_words.hear))
    return [heard, simulator, IncludeLaunchDescription(robot, launch_arguments=arguments.items())]

"""A survey in simulation: the nodes of robot.launch.py with a simulated robot, sensor and clock.

    ros2 launch soilmoist_ros simulation.launch.py field:=synthetic-high hours:=1

The folder ``out`` gets the field file and site file of the simulated field, the recording and the map.
"""

from datetime import datetime
from pathlib import Path

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription, OpaqueFunction
from launch.launch_description_entity import LaunchDescriptionEntity
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from soilmoist_ros.exploration.planning.property_names import property_name
from soilmoist_ros.nodes.system.launching import parameters_from
from soilmoist_ros.recording.run_folder import CONFIGURATION
from soilmoist_ros.simulation.fields.catalogue import surrogate_field_names
from soilmoist_ros.simulation.fields.field_files import write_field_file, write_site_file
from soilmoist_ros.simulation.mission.channel import mission_fields
from soilmoist_ros.simulation.mission.settings import MissionSettings

SIMULATOR = {
    "field": (
        "synthetic-high",
        f"field to simulate: {', '.join(surrogate_field_names())}, or a field file with a truth",
    ),
    "also": ("", "field of a second property on the same ground, counted and mapped beside; empty for none"),
    "speed": ("60", "simulated time per wall time"),
    "seed": ("1", "seed of all randomness"),
    "scenario": ("", "what goes wrong in navigation and links: a name or a file; empty for nothing"),
    "logger_port": ("4001", "TCP port on which the logger is simulated"),
    "gnss_port": ("4002", "TCP port on which the GNSS receiver is simulated"),
}
MISSION = {
    "strategy": ("gcb", "how the next stop is chosen"),
    "dwell": ("optimal", "how long to count at a stop: fmi:SECONDS, ami:THRESHOLD or optimal"),
    "hours": ("1", "simulated time of the mission [h]"),
    "navigator": ("goto_node", "how goals are sent: goto_node (needs topological_navigation_msgs) or goal_pose"),
    "autostart": ("true", "false to wait for the service planner/start"),
    "exit_when_finished": ("true", "false to go on after the mission, to look at its map"),
    "namespace": ("", "namespace of the robot"),
    "params_file": ("", "parameters of all nodes (YAML); the arguments of this file come before them"),
    "record": ("true", "false to record nothing"),
}


def generate_launch_description() -> LaunchDescription:
    """Simulator and nodes."""
    out = f"soilmoist_simulation_{datetime.now():%Y%m%d_%H%M%S}"
    return LaunchDescription(
        [
            *(
                DeclareLaunchArgument(name, default_value=default, description=text)
                for name, (default, text) in (SIMULATOR | MISSION).items()
            ),
            DeclareLaunchArgument(
                "also_weight", default_value="1", description="what the second property is worth to the planner"
            ),
            DeclareLaunchArgument("out", default_value=out, description="folder for all results"),
            OpaqueFunction(function=system),
        ]
    )


def system(context: LaunchContext) -> list[LaunchDescriptionEntity]:
    """The simulator, and the nodes of the robot on the simulated field."""

    def given(name: str) -> str:
        return LaunchConfiguration(name).perform(context)

    also = given("also")
    field = mission_fields(MissionSettings(field=given("field"), properties=(also,) if also else ()))[0]
    out = Path(given("out")).absolute()
    files = {"field": out / CONFIGURATION / "field.yaml", "site": out / CONFIGURATION / "site.yaml"}
    write_field_file(field, files["field"])
    write_site_file(field, files["site"])
    simulator = Node(
        package="soilmoist_ros",
        executable="field_simulator",
        name="field_simulator",
        namespace=given("namespace"),
        parameters=[
            *filter(None, [given("params_file")]),
            parameters_from("field_simulator", {name: given(name) for name in SIMULATOR}),
        ],
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
        "properties": f"[{property_name(also)}:{given('also_weight')}]" if also else "",
        "simulated": "true",
        "use_sim_time": "true",
    }
    robot = PythonLaunchDescriptionSource(str(Path(__file__).with_name("robot.launch.py")))
    return [simulator, IncludeLaunchDescription(robot, launch_arguments=arguments.items())]

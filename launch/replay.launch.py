# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Show a recorded survey in the viewers: play the bag's records to a mapper, and its plans to the displays.

    ros2 launch soilmoist_ros replay.launch.py bag:=recordings/NAME field:=my_field.yaml site:=my_site.yaml

``soilmoist replay BAG`` makes only the map, as fast as possible and without ROS.
"""

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, ExecuteProcess, OpaqueFunction, RegisterEventHandler
from launch.event_handlers import OnProcessIO
from launch.launch_description_entity import LaunchDescriptionEntity
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from soilmoist_ros.nodes.launching import LastWords, parameter_files, parameters_from, refuse_unknown

TOPICS = ("counts", "quarantined_counts", "place_doubts", "fix", "pressure", "temperature", "relative_humidity",
          "plan", "plan_markers", "mission", "mission_state", "visits", "robot_pose")  # fmt: skip
"""Topics that the mapper does not publish itself."""
MAPPER = {
    "field": "field file, or name of a shipped one",
    "site": "site file, or name of a shipped one; without one the map is of the count rate",
    "model": "variogram model, such as matern32",
    "fit": "how the variogram is fitted: reml or soft_l1",
    "save_dir": "folder that the mapper's service save writes",
}


def generate_launch_description() -> LaunchDescription:
    """The player of the bag, and a mapper."""
    return LaunchDescription(
        [
            DeclareLaunchArgument("bag", description="folder of the recording"),
            DeclareLaunchArgument("rate", default_value="60", description="recorded time per wall time"),
            DeclareLaunchArgument("namespace", default_value="", description="namespace of the recorded robot"),
            DeclareLaunchArgument("params_file", default_value="", description="parameters of the mapper (YAML)"),
            *(
                DeclareLaunchArgument(name, default_value="", description=f"{text} (empty: as in params_file)")
                for name, text in MAPPER.items()
            ),
            OpaqueFunction(function=player_and_mapper),
        ]
    )


def player_and_mapper(context: LaunchContext) -> list[LaunchDescriptionEntity]:
    """The mapper and the player of the bag."""
    refuse_unknown(__file__, [generate_launch_description()])
    last_words = LastWords()

    def given(name: str) -> str:
        return LaunchConfiguration(name).perform(context)

    mapper = Node(
        package="soilmoist_ros",
        executable="mapper",
        name="mapper",
        namespace=given("namespace"),
        parameters=[
            *parameter_files(given("params_file")),
            {"use_sim_time": True, **parameters_from("mapper", {name: given(name) for name in MAPPER})},
        ],
        on_exit=last_words.on_exit("mapper"),
        output="screen",
    )
    namespace = given("namespace").strip("/")
    topics = [f"/{namespace}/{topic}" if namespace else f"/{topic}" for topic in TOPICS]
    play = ["ros2", "bag", "play", given("bag"), "--clock", "--rate", given("rate"), "--topics", *topics]
    heard = RegisterEventHandler(OnProcessIO(on_stderr=last_words.hear))
    return [heard, mapper, ExecuteProcess(cmd=play, output="screen")]

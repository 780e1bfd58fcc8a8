# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The rclpy nodes. They declare parameters, convert messages, and call the core, which does the work."""

import os
from typing import TYPE_CHECKING

from soilmoist_ros.foundation import open_door

if TYPE_CHECKING:
    from soilmoist_ros.nodes.field_simulator import FieldSimulator as FieldSimulator
    from soilmoist_ros.nodes.mapper import Mapper as Mapper
    from soilmoist_ros.nodes.parameters.declaration import Parameters as Parameters
    from soilmoist_ros.nodes.parameters.parameter import Parameter as Parameter
    from soilmoist_ros.nodes.planner import Planner as Planner
    from soilmoist_ros.nodes.recorder import Recorder as Recorder
    from soilmoist_ros.nodes.runtime.key_press import on_space as on_space
    from soilmoist_ros.nodes.runtime.run import run as run
    from soilmoist_ros.nodes.sensor_driver import SensorDriver as SensorDriver
    from soilmoist_ros.nodes.system.demo import run_demo as run_demo
    from soilmoist_ros.nodes.system.demo_configuration import DemoSettings as DemoSettings
    from soilmoist_ros.nodes.system.monitor import monitored as monitored
    from soilmoist_ros.nodes.wiring.bag_player import player_of as player_of

# Pydantic's search for plugins reads the metadata of every installed package. The search takes longer than
# pydantic's work for a node. Pydantic reads this variable when it builds the first model.
os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")

__getattr__, __dir__, __all__ = open_door(
    __name__,
    {
        "field_simulator": "FieldSimulator",
        "mapper": "Mapper",
        "parameters.declaration": "Parameters",
        "parameters.parameter": "Parameter",
        "planner": "Planner",
        "recorder": "Recorder",
        "runtime.key_press": "on_space",
        "runtime.run": "run",
        "sensor_driver": "SensorDriver",
        "system.demo": "run_demo",
        "system.demo_configuration": "DemoSettings",
        "system.monitor": "monitored",
        "wiring.bag_player": "player_of",
    },
)

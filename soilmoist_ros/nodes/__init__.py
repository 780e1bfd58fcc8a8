# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The rclpy nodes. They declare parameters, convert messages, and call the core, which does the work."""

import os
from typing import TYPE_CHECKING

from soilmoist_ros.foundation import open_door

if TYPE_CHECKING:
    # fmt: off
    from soilmoist_ros.nodes.command_nodes import monitored as monitored, player_of as player_of
    from soilmoist_ros.nodes.demo import DemoSettings as DemoSettings, run_demo as run_demo
    from soilmoist_ros.nodes.field_simulator import FieldSimulator as FieldSimulator
    from soilmoist_ros.nodes.mapper import Mapper as Mapper
    from soilmoist_ros.nodes.node_process import run as run
    from soilmoist_ros.nodes.parameters import Parameter as Parameter, Parameters as Parameters
    from soilmoist_ros.nodes.planner import Planner as Planner
    from soilmoist_ros.nodes.recorder import Recorder as Recorder
    from soilmoist_ros.nodes.sensor_driver import SensorDriver as SensorDriver
    # fmt: on

# Pydantic's search for plugins reads the metadata of every installed package. The search takes longer than
# pydantic's work for a node. Pydantic reads this variable when it builds the first model.
os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")

__getattr__, __dir__, __all__ = open_door(
    __name__,
    {
        "command_nodes": "monitored player_of",
        "demo": "DemoSettings run_demo",
        "field_simulator": "FieldSimulator",
        "mapper": "Mapper",
        "node_process": "run",
        "parameters": "Parameter Parameters",
        "planner": "Planner",
        "recorder": "Recorder",
        "sensor_driver": "SensorDriver",
    },
)

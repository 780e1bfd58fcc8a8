# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The rclpy nodes. They declare parameters, convert messages, and call the core, which does the work."""

from __future__ import annotations

import gc
import os
from typing import TYPE_CHECKING

from soilmoist_ros.foundation.lazy import load_on_use

if TYPE_CHECKING:
    from soilmoist_ros.nodes.field_simulator import FieldSimulator
    from soilmoist_ros.nodes.mapper import Mapper
    from soilmoist_ros.nodes.parameters.declaration import Parameters
    from soilmoist_ros.nodes.parameters.parameter import Parameter
    from soilmoist_ros.nodes.planner import Planner
    from soilmoist_ros.nodes.recorder import Recorder
    from soilmoist_ros.nodes.runtime.run import run
    from soilmoist_ros.nodes.sensor_driver import SensorDriver
    from soilmoist_ros.nodes.system.demo import DemoSettings, run_demo

__all__ = [
    "DemoSettings",
    "FieldSimulator",
    "Mapper",
    "Parameter",
    "Parameters",
    "Planner",
    "Recorder",
    "SensorDriver",
    "run",
    "run_demo",
]

# Pydantic's search for plugins reads the metadata of every installed package. The search takes longer than
# pydantic's work for a node. Pydantic reads this variable when it builds the first model.
os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")

# The start of a node makes objects that stay; looking for garbage among them takes a tenth of it.
gc.set_threshold(50_000)

__getattr__ = load_on_use(__name__, __file__)

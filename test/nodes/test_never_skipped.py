# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Continuous integration has every package without which tests are skipped."""

import importlib
import os
import platform

import pytest


@pytest.mark.skipif(
    os.environ.get("CI", "").lower() not in ("true", "1") or platform.machine() != "x86_64",
    reason="only continuous integration on x86_64 must have ROS",
)
@pytest.mark.parametrize(
    "name",
    [
        "rclpy",
        "rclpy._rclpy_pybind11",
        "sensor_msgs.msg",
        "soilmoist_msgs.msg",
        "topological_navigation_msgs.action",
        "nav_msgs.msg",
        "nav2_msgs.action",
        "nav2_msgs.msg",
        "tf2_msgs.msg",
        "mcap_ros2.decoder",
        "xarray",
        "geopandas",
        "pyogrio",
        "reverse_geocode",
        "pandas",
        "distributed",
        "yaml",
        "aiohttp",
        "playwright.sync_api",
    ],
)
def test_what_tests_need_is_there(name):
    importlib.import_module(name)  # without it, tests would be skipped silently

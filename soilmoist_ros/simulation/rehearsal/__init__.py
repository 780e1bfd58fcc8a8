# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Rehearsal of a mission's whole control loop against injected faults, in simulated time and without ROS."""

# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Bags in the rosbag2 layout (MCAP): write, read, recover and play them. The public names are in ``recording``."""

# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Navigators of the planner node, and the virtual navigation of the field simulator."""

# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""One mission on one robot: requests for a plan, other robots, navigation results, commands."""

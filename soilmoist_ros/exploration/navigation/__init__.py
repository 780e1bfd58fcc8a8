# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""How goals reach the navigation of a robot, and what its answers mean."""

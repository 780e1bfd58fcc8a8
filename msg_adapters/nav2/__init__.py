# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Types of nav2_msgs; each adapter is given the class, so that it can be imported without that package."""

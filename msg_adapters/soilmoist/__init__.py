# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Types of soilmoist_msgs. The import of each module fails if that package is not built."""

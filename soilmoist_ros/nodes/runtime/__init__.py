# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Start and end of node processes, quality of service, and discovery on loopback."""

# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Factors for air pressure, humidity and incoming intensity; several detector tubes as one sensor."""

# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""All surveys of a field as a time series: maps, changes, files and a page."""

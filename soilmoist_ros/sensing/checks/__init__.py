# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Tests of counts: bad tubes are masked, bad records are quarantined, each with its reason."""

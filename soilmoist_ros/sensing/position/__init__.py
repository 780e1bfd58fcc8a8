# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""NMEA sentences to fixes, and the position of a receiver at any time."""

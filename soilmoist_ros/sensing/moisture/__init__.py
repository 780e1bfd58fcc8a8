# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The site file, the calibration of N0 with soil cores, and the calibration curve to soil moisture."""

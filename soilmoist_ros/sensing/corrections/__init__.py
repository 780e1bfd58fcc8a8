# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Correction factors, the incoming intensity, and the settings of a site file that lead to them."""

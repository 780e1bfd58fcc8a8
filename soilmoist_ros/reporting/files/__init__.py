# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Tables, GeoTIFF, GeoJSON and summary of a run."""

# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Covariates from files: rasters, what is derived from elevations, and polygons of a soil map."""

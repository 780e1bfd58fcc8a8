# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What is known of a field besides the counts of the survey: earlier surveys, covariates, drift."""
